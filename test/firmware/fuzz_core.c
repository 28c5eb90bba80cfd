/* SPDX-License-Identifier: Apache-2.0
 *
 * Feeds the core frames that are damaged or false in one way each, as datagrams and as a stream. No motor may move.
 * Exit 0 if none did and each was counted; sanitizers judge the rest.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "haptic_board.h"
#include "haptic_core.h"

enum { ROUNDS = 100000, SESSION = 0x5EED };

static struct haptic device;
static int moved;
static const int64_t NOW = 1000000000000;

int64_t board_now_ns(void) {
    return NOW;
}
int board_read(uint8_t *bytes, int room) {
    return bytes && room ? 0 : 0;
}
void board_write(const uint8_t *bytes, int count) {
    moved += count < 0 || bytes == NULL;
}
void board_answer_sender(void) {}
int64_t board_latch(int64_t deadline, int32_t counts[3]) {
    counts[0] = 0;
    return deadline;
}
int64_t board_write_motors(int64_t now, const float motors[3]) {
    moved += motors != NULL;
    return now;
}
void board_cut_motors(int64_t now) {
    (void)now;
}
void board_read_damper(float forces[3]) {
    forces[0] = 0.0f;
}
uint16_t board_read_inputs(int16_t *temperature) {
    *temperature = BOARD_NO_TEMPERATURE;
    return 0;
}
void board_wait_until(int64_t time) {
    (void)time;
}

static uint32_t draw(void) { /* xorshift (Marsaglia 2003) */
    static uint32_t state = 2463534242u;
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

static int command(uint8_t *frame, uint32_t session, uint32_t sequence, int64_t deadline, uint32_t period,
                   float motor) {
    struct haptic_header header = {HAPTIC_COMMAND, 1, session, sequence, 0};
    uint8_t payload[24], *place = haptic_put_i64(payload, deadline);
    place = haptic_put_u32(place, period);
    for (int i = 0; i < 3; i++) {
        place = haptic_put_f32(place, i == (int)(sequence % 3) ? motor : 1.0f);
    }
    return haptic_pack(frame, &header, payload);
}

/* A command that would move the motors if it were not wrong in one way; returns its length. */
static int wrong(uint8_t *frame) {
    static const float NO_NUMBERS[3] = {NAN, INFINITY, -INFINITY};
    static const uint32_t PERIODS[4] = {0, 99999, 10000001, 0xFFFFFFFFu};
    static const int64_t DEADLINES[4] = {1000000000000 - 1000000001, 1000000000000 + 15000001, INT64_MIN, INT64_MAX};
    uint32_t sequence = 100 + draw() % 100000;
    int count = command(frame, SESSION, sequence, NOW + 1000000, 1000000, 1.0f);
    switch (draw() % 9) {
        case 0: /* up to three bits, which the CRC finds without exception */
            for (uint32_t flips = 1 + draw() % 3; flips > 0; flips--) {
                frame[draw() % (uint32_t)count] ^= (uint8_t)(1u << draw() % 8);
            }
            if (haptic_crc32(frame, count - 4) == haptic_get_u32(frame + count - 4)) { /* they took one another back */
                frame[0] ^= 1;
            }
            return count;
        case 1: /* shorter */
            return 1 + (int)(draw() % (uint32_t)(count - 1));
        case 2: /* longer */
            frame[count] = (uint8_t)draw();
            return count + 1;
        case 3: /* noise */
            count = 1 + (int)(draw() % 200);
            for (int i = 0; i < count; i++) {
                frame[i] = (uint8_t)draw();
            }
            return count;
        case 4: /* another session */
            return command(frame, SESSION ^ (1u << draw() % 32), sequence, NOW + 1000000, 1000000, 1.0f);
        case 5: /* old: the hello's sequence was 50 */
            return command(frame, SESSION, 50u - draw() % 0x80000000u, NOW + 1000000, 1000000, 1.0f);
        case 6:
            return command(frame, SESSION, sequence, NOW + 1000000, 1000000, NO_NUMBERS[draw() % 3]);
        case 7:
            return command(frame, SESSION, sequence, NOW + 1000000, PERIODS[draw() % 4], 1.0f);
        default:
            return command(frame, SESSION, sequence, DEADLINES[draw() % 4], 1000000, 1.0f);
    }
}

static void begin(bool datagrams) {
    struct haptic_description known = {"fuzz", 1, 3, {0, 0, 0}, {2, 2, 2}, 100000, 15000000, 32, true, datagrams};
    struct haptic_header hello = {HAPTIC_HELLO, 0, SESSION, 50, 0};
    uint8_t frame[HAPTIC_MOST_FRAME], coded[HAPTIC_MOST_CODED];
    int count = haptic_pack(frame, &hello, NULL);
    haptic_begin(&device, &known);
    if (!datagrams) {
        count = haptic_cobs_encode(frame, count, coded);
        coded[count++] = 0;
    }
    haptic_receive(&device, datagrams ? frame : coded, count, NOW);
}

int main(void) {
    uint8_t frame[512], coded[512];
    uint32_t strays = 0;
    begin(true);
    for (int i = 0; i < ROUNDS; i++) {
        haptic_receive(&device, frame, wrong(frame), NOW);
    }
    uint32_t refused = device.refused;
    if (device.session != SESSION) {
        return 1;
    }
    begin(false);
    for (int i = 0; i < ROUNDS; i++) {
        int count = haptic_cobs_encode(frame, wrong(frame), coded);
        if (draw() % 4 == 0) { /* damage of the line, not of the frame */
            coded[draw() % (uint32_t)count] = (uint8_t)draw();
            strays++;
        }
        coded[count++] = 0;
        int half = (int)(draw() % (uint32_t)count);
        haptic_receive(&device, coded, half, NOW);
        haptic_receive(&device, coded + half, count - half, NOW);
    }
    printf("moved %d, refused %u of %d, %u of %d in a stream\n", moved, (unsigned)refused, ROUNDS,
           (unsigned)device.refused, ROUNDS);
    return moved == 0 && refused == ROUNDS && device.refused >= ROUNDS - strays && device.session == SESSION ? 0 : 1;
}
