# SPDX-License-Identifier: Apache-2.0
"""A passivity observer and controller before a wall that is too stiff, and before one that is computed too rarely."""

import numpy as np

from haptic_device.control import velocity_estimator, virtual_wall
from haptic_device.device import plant

PERIOD, STEP, LIMIT = 1e-3, 1e-4, 200.0
"""Servo period [s], encoder step [m], largest motor force [N]: the paper's device."""
MASS, DAMPING = 1.0, 5.0
"""Of the device [kg, N s/m]."""
HAND_STIFFNESS, HAND_DAMPING, DEPTH, SPEED = 500.0, 5.0, 0.01, 0.2
"""The hand [N/m, N s/m] aims so deep into the wall [m] and comes at this speed [m/s]."""
SECONDS = 2.0


def stiff() -> dict[str, float]:
    """Travel [mm] in the last second at 90 kN/m."""
    return _both(90e3, 1)


def rare() -> dict[str, float]:
    """Travel [mm] in the last second at 30 kN/m, the force computed at 66.7 Hz."""
    return _both(30e3, 15)


def _both(*wall):
    return {"without controller": _travel(*wall, False), "with controller": _travel(*wall, True)}


def _travel(stiffness, ticks, controlled):
    """Before a wall [N/m] each force of which stays for so many servo ticks."""
    x, v, seen, held, given, pushed, track = -0.02, SPEED, _read(-0.02), 0.0, 0.0, 0.0, []
    for k in range(round(SECONDS / PERIOD)):
        now = _read(x)
        rate = (now - seen) / PERIOD
        given += held * (now - seen)
        if k % ticks == 0:
            pushed = -virtual_wall.wall_force(stiffness, 0.0, now, 0.0)
        damper = _injected(given, rate) if controlled else 0.0
        seen, held = now, float(np.clip(pushed - damper * rate, -LIMIT, LIMIT))
        push = held + HAND_STIFFNESS * DEPTH
        x, v, _ = plant.slide(MASS, DAMPING + HAND_DAMPING, HAND_STIFFNESS, 0.0, push, 0.0, x, v, PERIOD)
        track.append(x)
    return 1e3 * float(np.ptp(track[len(track) // 2 :]))


def _injected(given, rate):
    """Damping [N s/m] that takes what was given beyond nothing out of the next tick, at most what the loop can take."""
    power = rate * rate * PERIOD
    return min(MASS / PERIOD, given / power) if given > 0.0 and power > 0.0 else 0.0


def _read(position):
    return velocity_estimator.position_of(np.floor(position / STEP + 0.5), STEP, 0.0)
