/* SPDX-License-Identifier: Apache-2.0 */
#include "plant.h"

#include <math.h>
#include <string.h>

enum { STEP = 10000 };    /* [ns] longest step */
enum { MOST_EVENTS = 8 }; /* reversals in one step, after which the axis rests to its end */
enum { FALSE_POSITIONS = 3 };

struct target {
    double place[3], rate[3];
};

/* Position, velocity and the energy given to the operator; of one axis. */
struct state {
    double x, v, energy;
};

/* The script's time now [ns]; with a fraction, of parts of a step. */
static double script_time(const struct plant *plant) {
    return (double)(plant->time - plant->hand.begin);
}

static double target_at(const struct plant *plant, double time, struct target *target) {
    return hand_at(&plant->hand, time * 1e-9, target->place, target->rate);
}

static void keep(struct plant *plant) {
    if (plant->sensing_delay > 0) {
        int64_t place = plant->kept++ % PLANT_HISTORY;
        plant->history[place].time = plant->time;
        memcpy(plant->history[place].position, plant->position, sizeof plant->position);
    }
}

void plant_begin(struct plant *plant, int64_t time) {
    plant->time = time;
    plant->energy = 0.0;
    plant->first = plant->waiting = 0;
    plant->kept = 0;
    memset(plant->velocity, 0, sizeof plant->velocity);
    memset(plant->motor, 0, sizeof plant->motor);
    memset(plant->position, 0, sizeof plant->position);
    memcpy(plant->position, plant->hand.start, sizeof *plant->position * (size_t)plant->axes);
    keep(plant);
}

/* ---- the equation of one axis ---- */

/* An axis over one step: `way` is the direction in which it slides, by which friction acts against it; 0: none. */
struct slide {
    const struct plant_axis *axis;
    double force; /* of motor and gravity */
    double grip, way;
};

/* Force of the hand's spring and damper on the handle. */
static double pull(const struct slide *slide, double x, double v, double s, double rate) {
    return slide->grip * (slide->axis->hand_stiffness * (s - x) + slide->axis->hand_damping * (rate - v));
}

static double acceleration(const struct slide *slide, double v, double pulled) {
    const struct plant_axis *axis = slide->axis;
    double others = slide->force + pulled - axis->damping * v - axis->coulomb * slide->way;
    return others / (axis->mass + slide->grip * axis->hand_mass);
}

static struct state derivative(const struct slide *slide, struct state at, double s, double rate) {
    double pulled = pull(slide, at.x, at.v, s, rate), a = acceleration(slide, at.v, pulled);
    double by_operator = pulled - slide->grip * slide->axis->hand_mass * a;
    struct state result = {at.v, a, -by_operator * at.v};
    return result;
}

static struct state moved(struct state from, struct state along, double h) {
    struct state to = {from.x + h * along.x, from.v + h * along.v, from.energy + h * along.energy};
    return to;
}

