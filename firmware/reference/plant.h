/* SPDX-License-Identifier: Apache-2.0
 *
 * A simulated device with a hand on it. On each axis, and independently of the other axes,
 *
 *   (m + m_h) x'' + (b + b_h) x' + k_h x = u + g + k_h s + b_h s' − f_c sign(x')
 *
 * u motor, g weight, s the hand's target. Integrated by Runge and Kutta's method of fourth order in steps of at most 10
 * µs, with the work at the handle as one more equation. Reversals are found within the steps; at rest the axis sticks
 * while the other forces are at most f_c. Nothing is integrated before it is asked for. SI; times in ns of one clock.
 */
#ifndef PLANT_H
#define PLANT_H

#include <stdint.h>

#include "hand.h"

enum { PLANT_PENDING = 1024, PLANT_HISTORY = 32768 };

struct plant_axis {
    double mass, damping, coulomb; /* of the mechanism: m, b, f_c */
    double weight;                 /* force of gravity g [N] */
    double hand_mass, hand_damping, hand_stiffness;
};

struct plant_force {
    int64_t time; /* from when on it acts */
    double force[3];
};

struct plant {
    int axes;
    struct plant_axis axis[3];
    int64_t sensing_delay, actuation_delay;               /* [ns] */
    void (*changed)(int64_t time, const double force[3]); /* told of each change of the motor's force; may be NULL */
    struct hand hand;

    int64_t time; /* up to which all is integrated */
    double position[3], velocity[3];
    double motor[3]; /* force of the motor on the handle [N, N, N m] */
    double energy;   /* given to the operator, −∫ f_operator · x' dt [J] */

    struct plant_force pending[PLANT_PENDING]; /* a ring of what has not begun to act */
    int first, waiting;
    struct {
        int64_t time;
        double position[3];
    } history[PLANT_HISTORY]; /* a ring, kept for the sensing delay */
    int64_t kept;             /* how many it has ever had */
};

/* At rest at its hand's start. axes, axis, delays and hand are to be set before. */
void plant_begin(struct plant *plant, int64_t time);

/* Integrates up to this time; nothing if that has passed. */
void plant_advance(struct plant *plant, int64_t time);

/* The motor's force is this one from `time` and the actuation delay on; returns from when on it acts. */
int64_t plant_push(struct plant *plant, int64_t time, const double force[3]);

/* No force from this time on, whatever was pushed before; no delay. */
void plant_cut(struct plant *plant, int64_t time);

/* Position that the encoder shows now: of one sensing delay ago. */
void plant_sensed(const struct plant *plant, double position[3]);

/* Force of the operator on the handle now: k_h (s − x) + b_h (s' − x') − m_h x''. */
void plant_operator_force(const struct plant *plant, double force[3]);

#endif
