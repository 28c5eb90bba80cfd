/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames of docs/reference/link_protocol.md: CRC-32, COBS, numbers as little-endian bytes. No heap, no state.
 */
#ifndef HAPTIC_FRAME_H
#define HAPTIC_FRAME_H

#include <stdbool.h>
#include <stdint.h>

enum haptic_kind {
    HAPTIC_HELLO = 1,
    HAPTIC_GREETING = 2,
    HAPTIC_COMMAND = 3,
    HAPTIC_SAMPLE = 4,
    HAPTIC_CLOCK = 5,
    HAPTIC_CLOCK_ANSWER = 6,
    HAPTIC_TARGET = 7,
    HAPTIC_TRUTH = 8
};

enum {
    HAPTIC_VERSION = 1,
    HAPTIC_HEAD = 16,          /* bytes before the payload */
    HAPTIC_CRC = 4,            /* bytes after it */
    HAPTIC_MOST_PAYLOAD = 160, /* bytes, of the longest kind */
    HAPTIC_MOST_FRAME = HAPTIC_HEAD + HAPTIC_MOST_PAYLOAD + HAPTIC_CRC,
    HAPTIC_MOST_CODED = HAPTIC_MOST_FRAME + 2 /* by COBS, with the 0 that ends it; frames are shorter than 254 bytes */
};

struct haptic_header {
    uint8_t kind;
    uint16_t flags;
    uint32_t session, sequence, answers;
};

/* CRC-32 of Ethernet and zlib of `count` bytes. */
uint32_t haptic_crc32(const uint8_t *bytes, int count);

/* Codes at most 254 bytes without the 0 that ends a frame; returns the number of bytes put into coded (count + 1). */
int haptic_cobs_encode(const uint8_t *bytes, int count, uint8_t *coded);

/* Decodes `count` bytes that stood before a 0 into `bytes`, which has room for `count`; returns how many, −1: not COBS.
 */
int haptic_cobs_decode(const uint8_t *coded, int count, uint8_t *bytes);

/* Bytes of the payload that this kind has; −1 for a kind that is none. */
int haptic_payload_of(uint8_t kind);

/* Writes header, payload (as long as its kind says) and CRC into frame; returns the number of bytes. */
int haptic_pack(uint8_t *frame, const struct haptic_header *header, const uint8_t *payload);

/* Whether version, kind, length and CRC of a frame are right; if so its header. The payload is at frame + HAPTIC_HEAD.
 */
bool haptic_unpack(const uint8_t *frame, int count, struct haptic_header *header);

/* Numbers as little-endian bytes, IEEE 754; put_… return the place after what they have put. */
uint8_t *haptic_put_u16(uint8_t *place, uint16_t value);
uint8_t *haptic_put_u32(uint8_t *place, uint32_t value);
uint8_t *haptic_put_i64(uint8_t *place, int64_t value);
uint8_t *haptic_put_f32(uint8_t *place, float value);
uint8_t *haptic_put_f64(uint8_t *place, double value);
uint32_t haptic_get_u32(const uint8_t *place);
int64_t haptic_get_i64(const uint8_t *place);
float haptic_get_f32(const uint8_t *place);
double haptic_get_f64(const uint8_t *place);

#endif
