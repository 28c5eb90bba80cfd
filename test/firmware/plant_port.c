/* SPDX-License-Identifier: Apache-2.0
 *
 * The reference device's plant and hand, set and asked by plain numbers; times in ns from 0.
 */
#include <string.h>

#include "reference/plant.h"

static struct plant plant;

/* Eight numbers of each of three axes: m, b, f_c, g, m_h, b_h, k_h, start; delays [ns]. */
void plant_port_begin(const double axes[3][8], int64_t sensing, int64_t actuation) {
    memset(&plant, 0, sizeof plant);
    plant.axes = 3;
    plant.sensing_delay = sensing;
    plant.actuation_delay = actuation;
    for (int i = 0; i < 3; i++) {
        const double *n = axes[i];
        struct plant_axis axis = {n[0], n[1], n[2], n[3], n[4], n[5], n[6]};
        plant.axis[i] = axis;
        plant.hand.start[i] = n[7];
    }
    plant.hand.lag = 0.01;
    plant_begin(&plant, 0);
}

void plant_port_waypoint(double time, double x, double y, double theta, double grip) {
    struct hand_waypoint waypoint = {time, {x, y, theta}, grip};
    plant.hand.waypoints[plant.hand.count++] = waypoint;
}

void plant_port_circle(double radius, double turns, double duration) {
    plant.hand.motion = HAND_CIRCLE;
    plant.hand.radius = radius;
    plant.hand.turns = turns;
    plant.hand.duration = duration;
}

void plant_port_follow(double lag) {
    plant.hand.motion = HAND_FOLLOW;
    plant.hand.lag = lag;
}

void plant_port_script(void) {
    hand_begin(&plant.hand, plant.time);
}
void plant_port_goal(const double goal[3]) {
    hand_follow(&plant.hand, plant.time, goal);
}
void plant_port_advance(int64_t time) {
    plant_advance(&plant, time);
}
int64_t plant_port_push(int64_t time, const double force[3]) {
    return plant_push(&plant, time, force);
}
int64_t plant_port_time(void) {
    return plant.time;
}
void plant_port_cut(int64_t time) {
    plant_cut(&plant, time);
}
int plant_port_done(void) {
    return hand_done(&plant.hand, plant.time);
}

/* position, velocity, motor, operator's force, target and its velocity, sensed position, each of 3; energy. */
void plant_port_state(double state[22]) {
    memcpy(state, plant.position, sizeof plant.position);
    memcpy(state + 3, plant.velocity, sizeof plant.velocity);
    memcpy(state + 6, plant.motor, sizeof plant.motor);
    plant_operator_force(&plant, state + 9);
    hand_at(&plant.hand, (double)(plant.time - plant.hand.begin) * 1e-9, state + 12, state + 15);
    plant_sensed(&plant, state + 18);
    state[21] = plant.energy;
}
