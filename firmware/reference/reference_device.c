/* SPDX-License-Identifier: Apache-2.0
 *
 * A device that is a process: the firmware's own core on a host, with a simulated mechanism and hand in place of
 * hardware. Its board functions integrate the plant up to the very times at which the core says that something happens.
 */
#define _XOPEN_SOURCE 700 /* open, dprintf */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../boards/host/host_board.h"
#include "../haptic_board.h"
#include "../haptic_core.h"
#include "plant.h"
#include "settings.h"

enum { TRUTH_EACH = 2000000, TRUTH_APART = 1000000, IDLE = 5000000 }; /* [ns] */
enum { SHORTEST_PERIOD = 100000 };                                    /* [ns] */
enum { BEFORE = 100000 };                                             /* [ns] ahead of a deadline */
static const double HOT = 80.0;                                       /* [°C] from which on it is too hot */

struct options {
    const char *config, *address, *link, *log;
    int port; /* −1: none */
    struct host_clock clock;
};

static struct settings settings;
static struct plant plant;
static struct haptic device;
static uint16_t inputs;
static int16_t temperature = BOARD_NO_TEMPERATURE;
static int64_t jump; /* [counts] of the encoder of x */
static int log_file = -1;

/* ---- the board: what host_board.c leaves to the simulated hardware ---- */

int64_t board_latch(int64_t deadline, int32_t counts[3]) {
    double position[3];
    int64_t due = host_monotonic_time(deadline);
    plant_advance(&plant, due);
    plant_sensed(&plant, position);
    for (int i = 0; i < plant.axes; i++) {
        double way = settings.encoder_sign[i] * (position[i] - settings.zero[i]) * settings.counts_per_unit[i];
        int64_t count = (int64_t)fmax(-9e18, fmin(9e18, floor(way + 0.5))) + (i == 0 ? jump : 0);
        uint32_t wrapped = (uint32_t)count; /* as a counter of 32 bits does */
        memcpy(&counts[i], &wrapped, sizeof wrapped);
    }
    return plant.time > due ? host_device_time(plant.time) : deadline;
}

int64_t board_write_motors(int64_t now, const float motors[3]) {
    double force[3];
    for (int i = 0; i < 3; i++) {
        force[i] = settings.motor_sign[i] * settings.motor_constant[i] * (double)motors[i];
    }
    int64_t acts = plant_push(&plant, host_monotonic_time(now), force);
    if (log_file >= 0) {
        dprintf(log_file, "%lld\n", (long long)acts);
    }
    return host_device_time(acts);
}

void board_cut_motors(int64_t now) {
    plant_cut(&plant, host_monotonic_time(now));
}

void board_read_damper(float forces[3]) {
    for (int i = 0; i < plant.axes; i++) {
        forces[i] = (float)(plant.axis[i].damping * plant.velocity[i]);
    }
}

uint16_t board_read_inputs(int16_t *value) {
    *value = temperature;
    return inputs;
}

/* The plant is integrated shortly before a deadline, while there is nothing else to do, and not when it has come. */
void board_wait_until(int64_t time) {
    if (time - board_now_ns() < 3 * BEFORE) {
        host_wait_until(time);
        return;
    }
    host_wait_until(time - BEFORE);
    if (board_now_ns() >= time - BEFORE) { /* else bytes have come, which are not kept waiting */
        plant_advance(&plant, host_monotonic_ns());
    }
}

/* ---- what tests do to it, by lines of the standard input ---- */

static void set_input(uint16_t bit, bool on) {
    inputs = (uint16_t)(on ? inputs | bit : inputs & ~bit);
}

static void hear(const char *line) {
    char what[16];
    double value;
    if (sscanf(line, "%15s %lf", what, &value) != 2 || !(fabs(value) < 1e9)) {
        fprintf(stderr,
                "reference_device: %s is no input; write estop, limit, encoder, temperature or jump and a number\n",
                line);
    } else if (strcmp(what, "estop") == 0) {
        set_input(BOARD_ESTOP, value != 0.0);
    } else if (strcmp(what, "limit") == 0) {
        set_input(BOARD_END_SWITCH, value != 0.0);
    } else if (strcmp(what, "encoder") == 0) {
        set_input(BOARD_BROKEN_ENCODER, value != 0.0);
    } else if (strcmp(what, "jump") == 0) {
        jump += (int64_t)value;
    } else if (strcmp(what, "temperature") == 0) {
        temperature = (int16_t)fmax(-32767.0, fmin(32767.0, floor(10.0 * value + 0.5)));
        set_input(BOARD_HOT, value >= HOT);
    } else {
        fprintf(stderr, "reference_device: %s is no input; write estop, limit, encoder, temperature or jump\n", what);
    }
}

