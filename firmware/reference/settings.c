/* SPDX-License-Identifier: Apache-2.0 */
#include "settings.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_NUMBERS = 5, LINE = 256 };

static const double MOST_STIFF = 1e5; /* [1/s] that the plant's steps of 10 µs follow */

/* A key with `count` numbers, each within [low, high]; where: in the settings. */
struct key {
    const char *name;
    int count;
    double low, high;
    const char *unit;
    size_t where;
};

#define KEY(name, count, low, high, unit) {#name, count, low, high, unit, offsetof(struct settings, name)}
#define HAND(name, count, low, high, unit) {#name, count, low, high, unit, offsetof(struct settings, hand.name)}

static const struct key KEYS[] = {
    KEY(axes, 1, 1, 3, ""),
    KEY(watchdog, 1, 0.001, 4, "s"),
    KEY(sensing_delay, 1, 0, 0.1, "s"),
    KEY(actuation_delay, 1, 0, 0.04, "s"),
    KEY(mass, 3, 1e-12, 1e9, "kg | kg m2"),
    KEY(damping, 3, 0, 1e9, "N s/m | N m s/rad"),
    KEY(coulomb, 3, 0, 1e9, "N | N m"),
    KEY(gravity, 3, -1e9, 1e9, "m/s2"),
    KEY(counts_per_unit, 3, 1e-12, 1e9, "1/m | 1/rad"),
    KEY(encoder_sign, 3, -1, 1, ""),
    KEY(zero, 3, -1e9, 1e9, "m | rad"),
    KEY(motor_constant, 3, 1e-12, 1e9, "N | N m per motor unit"),
    KEY(motor_sign, 3, -1, 1, ""),
    KEY(motor_limit, 3, 1e-12, 1e9, "N | N m"),
    KEY(hand_mass, 3, 0, 1e9, "kg | kg m2"),
    KEY(hand_damping, 3, 0, 1e9, "N s/m | N m s/rad"),
    KEY(hand_stiffness, 3, 0, 1e9, "N/m | N m/rad"),
    HAND(start, 3, -1e9, 1e9, "m | rad"),
    HAND(radius, 1, 0, 1e9, "m"),
    HAND(turns, 1, -1e9, 1e9, ""),
    HAND(duration, 1, 0.001, 1e9, "s"),
    HAND(lag, 1, 1e-6, 1e9, "s"),
    {"waypoint", 5, -1e9, 1e9, "s, m | rad, and grip", 0},
};

static void all(double values[3], double x, double y, double theta) {
    values[0] = x;
    values[1] = y;
    values[2] = theta;
}

void settings_begin(struct settings *settings) {
    memset(settings, 0, sizeof *settings);
    strcpy(settings->name, "reference");
    settings->axes = 3;
    settings->watchdog = 0.015;
    all(settings->mass, 0.1, 0.1, 1e-4);
    all(settings->damping, 3.0, 3.0, 0.004);
    all(settings->counts_per_unit, 2e5, 2e5, 4e4);
    all(settings->encoder_sign, 1, 1, 1);
    all(settings->motor_constant, 1, 1, 1);
    all(settings->motor_sign, 1, 1, 1);
    all(settings->motor_limit, 15, 15, 1);
    settings->hand.duration = 4.0;
    settings->hand.lag = 0.01;
}

static bool word_setting(struct settings *settings, const char *key, const char *text, char *sentence, int room) {
    static const char *const MOTIONS[3] = {"waypoints", "circle", "follow"}; /* in the order of enum hand_motion */
    if (strcmp(key, "name") == 0) {
        size_t length = strlen(text);
        if (length == 0 || length > sizeof settings->name) {
            snprintf(sentence, (size_t)room, "name has %u bytes; write 1 to %u", (unsigned)length,
                     (unsigned)sizeof settings->name);
            return false;
        }
        memset(settings->name, 0, sizeof settings->name);
        memcpy(settings->name, text, length);
        return true;
    }
    for (int i = 0; i < 3; i++) {
        if (strcmp(text, MOTIONS[i]) == 0) {
            settings->hand.motion = (enum hand_motion)i;
            return true;
        }
    }
    snprintf(sentence, (size_t)room, "motion is %s; write waypoints, circle or follow", text);
    return false;
}

/* The numbers of a line, at most MOST_NUMBERS; how many there are, −1: something is no number. */
static int numbers_of(const char *text, double numbers[MOST_NUMBERS]) {
    int count = 0;
    for (;;) {
        char *end;
        text += strspn(text, " \t");
        if (*text == 0) {
            return count;
        }
        double number = strtod(text, &end);
        if (end == text || (*end != 0 && *end != ' ' && *end != '\t')) {
            return -1;
        }
        if (count < MOST_NUMBERS) {
            numbers[count] = number;
        }
        count++;
        text = end;
    }
}

