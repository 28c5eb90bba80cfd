/* SPDX-License-Identifier: Apache-2.0
 *
 * The firmware's core on a board that a test plays: its clock, encoders, inputs and line are numbers of this file.
 */
#include <string.h>

#include "haptic_board.h"
#include "haptic_core.h"

enum { ROOM = 1 << 20 };

static struct haptic device;
static int64_t now, latched[4096];
static int latches, writes, cuts;
static float motors[3];
static uint16_t inputs;
static int16_t temperature = BOARD_NO_TEMPERATURE;
static uint8_t sent[ROOM];
static int held;

int64_t board_now_ns(void) {
    return now;
}

int board_read(uint8_t *bytes, int room) {
    (void)bytes;
    (void)room;
    return 0;
}

void board_write(const uint8_t *bytes, int count) { /* each write with its length before it */
    if (held + count + 2 <= ROOM) {
        sent[held++] = (uint8_t)count;
        sent[held++] = (uint8_t)(count >> 8);
        memcpy(sent + held, bytes, (size_t)count);
        held += count;
    }
}

void board_answer_sender(void) {}

int64_t board_latch(int64_t deadline, int32_t counts[3]) {
    counts[0] = ++latches;
    counts[1] = -latches;
    counts[2] = INT32_MIN;
    latched[latches % 4096] = deadline;
    return now;
}

int64_t board_write_motors(int64_t time, const float values[3]) {
    writes++;
    memcpy(motors, values, sizeof motors);
    return time;
}

void board_cut_motors(int64_t time) {
    (void)time;
    cuts++;
    memset(motors, 0, sizeof motors);
}

void board_read_damper(float forces[3]) {
    forces[0] = 0.5f;
}

uint16_t board_read_inputs(int16_t *value) {
    *value = temperature;
    return inputs;
}

void board_wait_until(int64_t time) {
    now = time;
}

/* ---- what a test calls ---- */

void port_begin(int64_t time, int axes, int datagrams) {
    struct haptic_description known;
    memset(&known, 0, sizeof known);
    memcpy(known.name, "port", 4);
    known.firmware = 0x010203;
    known.axes = (uint32_t)axes;
    for (int i = 0; i < axes; i++) {
        known.counts_per_unit[i] = 1000.0f;
        known.largest_motor[i] = 2.0f;
    }
    known.shortest_period = 100000;
    known.watchdog = 15000000;
    known.counter_bits = 32;
    known.simulated = true;
    known.datagrams = datagrams;
    now = time;
    inputs = 0;
    held = latches = writes = cuts = 0;
    haptic_begin(&device, &known);
    cuts = 0;
}

void port_time(int64_t time) {
    now = time;
}
void port_inputs(int bits, int value) {
    inputs = (uint16_t)bits;
    temperature = (int16_t)value;
}
void port_advance(void) {
    haptic_advance(&device, now);
}
void port_receive(const uint8_t *bytes, int count) {
    haptic_receive(&device, bytes, count, now);
}
void port_motors(float values[3]) {
    memcpy(values, motors, sizeof motors);
}
int64_t port_due(void) {
    return haptic_due(&device, now);
}
int port_writes(void) {
    return writes;
}
int port_refused(void) {
    return (int)device.refused;
}
int port_cuts(void) {
    return (int)device.cuts;
}
void port_target(double target[3]) {
    memcpy(target, device.target, sizeof device.target);
}
void port_sent_sequence(uint32_t sequence) {
    device.sent_sequence = sequence;
}

/* All that was sent since this was asked last; returns the number of bytes. */
int port_sent(uint8_t *bytes, int room) {
    int count = held <= room ? held : 0;
    memcpy(bytes, sent, (size_t)count);
    held = 0;
    return count;
}
