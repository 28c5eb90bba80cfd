/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the tests ask of firmware/haptic_device.h, one answer a line: `page_tool DOMAIN NAMESPACE` holds a page and obeys
 * lines of standard input, `page_tool names` answers "DOMAIN<tab>NAMESPACE" by the file's name.
 */
#ifdef FULL
#define posix_fallocate none_left
#endif
#include "haptic_device.h"

#include <signal.h>
#include <sys/wait.h>
#ifdef FULL
int none_left(int file, off_t from, off_t length)
{
    (void)file, (void)from, (void)length;
    return ENOSPC;
}
#endif

static void say_names(void)
{
    char line[512], name[256];
    while (fgets(line, sizeof line, stdin)) {
        char *name_space = strchr(line, '\t');
        *name_space++ = 0;
        name_space[strcspn(name_space, "\n")] = 0;
        puts(haptic_file_name(name, sizeof name, line, name_space) == 0 ? name : "too long");
        fflush(stdout);
    }
}

/* Looks for so many records of a process that writes them without a pause, all words alike; says how many were torn. */
static long long torn(haptic_page *page, int wanted)
{
    pid_t writer = fork();
    for (int64_t number = 1; writer == 0; number++) {
        int64_t all[HAPTIC_SERVO_WORDS];
        for (int i = 0; i < HAPTIC_SERVO_WORDS; i++)
            all[i] = number;
        haptic_publish(page->words, HAPTIC_SERVO_LOCK, HAPTIC_SERVO_FIRST, all, HAPTIC_SERVO_WORDS);
        for (int64_t pause = haptic_now_ns() + 200; haptic_now_ns() < pause;)
            continue;
    }
    int64_t block[HAPTIC_SERVO_WORDS], before = -1;
    long long found = 0;
    while (wanted > 0) {
        int64_t turn = haptic_collect(page->words, HAPTIC_SERVO_LOCK, HAPTIC_SERVO_FIRST, block, HAPTIC_SERVO_WORDS);
        if (turn < 0 || turn == before)
            continue;
        before = turn;
        wanted--;
        for (int i = 1; i < HAPTIC_SERVO_WORDS; i++)
            found += block[i] != block[0];
    }
    kill(writer, SIGKILL);
    waitpid(writer, NULL, 0);
    return found;
}

static void obey(haptic_page *page)
{
    char line[512];
    haptic_command c;
    long long a, b, n[5];
    double d[3];
    memset(&c, 0, sizeof c);
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "read %lld", &a) == 1) {
            printf("%d", haptic_read_servo(page, &c, a));
            printf(" %lld %lld %lld %lld %lld %.17g %.17g %.17g", (long long)c.session, (long long)c.written,
                   (long long)c.deadline, (long long)c.period, (long long)c.engaged, c.motor[0], c.motor[1], c.motor[2]);
        } else if (sscanf(line, "write %lld %lld %lld %lld %lld %lf %lf %lf %lld", &n[0], &n[1], &n[2], &n[3], &n[4], &d[0],
                          &d[1], &d[2], &a) == 9) {
            int64_t counts[3] = {n[2], n[3], n[4]};
            haptic_write_device(page, n[0], n[1], counts, d, a);
            printf("%lld", (long long)page->session);
        } else if (sscanf(line, "hammer %lld", &a) == 1) {
            for (int64_t i = 1; i <= a; i++) {
                int64_t counts[3] = {i, i, i};
                haptic_write_device(page, i, i, counts, NULL, i);
            }
        } else if (sscanf(line, "torn %lld", &a) == 1) {
            printf("%lld", torn(page, (int)a));
        } else if (sscanf(line, "watchdog %lld %lld", &a, &b) == 2) {
            printf("%d", haptic_motor_watchdog(1000, 1000 + a, b));
        } else if (strncmp(line, "present", 7) == 0) {
            printf("%d", haptic_servo_present(page));
        } else {
            printf("what is %s", line);
        }
        puts("");
        fflush(stdout);
    }
}

int main(int argc, char **argv)
{
    haptic_page page;
    if (argc < 3) {
        say_names();
        return 0;
    }
    if (haptic_open(&page, *argv[1] ? argv[1] : NULL, *argv[2] ? argv[2] : NULL) != 0) {
        puts(page.error);
        return 1;
    }
    printf("%s %d\n", page.path, page.stale);
    fflush(stdout);
    obey(&page);
    haptic_close(&page);
    return 0;
}
