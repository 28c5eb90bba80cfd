/* SPDX-License-Identifier: Apache-2.0
 *
 * What a board has to do: ten functions. The core calls them from one thread and no interrupt; none of them but
 * board_wait_until may wait. All times are nanoseconds of the board's own clock, which never stops.
 */
#ifndef HAPTIC_BOARD_H
#define HAPTIC_BOARD_H

#include <stdint.h>

/* Causes that board_read_inputs tells, the bits of a sample's status. */
enum {
    BOARD_ESTOP = 4,          /* the emergency-stop button is pressed */
    BOARD_HOT = 8,            /* too hot to go on */
    BOARD_END_SWITCH = 16,    /* an end switch is reached */
    BOARD_BROKEN_ENCODER = 32 /* an encoder's own check has failed */
};

enum { BOARD_NO_TEMPERATURE = -32768 };

#ifdef __cplusplus
extern "C" {
#endif

/* The time [ns]. */
int64_t board_now_ns(void);

/* Bytes that have come, at most room; 0: none. Where the line has datagrams: one whole datagram. */
int board_read(uint8_t *bytes, int room);

/* Sends bytes; what the line does not take is lost. */
void board_write(const uint8_t *bytes, int count);

/* From now on board_write goes to whoever sent what was read last; nothing to do on a serial line. */
void board_answer_sender(void);

/* Latches all encoders: counts of x, y, theta. Returns when [ns]. deadline: when it should have been, not in the
 * future. */
int64_t board_latch(int64_t deadline, int32_t counts[3]);

/* Sets the motors [motor units of x, y, theta], within their limits. Returns when they begin to act [ns].
 * now: when it was decided [ns], for a board that simulates. */
int64_t board_write_motors(int64_t now, const float motors[3]);

/* Motors to zero at once, by their drivers' enable line too if there is one; the next board_write_motors undoes that.
 * now: as above; when nobody was late. */
void board_cut_motors(int64_t now);

/* Force of the physical damper on each axis [N, N m], along the motion positive; 0 where it is not measured. */
void board_read_damper(float forces[3]);

/* Temperature of the hottest part [0.1 °C], BOARD_NO_TEMPERATURE: not measured. Returns a sum of BOARD_… bits. */
uint16_t board_read_inputs(int16_t *temperature);

/* Returns at this time [ns], or earlier: at the latest when bytes come, or after 1 ms if the clock is set meanwhile. */
void board_wait_until(int64_t time);

#ifdef __cplusplus
}
#endif

#endif