/* ---- its beginning ---- */

static int refuse(const char *sentence) {
    fprintf(stderr, "reference_device: %s\n", sentence);
    return 1;
}

static bool number_option(const char *name, const char *text, double low, double high, double *value, char *sentence,
                          int room) {
    char *end;
    *value = strtod(text, &end);
    if (end == text || *end != 0 || !(*value >= low && *value <= high)) {
        snprintf(sentence, (size_t)room, "%s is %s; write a number from %g to %g", name, text, low, high);
        return false;
    }
    return true;
}

static bool one_option(struct options *options, const char *name, const char *text, char *sentence, int room) {
    double number;
    if (strcmp(name, "--config") == 0) {
        options->config = text;
    } else if (strcmp(name, "--bind") == 0) {
        options->address = text;
    } else if (strcmp(name, "--pty") == 0) {
        options->link = text;
    } else if (strcmp(name, "--log") == 0) {
        options->log = text;
    } else if (strcmp(name, "--udp") == 0) {
        if (!number_option(name, text, 0, 65535, &number, sentence, room)) {
            return false;
        }
        options->port = (int)number;
    } else if (strcmp(name, "--clock-ppm") == 0) {
        return number_option(name, text, -1e5, 1e5, &options->clock.ppm, sentence, room);
    } else if (strcmp(name, "--clock-offset-s") == 0) {
        return number_option(name, text, -1e9, 1e9, &options->clock.offset, sentence, room);
    } else if (strcmp(name, "--clock-step-us") == 0) {
        return number_option(name, text, -1e9, 1e9, &options->clock.step, sentence, room);
    } else if (strcmp(name, "--clock-step-at") == 0) {
        return number_option(name, text, 0, 1e9, &options->clock.step_at, sentence, room);
    } else {
        snprintf(sentence, (size_t)room, "%s is no option that is known", name);
        return false;
    }
    return true;
}

static bool read_options(struct options *options, int count, char **words, char *sentence, int room) {
    for (int i = 1; i < count; i += 2) {
        if (i + 1 == count) {
            snprintf(sentence, (size_t)room, "%s needs a value", words[i]);
            return false;
        }
        if (!one_option(options, words[i], words[i + 1], sentence, room)) {
            return false;
        }
    }
    if ((options->port < 0) == (options->link == NULL)) {
        snprintf(sentence, (size_t)room, "write either --udp PORT or --pty LINK");
        return false;
    }
    return true;
}

static void log_motor(int64_t time, const double force[3]) {
    if (log_file >= 0) { /* one write a line: a kill loses none */
        dprintf(log_file, "%lld %.9g %.9g %.9g\n", (long long)time, force[0], force[1], force[2]);
    }
}

static void build_plant(void) {
    plant.axes = (int)settings.axes;
    plant.hand = settings.hand;
    plant.sensing_delay = (int64_t)(settings.sensing_delay * 1e9 + 0.5);
    plant.actuation_delay = (int64_t)(settings.actuation_delay * 1e9 + 0.5);
    plant.changed = log_motor;
    for (int i = 0; i < 3; i++) {
        struct plant_axis axis = {settings.mass[i],          settings.damping[i],
                                  settings.coulomb[i],       settings.mass[i] * settings.gravity[i],
                                  settings.hand_mass[i],     settings.hand_damping[i],
                                  settings.hand_stiffness[i]};
        plant.axis[i] = axis;
    }
    plant_begin(&plant, host_monotonic_ns());
}

