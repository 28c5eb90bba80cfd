/* SPDX-License-Identifier: Apache-2.0 */
#include "haptic_frame.h"

#include <string.h>

/* Remainders of the 16 nibbles by the reflected polynomial 0xEDB88320: 64 bytes of table, two looks a byte. */
static const uint32_t NIBBLES[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                     0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                     0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};

uint32_t haptic_crc32(const uint8_t *bytes, int count) {
    uint32_t remainder = 0xFFFFFFFFu;
    for (int i = 0; i < count; i++) {
        remainder ^= bytes[i];
        remainder = (remainder >> 4) ^ NIBBLES[remainder & 15u];
        remainder = (remainder >> 4) ^ NIBBLES[remainder & 15u];
    }
    return remainder ^ 0xFFFFFFFFu;
}

/* COBS (Cheshire and Baker 1999): each 0, and one more after the last byte, becomes the distance from the one before.
 * A distance of 255 would mean that no 0 follows; frames are too short for it to be written. */
int haptic_cobs_encode(const uint8_t *bytes, int count, uint8_t *coded) {
    int last = 0, out = 1;
    for (int i = 0; i < count; i++) {
        if (bytes[i] == 0) {
            coded[last] = (uint8_t)(out - last);
            last = out;
        } else {
            coded[out] = bytes[i];
        }
        out++;
    }
    coded[last] = (uint8_t)(out - last);
    return out;
}

int haptic_cobs_decode(const uint8_t *coded, int count, uint8_t *bytes) {
    int in = 0, out = 0;
    while (in < count) {
        int distance = coded[in++];
        if (distance == 0 || in + distance - 1 > count) {
            return -1;
        }
        for (int i = 1; i < distance; i++) {
            if (coded[in] == 0) {
                return -1;
            }
            bytes[out++] = coded[in++];
        }
        if (distance < 255 && in < count) {
            bytes[out++] = 0;
        }
    }
    return out;
}

int haptic_payload_of(uint8_t kind) {
    static const int16_t PAYLOADS[9] = {-1, 0, 72, 24, 52, 8, 24, 24, HAPTIC_MOST_PAYLOAD};
    return kind < 9 ? PAYLOADS[kind] : -1;
}

int haptic_pack(uint8_t *frame, const struct haptic_header *header, const uint8_t *payload) {
    int count = haptic_payload_of(header->kind);
    uint8_t *place = frame;
    *place++ = HAPTIC_VERSION;
    *place++ = header->kind;
    place = haptic_put_u16(place, header->flags);
    place = haptic_put_u32(place, header->session);
    place = haptic_put_u32(place, header->sequence);
    place = haptic_put_u32(place, header->answers);
    if (count > 0) {
        memcpy(place, payload, (size_t)count);
    }
    haptic_put_u32(place + count, haptic_crc32(frame, HAPTIC_HEAD + count));
    return HAPTIC_HEAD + count + HAPTIC_CRC;
}

bool haptic_unpack(const uint8_t *frame, int count, struct haptic_header *header) {
    int body = count - HAPTIC_CRC;
    if (body < HAPTIC_HEAD || frame[0] != HAPTIC_VERSION || haptic_payload_of(frame[1]) != body - HAPTIC_HEAD ||
        haptic_get_u32(frame + body) != haptic_crc32(frame, body)) {
        return false;
    }
    header->kind = frame[1];
    header->flags = (uint16_t)(frame[2] | frame[3] << 8);
    header->session = haptic_get_u32(frame + 4);
    header->sequence = haptic_get_u32(frame + 8);
    header->answers = haptic_get_u32(frame + 12);
    return true;
}

static uint8_t *put(uint8_t *place, uint64_t bits, int count) {
    for (int i = 0; i < count; i++) {
        *place++ = (uint8_t)(bits >> 8 * i);
    }
    return place;
}

static uint64_t get(const uint8_t *place, int count) {
    uint64_t bits = 0;
    for (int i = 0; i < count; i++) {
        bits |= (uint64_t)place[i] << 8 * i;
    }
    return bits;
}

uint8_t *haptic_put_u16(uint8_t *place, uint16_t value) {
    return put(place, value, 2);
}

uint8_t *haptic_put_u32(uint8_t *place, uint32_t value) {
    return put(place, value, 4);
}

uint8_t *haptic_put_i64(uint8_t *place, int64_t value) {
    return put(place, (uint64_t)value, 8);
}

uint8_t *haptic_put_f32(uint8_t *place, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put(place, bits, 4);
}

uint8_t *haptic_put_f64(uint8_t *place, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put(place, bits, 8);
}

uint32_t haptic_get_u32(const uint8_t *place) {
    return (uint32_t)get(place, 4);
}

int64_t haptic_get_i64(const uint8_t *place) {
    uint64_t bits = get(place, 8);
    int64_t value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

float haptic_get_f32(const uint8_t *place) {
    uint32_t bits = haptic_get_u32(place);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

double haptic_get_f64(const uint8_t *place) {
    uint64_t bits = get(place, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
