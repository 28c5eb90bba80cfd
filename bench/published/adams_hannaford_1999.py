# SPDX-License-Identifier: Apache-2.0
"""Llewellyn's criterion for a two-port, applied to display and coupling."""

import numpy as np

from bench.reference.bisection import bisected
from haptic_device.theory.transfer import wall_transfer

DAMPINGS = 0.0, 0.25, 1.0
"""B/(KT)."""
ANGLES = np.linspace(1e-3, np.pi, 4001)
"""ωT of the grid."""
HALVINGS = 40


def coupling() -> list[float]:
    """Least b/(KT) by the criterion on a grid of frequencies, by bisection."""
    return [bisected(lambda b, B=B: _stable(_hybrid(b, B)), 0.0, 10.0, HALVINGS) for B in DAMPINGS]


def _stable(h):
    """Llewellyn: Re h₁₁ ≥ 0, Re h₂₂ ≥ 0, 2 Re h₁₁ Re h₂₂ ≥ |h₁₂ h₂₁| + Re(h₁₂ h₂₁) at every angle."""
    own = h[:, (0, 1), (0, 1)].real
    across = h[:, 0, 1] * h[:, 1, 0]
    return bool(np.all(own >= 0.0) and np.all(2.0 * own.prod(axis=1) >= np.abs(across) + across.real))


def _hybrid(physical_damping, damping):
    """(force 1, −speed 2) of (speed 1, force 2) at the angles, (angles, 2, 2); K = T = 1.

    Port 1 has the force that the hand holds over a period and the handle's mean speed in it; port 2 the coupling's
    force and the speed that the simulation sees, one period later. (force 1, speed 1) is the product of three matrices,
    of the device, the coupling and that period, with (force 2, speed 2).
    """
    z = np.exp(1j * ANGLES)
    give = (z - 1.0) / wall_transfer(1.0, damping, 1.0)(z)
    device = np.array([[1.0, physical_damping], [0.0, 1.0]])
    (a, b), (c, d) = np.moveaxis(device @ _matrices(1.0, 0.0, give, 1.0) @ _matrices(1.0, 0.0, 0.0, z), 0, 2)
    return _matrices(b / d, a - b * c / d, -1.0 / d, c / d)


def _matrices(*entries):
    return np.moveaxis(np.array(np.broadcast_arrays(*entries, ANGLES)[:4], complex), 0, 1).reshape(-1, 2, 2)
