/* SPDX-License-Identifier: Apache-2.0 */
#include "haptic_core.h"

#include <math.h>
#include <string.h>

#include "haptic_board.h"

enum { UNASKED = 1000000 };                     /* [ns] between samples that nobody has asked for */
enum { LONGEST_PERIOD = 10000000 };             /* [ns] of commands */
static const uint16_t LATCHING = HAPTIC_ESTOP | HAPTIC_HOT | HAPTIC_BROKEN_ENCODER;

static void cut(struct haptic *device, int64_t now) {
    device->clamped = false;
    board_cut_motors(now);
}

void haptic_begin(struct haptic *device, const struct haptic_description *description) {
    memset(device, 0, sizeof *device);
    device->description = *description;
    device->temperature = BOARD_NO_TEMPERATURE;
    cut(device, board_now_ns());
}

/* ---- what the device says ---- */

void haptic_send(struct haptic *device, enum haptic_kind kind, uint16_t flags, uint32_t answers,
                 const uint8_t *payload) {
    struct haptic_header header = {(uint8_t)kind, flags, device->session, ++device->sent_sequence, answers};
    uint8_t frame[HAPTIC_MOST_FRAME], coded[HAPTIC_MOST_CODED];
    int count = haptic_pack(frame, &header, payload);
    if (device->description.datagrams) {
        board_write(frame, count);
        return;
    }
    count = haptic_cobs_encode(frame, count, coded);
    coded[count++] = 0;
    board_write(coded, count);
}

static void greet(struct haptic *device, uint32_t answers) {
    const struct haptic_description *known = &device->description;
    uint8_t payload[72], *place = payload + sizeof known->name;
    memcpy(payload, known->name, sizeof known->name);
    place = haptic_put_u32(place, known->firmware);
    place = haptic_put_u32(place, known->axes);
    for (int i = 0; i < 3; i++) {
        place = haptic_put_f32(place, known->counts_per_unit[i]);
    }
    for (int i = 0; i < 3; i++) {
        place = haptic_put_f32(place, known->largest_motor[i]);
    }
    place = haptic_put_u32(place, known->shortest_period);
    place = haptic_put_u32(place, known->watchdog);
    place = haptic_put_u32(place, known->counter_bits);
    haptic_put_u32(place, known->simulated ? 1 : 0);
    if (!known->datagrams && device->sent_sequence == 0) {
        board_write((const uint8_t[1]){0}, 1); /* a session begins with a 0: what the line held before is no frame */
    }
    haptic_send(device, HAPTIC_GREETING, 0, answers, payload);
}

static void sample(struct haptic *device, uint32_t answers, bool asked, int64_t due, int64_t applied) {
    int32_t counts[3] = {0, 0, 0};
    float damper[3] = {0.0f, 0.0f, 0.0f};
    int64_t sampled = board_latch(due, counts);
    board_read_damper(damper);
    uint8_t payload[52], *place = haptic_put_i64(payload, asked ? due : sampled);
    place = haptic_put_i64(place, sampled);
    place = haptic_put_i64(place, applied);
    for (int i = 0; i < 3; i++) {
        place = haptic_put_u32(place, (uint32_t)counts[i]);
    }
    place = haptic_put_u16(place, (uint16_t)device->temperature);
    place = haptic_put_u16(place, 0);
    for (int i = 0; i < 3; i++) {
        place = haptic_put_f32(place, fabsf(damper[i]) <= 1000.0f ? damper[i] : 0.0f); /* more no damper feels */
    }
    uint16_t status = (uint16_t)(device->latched | (device->inputs & HAPTIC_END_SWITCH));
    status |= device->cut ? HAPTIC_CUT : 0;
    status |= device->clamped ? HAPTIC_CLAMPED : 0;
    haptic_send(device, HAPTIC_SAMPLE, status, answers, payload);
}

/* ---- what falls due ---- */

static void look_at_inputs(struct haptic *device, int64_t now) {
    device->inputs = board_read_inputs(&device->temperature);
    uint16_t fresh = (uint16_t)(device->inputs & LATCHING & ~device->latched);
    if (fresh != 0) {
        device->latched |= fresh;
        cut(device, now);
    }
}

/* Commands are awaited: the watchdog runs and deadlines are the servo's. */
static bool fed(const struct haptic *device) {
    return device->commanded && !device->cut;
}

static int64_t watchdog_end(const struct haptic *device) {
    return device->command_time + device->description.watchdog;
}

/* A clock that was set back must not stretch the watchdog, nor silence the device. What passed since the last look is
 * not known; looks are at most UNASKED apart. */
