# SPDX-License-Identifier: Apache-2.0
"""The μ test of Colgate, Stanley & Brown 1995, eqs. 4–5: a coupling between any operator and any passive simulation.

Two unknown blocks of gain at most 1: the operator with the display, w = (z−1)x₁/T = −(1 + Δ₁)/(2b) · u, and the
passive environment, u − b₀v₂ = Δ₂ (u + b₀v₂) for any b₀ > 0. With the display's sampled position per speed
r = T z^{−N}/(z−1), that of an environment in step I = Tz/(z−1), and D = 1/H + r/(2b) + I/b₀,

    M = (1/D) [[−r/(2b), I/b₀], [−r/b, 2I/b₀ − D]],   passive ⇔ D has a stable inverse and μ(M) < 1 for 0 < ω ≤ π/T.

For two complex scalars μ² = (F + √(F² − 4|det M|²))/2, F = |m₁₁|² + |m₂₂|² + 2|m₁₂ m₂₁|, so μ < 1 ⇔ F < 1 + |det M|²
with |det M| < 1. μ → 1 at rest for every gain; the margin (1 + |det M|² − F)/(1 − cos ωT) stays finite there.
"""

import numpy as np

from haptic_device.theory.coupling_damping import leak, supply
from haptic_device.theory.delay import split_delay
from haptic_device.theory.passivity import as_transfer, sharp_angles
from haptic_device.theory.quantity import Array, Complexes, Quantity, positive
from haptic_device.theory.supremum import supremum
from haptic_device.theory.transfer import AnyTransfer, Response, Transfer


def mu_margin(transfer: AnyTransfer, period: float, physical_damping: float, delay_samples: float = 0.0) -> Quantity:
    """Smallest margin of the μ test over all frequencies, without a unit; the display is passive if it is above 0.

    The μ test of Colgate, Stanley & Brown 1995, eqs. 4–5, with b₀ = b; see this module. −inf means that D is not
    stable. A callable can broadcast parameters, and so can T and b, each with a last axis of length one. Raises
    ValueError if T or b is not above 0.

    Args:
        transfer: as in `least_damping`; a callable must give a stable D, which is not checked.
        period: T [s].
        physical_damping: b [N s/m].
        delay_samples: delay in the display's own loop, in periods.

    Examples:
        >>> from haptic_device.theory.mu import mu_margin
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> spring = wall_transfer(1000.0, 0.0, 0.001)  # needs b > KT/2 = 0.5 N s/m
        >>> [bool(mu_margin(spring, 0.001, b) > 0.0) for b in (0.49, 0.51)]
        [False, True]
    """
    positive("period", period, "s")
    positive("physical_damping", physical_damping, "N s/m")
    transfer = as_transfer(transfer)
    if isinstance(transfer, Transfer) and not _nominally_stable(transfer, period, physical_damping, delay_samples):
        return -np.inf
    lowest, _ = supremum(
        lambda angle: -margin_at(transfer, period, physical_damping, angle, delay_samples), sharp_angles(transfer)
    )
    return -lowest


def margin_at(
    transfer: Response, period: float, physical_damping: float, angle: Array, delay_samples: float = 0.0
) -> Array:
    """The margin with b₀ = b at the angles θ, the poles of D cleared so that nothing cancels near rest.

    For a fractional delay its sign is exact, and D has the delay interpolated.
    """
    z = np.exp(1j * angle)
    response = transfer(z)
    integrators = 0.5 * _late(angle, delay_samples) + z
    loop = physical_damping * 2j * np.sin(0.5 * angle) * np.exp(0.5j * angle) + response * period * integrators
    kept = period * physical_damping * supply(response, angle)
    given = 0.5 * period**2 * np.abs(response) ** 2 * leak(angle, delay_samples)
    return 4.0 * (kept - given) / np.abs(loop) ** 2


def _late(angle: Array, delay_samples: float) -> Complexes:
    whole, fraction = split_delay(delay_samples)
    return np.exp(-1j * whole * angle) * (1.0 - fraction + fraction * np.exp(-1j * angle))


def _nominally_stable(transfer: Transfer, period: float, physical_damping: float, delay_samples: float) -> bool:
    """Whether D, with both unknown blocks at 0 and b₀ = b, has all its zeros inside the unit circle."""
    whole, fraction = split_delay(delay_samples)
    shift = np.append(1.0, np.zeros(whole + 1))
    display = 0.5 * np.array([1.0 - fraction, fraction])
    ports = np.polyadd(display, np.append(shift, 0.0))
    free = physical_damping * np.polymul(np.polymul(shift, [1.0, -1.0]), transfer.denominator)
    roots = np.roots(np.polyadd(free, period * np.polymul(ports, transfer.numerator)))
    if np.polyval(transfer.numerator, 1.0) == 0.0:  # without a spring the positions drift apart freely
        roots = np.delete(roots, np.argmin(np.abs(roots - 1.0)))
    return np.max(np.abs(roots), initial=0.0) < 1.0
