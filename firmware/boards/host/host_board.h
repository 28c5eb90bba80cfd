/* SPDX-License-Identifier: Apache-2.0
 *
 * The line, the clock and the wait of a device that is a process on a POSIX host: four of the ten functions of
 * haptic_board.h (board_now_ns, board_read, board_write, board_answer_sender), and host_wait_until for a fifth.
 */
#ifndef HOST_BOARD_H
#define HOST_BOARD_H

#include <stdbool.h>
#include <stdint.h>

/* The device's clock: offset + (1 + ppm/10⁶) · CLOCK_MONOTONIC, counted from the start, and a step. */
struct host_clock {
    double ppm;
    double offset;  /* [s] */
    double step;    /* [µs] */
    double step_at; /* [s] after the start */
};

void host_begin(const struct host_clock *clock);

/* A UDP socket bound to this address and port (0: any free). Returns the port, −1: errno says why. */
int host_open_udp(const char *address, int port);

/* A pseudo-terminal whose other side is linked to by this path. Returns the other side's name, NULL: errno says why. */
const char *host_open_pty(const char *link);

/* Real-time priority and locked memory, where they can be had. */
void host_prefer_realtime(void);

/* SIGTERM when the process that started this one ends, however it ends; on Linux. */
void host_end_with_parent(void);

/* Returns at this time of the device's clock [ns], earlier when bytes come or a signal does. */
void host_wait_until(int64_t time);

/* Whether SIGINT, SIGTERM or SIGHUP asks it to end. */
bool host_ending(void);

/* The next whole line of the standard input, if one has come, without its end. */
bool host_line(char *line, int room);

/* CLOCK_MONOTONIC [ns], and between it and the device's clock. */
int64_t host_monotonic_ns(void);
int64_t host_device_time(int64_t monotonic);
int64_t host_monotonic_time(int64_t device);

void host_close(void);

#endif