static void follow_clock(struct haptic *device, int64_t now) {
    if (now < device->looked) {
        device->command_time = now - (device->looked - device->command_time) - UNASKED;
    }
    device->looked = now;
    if (!fed(device) && device->deadline > now + UNASKED) {
        device->deadline = now + UNASKED;
    }
}

/* The first time on the grid of `due` that is after it and after `past`: what was missed is not made up for. */
static int64_t after(int64_t due, int64_t period, int64_t past) {
    return due + period * (past > due ? (past - due) / period + 1 : 1);
}

/* The next deadline that was announced before the last command's, or the deadline of that. */
static int64_t next_deadline(const struct haptic *device) {
    int64_t next = device->deadline;
    for (int i = 0; i < device->keeps; i++) {
        next = device->kept[i].time < next ? device->kept[i].time : next;
    }
    return next;
}

/* Takes those that have come from the kept ones; returns how many, and the newest of them. */
static int take_kept(struct haptic *device, int64_t now, struct haptic_deadline *newest) {
    int come = 0, keeps = device->keeps;
    device->keeps = 0;
    for (int i = 0; i < keeps; i++) {
        if (device->kept[i].time > now) {
            device->kept[device->keeps++] = device->kept[i];
        } else if (come++ == 0 || device->kept[i].time > newest->time) {
            *newest = device->kept[i];
        }
    }
    return come;
}

static void deadline_has_come(struct haptic *device, int64_t now) {
    struct haptic_deadline kept = {0, 0, 0};
    int64_t due = device->deadline;
    if (take_kept(device, now, &kept) > 0 && due > now) {
        sample(device, kept.command, true, kept.time, kept.applied);
        return;
    }
    sample(device, fed(device) && !device->answered ? device->command : 0, fed(device), due, device->applied);
    device->answered = true;
    device->deadline = after(due, fed(device) ? device->period : UNASKED, now);
}

static void watchdog_cuts(struct haptic *device) {
    int64_t end = watchdog_end(device);
    cut(device, end);
    device->cut = true;
    device->cuts++;
    device->deadline = end;
    device->keeps = 0;
}

void haptic_advance(struct haptic *device, int64_t now) {
    look_at_inputs(device, now);
    if (device->session == 0) {
        return;
    }
    follow_clock(device, now);
    for (;;) { /* in the order of their times, however late this is called */
        if (fed(device) && watchdog_end(device) <= now && watchdog_end(device) <= next_deadline(device)) {
            watchdog_cuts(device);
        } else if (next_deadline(device) <= now) {
            deadline_has_come(device, now);
        } else {
            return;
        }
    }
}

int64_t haptic_due(const struct haptic *device, int64_t now) {
    int64_t due = now + UNASKED;
    if (device->session != 0 && next_deadline(device) < due) {
        due = next_deadline(device);
    }
    if (fed(device) && watchdog_end(device) < due) {
        due = watchdog_end(device);
    }
    return due;
}

/* ---- what the host says ---- */

static bool take_hello(struct haptic *device, const struct haptic_header *header, int64_t now) {
    if (header->session == 0) {
        return false;
    }
    board_answer_sender();
    if (header->session != device->session) {
        cut(device, now);
        device->session = header->session;
        device->taken_sequence = header->sequence;
        device->sent_sequence = 0;
        device->commanded = device->engaged = false;
        device->applied = 0;
        device->keeps = 0;
        device->deadline = now + UNASKED;
    }
    greet(device, header->sequence);
    return true;
}

static bool sensible(const struct haptic *device, const float motors[3], int64_t deadline, int64_t period,
                     int64_t now) {
    int64_t ahead = 2 * period > device->description.watchdog ? 2 * period : device->description.watchdog;
    return isfinite(motors[0]) && isfinite(motors[1]) && isfinite(motors[2]) &&
           period > 0 && period >= device->description.shortest_period && period <= LONGEST_PERIOD &&
           deadline >= now - (int64_t)device->description.watchdog && deadline <= now + ahead;
}

/* Within the device's limits, 0 for axes that are not there; says whether an axis that is there wanted more. */
static bool clamp(const struct haptic *device, float motors[3]) {
    bool clamped = false;
    for (uint32_t i = 0; i < 3; i++) {
        float most = device->description.largest_motor[i];
        float within = motors[i] > most ? most : motors[i] < -most ? -most : motors[i];
        clamped |= i < device->description.axes && within != motors[i];
        motors[i] = within;
    }
    return clamped;
}

