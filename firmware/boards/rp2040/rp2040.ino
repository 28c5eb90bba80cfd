// SPDX-License-Identifier: Apache-2.0
// An RP2040 (Arduino-Pico core) with one encoder, counted by interrupts, and one motor by PWM and direction, on its own
// USB. Put this file and haptic_*.{h,c} into one sketch folder. Every number below is this board's wiring: change them
// to yours.
#include <Arduino.h>

#include "haptic_board.h"
#include "haptic_core.h"

static const int PWM = 2, DIRECTION = 3, ENABLE = 4, ESTOP = 5, A = 6, B = 7;  // ESTOP: closed to ground when released
static const float LARGEST = 1.0f;                                             // motor units: share of full current
static const int FULL = 1023;

static volatile int32_t count_x = 0;
static struct haptic device;

static void quadrature() {  // on each edge: the new phase is one step before or behind the last one
    static const int8_t STEPS[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};
    static uint8_t phase = 0;
    phase = (uint8_t)((phase << 2 | digitalRead(A) << 1 | digitalRead(B)) & 15);
    count_x += STEPS[phase];
}

int64_t board_now_ns(void) {
    return (int64_t)time_us_64() * 1000;
}

int board_read(uint8_t *bytes, int room) {
    int count = 0;
    while (count < room && Serial.available() > 0) {
        bytes[count++] = (uint8_t)Serial.read();
    }
    return count;
}

void board_write(const uint8_t *bytes, int count) {
    if (Serial.availableForWrite() >= count) {  // else it is lost: a host that does not read must not stop the loop
        Serial.write(bytes, count);
        Serial.flush();
    }
}

void board_answer_sender(void) {}

int64_t board_latch(int64_t, int32_t counts[3]) {
    counts[0] = count_x;
    return board_now_ns();
}

int64_t board_write_motors(int64_t, const float motors[3]) {
    digitalWrite(DIRECTION, motors[0] < 0.0f ? LOW : HIGH);
    analogWrite(PWM, (int)(FULL * fabsf(motors[0]) / LARGEST));
    digitalWrite(ENABLE, HIGH);
    return board_now_ns();
}

void board_cut_motors(int64_t) {
    digitalWrite(ENABLE, LOW);
    analogWrite(PWM, 0);
}

void board_read_damper(float *) {}

uint16_t board_read_inputs(int16_t *temperature) {
    *temperature = (int16_t)(10.0f * analogReadTemp());
    return digitalRead(ESTOP) == HIGH ? BOARD_ESTOP : 0;
}

void board_wait_until(int64_t time) {
    while (board_now_ns() < time && Serial.available() == 0) {
    }
}

void setup() {
    pinMode(ESTOP, INPUT_PULLUP);
    pinMode(ENABLE, OUTPUT);
    pinMode(DIRECTION, OUTPUT);
    pinMode(A, INPUT_PULLUP);
    pinMode(B, INPUT_PULLUP);
    analogWriteResolution(10);
    analogWriteFreq(36000);
    attachInterrupt(digitalPinToInterrupt(A), quadrature, CHANGE);
    attachInterrupt(digitalPinToInterrupt(B), quadrature, CHANGE);
    struct haptic_description known = {};
    strncpy(known.name, "rp2040", sizeof known.name);
    known.firmware = 1 << 16;
    known.axes = 1;
    known.largest_motor[0] = LARGEST;
    known.shortest_period = 100000;
    known.watchdog = 15000000;
    known.counter_bits = 32;
    haptic_begin(&device, &known);
}

void loop() {
    haptic_step(&device);
}
