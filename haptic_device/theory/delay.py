# SPDX-License-Identifier: Apache-2.0
"""Passivity when the held force is switched a fraction of a period after the sample it answers.

Let the sample be taken at kT and its force held over [kT + s T, (k+1)T + s T), 0 ≤ s < 1. Between two instants the
damper takes least from a given displacement Δx when the speed is constant: b Δx²/Δt. What the display gives at most
is therefore a quadratic form in the positions x at the samples and y at the switchings,

    Σ b (y_k − x_k)²/(sT) + b (x_{k+1} − y_k)²/((1−s)T) + u_k (y_{k+1} − y_k)  ≥ 0,

and the display is passive iff its 2 × 2 Hermitian symbol is positive semidefinite at every frequency. The determinant
is quadratic in b and gives, with θ = ωT and P̄ = 1 − s + s e^{−jθ} (the linear interpolation of a delay),

    b ≥ ½ [R + √(R² + s(1−s) T² |H|²)],   R = right-hand side of (1) for P̄ H.

At s = 0 this is (1). For a spring alone it is largest at rest: b ≥ (KT/2) [½ + s + √(¼ + 2s)], more than K(T/2 + sT).
control/passivity.least_damping has that form for the spring and a bound for the damper; this one is exact for any H.
"""

import functools

import numpy as np
from scipy.optimize import brentq

from haptic_device.theory.passivity import (
    LeastDamping,
    as_transfer,
    damping_demand,
    larger_of_rest,
    sharp_angles,
    unstable_pole,
)
from haptic_device.theory.quantity import Array, Complexes, Quantity, not_negative, over_grids, positive
from haptic_device.theory.supremum import supremum
from haptic_device.theory.transfer import AnyTransfer, Response, delayed, value_at_rest, wall_transfer


def split_delay(delay_samples: float) -> tuple[int, float]:
    """A delay in periods as whole samples and the fraction left over."""
    not_negative("delay_samples", delay_samples, "samples")
    whole = int(np.floor(delay_samples))
    return whole, float(delay_samples - whole)


def delayed_demand(transfer: Response, period: float, fraction: float, angle: Array) -> Array:
    """Damping needed at the angles θ = ωT when the force is switched `fraction` of a period late [N s/m]."""
    late = damping_demand(lambda z: (1.0 - fraction + fraction / z) * transfer(z), period, angle)
    if fraction == 0.0:
        return late
    return _larger_root(late, _squared_gain(transfer(np.exp(1j * angle)), period, fraction))


def least_damping_delayed(transfer: AnyTransfer, period: float, delay_samples: float) -> LeastDamping:
    """Least physical damping with any H(z) and a loop delay, as a LeastDamping.

    The condition is exact, as in `least_damping`. Raises ValueError if the period is not above 0, or the delay is below
    0.

    Args:
        transfer: H(z), as in `least_damping`.
        period: T [s].
        delay_samples: the delay in periods, any number ≥ 0.

    Examples:
        >>> from haptic_device.theory.delay import least_damping_delayed
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> spring = wall_transfer(1000.0, 0.0, 0.001)
        >>> print(round(least_damping_delayed(spring, 0.001, 1.0).damping, 9))  # KT (1/2 + 1)
        1.5
        >>> print(round(least_damping_delayed(spring, 0.001, 0.5).damping, 9))  # KT/2 (1 + sqrt(5/4))
        1.059016994
    """
    positive("period", period, "s")
    whole, fraction = split_delay(delay_samples)
    transfer = delayed(as_transfer(transfer), whole)
    if (unstable := unstable_pole(transfer)) is not None:
        return LeastDamping(np.inf, abs(np.angle(unstable)) / period)
    moving, angle = supremum(lambda angle: delayed_demand(transfer, period, fraction, angle), sharp_angles(transfer))
    return larger_of_rest(_demand_at_rest(transfer, period, fraction), moving, angle, period)


def wall_damping_needed(
    stiffness: Quantity,
    damping: Quantity,
    period: Quantity,
    velocity_lag: Quantity = 0.0,
    delay_samples: Quantity = 0.0,
) -> LeastDamping:
    """Least physical damping of a wall with a lagging velocity and a delay, as a LeastDamping. All arguments broadcast.

    The condition is exact, as in `least_damping_delayed`. Raises ValueError for a value out of range.

    Args:
        stiffness: K [N/m].
        damping: B [N s/m].
        period: T [s].
        velocity_lag: τ [s].
        delay_samples: the delay in periods, any number ≥ 0.

    Examples:
        >>> from haptic_device.theory.delay import wall_damping_needed
        >>> needed = wall_damping_needed([500.0, 1000.0], 0.1, 0.001).damping
        >>> print(needed.round(9))  # KT/2 + B
        [0.35 0.6 ]
    """
    found = _wall_damping_needed(stiffness, damping, period, velocity_lag, delay_samples)
    return LeastDamping(*(one[()] for one in found))


@functools.partial(np.vectorize, otypes=[float, float])
def _wall_damping_needed(
    stiffness: float, damping: float, period: float, velocity_lag: float, delay_samples: float
) -> LeastDamping:
    return least_damping_delayed(wall_transfer(stiffness, damping, period, velocity_lag), period, delay_samples)


@over_grids
def largest_passive_stiffness(
    physical_damping: float, damping: float, period: float, velocity_lag: float = 0.0, delay_samples: float = 0.0
) -> float:
    """Largest passive stiffness K [N/m] of a wall; 0 if there is none. All arguments broadcast.

    The needed damping is a supremum of functions that are linear in K, so it is convex in K. It is at least KT/2, the
    mean of (1) over θ for every delay and lag. So the passive stiffnesses form one interval, which ends at 2b/T or
    below. Raises ValueError for a value out of range.

    Args:
        physical_damping: b > 0 of the device [N s/m].
        damping: B of the wall [N s/m].
        period: T [s].
        velocity_lag: τ [s].
        delay_samples: the delay in periods, any number ≥ 0.

    Examples:
        >>> from haptic_device.theory.delay import largest_passive_stiffness
        >>> print(round(largest_passive_stiffness(1.0, 0.1, 0.001), 6))  # 2 (b - B)/T
        1800.0
        >>> print(largest_passive_stiffness([0.5, 1.0], 0.0, 0.001).round(6))
        [1000. 2000.]
    """
    positive("physical_damping", physical_damping, "N s/m")

    def lacking(stiffness: float) -> float:
        needed = wall_damping_needed(stiffness, damping, period, velocity_lag, delay_samples).damping
        return float(needed) - physical_damping

    high = 2.0 * physical_damping / period
    if lacking(0.0) >= 0.0:
        return 0.0
    return high if lacking(high) <= 0.0 else brentq(lacking, 0.0, high, xtol=1e-13 * high)


def _larger_root(demand: Quantity, gain: Quantity) -> Array:
    return 0.5 * (demand + np.sqrt(demand**2 + gain))


def _squared_gain(response: Quantity | Complexes, period: float, fraction: float) -> Array:
    return fraction * (1.0 - fraction) * (period * np.abs(response)) ** 2


def _demand_at_rest(transfer: Response, period: float, fraction: float) -> Quantity:
    value, slope = value_at_rest(transfer)
    late = period * ((0.5 + fraction) * value - slope)
    return _larger_root(late, _squared_gain(value, period, fraction)) if fraction else late
