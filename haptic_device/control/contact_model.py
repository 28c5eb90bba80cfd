# SPDX-License-Identifier: Apache-2.0
"""A local contact: the pair of features, one of the tool and one of another body, that may touch within the next moves.

With d the way from the other body's point to the tool's, and n the unit normal out of the other body,

    gap = n · d − ρ,      rate of the gap = n · (v + θ' ẑ × arm − u)

where u is the velocity of the other body's surface and the arm goes from the tool's origin to where they touch. Kinds:

    FLAT_THERE  a point of the tool at a plane of the other body: n is the plane's
    FLAT_HERE   a point of the other body at a plane of the tool: n turns with the tool
    ROUND       two discs: n = d/|d|

Both flats are exact for any turn of the tool, so the lever arms are those of the present pose, not of the sample's. A
round feature (ρ > 0) at a flat one is held by the edge within [low, high] along it and by its nearer end outside.
Features with sharp points come in groups: a point is outside a convex shape if it is in front of at least one of its
edges, so only the member with the largest gap counts (`hide_others`).
"""

import math

import numpy as np

from haptic_device.jit import njit
from haptic_device.message_fields import COMMON, EACH, MOST

FLAT_THERE, FLAT_HERE, ROUND = 1, 2, 3
IDENTITY, GROUP, KIND, GAP, POINT_X, POINT_Y, TOOL_X, TOOL_Y, NORMAL_X, NORMAL_Y, LOW, HIGH = range(12)
RADIUS, TOOL_RADIUS, FRICTION, RESTITUTION, VELOCITY_X, VELOCITY_Y, TURN_RATE = range(12, 19)
MOBILITY, SLIP_MOBILITY, FORCE = range(19, 22)
SET = np.dtype(
    [("number", "f8"), ("sent", "f8")] + [(name, "f8") for name in COMMON] + [("table", "f8", (MOST, len(EACH)))]
)
"""A set as the servo takes it: sequence and deadline [ns] of the handle sample it answers, contacts."""

PLACE = 5  # columns that `place` fills in: gap, normal, arm
GAP_NOW, NX, NY, ARM_X, ARM_Y = range(PLACE)

UNIT, APART, LARGEST = 1e-6, 1e-3, 1e3  # of |n|² − 1; overlap [m] of planes face to face; of friction, mobility, …


@njit
def place(one, pose, age, back, out):
    """Gap, normal and arm of a contact (row of a table) now, into out.

    pose: the tool's; age [s] of the sample; back [m]: how far the tool has pushed the other body since, along −n.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    rx, ry = c * one[TOOL_X] - s * one[TOOL_Y], s * one[TOOL_X] + c * one[TOOL_Y]
    dx = pose[0] + rx - one[POINT_X] - one[VELOCITY_X] * age
    dy = pose[1] + ry - one[POINT_Y] - one[VELOCITY_Y] * age
    if one[KIND] == FLAT_HERE:
        nx, ny = c * one[NORMAL_X] - s * one[NORMAL_Y], s * one[NORMAL_X] + c * one[NORMAL_Y]
    else:
        # first order: the age is some ticks
        turn = one[TURN_RATE] * age
        nx, ny = one[NORMAL_X] - turn * one[NORMAL_Y], one[NORMAL_Y] + turn * one[NORMAL_X]
    dx, dy = dx + back * nx, dy + back * ny
    arm_x, arm_y = rx, ry
    here = one[KIND] == FLAT_HERE
    if one[RADIUS] > 0.0:
        over, end = _over_the_end(one, nx, ny, dx, dy)
        if over:
            reach = end if here else -end
            dx, dy = dx - reach * ny, dy + reach * nx
            if here:
                arm_x, arm_y = rx - reach * ny, ry + reach * nx
            far = math.hypot(dx, dy)
            nx, ny = (dx / far, dy / far) if far > 0.0 else (nx, ny)
            here = False
    # along the normal, less the round feature's radius
    gap = nx * dx + ny * dy - one[RADIUS]
    if here:
        ahead = one[RADIUS] - one[TOOL_RADIUS]
        arm_x, arm_y = rx - dx + ahead * nx, ry - dy + ahead * ny
    else:
        arm_x, arm_y = arm_x - one[TOOL_RADIUS] * nx, arm_y - one[TOOL_RADIUS] * ny
    out[GAP_NOW], out[NX], out[NY], out[ARM_X], out[ARM_Y] = gap, nx, ny, arm_x, arm_y


@njit
def _over_the_end(one, nx, ny, dx, dy):
    """Whether an end of the edge is nearest, and where it is along the edge's tangent (−n_y, n_x) [m]."""
    if one[KIND] == ROUND:
        return True, 0.0
    along = -ny * dx + nx * dy
    along = -along if one[KIND] == FLAT_HERE else along
    held = min(one[HIGH], max(one[LOW], along))
    return held != along, held


