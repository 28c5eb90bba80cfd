# SPDX-License-Identifier: Apache-2.0
"""Llewellyn's criterion for a two-port, applied to display and coupling, beside our bound for any simulation."""

import numpy as np

from haptic_device.analysis.coupling_damping import least_damping_for_any_simulation
from haptic_device.analysis.transfer import wall_transfer

DAMPINGS = -0.25, 0.0, 0.25, 1.0
"""B/(KT)."""
ANGLES = np.linspace(1e-4, np.pi, 4001)
"""ωT of the grid."""


def coupling() -> list[float]:
    """Least damping by Llewellyn's criterion on a grid of frequencies, over ours."""
    return [_by_llewellyn(B) / _ours(B) for B in DAMPINGS]


def _by_llewellyn(damping):
    """The criterion 2 Re h₁₁ Re h₂₂ ≥ |h₁₂ h₂₁| + Re(h₁₂ h₂₁), solved for h₁₁ = b; K = T = 1.

    Port 1 has the force that the hand holds over a period and the handle's mean speed in it; port 2 the coupling's
    force and the speed that the simulation sees, one period later: h₁₂ = 1, h₂₁ = −1/z, h₂₂ = 1/Z, Z = H z/(z − 1).
    """
    z = np.exp(1j * ANGLES)
    impedance = wall_transfer(1.0, damping, 1.0)(z) * z / (z - 1.0)
    transmitted = -1.0 / z
    return float(np.max((np.abs(transmitted) + transmitted.real) / (2.0 * (1.0 / impedance).real)))


def _ours(damping):
    return float(least_damping_for_any_simulation(wall_transfer(1.0, damping, 1.0), 1.0).damping)
