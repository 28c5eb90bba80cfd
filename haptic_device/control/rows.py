# SPDX-License-Identifier: Apache-2.0
"""The table of springs and dampers that pull at the handle: each wall, each axis of the coupling and of cancellation.

A row pulls along `normal` with K (offset − normal · q), held within [low, high], times its weight, and damps what its
end moves faster than the handle. A wall has low = 0, a coupling low = −high, cancellation has K = 0 and B < 0. All are
in the world: m, rad, N, N m. Nothing here knows whose a row is.
"""

import numpy as np

from haptic_device.config.parameters import MOST_WALLS
from haptic_device.jit import kernel, njit

AXES = 3  # x, y, theta
COUPLING, CANCELLATION, WALLS = 0, AXES, 2 * AXES  # where in the table the rows of each begin
MOST = WALLS + MOST_WALLS
ROW = np.dtype(
    [("normal", "f8", (AXES,))]
    + [(name, "f8") for name in ("offset", "stiffness", "damping", "low", "high", "weight", "rate")]
)
"""low, high: of its force [N | N m]; weight: 0…1 on all of it; rate: of its offset, at which the damper pulls [m/s]."""


@njit
def stretch(row, place):
    """Stretch of a row's spring [m | rad], positive where it pulls along its normal."""
    return row.offset - row.normal[0] * place[0] - row.normal[1] * place[1] - row.normal[2] * place[2]


@njit
def pull(row, x, rate):
    """Force of spring and of damper [N] at stretch x, both together within [low, high], and the spring's store [J].

    The store is the integral of the spring's force: quadratic up to a limit, straight beyond.
    """
    if row.weight <= 0.0 or (row.low == 0.0 and x <= 0.0):
        return 0.0, 0.0, 0.0
    spring = min(row.high, max(row.low, row.stiffness * x))
    store = spring * (x - 0.5 * spring / row.stiffness) if row.stiffness > 0.0 else 0.0
    damper = min(row.high, max(row.low, spring + row.damping * rate)) - spring
    return row.weight * spring, row.weight * damper, row.weight * store


@kernel
def force(rows, count, place, velocity, spring, damper):
    """Fills in spring and damper force of the first rows, by axis [N | N m]; returns what their springs store [J]."""
    store = 0.0
    for i in range(AXES):
        spring[i] = damper[i] = 0.0
    for r in range(count):
        row = rows[r]
        if row.weight <= 0.0:
            continue
        n = row.normal
        rate = row.rate - n[0] * velocity[0] - n[1] * velocity[1] - n[2] * velocity[2]
        s, d, u = pull(row, stretch(row, place), rate)
        store += u
        for i in range(AXES):
            spring[i] += n[i] * s
            damper[i] += n[i] * d
    return store


@kernel
def blend(rows, wished, first, end, share, trial):
    """trial = rows + share (wished − rows), every number of the rows from first to end."""
    for r in range(first, end):
        a, b, t = rows[r], wished[r], trial[r]
        if share == 1.0:
            copy(b, t)
            continue
        for i in range(AXES):
            t.normal[i] = a.normal[i] + share * (b.normal[i] - a.normal[i])
        t.offset, t.rate = a.offset + share * (b.offset - a.offset), a.rate + share * (b.rate - a.rate)
        t.stiffness = a.stiffness + share * (b.stiffness - a.stiffness)
        t.damping = a.damping + share * (b.damping - a.damping)
        t.low, t.high = a.low + share * (b.low - a.low), a.high + share * (b.high - a.high)
        t.weight = a.weight + share * (b.weight - a.weight)


@njit
def copy(a, b):
    """b = a."""
    for i in range(AXES):
        b.normal[i] = a.normal[i]
    b.offset, b.stiffness, b.damping, b.low, b.high = a.offset, a.stiffness, a.damping, a.low, a.high
    b.weight, b.rate = a.weight, a.rate


@njit
def same(a, b):
    """Whether two rows are alike in all but weight and rate."""
    alike = a.offset == b.offset and a.stiffness == b.stiffness and a.damping == b.damping
    alike = alike and a.low == b.low and a.high == b.high
    return alike and same_normal(a, b)


@njit
def same_normal(a, b):
    return a.normal[0] == b.normal[0] and a.normal[1] == b.normal[1] and a.normal[2] == b.normal[2]
