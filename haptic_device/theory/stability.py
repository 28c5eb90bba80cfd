# SPDX-License-Identifier: Apache-2.0
"""Stability of the display without an operator: exact sampled plant, wall, delay; the stiffnesses that are stable.

The device 1/(s(ms + b)) under a zero-order hold has the sampled position (a = b/m, φ = (1 − e^{−aT})/a)

    x(z)/f(z) = [β (z − e^{−aT}) + φ²/m] / ((z − 1)(z − e^{−aT})),   β = (T − φ)/b,

and the loop with u = H(z) z^{−N} x the characteristic polynomial p(z) + K q(z), for H is linear in K. Stability is
lost or won only where a root crosses the unit circle: where −p/q is real there. Those stiffnesses are the roots of a
polynomial in cos ωT; between two of them nothing changes, and one look at the roots decides. So the answer is complete
even where stability is lost and comes back (delays with much damping). Stability is not passivity: an operator may
destabilize what is stable alone.
"""

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from haptic_device.theory.delay import split_delay
from haptic_device.theory.quantity import Array, Quantity, finite, not_negative, over_grids, positive
from haptic_device.theory.transfer import Transfer, wall_transfer


def held_plant(mass: float, physical_damping: float, period: float, fraction: float = 0.0) -> Transfer:
    """Sampled position over held force of the device 1/(s(ms + b)), x(z)/f(z) [m/N], exact; as a Transfer.

    Raises ValueError for a value out of range.

    Args:
        mass: m > 0 [kg].
        physical_damping: b ≥ 0 [N s/m].
        period: T > 0 [s].
        fraction: part s of a period, 0 ≤ s < 1, after which the force changes.

    Examples:
        >>> from haptic_device.theory.stability import held_plant
        >>> plant = held_plant(0.1, 0.0, 0.001)  # without damping T²/(2m) (z + 1)/(z - 1)²
        >>> print(plant.numerator, plant.denominator)
        [5.e-06 5.e-06] [ 1. -2.  1.]
    """
    positive("mass", mass, "kg")
    not_negative("physical_damping", physical_damping, "N s/m")
    positive("period", period, "s")
    early, late = fraction * period, (1.0 - fraction) * period
    decay = np.exp(-physical_damping * period / mass)
    old_position, old_velocity = _response(mass, physical_damping, early)
    glide = _glide(mass, physical_damping, late)
    old_position = old_position + glide * old_velocity
    old_velocity = old_velocity * np.exp(-physical_damping * late / mass)
    new_position, new_velocity = _response(mass, physical_damping, late)
    whole_glide = _glide(mass, physical_damping, period)
    new = [new_position, whole_glide * new_velocity - decay * new_position]
    old = [old_position, whole_glide * old_velocity - decay * old_position]
    denominator = np.polymul([1.0, -1.0], [1.0, -decay])
    if fraction == 0.0:
        return Transfer(np.array(new), denominator)
    return Transfer(np.polyadd(np.append(new, 0.0), old), np.append(denominator, 0.0))


def characteristic(
    mass: float,
    physical_damping: float,
    damping: float,
    period: float,
    delay_samples: float = 0.0,
    velocity_lag: float = 0.0,
) -> tuple[npt.NDArray[np.floating], npt.NDArray[np.floating]]:
    """Polynomials (p, q) in z, from the highest power down: the loop's poles are the roots of p + K q."""
    whole, fraction = split_delay(delay_samples)
    plant = held_plant(mass, physical_damping, period, fraction)
    viscous = wall_transfer(0.0, damping, period, velocity_lag)
    free = np.polymul(np.append(plant.denominator, np.zeros(whole)), viscous.denominator)
    return (
        np.polyadd(free, np.polymul(plant.numerator, viscous.numerator)),
        np.polymul(plant.numerator, viscous.denominator),
    )


def spectral_radius(
    stiffness: Quantity,
    damping: Quantity,
    mass: float,
    physical_damping: float,
    period: float,
    delay_samples: float = 0.0,
    velocity_lag: float = 0.0,
) -> Quantity:
    """Largest magnitude of the loop's poles without an operator: below 1 the display is stable by itself.

    At K = 0 the position is free and gives a pole at exactly 1, which is left out. A stable display need not be
    passive: an operator can make it unstable. Raises ValueError for a value out of range.

    Args:
        stiffness: K of the wall [N/m]; broadcasts.
        damping: B of the wall [N s/m]; broadcasts.
        mass: m [kg].
        physical_damping: b [N s/m].
        period: T [s].
        delay_samples: the delay in periods.
        velocity_lag: τ [s].

    Examples:
        >>> from haptic_device.theory.stability import spectral_radius
        >>> print(spectral_radius([1000.0, 4000.0], 0.0, 0.1, 1.0, 0.001).round(4))  # stable, and not
        [0.9975 1.0049]
    """
    finite("stiffness", stiffness, "N/m")

    def radius(stiffness: float, damping: float) -> float:
        fixed, scaled = characteristic(mass, physical_damping, damping, period, delay_samples, velocity_lag)
        if stiffness == 0.0:
            return _radius(np.polydiv(fixed, [1.0, -1.0])[0])
        return _radius(np.polyadd(fixed, stiffness * scaled))

    return np.vectorize(radius, otypes=[float])(stiffness, damping)[()]


