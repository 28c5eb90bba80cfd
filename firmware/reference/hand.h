/* SPDX-License-Identifier: Apache-2.0
 *
 * Where the simulated operator's hand wants the handle: a script through waypoints, a circle, or after targets that
 * come. Positions in m, m, rad, in device units; times in ns, of one clock.
 */
#ifndef HAND_H
#define HAND_H

#include <stdbool.h>
#include <stdint.h>

enum hand_motion { HAND_WAYPOINTS, HAND_CIRCLE, HAND_FOLLOW };

enum { HAND_MOST_WAYPOINTS = 64 };

struct hand_waypoint {
    double time; /* [s] of the script */
    double place[3];
    double grip; /* from here on: 1 holds the handle, 0 has let go */
};

struct hand {
    enum hand_motion motion;
    double start[3];
    struct hand_waypoint waypoints[HAND_MOST_WAYPOINTS]; /* joined by minimum-jerk motions */
    int count;
    double radius, turns; /* of the circle, whose rightmost point is start */
    double duration;      /* of the circle [s] */
    double lag;           /* of following, first order [s] */

    bool begun;
    int64_t begin; /* [ns] */

    double goal[3], left[3]; /* of following: the last target, and where the hand was when it came */
    int64_t goal_time;       /* [ns] */
};

/* The script begins at this time, once. */
void hand_begin(struct hand *hand, int64_t time);

/* Where a following hand goes from this time on; nothing to other scripts. */
void hand_follow(struct hand *hand, int64_t time, const double goal[3]);

/* Target and its velocity at this time of the script [s]; returns the grip, 0…1. */
double hand_at(const struct hand *hand, double time, double place[3], double rate[3]);

/* Whether the script has ended by this time; following has no end. */
bool hand_done(const struct hand *hand, int64_t time);

#endif
