/* SPDX-License-Identifier: Apache-2.0
 *
 * The device's side of docs/reference/link_protocol.md: sessions, announced deadlines, watchdog, latched faults. All state is in
 * a struct haptic that the caller owns; nothing waits and nothing is allocated. Hardware is reached by haptic_board.h.
 */
#ifndef HAPTIC_CORE_H
#define HAPTIC_CORE_H

#include <stdbool.h>
#include <stdint.h>

#include "haptic_frame.h"

#ifdef __cplusplus
extern "C" {
#endif

enum haptic_status {
    HAPTIC_CUT = 2, /* by the watchdog */
    HAPTIC_ESTOP = 4,
    HAPTIC_HOT = 8,
    HAPTIC_END_SWITCH = 16,
    HAPTIC_BROKEN_ENCODER = 32,
    HAPTIC_CLAMPED = 128
};

enum { HAPTIC_KEPT = 4 }; /* deadlines that wait behind the last command's */

/* A deadline that a command has announced. */
struct haptic_deadline {
    int64_t time;     /* [ns] */
    int64_t applied;  /* when the command's motor values began to act [ns] */
    uint32_t command; /* its sequence */
};

/* What the device is; the greeting says it. */
struct haptic_description {
    char name[24];            /* ASCII, padded with zeros */
    uint32_t firmware;        /* major · 65536 + minor · 256 + patch */
    uint32_t axes;            /* 1 (x), 2 (x, y), 3 (x, y, theta) */
    float counts_per_unit[3]; /* [1/m, 1/m, 1/rad]; 0: unknown */
    float largest_motor[3];   /* [motor units]; 0 for axes that are not there */
    uint32_t shortest_period; /* of commands [ns] */
    uint32_t watchdog;        /* longest time without a command before the motors are cut [ns] */
    uint32_t counter_bits;    /* 32, or 16 */
    bool simulated;           /* takes targets and tells truths */
    bool datagrams;           /* each board_read is one frame; else a stream of COBS */
};

struct haptic {
    struct haptic_description description;

    uint32_t session;        /* 0: none yet */
    uint32_t taken_sequence; /* of the last frame taken */
    uint32_t sent_sequence;  /* of the last frame sent */

    bool commanded;       /* a command has been taken in this session */
    bool engaged;         /* the last one says that the display is engaged */
    uint32_t command;     /* its sequence */
    int64_t command_time; /* when it was taken [ns] */
    int64_t looked;       /* when this was looked at last [ns] */
    int64_t applied;      /* when its motor values began to act [ns]; 0: none yet */
    bool answered;        /* the deadline that it announced has come */
    int64_t deadline;     /* the next [ns]; unasked samples too */
    int64_t period;       /* [ns] */

    struct haptic_deadline kept[HAPTIC_KEPT]; /* of commands before the last one, and not reached yet */
    int keeps;                                /* how many */

    bool cut, clamped;   /* bits of status that the core finds itself */
    uint16_t latched;    /* … and those that stay until they are cleared */
    uint16_t inputs;     /* as last read */
    int16_t temperature; /* [0.1 °C] */

    double target[3]; /* of the last target frame [m, m, rad] */
    uint32_t targets; /* how many came */

    uint32_t refused; /* frames dropped */
    uint32_t cuts;    /* by the watchdog */

    int held; /* bytes of a frame that has not ended yet; beyond the room: all up to the next 0 is dropped */
    uint8_t coded[HAPTIC_MOST_CODED];
};

/* Forgets all and sets the motors to zero. */
void haptic_begin(struct haptic *device, const struct haptic_description *description);

/* Does what has fallen due by now: watchdog, samples. Inputs are looked at. */
void haptic_advance(struct haptic *device, int64_t now);

/* Takes what board_read gave: a datagram, or a piece of the stream. now: when it came [ns]. */
void haptic_receive(struct haptic *device, const uint8_t *bytes, int count, int64_t now);

/* When haptic_advance has something to do next [ns], at most 1 ms from now: inputs want to be looked at. */
int64_t haptic_due(const struct haptic *device, int64_t now);

/* Sends a frame of this session; payload as long as its kind says. answers: sequence of the frame answered, or 0. */
void haptic_send(struct haptic *device, enum haptic_kind kind, uint16_t flags, uint32_t answers,
                 const uint8_t *payload);

/* One pass of the device's loop: what has come, what is due, else a wait. Call it for ever. */
void haptic_step(struct haptic *device);

#ifdef __cplusplus
}
#endif

#endif