def stable_ranges(
    mass: float,
    physical_damping: float,
    damping: float,
    period: float,
    delay_samples: float = 0.0,
    velocity_lag: float = 0.0,
) -> list[tuple[float, float]]:
    """Intervals (low, high) of stiffness K > 0 [N/m] in which the loop is stable without an operator, in rising order.

    Raises ValueError for a value out of range.

    Args:
        mass: m > 0 of the device [kg].
        physical_damping: b of the device [N s/m].
        damping: B of the wall [N s/m].
        period: T [s].
        delay_samples: the delay in periods.
        velocity_lag: τ of the filter on the velocity [s].

    Examples:
        >>> from haptic_device.theory.stability import stable_ranges
        >>> [(low, round(high, 3)) for low, high in stable_ranges(0.1, 1.0, 0.0, 0.001)]
        [(0.0, 2003.339)]
    """
    finite("damping", damping, "N s/m")
    fixed, scaled = characteristic(mass, physical_damping, damping, period, delay_samples, velocity_lag)
    edges = np.concatenate([[0.0], _crossings(fixed, scaled), [np.inf]])
    ranges: list[tuple[float, float]] = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        middle = 0.5 * (low + high) if np.isfinite(high) else 2.0 * low + 1.0
        if _radius(np.polyadd(fixed, middle * scaled)) >= 1.0:
            continue
        if ranges and ranges[-1][1] == low:
            low = ranges.pop()[0]
        ranges.append((float(low), float(high)))
    return ranges


@over_grids
def largest_stable_stiffness(
    mass: float,
    physical_damping: float,
    damping: float,
    period: float,
    delay_samples: float = 0.0,
    velocity_lag: float = 0.0,
) -> float:
    """Stiffness K [N/m] at which stability is lost first when K rises from 0; 0 if there is none near K = 0.

    The arguments broadcast. The loop can be stable again at a larger K; see `stable_ranges`. With B = 0 and a small
    bT/m it is near 2b/T, the passive limit. Raises ValueError for a value out of range.

    Args:
        mass: m > 0 of the device [kg].
        physical_damping: b of the device [N s/m].
        damping: B of the wall [N s/m].
        period: T [s].
        delay_samples: the delay in periods.
        velocity_lag: τ of the filter on the velocity [s].

    Examples:
        >>> from haptic_device.theory.stability import largest_stable_stiffness
        >>> print(round(largest_stable_stiffness(0.1, 1.0, 0.0, 0.001), 3))
        2003.339
    """
    ranges = stable_ranges(mass, physical_damping, damping, period, delay_samples, velocity_lag)
    return ranges[0][1] if ranges and ranges[0][0] == 0.0 else 0.0


def _glide(mass: float, physical_damping: float, time: float) -> float:
    """Distance covered in `time` per unit of initial velocity [s]."""
    decay = physical_damping * time / mass
    return time if decay == 0.0 else time * (-np.expm1(-decay) / decay)  # the least of numbers has few digits


def _response(mass: float, physical_damping: float, time: float) -> tuple[float, float]:
    """Position and velocity after `time` of unit force from rest; a series where (T − φ)/b would cancel."""
    decay = physical_damping * time / mass
    if decay < 1e-2:
        shape = 1 / 2 - decay / 6 + decay**2 / 24 - decay**3 / 120 + decay**4 / 720 - decay**5 / 5040
    else:
        shape = (decay + np.expm1(-decay)) / decay**2
    return shape * time**2 / mass, _glide(mass, physical_damping, time) / mass


def _crossings(fixed: npt.NDArray[np.floating], scaled: npt.NDArray[np.floating]) -> Array:
    """Positive K for which p + K q has a root on the unit circle, rising.

    Im{p q̄} on the circle is sin θ times a polynomial in cos θ: Σ a_k sin kθ = sin θ Σ a_k U_{k−1}(cos θ).
    """
    count = fixed.size
    scaled = np.concatenate([np.zeros(count - scaled.size), scaled])
    product = np.correlate(fixed, scaled, "full")
    sines = product[: count - 1][::-1] - product[count:]
    cosines = chebyshev.chebroots(chebyshev.chebtrim(_second_kind(sines), 1e-18 * np.max(np.abs(sines))))
    inside = cosines[(np.abs(cosines.imag) < 1e-6) & (np.abs(cosines.real) < 1.0)].real
    circle = np.append(np.exp(1j * np.arccos(inside)), -1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = -np.real(np.polyval(fixed, circle) / np.polyval(scaled, circle))
    gains = np.sort(gains[np.isfinite(gains) & (gains > 0.0)])
    return gains[np.diff(gains, prepend=0.0) > 1e-9 * gains]


def _second_kind(weights: Array) -> Array:
    """Chebyshev series of Σ w_k U_k: U_k is twice the sum of the T_j of its parity, T_0 counted once."""
    series = np.array([2.0 * weights[index::2].sum() for index in range(weights.size)])
    series[0] /= 2.0
    return series


def _radius(polynomial: npt.NDArray[np.floating]) -> float:
    return np.max(np.abs(np.roots(polynomial)), initial=0.0)