@njit
def hide_others(table, gaps, shown):
    """Fills in shown: 1 for each contact that counts now; of a group the one with the largest gap. gaps: (MOST, …)."""
    for i in range(MOST):
        shown[i] = 1.0 if table[i, IDENTITY] > 0.0 else 0.0
        if shown[i] == 0.0 or table[i, GROUP] == 0.0:
            continue
        for k in range(i):
            if shown[k] > 0.0 and table[k, GROUP] == table[i, GROUP]:
                if gaps[k, GAP_NOW] >= gaps[i, GAP_NOW]:
                    shown[i] = 0.0
                    break
                shown[k] = 0.0


ACCEPTED, NOT_FINITE, NOT_A_CONTACT, NO_WAY_OUT, NOT_MINE, OLD, OTHER_SENDER, OTHER_SCENE, OTHER_LAYOUT = range(9)
REFUSALS = (
    "accepted",
    "NaN or out of range",
    "normal of no or other length than one, or unphysical numbers",
    "planes that leave no room",
    "answers another session",
    "late or repeated",
    "of another simulation than the tool's",
    "of another scene",
    "other layout",
)


@njit
def judge_table(table):
    """ACCEPTED, or why this table of contacts cannot be used."""
    for i in range(MOST):
        one = table[i]
        for value in one:
            if not abs(value) < 1e15:
                return NOT_FINITE
        # a row that is not used
        if one[IDENTITY] == 0.0:
            continue
        if one[KIND] != FLAT_THERE and one[KIND] != FLAT_HERE and one[KIND] != ROUND:
            return NOT_A_CONTACT
        if abs(one[NORMAL_X] ** 2 + one[NORMAL_Y] ** 2 - 1.0) > UNIT:
            return NOT_A_CONTACT
        if not (0.0 <= one[FRICTION] < LARGEST and 0.0 <= one[RESTITUTION] <= 1.0):
            return NOT_A_CONTACT
        if one[MOBILITY] < 0.0 or one[SLIP_MOBILITY] < 0.0 or one[RADIUS] < 0.0 or one[TOOL_RADIUS] < 0.0:
            return NOT_A_CONTACT
        if abs(one[POINT_X]) > LARGEST or abs(one[POINT_Y]) > LARGEST:
            return NOT_FINITE
        if abs(one[VELOCITY_X]) > LARGEST or abs(one[VELOCITY_Y]) > LARGEST:
            return NOT_FINITE
    return _judge_room(table)


@njit
def _judge_room(table):
    """NO_WAY_OUT where two planes face each other and overlap, with no other member in their groups to give way."""
    for i in range(MOST):
        for k in range(i):
            facing = table[i, NORMAL_X] * table[k, NORMAL_X] + table[i, NORMAL_Y] * table[k, NORMAL_Y]
            both = table[i, IDENTITY] > 0.0 and table[k, IDENTITY] > 0.0 and table[i, KIND] == table[k, KIND]
            overlap = both and facing < -0.99 and table[i, GAP] + table[k, GAP] < -APART
            if overlap and _alone(table, i) and _alone(table, k):
                return NO_WAY_OUT
    return ACCEPTED


@njit
def _alone(table, i):
    members = 0
    for k in range(MOST):
        members += table[i, GROUP] > 0.0 and table[k, GROUP] == table[i, GROUP]
    return members <= 1
