/* SPDX-License-Identifier: Apache-2.0 */
#include "hand.h"

#include <math.h>
#include <string.h>

static const double TURN = 6.283185307179586; /* [rad] */
static const double EASE = 0.1;               /* share of the circle's time in which its rate rises, and falls */

void hand_begin(struct hand *hand, int64_t time) {
    if (hand->begun) {
        return;
    }
    hand->begun = true;
    hand->begin = hand->goal_time = time;
    memcpy(hand->goal, hand->start, sizeof hand->goal);
    memcpy(hand->left, hand->start, sizeof hand->left);
}

void hand_follow(struct hand *hand, int64_t time, const double goal[3]) {
    double rate[3];
    if (hand->motion != HAND_FOLLOW || !hand->begun) {
        return;
    }
    hand_at(hand, (double)(time - hand->begin) * 1e-9, hand->left, rate);
    memcpy(hand->goal, goal, sizeof hand->goal);
    hand->goal_time = time;
}

static double stay(const double where[3], double place[3], double rate[3]) {
    memcpy(place, where, 3 * sizeof *place);
    memset(rate, 0, 3 * sizeof *rate);
    return 1.0;
}

/* Flash and Hogan 1985: at rest at both ends. */
static double through_waypoints(const struct hand *hand, double time, double place[3], double rate[3]) {
    int last = 0;
    while (last + 1 < hand->count && hand->waypoints[last + 1].time <= time) {
        last++;
    }
    const struct hand_waypoint *from = &hand->waypoints[last];
    if (last + 1 == hand->count || time <= from->time) {
        stay(from->place, place, rate);
        return from->grip;
    }
    const struct hand_waypoint *to = from + 1;
    double span = to->time - from->time, s = (time - from->time) / span;
    double share = s * s * s * (10.0 + s * (-15.0 + 6.0 * s)), speed = 30.0 * s * s * (1.0 - s) * (1.0 - s) / span;
    for (int i = 0; i < 3; i++) {
        double way = to->place[i] - from->place[i];
        place[i] = from->place[i] + share * way;
        rate[i] = speed * way;
    }
    return from->grip;
}

/* Share of the turns after this share s of the time, and its derivative. The rate rises by 3 q² − 2 q³ over the first
 * tenth. */
static double eased(double s, double *slope) {
    double most = 1.0 / (1.0 - EASE);
    if (s > 1.0 - EASE) {
        double left = eased(1.0 - s, slope);
        return 1.0 - left;
    }
    double q = s / EASE;
    if (q >= 1.0) {
        *slope = most;
        return most * (s - 0.5 * EASE);
    }
    *slope = most * q * q * (3.0 - 2.0 * q);
    return most * EASE * q * q * q * (1.0 - 0.5 * q);
}

static double round_circle(const struct hand *hand, double time, double place[3], double rate[3]) {
    double slope, s = time < hand->duration ? (time > 0.0 ? time / hand->duration : 0.0) : 1.0;
    double angle = TURN * hand->turns * eased(s, &slope), speed = TURN * hand->turns * slope / hand->duration;
    stay(hand->start, place, rate);
    place[0] += hand->radius * (cos(angle) - 1.0);
    place[1] += hand->radius * sin(angle);
    rate[0] = -hand->radius * sin(angle) * speed;
    rate[1] = hand->radius * cos(angle) * speed;
    return 1.0;
}

static double after_goal(const struct hand *hand, double time, double place[3], double rate[3]) {
    double since = time - (double)(hand->goal_time - hand->begin) * 1e-9;
    double left = exp(-(since > 0.0 ? since : 0.0) / hand->lag);
    for (int i = 0; i < 3; i++) {
        double way = hand->goal[i] - hand->left[i];
        place[i] = hand->goal[i] - left * way;
        rate[i] = left * way / hand->lag;
    }
    return 1.0;
}

double hand_at(const struct hand *hand, double time, double place[3], double rate[3]) {
    if (!hand->begun) {
        stay(hand->start, place, rate);
        return hand->motion == HAND_WAYPOINTS && hand->count > 0 ? hand->waypoints[0].grip : 1.0;
    }
    switch (hand->motion) {
        case HAND_CIRCLE:
            return round_circle(hand, time, place, rate);
        case HAND_FOLLOW:
            return after_goal(hand, time, place, rate);
        default:
            return hand->count > 0 ? through_waypoints(hand, time, place, rate) : stay(hand->start, place, rate);
    }
}

bool hand_done(const struct hand *hand, int64_t time) {
    double end = hand->duration, since = (double)(time - hand->begin) * 1e-9;
    if (hand->motion == HAND_WAYPOINTS) {
        end = hand->count > 0 ? hand->waypoints[hand->count - 1].time : 0.0;
    }
    return hand->begun && hand->motion != HAND_FOLLOW && since >= end;
}