/* A deadline that is not reached yet waits on, unless the new command announces it again. */
static void keep_deadline(struct haptic *device, int64_t announced, int64_t now) {
    if (fed(device) && !device->answered && device->deadline > now && device->deadline != announced &&
        device->keeps < HAPTIC_KEPT) {
        struct haptic_deadline kept = {device->deadline, device->applied, device->command};
        device->kept[device->keeps++] = kept;
    }
}

static bool take_command(struct haptic *device, const struct haptic_header *header, const uint8_t *payload,
                         int64_t now) {
    int64_t deadline = haptic_get_i64(payload), period = haptic_get_u32(payload + 8);
    float motors[3];
    for (int i = 0; i < 3; i++) {
        motors[i] = haptic_get_f32(payload + 12 + 4 * i);
    }
    if (!sensible(device, motors, deadline, period, now)) {
        return false;
    }
    keep_deadline(device, deadline, now);
    bool engaged = header->flags & 1, at_rest = motors[0] == 0.0f && motors[1] == 0.0f && motors[2] == 0.0f;
    if (!engaged && at_rest) {
        device->latched &= device->inputs;
    }
    device->clamped = clamp(device, motors);
    if (device->latched != 0) {
        cut(device, now);
        device->applied = now;
    } else {
        device->applied = board_write_motors(now, motors);
    }
    device->commanded = true;
    device->engaged = engaged;
    device->cut = device->answered = false;
    device->command = header->sequence;
    device->command_time = now;
    device->deadline = deadline;
    device->period = period;
    return true;
}

static bool take_clock(struct haptic *device, const struct haptic_header *header, const uint8_t *payload, int64_t now) {
    uint8_t answer[24];
    memcpy(answer, payload, 8);
    haptic_put_i64(haptic_put_i64(answer + 8, now), board_now_ns());
    haptic_send(device, HAPTIC_CLOCK_ANSWER, 0, header->sequence, answer);
    return true;
}

static bool take_target(struct haptic *device, const uint8_t *payload) {
    double target[3];
    for (int i = 0; i < 3; i++) {
        target[i] = haptic_get_f64(payload + 8 * i);
    }
    if (!device->description.simulated || !isfinite(target[0]) || !isfinite(target[1]) || !isfinite(target[2])) {
        return false;
    }
    memcpy(device->target, target, sizeof target);
    device->targets++;
    return true;
}

/* Of 32 bits, round the end: 0 is newer than 2³² − 1. */
static bool newer(uint32_t sequence, uint32_t last) {
    return sequence != last && sequence - last < 0x80000000u;
}

static bool take_frame(struct haptic *device, const uint8_t *frame, int count, int64_t now) {
    struct haptic_header header;
    const uint8_t *payload = frame + HAPTIC_HEAD;
    bool taken;
    if (!haptic_unpack(frame, count, &header)) {
        return false;
    }
    if (header.kind == HAPTIC_HELLO) {
        return take_hello(device, &header, now);
    }
    if (device->session == 0 || header.session != device->session || !newer(header.sequence, device->taken_sequence)) {
        return false;
    }
    switch (header.kind) {
        case HAPTIC_COMMAND:
            taken = take_command(device, &header, payload, now);
            break;
        case HAPTIC_CLOCK:
            taken = take_clock(device, &header, payload, now);
            break;
        case HAPTIC_TARGET:
            taken = take_target(device, payload);
            break;
        default: /* what a device says itself */
            taken = false;
    }
    if (taken) {
        device->taken_sequence = header.sequence;
    }
    return taken;
}

static void frame_has_come(struct haptic *device, const uint8_t *frame, int count, int64_t now) {
    if (!take_frame(device, frame, count, now)) {
        device->refused++;
    }
    haptic_advance(device, now); /* a deadline that has passed already is latched at once */
}

static void code_has_come(struct haptic *device, int64_t now) {
    uint8_t frame[HAPTIC_MOST_CODED];
    int count = device->held > (int)sizeof device->coded ? -1 : haptic_cobs_decode(device->coded, device->held, frame);
    if (count < 0) {
        device->refused++;
        return;
    }
    frame_has_come(device, frame, count, now);
}

void haptic_receive(struct haptic *device, const uint8_t *bytes, int count, int64_t now) {
    haptic_advance(device, now); /* what was due before the frame came */
    if (device->description.datagrams) {
        frame_has_come(device, bytes, count, now);
        return;
    }
    for (int i = 0; i < count; i++) {
        if (bytes[i] != 0) {
            if (device->held < (int)sizeof device->coded) {
                device->coded[device->held] = bytes[i];
            }
            device->held += device->held <= (int)sizeof device->coded;
        } else if (device->held > 0) {
            code_has_come(device, now);
            device->held = 0;
        }
    }
}
