# SPDX-License-Identifier: Apache-2.0
"""A wall whose velocity passes a filter of first order needs less damping of the device."""

from haptic_device.theory.passivity import least_damping
from haptic_device.theory.transfer import wall_transfer

WALLS = (0.25, 1.0), (1.0, 1.0), (1.0, 5.0), (-0.25, 5.0)
"""B/(KT) and τ/T."""


def filtered() -> list[float]:
    """Least b/(KT) of these walls: the condition of Colgate 1995, searched over the frequencies."""
    return [float(least_damping(wall_transfer(1.0, B, 1.0, lag), 1.0).damping) for B, lag in WALLS]
