/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The device's page of shared memory, for a process of one's own that serves it: a device behind a closed library in C.
 * Header only; C99 with GCC's builtins (GCC, Clang), or C++. GNU/Linux only. Include it first, or compile with
 * -D_GNU_SOURCE. haptic_device/realtime/shared_memory.py is the other side; examples/own_device.c is a whole device.
 *
 *     haptic_page page;
 *     if (haptic_open(&page, NULL, NULL) != 0) { fprintf(stderr, "%s\n", page.error); return 1; }
 *     while (...) { haptic_read_servo(&page, &command, WATCHDOG); ... haptic_write_device(&page, ...); }
 *     haptic_close(&page);
 *
 * Times are nanoseconds of CLOCK_MONOTONIC. One thread at a time may use a page. Nothing but haptic_open, haptic_close
 * and haptic_sleep_until waits.
 */
#ifndef HAPTIC_DEVICE_H
#define HAPTIC_DEVICE_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#ifndef F_OFD_SETLK
#error "haptic_device.h needs GNU/Linux: include it before all other headers, or compile with -D_GNU_SOURCE"
#endif

#define HAPTIC_FOLDER "/dev/shm"
#define HAPTIC_MAGIC INT64_C(0x6861707469630001)
#define HAPTIC_LAYOUT_VERSION 2
#define HAPTIC_WORDS 64 /* of 8 bytes: word 0 is the magic, word 1 the layout version */
#define HAPTIC_BYTES (8 * HAPTIC_WORDS)

/* bytes of the file that are locked: by the device, by the servo, and by who comes or goes */
#define HAPTIC_DEVICE_BYTE 0
#define HAPTIC_SERVO_BYTE 1
#define HAPTIC_GATE_BYTE 2

/* each block has the word of its sequence lock before it */
#define HAPTIC_DEVICE_LOCK 8
#define HAPTIC_DEVICE_FIRST 9
#define HAPTIC_DEVICE_WORDS 12 /* session, latched, status, alive, counts 3, drag 3 (float64 bits), delay, stamp error */
#define HAPTIC_SERVO_LOCK 32
#define HAPTIC_SERVO_FIRST 33
#define HAPTIC_SERVO_WORDS 8 /* session, written, next deadline, period, engaged, motor 3 (float64 bits) */

/* bits of the status */
#define HAPTIC_WATCHDOG 2    /* the device has cut the motor */
#define HAPTIC_ESTOP 4       /* the emergency-stop button is pressed */
#define HAPTIC_HOT 8         /* too hot: the device has cut the motor */
#define HAPTIC_END_SWITCH 16 /* an end switch is reached */
#define HAPTIC_ENCODER 32    /* an encoder is broken, by the device's own check */
#define HAPTIC_CLAMPED 128   /* the last motor value was larger than the device can make */

#define HAPTIC_ATTEMPTS 1000                   /* of a reader at a record that is being written */
#define HAPTIC_NEAR INT64_C(1000000000)        /* [ns] how old the times of a write may be */
#define HAPTIC_SHORTEST_PERIOD INT64_C(10000)  /* [ns] of a servo */
#define HAPTIC_LONGEST_PERIOD INT64_C(10000000) /* [ns] */

typedef struct {
    int64_t *words;  /* NULL: not open */
    int file;
    int stale;       /* 1: the page was left by owners that had died */
    int64_t session; /* a number of this run */
    int64_t stamp_error; /* to be set where it is not 0: half-width of what is not known of `latched` [ns] */
    int64_t seen;    /* sequence of the servo's last write that was looked at */
    char path[256];
    char error[512]; /* why haptic_open failed: one sentence */
} haptic_page;

/* The servo's last write. */
typedef struct {
    int64_t session;
    int64_t written;  /* when [ns] */
    int64_t deadline; /* when the encoders are to be latched next [ns] */
    int64_t period;   /* of the servo [ns] */
    int64_t engaged;  /* 1: the display is engaged */
    double motor[3];  /* of x, y, theta [motor units], from now on until the next write; 0 for axes that are not there */
} haptic_command;