static void describe(struct haptic_description *known, bool datagrams) {
    memset(known, 0, sizeof *known);
    memcpy(known->name, settings.name, sizeof known->name);
    known->firmware = 1 << 16;
    known->axes = (uint32_t)plant.axes;
    for (int i = 0; i < plant.axes; i++) {
        known->counts_per_unit[i] = (float)settings.counts_per_unit[i];
        known->largest_motor[i] = (float)(settings.motor_limit[i] / settings.motor_constant[i]);
    }
    known->shortest_period = SHORTEST_PERIOD;
    known->watchdog = (uint32_t)(settings.watchdog * 1e9 + 0.5);
    known->counter_bits = 32;
    known->simulated = true;
    known->datagrams = datagrams;
}

static bool open_line(const struct options *options, char *sentence, int room) {
    if (options->link != NULL) {
        const char *name = host_open_pty(options->link);
        if (name == NULL) {
            snprintf(sentence, (size_t)room, "%s: %s", options->link, strerror(errno));
            return false;
        }
        printf("pty %s\n", name);
    } else {
        int port = host_open_udp(options->address, options->port);
        if (port < 0) {
            snprintf(sentence, (size_t)room, "%s:%d: %s", options->address, options->port, strerror(errno));
            return false;
        }
        printf("udp %d\n", port);
    }
    fflush(stdout);
    return true;
}

/* ---- its life ---- */

static void tell_truth(void) {
    double by_operator[3], target[3], rate[3];
    uint8_t payload[HAPTIC_MOST_PAYLOAD], *place = haptic_put_i64(payload, host_device_time(plant.time));
    plant_operator_force(&plant, by_operator);
    hand_at(&plant.hand, (double)(plant.time - plant.hand.begin) * 1e-9, target, rate);
    const double *const FIELDS[6] = {plant.position, plant.velocity, by_operator, plant.motor, target, rate};
    for (int field = 0; field < 6; field++) {
        for (int i = 0; i < 3; i++) {
            place = haptic_put_f64(place, FIELDS[field][i]);
        }
    }
    haptic_put_f64(place, plant.energy);
    bool driven = device.commanded && !device.cut;
    haptic_send(&device, HAPTIC_TRUTH, (uint16_t)(hand_done(&plant.hand, plant.time) | driven << 1), 0, payload);
}

static void live(void) {
    char line[128];
    uint32_t targets = 0;
    int64_t told = plant.time;
    while (!host_ending()) {
        haptic_step(&device);
        while (host_line(line, sizeof line)) {
            hear(line);
        }
        if (device.commanded && device.engaged) { /* nothing is integrated beyond the command yet */
            hand_begin(&plant.hand, plant.time);
        }
        if (device.targets != targets) {
            targets = device.targets;
            hand_follow(&plant.hand, plant.time, device.target);
        }
        if (device.session != 0 && plant.time - told >= TRUTH_EACH) {
            told += (plant.time - told) / TRUTH_EACH * TRUTH_EACH;
            told = plant.time - told > TRUTH_APART ? plant.time - TRUTH_APART : told;
            tell_truth();
        }
        if (device.session == 0 && host_monotonic_ns() - plant.time > IDLE) {
            plant_advance(&plant, host_monotonic_ns());
        }
    }
}

int main(int count, char **words) {
    struct options options = {NULL, "127.0.0.1", NULL, NULL, -1, {0.0, 0.0, 0.0, 0.0}};
    struct haptic_description description;
    char sentence[1024];
    settings_begin(&settings);
    if (!read_options(&options, count, words, sentence, sizeof sentence) ||
        (options.config != NULL && !settings_read(&settings, options.config, sentence, sizeof sentence))) {
        return refuse(sentence);
    }
    if (options.log != NULL && (log_file = open(options.log, O_WRONLY | O_CREAT | O_APPEND, 0666)) < 0) {
        snprintf(sentence, sizeof sentence, "%s: %s", options.log, strerror(errno));
        return refuse(sentence);
    }
    host_begin(&options.clock);
    host_end_with_parent();
    host_prefer_realtime();
    build_plant();
    describe(&description, options.link == NULL);
    haptic_begin(&device, &description);
    if (!open_line(&options, sentence, sizeof sentence)) {
        return refuse(sentence);
    }
    live();
    board_cut_motors(board_now_ns());
    host_close();
    printf("frames refused %u, watchdog cuts %u, energy given %.6g J\n", (unsigned)device.refused,
           (unsigned)device.cuts, plant.energy);
    return 0;
}
