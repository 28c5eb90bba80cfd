# SPDX-License-Identifier: Apache-2.0
"""A finger on a manipulandum, without losses, on a sampled floor: each bounce is higher than the one before."""

from haptic_device.control import virtual_wall
from haptic_device.device import plant

PERIOD, FLOOR = 10e-3, 5000.0
"""s, N/m."""
MASS, SPRING = 0.35 + 0.006, 500.0
"""Manipulandum and finger together [kg]; the finger's spring [N/m]."""
START, AIM = -0.02, 0.01
"""Where it begins at rest, and where the finger's spring draws it to: depth in the floor [m]."""
PARTS = 10
"""Of a period, to see the top of a bounce."""
BOUNCES = "first", "second", "third", "fourth", "fifth"


def heights() -> dict[str, float]:
    """Height [m] of each bounce over the floor."""
    x, v, tops = START, 0.0, []
    while len(tops) < len(BOUNCES):
        force = SPRING * AIM - virtual_wall.wall_force(FLOOR, 0.0, x, 0.0)
        for _ in range(PARTS):
            x, before, (x1, v, _) = x, v, plant.slide(MASS, 0.0, SPRING, 0.0, force, 0.0, x, v, PERIOD / PARTS)
            if before < 0.0 <= v and x1 < 0.0:
                tops.append(-min(x, x1))
            x = x1
    return dict(zip(BOUNCES, tops, strict=True))