static inline int64_t haptic_now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* Sleeps to this time; returns earlier if a signal comes. */
static inline void haptic_sleep_until(int64_t deadline)
{
    struct timespec until;
    until.tv_sec = (time_t)(deadline / INT64_C(1000000000));
    until.tv_nsec = (long)(deadline % INT64_C(1000000000));
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

/*
 * Asks for real time for this thread: SCHED_FIFO (85 is above the servo), sleeps that end on time, and that all memory
 * which the process has now stays; call it when the library is open. Returns 0, or errno of what was refused first; the
 * rest is had all the same.
 */
static inline int haptic_go_realtime(int priority)
{
    struct sched_param wanted;
    int refused = 0;
    memset(&wanted, 0, sizeof wanted);
    wanted.sched_priority = priority;
    if (prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) != 0) /* else an ordinary thread wakes 50 us late */
        refused = errno;
    if (mlockall(MCL_CURRENT) != 0 && refused == 0)
        refused = errno;
    if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) != 0 && refused == 0)
        refused = errno;
    return refused;
}

/* Writes the values into words from `first` on, under the sequence lock at words[lock]; one writer only. */
static inline void haptic_publish(int64_t *words, int lock, int first, const int64_t *values, int count)
{
    int64_t turn = __atomic_load_n(&words[lock], __ATOMIC_ACQUIRE) | 1; /* odd already, where a writer died midway */
    __atomic_store_n(&words[lock], turn, __ATOMIC_RELEASE);
    __atomic_thread_fence(__ATOMIC_SEQ_CST); /* odd is seen before any new word */
    for (int i = 0; i < count; i++)
        __atomic_store_n(&words[first + i], values[i], __ATOMIC_RELAXED);
    __atomic_store_n(&words[lock], turn + 1, __ATOMIC_RELEASE);
}

/* Copies a record that is whole out of words; returns its even sequence, or -1 if the writer never left it alone. */
static inline int64_t haptic_collect(const int64_t *words, int lock, int first, int64_t *values, int count)
{
    for (int attempt = 0; attempt < HAPTIC_ATTEMPTS; attempt++) {
        int64_t turn = __atomic_load_n(&words[lock], __ATOMIC_ACQUIRE);
        if (turn & 1)
            continue;
        for (int i = 0; i < count; i++)
            values[i] = __atomic_load_n(&words[first + i], __ATOMIC_RELAXED);
        __atomic_thread_fence(__ATOMIC_SEQ_CST); /* all words are read before the sequence is read again */
        if (__atomic_load_n(&words[lock], __ATOMIC_ACQUIRE) == turn)
            return turn;
    }
    return -1;
}

/*
 * Looks for a write of the servo that was not seen before. Returns 1 if there is one, which is then in *command; 0 if
 * there is none; -1 if its content makes no sense: *command stays as it was, and so must the motor. Sense: times at
 * most 1 s old, written not in the future, a deadline no further ahead than two periods or the watchdog's limit [ns],
 * whichever is longer, a period of a servo, and motor values that are numbers.
 */
static inline int haptic_read_servo(haptic_page *page, haptic_command *command, int64_t limit)
{
    int64_t block[HAPTIC_SERVO_WORDS];
    int64_t turn = haptic_collect(page->words, HAPTIC_SERVO_LOCK, HAPTIC_SERVO_FIRST, block, HAPTIC_SERVO_WORDS);
    int64_t now = haptic_now_ns(), ahead;
    double motor[3];
    if (turn < 0 || turn == page->seen)
        return 0;
    page->seen = turn;
    memcpy(motor, block + 5, sizeof motor);
    if (block[3] < HAPTIC_SHORTEST_PERIOD || block[3] > HAPTIC_LONGEST_PERIOD)
        return -1;
    ahead = 2 * block[3] > limit ? 2 * block[3] : limit;
    if (block[1] < now - HAPTIC_NEAR || block[1] > now || block[2] < now - HAPTIC_NEAR || block[2] > now + ahead)
        return -1;
    for (int i = 0; i < 3; i++)
        if (!(motor[i] - motor[i] == 0.0)) /* not finite */
            return -1;
    command->session = block[0];
    command->written = block[1];
    command->deadline = block[2];
    command->period = block[3];
    command->engaged = block[4];
    memcpy(command->motor, motor, sizeof motor);
    return 1;
}

/*
 * Tells the servo what was latched: counts of x, y, theta; drag, the measured force of the physical damper [N, N, N m],
 * NULL where it is not measured; status, of the bits above; delay, how late the motor acts after the servo's write
 * [ns], 0 where it is not measured (haptic_p99 follows it), with page->stamp_error in it. latched must be the time of these counts, and never before
 * the deadline that they answer.
 */