static bool add_waypoint(struct hand *hand, const double numbers[5], char *sentence, int room) {
    if (hand->count == HAND_MOST_WAYPOINTS) {
        snprintf(sentence, (size_t)room, "there are more than %d waypoints", HAND_MOST_WAYPOINTS);
        return false;
    }
    if (hand->count > 0 && numbers[0] < hand->waypoints[hand->count - 1].time) {
        snprintf(sentence, (size_t)room,
                 "waypoint at %g s comes after one at %g s; write them in the order of their times", numbers[0],
                 hand->waypoints[hand->count - 1].time);
        return false;
    }
    if (!(numbers[4] >= 0.0 && numbers[4] <= 1.0)) {
        snprintf(sentence, (size_t)room, "grip of a waypoint is %g; the limits are 0 and 1", numbers[4]);
        return false;
    }
    struct hand_waypoint *waypoint = &hand->waypoints[hand->count++];
    waypoint->time = numbers[0];
    memcpy(waypoint->place, numbers + 1, sizeof waypoint->place);
    waypoint->grip = numbers[4];
    return true;
}

static bool number_setting(struct settings *settings, const struct key *key, const char *text, char *sentence,
                           int room) {
    double numbers[MOST_NUMBERS];
    int count = numbers_of(text, numbers);
    if (count < 0) {
        snprintf(sentence, (size_t)room, "%s is %s, which is no number", key->name, text);
        return false;
    }
    if (count != key->count) {
        snprintf(sentence, (size_t)room, "%s has %d numbers; write %d", key->name, count, key->count);
        return false;
    }
    for (int i = 0; i < count; i++) {
        bool sign = strstr(key->name, "_sign") != NULL, whole = strcmp(key->name, "axes") == 0;
        if (!(numbers[i] >= key->low && numbers[i] <= key->high) || (sign && fabs(numbers[i]) != 1.0) ||
            (whole && floor(numbers[i]) != numbers[i])) {
            snprintf(sentence, (size_t)room, "%s is %g%s%s; the limits are %g and %g", key->name, numbers[i],
                     *key->unit ? " " : "", key->unit, key->low, key->high);
            return false;
        }
    }
    if (key->where == 0) {
        return add_waypoint(&settings->hand, numbers, sentence, room);
    }
    memcpy((char *)settings + key->where, numbers, sizeof *numbers * (size_t)count);
    return true;
}

static bool line_setting(struct settings *settings, char *line, char *sentence, int room) {
    line[strcspn(line, "#\r\n")] = 0;
    line += strspn(line, " \t");
    for (size_t end = strlen(line); end > 0 && strchr(" \t", line[end - 1]) != NULL; end--) {
        line[end - 1] = 0;
    }
    if (*line == 0) {
        return true;
    }
    char *text = line + strcspn(line, " \t");
    if (*text != 0) {
        *text++ = 0;
        text += strspn(text, " \t");
    }
    if (strcmp(line, "name") == 0 || strcmp(line, "motion") == 0) {
        return word_setting(settings, line, text, sentence, room);
    }
    for (size_t i = 0; i < sizeof KEYS / sizeof *KEYS; i++) {
        if (strcmp(line, KEYS[i].name) == 0) {
            return number_setting(settings, &KEYS[i], text, sentence, room);
        }
    }
    snprintf(sentence, (size_t)room, "%s is no key that is known", line);
    return false;
}

/* Whether the steps of the plant are short enough for it, with the hand on it and off it. */
static bool slow_enough(const struct settings *settings, char *sentence, int room) {
    for (int i = 0; i < (int)settings->axes; i++) {
        double mass = settings->mass[i] + settings->hand_mass[i];
        double alone = settings->damping[i] / settings->mass[i];
        double held = (settings->damping[i] + settings->hand_damping[i]) / mass;
        double fastest = fmax(fmax(alone, held), sqrt(settings->hand_stiffness[i] / mass));
        if (fastest > MOST_STIFF) {
            snprintf(sentence, (size_t)room,
                     "damping and stiffness make axis %d as fast as %g 1/s; the limit is %g 1/s", i + 1, fastest,
                     MOST_STIFF);
            return false;
        }
    }
    return true;
}

bool settings_read(struct settings *settings, const char *file, char *sentence, int room) {
    char line[LINE], what[LINE + 128];
    FILE *stream = fopen(file, "r");
    if (stream == NULL) {
        snprintf(sentence, (size_t)room, "%s: %s", file, strerror(errno));
        return false;
    }
    bool good = true;
    for (int number = 1; good && fgets(line, sizeof line, stream) != NULL; number++) {
        good = line_setting(settings, line, what, (int)sizeof what);
        if (!good) {
            snprintf(sentence, (size_t)room, "%s, line %d: %s", file, number, what);
        }
    }
    fclose(stream);
    if (good && !slow_enough(settings, what, (int)sizeof what)) {
        snprintf(sentence, (size_t)room, "%s: %s", file, what);
        return false;
    }
    return good;
}
