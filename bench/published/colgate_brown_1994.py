# SPDX-License-Identifier: Apache-2.0
"""Which property of a display widens its range of passive walls most."""

import numpy as np

from haptic_device.theory.assessment import coulomb_friction_needed
from haptic_device.theory.delay import largest_passive_stiffness

DISPLAY = {"physical_damping": 0.5, "period": 1e-3, "resolution": 2e-5, "velocity_lag": 0.0}
FRICTION = 0.1
"""N."""
TEN_TIMES = {
    "damping": {"physical_damping": 5.0},
    "sampling rate": {"period": 1e-4},
    "encoder": {"resolution": 2e-6},
    "velocity filter": {"velocity_lag": 1.0 / (2.0 * np.pi * 30.0)},  # 30 Hz, a tenth of what T = 1 ms could follow
}
"""A better display: each property ten times as good, the filter a usual one."""
DAMPING = np.linspace(0.0, 6.0, 121)
"""B of the walls [N s/m]."""


def widths(friction: float = FRICTION) -> dict[str, float]:
    """Area of the passive walls in the K–B plane with one property better, over that of the display as it is."""
    plain = _area(friction, **DISPLAY)
    return {name: _area(friction, **DISPLAY | change) / plain for name, change in TEN_TIMES.items()}


def _area(friction, physical_damping, period, resolution, velocity_lag):
    """What damping allows, and what Coulomb friction [N] allows beside the encoder's step, which is linear in K."""
    by_damping = largest_passive_stiffness(physical_damping, DAMPING, period, velocity_lag)
    without, with_one = (coulomb_friction_needed(K, DAMPING, period, resolution, velocity_lag) for K in (0.0, 1.0))
    by_friction = (friction - without) / (with_one - without)
    return float(np.trapezoid(np.maximum(0.0, np.minimum(by_damping, by_friction)), DAMPING))
