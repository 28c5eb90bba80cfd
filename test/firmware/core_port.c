/* SPDX-License-Identifier: Apache-2.0
 *
 * The firmware's core on a board that a test plays: its clock, encoders, inputs and line are numbers of this file, or
 * its encoders and motors are those of the plant in plant_port.c, on the same clock.
 */
#include <math.h>
#include <string.h>

#include "haptic_board.h"
#include "haptic_core.h"

void plant_port_advance(int64_t time);
int64_t plant_port_push(int64_t time, const double force[3]);
void plant_port_cut(int64_t time);
void plant_port_state(double state[22]);

enum { ROOM = 1 << 20 };

static struct haptic device;
static int64_t now, latched[4096];
static int latches, writes, cuts;
static float motors[3];
static uint16_t inputs;
static int16_t temperature = BOARD_NO_TEMPERATURE;
static uint8_t sent[ROOM];
static int held;
static double counts_per_unit[3]; /* of the plant; 0: there is none */
static int64_t integrated;

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

static int64_t latch_plant(int64_t deadline, int32_t counts[3]) {
    double state[22];
    integrated = deadline > integrated ? deadline : integrated;
    plant_port_advance(integrated);
    plant_port_state(state);
    for (int i = 0; i < 3; i++) {
        counts[i] = (int32_t)floor(state[18 + i] * counts_per_unit[i] + 0.5);
    }
    return integrated;
}

int64_t board_latch(int64_t deadline, int32_t counts[3]) {
    if (counts_per_unit[0] > 0.0) {
        return latch_plant(deadline, counts);
    }
    counts[0] = ++latches;
    counts[1] = -latches;
    counts[2] = INT32_MIN;
    latched[latches % 4096] = deadline;
    return now;
}

int64_t board_write_motors(int64_t time, const float values[3]) {
    writes++;
    memcpy(motors, values, sizeof motors);
    if (counts_per_unit[0] > 0.0) {
        double force[3] = {values[0], values[1], values[2]};
        return plant_port_push(time, force);
    }
    return time;
}

void board_cut_motors(int64_t time) {
    if (counts_per_unit[0] > 0.0) {
        plant_port_cut(time);
    }
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

static void begin(int64_t time, int axes, int datagrams, const double counts[3], const double largest[3]) {
    struct haptic_description known;
    memset(&known, 0, sizeof known);
    memcpy(known.name, "port", 4);
    known.firmware = 0x010203;
    known.axes = (uint32_t)axes;
    for (int i = 0; i < axes; i++) {
        known.counts_per_unit[i] = (float)counts[i];
        known.largest_motor[i] = (float)largest[i];
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

void port_begin(int64_t time, int axes, int datagrams) {
    const double COUNTS[3] = {1000.0, 1000.0, 1000.0}, LARGEST[3] = {2.0, 2.0, 2.0};
    counts_per_unit[0] = 0.0;
    begin(time, axes, datagrams, COUNTS, LARGEST);
}

/* With the plant, which has begun already, at time 0; its motors' units are N and N m. */
void port_begin_plant(int datagrams, const double counts[3], const double largest[3]) {
    memcpy(counts_per_unit, counts, sizeof counts_per_unit);
    integrated = 0;
    begin(0, 3, datagrams, counts, largest);
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
