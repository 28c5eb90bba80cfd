// SPDX-License-Identifier: Apache-2.0
// A Teensy 4 with two encoders (the Encoder library) and two motors by PWM and direction, on its own USB. Put this file
// and haptic_*.{h,c} into one sketch folder. Every number below is this board's wiring: change them to yours.
#include <Arduino.h>
#include <Encoder.h>

#include "haptic_board.h"
#include "haptic_core.h"

static const int PWM[2] = {2, 3}, DIRECTION[2] = {4, 5}, ENABLE = 6,
                 ESTOP = 7;         // ESTOP: closed to ground when released
static const float LARGEST = 1.0f;  // motor units: share of full current
static const int FULL = 4095;       // PWM of 12 bits

static Encoder encoder_x(8, 9), encoder_y(10, 11);
static struct haptic device;

int64_t board_now_ns(void) {  // the cycle counter, carried on to 64 bits: asked at least once a millisecond
    static uint32_t last = 0;
    static int64_t cycles = 0;
    uint32_t now = ARM_DWT_CYCCNT;
    cycles += (uint32_t)(now - last);
    last = now;
    return cycles * 1000 / (F_CPU_ACTUAL / 1000000);
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
        Serial.send_now();
    }
}

void board_answer_sender(void) {}

int64_t board_latch(int64_t, int32_t counts[3]) {
    counts[0] = encoder_x.read();
    counts[1] = encoder_y.read();
    return board_now_ns();
}

int64_t board_write_motors(int64_t, const float motors[3]) {
    for (int i = 0; i < 2; i++) {
        digitalWrite(DIRECTION[i], motors[i] < 0.0f ? LOW : HIGH);
        analogWrite(PWM[i], (int)(FULL * fabsf(motors[i]) / LARGEST));
    }
    digitalWrite(ENABLE, HIGH);
    return board_now_ns();
}

void board_cut_motors(int64_t) {
    digitalWrite(ENABLE, LOW);
    for (int i = 0; i < 2; i++) {
        analogWrite(PWM[i], 0);
    }
}

void board_read_damper(float *) {}

uint16_t board_read_inputs(int16_t *temperature) {
    *temperature = (int16_t)(10.0f * tempmonGetTemp());
    return digitalRead(ESTOP) == HIGH ? BOARD_ESTOP : 0;
}

void board_wait_until(int64_t time) {
    while (board_now_ns() < time && Serial.available() == 0) {
    }
}

void setup() {
    pinMode(ESTOP, INPUT_PULLUP);
    pinMode(ENABLE, OUTPUT);
    analogWriteResolution(12);
    for (int i = 0; i < 2; i++) {
        pinMode(DIRECTION[i], OUTPUT);
        analogWriteFrequency(PWM[i], 36000);
    }
    struct haptic_description known = {};
    strncpy(known.name, "teensy4", sizeof known.name);
    known.firmware = 1 << 16;
    known.axes = 2;
    known.largest_motor[0] = known.largest_motor[1] = LARGEST;
    known.shortest_period = 100000;
    known.watchdog = 15000000;
    known.counter_bits = 32;
    haptic_begin(&device, &known);
}

void loop() {
    haptic_step(&device);
}
