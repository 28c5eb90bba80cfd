# SPDX-License-Identifier: Apache-2.0
"""The paper that this display is built after: eq. 3 by three ways, eq. 5, and damping that is cancelled."""

from adversary.wall_search import Display, search
from bench.reference.boundary import boundary_stiffness
from bench.theory import mu_threshold
from haptic_device.theory.passivity import least_damping
from haptic_device.theory.transfer import wall_transfer
from haptic_device.theory.zwidth import OPERATORS, Setup

DAMPINGS = 0.0, 0.25, 1.0, -0.25, -1.0
"""B/(KT)."""
SEARCHED = 0.0, 0.3, -0.3
"""B/(KT) of the walls that handle paths are searched against."""
TICKS, STARTS, ENOUGH = 40, 8, 1e-3


def wall() -> list[float]:
    """Least b/(KT) of walls of these B/(KT): eq. 1, searched over the frequencies."""
    return [float(least_damping(wall_transfer(1.0, B, 1.0), 1.0).damping) for B in DAMPINGS]


def paths() -> dict[str, float]:
    """Energy [K step²] that a search over handle paths draws from a unilateral wall on both sides of eq. 3.

    Of three walls: the least just below the bound, the most just above it.
    """
    bounds = [(B, 0.5 + abs(B)) for B in SEARCHED]
    below = [search(Display(0.98 * b, damping=B), TICKS, 2 * STARTS, enough=ENOUGH).energy for B, b in bounds]
    above = [search(Display(1.02 * b, damping=B), TICKS, STARTS).energy for B, b in bounds]
    return {"b 2 % below": float(min(below)), "b 2 % above": float(max(above))}


def shaking() -> list[float]:
    """Softest spring that shakes with the worst of twelve operators, over 2b/T of eq. 3."""
    setup = Setup(mass=0.1, physical_damping=0.5, period=1e-3)
    bound = 2.0 * setup.physical_damping / setup.period
    return [boundary_stiffness(setup, OPERATORS["worst"], 0.0, 2.0 * bound) / bound]


def coupling() -> list[float]:
    """Least b/(KT) of couplings of B/(KT) = 0, ¼, 1 by the μ test, eq. 5."""
    return [mu_threshold(B) for B in DAMPINGS[:3]]


def cancelled() -> list[float]:
    """Least b over the damping that is cancelled, K = 0 and B = −b: 1 is borderline."""
    return [float(least_damping(wall_transfer(0.0, -b, 1e-3), 1e-3).damping) / b for b in (0.1, 1.0, 10.0)]