static inline void haptic_write_device(haptic_page *page, int64_t latched, int64_t status, const int64_t counts[3],
                                       const double drag[3], int64_t delay)
{
    int64_t block[HAPTIC_DEVICE_WORDS] = {0};
    block[0] = page->session;
    block[1] = latched;
    block[2] = status;
    block[3] = haptic_now_ns();
    memcpy(block + 4, counts, 3 * sizeof *counts);
    if (drag != NULL)
        memcpy(block + 7, drag, 3 * sizeof *drag);
    block[10] = delay;
    block[11] = page->stamp_error;
    haptic_publish(page->words, HAPTIC_DEVICE_LOCK, HAPTIC_DEVICE_FIRST, block, HAPTIC_DEVICE_WORDS);
}

/* 1 if the motor must be zero now: the servo's last write that made sense is older than the limit [ns]. */
static inline int haptic_motor_watchdog(int64_t written, int64_t now, int64_t limit)
{
    return now - written > limit;
}

/*
 * Follows what 99 in 100 values lie below [ns]: the estimate rises by 9.9 us where a value lies above it and falls by
 * 0.1 us where not (Robbins and Monro 1951). Begin with 0.
 */
static inline int64_t haptic_p99(int64_t estimate, int64_t value)
{
    estimate += value > estimate ? 9900 : -100;
    return estimate > 0 ? estimate : 0;
}

/*
 * Name of the page's file. domain: of ROS; namespace: of the driver, such as "/haptic". Returns 0, or -1 where it does
 * not fit into `size` bytes.
 */
static inline int haptic_file_name(char *name, size_t size, const char *domain, const char *name_space)
{
    size_t length = strlen(name_space);
    int used;
    while (length > 0 && *name_space == '/') {
        name_space++;
        length--;
    }
    while (length > 0 && name_space[length - 1] == '/')
        length--;
    used = snprintf(name, size, "haptic_display.%s.%.*s", domain, length ? (int)length : 4, length ? name_space : "root");
    if (used < 0 || (size_t)used >= size)
        return -1;
    for (char *at = name + strlen("haptic_display.") + strlen(domain); *at; at++)
        if (*at == '/')
            *at = '.';
    return 0;
}

/* fcntl on the lock of one byte, of this open file and not of the process; returns 0 or errno. */
static inline int haptic_lock_byte(int file, int command, short kind, int byte, short *found)
{
    struct flock request;
    int done;
    memset(&request, 0, sizeof request);
    request.l_type = kind;
    request.l_whence = SEEK_SET;
    request.l_start = byte;
    request.l_len = 1;
    do
        done = fcntl(file, command, &request);
    while (done != 0 && errno == EINTR);
    if (found != NULL)
        *found = request.l_type;
    return done == 0 ? 0 : errno;
}

/* 1 if a servo holds the page now. It may be there and not run: that is told by its writes. */
static inline int haptic_servo_present(const haptic_page *page)
{
    short found = F_UNLCK;
    haptic_lock_byte(page->file, F_OFD_GETLK, F_WRLCK, HAPTIC_SERVO_BYTE, &found);
    return found != F_UNLCK;
}

/* Whether the file at the path is still the one that is open: its last owner may have removed it. */
static inline int haptic_still_there(const haptic_page *page)
{
    struct stat named, held;
    return stat(page->path, &named) == 0 && fstat(page->file, &held) == 0 && named.st_ino == held.st_ino;
}

static inline void haptic_let_go(haptic_page *page)
{
    haptic_lock_byte(page->file, F_OFD_SETLK, F_UNLCK, HAPTIC_DEVICE_BYTE, NULL);
    haptic_lock_byte(page->file, F_OFD_SETLK, F_UNLCK, HAPTIC_GATE_BYTE, NULL);
    close(page->file);
    page->file = -1;
}

/* Keeps the sentence "page PATH TEXT: CAUSE", with the text of errno as cause unless it is 0; returns -1. */
static inline int haptic_refuse(haptic_page *page, const char *text, int cause)
{
    snprintf(page->error, sizeof page->error, "page %s %s%s%s", page->path, text, cause ? ": " : "",
             cause ? strerror(cause) : "");
    return -1;
}

