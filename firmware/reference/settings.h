/* SPDX-License-Identifier: Apache-2.0
 *
 * What the reference device is told of itself: a text file with one `key value…` a line; README.md lists the keys.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>

#include "hand.h"

struct settings {
    char name[24];
    double axes, watchdog, sensing_delay, actuation_delay; /* [s] */
    double mass[3], damping[3], coulomb[3], gravity[3];    /* gravity: acceleration [m/s²] */
    double counts_per_unit[3], encoder_sign[3], zero[3];
    double motor_constant[3], motor_sign[3], motor_limit[3]; /* limit [N, N, N m] */
    double hand_mass[3], hand_damping[3], hand_stiffness[3];
    struct hand hand;
};

/* A device of three axes with a still hand. */
void settings_begin(struct settings *settings);

/* Reads a file. False where something is wrong: `sentence` (room bytes) then says what. */
bool settings_read(struct settings *settings, const char *file, char *sentence, int room);

#endif