/* Runge–Kutta of fourth order over h [s]; targets at its beginning, middle and end. */
static struct state step(const struct slide *slide, struct state from, double h, const struct target target[3], int i) {
    struct state k1 = derivative(slide, from, target[0].place[i], target[0].rate[i]);
    struct state k2 = derivative(slide, moved(from, k1, h / 2), target[1].place[i], target[1].rate[i]);
    struct state k3 = derivative(slide, moved(from, k2, h / 2), target[1].place[i], target[1].rate[i]);
    struct state k4 = derivative(slide, moved(from, k3, h), target[2].place[i], target[2].rate[i]);
    struct state to = moved(moved(moved(moved(from, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
    return to;
}

/* The same over a part of the step, from `begin` [ns of the script] over h [s]. */
static struct state part(const struct plant *plant, const struct slide *slide, struct state from, double begin,
                         double h, int i) {
    struct target target[3];
    for (int at = 0; at < 3; at++) {
        target_at(plant, begin + at * 0.5e9 * h, &target[at]);
    }
    return step(slide, from, h, target, i);
}

static double sign(double value) {
    return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0;
}

/* Which way the axis slides from here on: as it moves; at rest as the other forces push, 0 if friction holds them. */
static double way_of(const struct slide *slide, struct state at, double s, double rate) {
    double push = slide->force + pull(slide, at.x, 0.0, s, rate);
    return at.v != 0.0 ? sign(at.v) : fabs(push) > slide->axis->coulomb ? sign(push) : 0.0;
}

/* When within h the velocity is zero, and the state there: by false positions, the velocity being nearly straight. */
static double reversal(const struct plant *plant, const struct slide *slide, struct state from, double begin, double h,
                       double v_end, int i, struct state *there) {
    double low = 0.0, high = h, v_low = from.v, v_high = v_end, at = 0.0;
    *there = from;
    for (int tries = 0; tries < FALSE_POSITIONS && v_low != 0.0; tries++) {
        at = (low * v_high - high * v_low) / (v_high - v_low);
        *there = part(plant, slide, from, begin, at, i);
        if (there->v * slide->way > 0.0) {
            low = at;
            v_low = there->v;
        } else {
            high = at;
            v_high = there->v;
        }
    }
    there->v = 0.0;
    return at; /* 0: it rested, was pushed, and is pushed back within the step */
}

/* An axis with friction over a step that may hold reversals. begin [ns of the script], h [s]. */
static struct state slid(const struct plant *plant, struct slide *slide, struct state at, double begin, double h,
                         int i) {
    for (int events = 0; events < MOST_EVENTS && h > 0.0; events++) {
        struct target now;
        target_at(plant, begin, &now);
        slide->way = way_of(slide, at, now.place[i], now.rate[i]);
        if (slide->way == 0.0) { /* it sticks; whether it still does is looked at in the next step */
            break;
        }
        struct state end = part(plant, slide, at, begin, h, i), there;
        if (end.v * slide->way >= 0.0) {
            return end;
        }
        double took = reversal(plant, slide, at, begin, h, end.v, i, &there);
        if (took == 0.0) {
            break;
        }
        at = there;
        begin += took * 1e9;
        h -= took;
    }
    at.v = 0.0;
    return at;
}

/* ---- all axes ---- */

static void step_to(struct plant *plant, int64_t end) {
    struct target target[3];
    double begin = script_time(plant), h = (double)(end - plant->time) * 1e-9;
    double grip = target_at(plant, begin, &target[0]);
    target_at(plant, begin + 0.5e9 * h, &target[1]);
    target_at(plant, begin + 1e9 * h, &target[2]);
    for (int i = 0; i < plant->axes; i++) {
        const struct plant_axis *axis = &plant->axis[i];
        struct slide slide = {axis, plant->motor[i] + axis->weight, grip, sign(plant->velocity[i])};
        struct state from = {plant->position[i], plant->velocity[i], plant->energy}, to = from;
        bool moves = axis->coulomb == 0.0 || from.v != 0.0;
        if (moves) {
            to = step(&slide, from, h, target, i);
        }
        if (!moves || (axis->coulomb > 0.0 && to.v * slide.way < 0.0)) {
            to = slid(plant, &slide, from, begin, h, i);
        }
        plant->position[i] = to.x;
        plant->velocity[i] = to.v;
        plant->energy = to.energy;
    }
    plant->time = end;
    keep(plant);
}

static void set_motor(struct plant *plant, int64_t time, const double force[3]) {
    if (memcmp(plant->motor, force, sizeof plant->motor) != 0) {
        memcpy(plant->motor, force, sizeof plant->motor);
        if (plant->changed) {
            plant->changed(time, force);
        }
    }
}

static void apply_pending(struct plant *plant) {
    while (plant->waiting > 0 && plant->pending[plant->first].time <= plant->time) {
        set_motor(plant, plant->pending[plant->first].time, plant->pending[plant->first].force);
        plant->first = (plant->first + 1) % PLANT_PENDING;
        plant->waiting--;
    }
}

void plant_advance(struct plant *plant, int64_t time) {
    apply_pending(plant);
    while (plant->time < time) {
        int64_t end = plant->time + STEP < time ? plant->time + STEP : time;
        if (plant->waiting > 0 && plant->pending[plant->first].time < end) {
            end = plant->pending[plant->first].time;
        }
        step_to(plant, end);
        apply_pending(plant);
    }
}

int64_t plant_push(struct plant *plant, int64_t time, const double force[3]) {
    plant_advance(plant, time);
    time = plant->time + plant->actuation_delay;
    if (plant->waiting == PLANT_PENDING) { /* more commands than periods: the last one counts */
        plant->waiting--;
    }
    struct plant_force *last = &plant->pending[(plant->first + plant->waiting++) % PLANT_PENDING];
    last->time = time;
    memcpy(last->force, force, sizeof last->force);
    apply_pending(plant);
    return time;
}

void plant_cut(struct plant *plant, int64_t time) {
    static const double NONE[3] = {0.0, 0.0, 0.0};
    plant_advance(plant, time);
    plant->waiting = 0;
    set_motor(plant, plant->time, NONE);
}

void plant_sensed(const struct plant *plant, double position[3]) {
    int64_t time = plant->time - plant->sensing_delay;
    memcpy(position, plant->position, sizeof plant->position);
    if (plant->sensing_delay == 0) {
        return;
    }
    int64_t oldest = plant->kept > PLANT_HISTORY ? plant->kept - PLANT_HISTORY : 0, newest = plant->kept - 1,
            low = oldest;
    if (newest < 0 || plant->history[oldest % PLANT_HISTORY].time >= time) {
        memcpy(position, newest < 0 ? plant->position : plant->history[oldest % PLANT_HISTORY].position,
               sizeof plant->position);
        return;
    }
    while (newest - low > 1) { /* the last one before `time`, by halves */
        int64_t middle = (low + newest) / 2;
        if (plant->history[middle % PLANT_HISTORY].time < time) {
            low = middle;
        } else {
            newest = middle;
        }
    }
    int64_t before = plant->history[low % PLANT_HISTORY].time, after = plant->history[newest % PLANT_HISTORY].time;
    double share = (double)(time - before) / (double)(after - before);
    for (int i = 0; i < 3; i++) {
        double from = plant->history[low % PLANT_HISTORY].position[i];
        position[i] = from + share * (plant->history[newest % PLANT_HISTORY].position[i] - from);
    }
}

void plant_operator_force(const struct plant *plant, double force[3]) {
    struct target now;
    double grip = target_at(plant, script_time(plant), &now);
    for (int i = 0; i < 3; i++) {
        force[i] = 0.0;
        if (i < plant->axes) {
            const struct plant_axis *axis = &plant->axis[i];
            struct state at = {plant->position[i], plant->velocity[i], 0.0};
            struct slide slide = {axis, plant->motor[i] + axis->weight, grip, 0.0};
            slide.way = way_of(&slide, at, now.place[i], now.rate[i]);
            double pulled = pull(&slide, at.x, at.v, now.place[i], now.rate[i]);
            double a = slide.way == 0.0 && axis->coulomb > 0.0 ? 0.0 : acceleration(&slide, at.v, pulled);
            force[i] = pulled - grip * axis->hand_mass * a;
        }
    }
}
