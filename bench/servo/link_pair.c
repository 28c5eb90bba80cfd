/* SPDX-License-Identifier: Apache-2.0
 *
 * The least that a host and a device can do on a line, beside which ours is measured: `link_pair udp|pty RATE COUNT`.
 * The host announces a deadline, sleeps up to it and waits for the sample; the device latches at the deadline and
 * answers. Frames are those of docs/reference/link_protocol.md, priorities those of servo and reference device. Prints for each
 * deadline how long after it the sample was in hand [ns], −1: not within half a period.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "haptic_frame.h"

enum { SERVO = 80, DEVICE = 84 }; /* priorities */

static const int64_t SECOND = 1000000000;

/* One end; held: bytes of a frame that has not ended yet. */
struct line {
    int file, held;
    bool datagrams;
    uint8_t coded[HAPTIC_MOST_CODED];
    uint32_t sent;
};

static int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

static void prefer_realtime(int priority) {
    struct sched_param wanted = {.sched_priority = priority};
    sched_setscheduler(0, SCHED_FIFO, &wanted);
    mlockall(MCL_CURRENT | MCL_FUTURE);
    prctl(PR_SET_TIMERSLACK, 1);
}

static void wait_until(int file, int64_t time) {
    int64_t now = now_ns(), left = time > now ? time - now : 0;
    struct timespec wait = {left / SECOND, left % SECOND};
    struct pollfd asked = {file, POLLIN, 0};
    ppoll(&asked, 1, &wait, NULL);
}

static void say(struct line *line, struct haptic_header *header, const uint8_t *payload) {
    uint8_t frame[HAPTIC_MOST_FRAME], coded[HAPTIC_MOST_CODED];
    header->session = 1;
    header->sequence = ++line->sent;
    int count = haptic_pack(frame, header, payload);
    if (!line->datagrams) {
        count = haptic_cobs_encode(frame, count, coded);
        coded[count++] = 0;
    }
    (void)!write(line->file, line->datagrams ? frame : coded, (size_t)count);
}

/* Takes the next frame that has come, if there is a whole one. */
static bool hear(struct line *line, struct haptic_header *header, uint8_t *frame) {
    if (line->datagrams) {
        ssize_t count = read(line->file, frame, HAPTIC_MOST_CODED);
        return count > 0 && haptic_unpack(frame, (int)count, header);
    }
    uint8_t *end = memchr(line->coded, 0, (size_t)line->held);
    if (end == NULL) {
        ssize_t count = read(line->file, line->coded + line->held, sizeof line->coded - (size_t)line->held);
        line->held += count > 0 ? (int)count : 0;
        end = memchr(line->coded, 0, (size_t)line->held);
    }
    if (end == NULL) {
        line->held = line->held == (int)sizeof line->coded ? 0 : line->held;
        return false;
    }
    int coded = (int)(end - line->coded), count = haptic_cobs_decode(line->coded, coded, frame);
    line->held -= coded + 1;
    memmove(line->coded, end + 1, (size_t)line->held);
    return count > 0 && haptic_unpack(frame, count, header);
}

static void be_device(struct line line) {
    uint8_t frame[HAPTIC_MOST_CODED];
    int64_t deadline = INT64_MAX, now;
    struct haptic_header heard, answer = {HAPTIC_SAMPLE, 0, 0, 0, 0};
    prefer_realtime(DEVICE);
    for (;;) {
        wait_until(line.file, deadline < now_ns() + SECOND ? deadline : now_ns() + SECOND);
        while (hear(&line, &heard, frame)) {
            deadline = haptic_get_i64(frame + HAPTIC_HEAD);
            answer.answers = heard.sequence;
        }
        if ((now = now_ns()) >= deadline) {
            uint8_t payload[HAPTIC_MOST_PAYLOAD] = {0};
            haptic_put_i64(haptic_put_i64(payload, deadline), now);
            say(&line, &answer, payload);
            deadline = INT64_MAX;
        }
    }
}

static void announce(struct line *line, int64_t deadline, int64_t period) {
    uint8_t payload[HAPTIC_MOST_PAYLOAD] = {0};
    struct haptic_header header = {HAPTIC_COMMAND, 0, 0, 0, 0};
    haptic_put_u32(haptic_put_i64(payload, deadline), (uint32_t)period);
    say(line, &header, payload);
}

static bool awaited(struct line *line, int64_t give_up) {
    uint8_t frame[HAPTIC_MOST_CODED];
    struct haptic_header heard;
    for (;;) {
        while (hear(line, &heard, frame)) {
            if (heard.answers == line->sent) {
                return true;
            }
        }
        if (now_ns() >= give_up) {
            return false;
        }
        wait_until(line->file, give_up);
    }
}

static void be_host(struct line line, int64_t period, int count, int64_t *waits) {
    prefer_realtime(SERVO);
    int64_t deadline = now_ns() + 100 * period; /* the other one has to start */
    announce(&line, deadline, period);
    for (int i = 0; i < count; i++) {
        struct timespec until = {deadline / SECOND, deadline % SECOND};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        bool came = awaited(&line, deadline + period / 2);
        int64_t now = now_ns();
        waits[i] = came ? now - deadline : -1;
        deadline += period * ((now - deadline) / period + 1);
        announce(&line, deadline, period);
    }
}

static bool open_udp(int files[2]) {
    struct sockaddr_in places[2];
    for (int i = 0; i < 2; i++) {
        socklen_t size = sizeof places[i];
        memset(&places[i], 0, sizeof places[i]);
        places[i].sin_family = AF_INET;
        places[i].sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        files[i] = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
        if (files[i] < 0 || bind(files[i], (struct sockaddr *)&places[i], size) < 0 ||
            getsockname(files[i], (struct sockaddr *)&places[i], &size) < 0) {
            return false;
        }
    }
    return connect(files[0], (struct sockaddr *)&places[1], sizeof places[1]) == 0 &&
           connect(files[1], (struct sockaddr *)&places[0], sizeof places[0]) == 0;
}

/* The host's is a serial line, the device's its other end. */
static bool open_pty(int files[2]) {
    struct termios line;
    files[1] = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (files[1] < 0 || grantpt(files[1]) < 0 || unlockpt(files[1]) < 0 ||
        (files[0] = open(ptsname(files[1]), O_RDWR | O_NOCTTY | O_NONBLOCK)) < 0 || tcgetattr(files[0], &line) < 0) {
        return false;
    }
    cfmakeraw(&line);
    return tcsetattr(files[0], TCSANOW, &line) == 0;
}

int main(int words, char **word) {
    int files[2], count = words == 4 ? atoi(word[3]) : 0;
    double rate = words == 4 ? atof(word[2]) : 0.0;
    bool datagrams = words == 4 && strcmp(word[1], "udp") == 0;
    int64_t *waits = calloc((size_t)(count > 0 ? count : 1), sizeof *waits);
    if (count < 1 || !(rate >= 1.0) || waits == NULL || !(datagrams ? open_udp : open_pty)(files)) {
        perror("link_pair");
        return 1;
    }
    pid_t device = fork();
    struct line line = {files[device == 0], 0, datagrams, {0}, 0};
    if (device == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        be_device(line);
    }
    be_host(line, (int64_t)(1e9 / rate), count, waits);
    kill(device, SIGKILL);
    for (int i = 0; i < count; i++) {
        printf("%lld\n", (long long)waits[i]);
    }
    return 0;
}
