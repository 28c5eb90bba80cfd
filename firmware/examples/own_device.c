/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A device of one axis behind a library in C, served to the driver by a process of one's own (docs/how_to/connect_a_device.md).
 * In place of the library stand two functions with a mass of 100 g between a spring and a damper. Compile and run:
 *
 *     cc -std=c99 -O2 -o own_device own_device.c && ./own_device [DOMAIN [NAMESPACE]]
 */
#include "../haptic_device.h"

#include <signal.h>

#define WATCHDOG INT64_C(15000000) /* [ns] without a write, after which the motor is zero */
#define FREE INT64_C(1000000)      /* [ns] between samples while there is no servo */
#define LOOK INT64_C(20000)        /* [ns] between looks for a write; less is sooner, and takes more of a core */
#define MOST 15.0                  /* [motor units] that the device can make */
#define COUNTS 200000.0            /* per m */

static volatile sig_atomic_t ended; /* the signal that ends it */
static void end(int number)
{
    ended = number;
}

static struct {
    double position, velocity, force; /* [m, m/s, N] */
    int64_t time;
} handle = {0.03, 0.0, 0.0, 0};

static void move_handle(void)
{
    const double step = 20e-6, mass = 0.1, stiffness = 20.0, damping = 3.0, rest = 0.03;
    for (; handle.time < haptic_now_ns(); handle.time += 20000) { /* semi-implicit Euler */
        double pull = handle.force - stiffness * (handle.position - rest) - damping * handle.velocity;
        handle.velocity += step * pull / mass;
        handle.position += step * handle.velocity;
    }
}

/* The two functions of the library: yours. */
static double sdk_read_position(void)
{
    move_handle();
    return handle.position;
}

static void sdk_set_force(double force)
{
    move_handle();
    handle.force = force;
}

int main(int argc, char **argv)
{
    haptic_page page;
    haptic_command command;
    int driven = 0, clamped = 0;
    int64_t due, period = FREE, delay = 0;

    signal(SIGTERM, end);
    signal(SIGINT, end);
    signal(SIGHUP, end);
    if (haptic_open(&page, argc > 1 ? argv[1] : NULL, argc > 2 ? argv[2] : NULL) != 0) {
        fprintf(stderr, "own_device: %s\n", page.error);
        return 1;
    }
    printf("own_device: serves %s%s\n", page.path, page.stale ? ", left by a process that had died" : "");
    fflush(stdout);
    if (haptic_go_realtime(85) != 0)
        fprintf(stderr, "own_device: without real-time scheduling, so samples may be late (docs/how_to/install.md)\n");
    handle.time = due = haptic_now_ns();
    while (!ended) {
        int64_t now = haptic_now_ns();
        if (haptic_read_servo(&page, &command, WATCHDOG) == 1) { /* the motor holds this value up to the next write */
            double force = command.motor[0];
            clamped = force > MOST || force < -MOST;
            sdk_set_force(!clamped ? force : force > 0.0 ? MOST : -MOST);
            delay = haptic_p99(delay, haptic_now_ns() - command.written);
            driven = 1;
            due = command.deadline;
            period = command.period;
            continue;
        }
        if (driven && haptic_motor_watchdog(command.written, now, WATCHDOG)) {
            sdk_set_force(0.0);
            driven = 0;
            period = FREE;
            due = now;
        }
        if (now >= due) { /* latch: never before the deadline, and say when */
            double position = sdk_read_position();
            int64_t counts[3] = {(int64_t)(COUNTS * position + (position < 0.0 ? -0.5 : 0.5)), 0, 0};
            haptic_write_device(&page, now, driven ? clamped * HAPTIC_CLAMPED : HAPTIC_WATCHDOG, counts, NULL, delay);
            due += period * (1 + (now - due) / period); /* without a newer write, the next deadline is a period later */
        }
        haptic_sleep_until(due < now + LOOK ? due : now + LOOK);
    }
    sdk_set_force(0.0); /* whatever the reason to end */
    haptic_close(&page);
    return 0;
}