/* Takes the role of the device on the open file, the gate being locked. */
static inline int haptic_claim(haptic_page *page)
{
    int cause = haptic_lock_byte(page->file, F_OFD_SETLK, F_WRLCK, HAPTIC_DEVICE_BYTE, NULL), alone;
    char text[128];
    struct stat held;
    void *memory;
    if (cause == EAGAIN || cause == EACCES)
        return haptic_refuse(page, "is held by another device; stop it, or use another namespace", 0);
    if (cause != 0)
        return haptic_refuse(page, "cannot be locked", cause);
    alone = !haptic_servo_present(page);
    if (fstat(page->file, &held) != 0)
        return haptic_refuse(page, "cannot be looked at", errno);
    page->stale = alone && held.st_size > 0;
    if (ftruncate(page->file, HAPTIC_BYTES) != 0)
        return haptic_refuse(page, "cannot be given its size", errno);
    cause = posix_fallocate(page->file, 0, HAPTIC_BYTES); /* to write where there is no memory would end the process */
    if (cause != 0) {
        if (!haptic_servo_present(page) && haptic_still_there(page))
            unlink(page->path);
        snprintf(text, sizeof text, "needs %d bytes of %s, which cannot be had", HAPTIC_BYTES, HAPTIC_FOLDER);
        return haptic_refuse(page, text, cause);
    }
    memory = mmap(NULL, HAPTIC_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, page->file, 0);
    if (memory == MAP_FAILED)
        return haptic_refuse(page, "cannot be mapped", errno);
    page->words = (int64_t *)memory;
    if (alone) {
        memset(memory, 0, HAPTIC_BYTES);
        page->words[0] = HAPTIC_MAGIC;
        page->words[1] = HAPTIC_LAYOUT_VERSION;
    }
    if (page->words[0] != HAPTIC_MAGIC || page->words[1] != HAPTIC_LAYOUT_VERSION) {
        snprintf(text, sizeof text, "has layout version %lld, this program speaks %d", (long long)page->words[1],
                 HAPTIC_LAYOUT_VERSION);
        munmap(memory, HAPTIC_BYTES);
        page->words = NULL;
        return haptic_refuse(page, text, 0);
    }
    return 0;
}

/*
 * Takes the page as its device, whether the servo is there already or comes later. domain: that of ROS; NULL: as
 * ROS_DOMAIN_ID says, or "0". name_space: of the driver; NULL: "/haptic". Returns 0, or -1 with a sentence in
 * page->error; then nothing is held.
 */
static inline int haptic_open(haptic_page *page, const char *domain, const char *name_space)
{
    char name[sizeof page->path - sizeof HAPTIC_FOLDER], *end;
    const char *given = getenv("ROS_DOMAIN_ID");
    int64_t before[HAPTIC_SERVO_WORDS];
    long number;
    int cause;
    memset(page, 0, sizeof *page);
    page->file = -1;
    if (domain == NULL)
        domain = given != NULL && *given ? given : "0";
    number = strtol(domain, &end, 10);
    if (*domain < '0' || *domain > '9' || *end || number > 232 || (*domain == '0' && domain[1])) {
        snprintf(page->error, sizeof page->error, "the ROS domain is '%.32s'; a whole number from 0 to 232 is needed", domain);
        return -1;
    }
    if (haptic_file_name(name, sizeof name, domain, name_space != NULL ? name_space : "/haptic") != 0) {
        snprintf(page->error, sizeof page->error, "the namespace is longer than %d characters",
                 (int)(sizeof name - sizeof "haptic_display.232."));
        return -1;
    }
    snprintf(page->path, sizeof page->path, "%s/%s", HAPTIC_FOLDER, name);
    for (;;) {
        page->file = open(page->path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
        if (page->file < 0)
            return haptic_refuse(page, "cannot be opened", errno);
        cause = haptic_lock_byte(page->file, F_OFD_SETLKW, F_WRLCK, HAPTIC_GATE_BYTE, NULL);
        if (cause != 0) {
            close(page->file);
            return haptic_refuse(page, "cannot be locked", cause);
        }
        if (haptic_still_there(page))
            break;
        close(page->file); /* removed by its last owner between our open and our lock */
    }
    if (haptic_claim(page) != 0) {
        haptic_let_go(page);
        return -1;
    }
    page->session = haptic_now_ns() | 1;
    /* a write from before this run moves nothing */
    page->seen = haptic_collect(page->words, HAPTIC_SERVO_LOCK, HAPTIC_SERVO_FIRST, before, HAPTIC_SERVO_WORDS);
    haptic_lock_byte(page->file, F_OFD_SETLK, F_UNLCK, HAPTIC_GATE_BYTE, NULL);
    return 0;
}

/* Lets the page go, and removes its file if no servo holds it. Set the motor to zero first. */
static inline void haptic_close(haptic_page *page)
{
    if (page->words == NULL)
        return;
    munmap(page->words, HAPTIC_BYTES);
    page->words = NULL;
    haptic_lock_byte(page->file, F_OFD_SETLKW, F_WRLCK, HAPTIC_GATE_BYTE, NULL);
    if (!haptic_servo_present(page) && haptic_still_there(page))
        unlink(page->path);
    haptic_let_go(page);
}

#endif
