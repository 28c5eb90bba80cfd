# SPDX-License-Identifier: Apache-2.0
"""Transfer functions in z with real coefficients: what the sampled side of the display does, u(z) = H(z) x(z)."""

from collections.abc import Callable
from typing import NamedTuple, cast, overload

import numpy as np
import numpy.typing as npt

from haptic_device.theory.quantity import Array, Complexes, Quantity, finite, not_negative, positive


class Transfer(NamedTuple):
    """A transfer function H(z): a ratio of two polynomials in z with real coefficients. Call it with complex z.

    Attributes:
        numerator: coefficients from the highest power of z down, (n).
        denominator: coefficients of the denominator in the same order, (d).

    Examples:
        >>> from haptic_device.theory.transfer import Transfer
        >>> lag = Transfer([0.5, 0.0], [1.0, -0.5])  # y(k) = 0.5 y(k-1) + 0.5 x(k)
        >>> print(lag(1.0))  # a constant passes unchanged
        1.0
        >>> print(lag.poles())
        [0.5]
    """

    numerator: Array
    denominator: Array

    def __call__(self, z: Complexes) -> Complexes:
        return cast(Complexes, np.polyval(self.numerator, z) / np.polyval(self.denominator, z))

    def poles(self) -> npt.NDArray[np.inexact]:
        """All poles, also those at the origin."""
        return np.roots(self.denominator)


Response = Transfer | Callable[[Complexes], Complexes]
"""H(z) with real coefficients, as a function of complex z of any shape."""
AnyTransfer = Response | tuple[npt.ArrayLike, npt.ArrayLike]
"""A Response, or a pair (numerator, denominator) of coefficients in z from the highest power down."""


def wall_transfer(
    stiffness: Quantity, damping: Quantity, period: Quantity, velocity_lag: Quantity = 0.0, delay_samples: float = 0
) -> Transfer:
    """Transfer function H(z) [N/m] of a spring and damper on a sampled position; its force acts against the motion.

    H(z) = K + B (z−1)/(T z) (Colgate, Stanley & Brown 1995, eq. 2). With a lag τ of the velocity the damper is
    B α (z−1)/(T (z−1+α)) with α = T/(T+τ), by backward Euler. Raises ValueError for a value out of range.

    Args:
        stiffness: K [N/m].
        damping: B [N s/m].
        period: T > 0 [s].
        velocity_lag: time constant τ ≥ 0 of a first-order lag on the velocity [s].
        delay_samples: delay of the force, a whole number N of periods; a factor z^−N.

    Examples:
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> wall = wall_transfer(1000.0, 1.0, 0.001)
        >>> print(wall.numerator, wall.denominator)  # ((K + B/T) z - B/T) / z
        [ 2000. -1000.] [1. 0.]
        >>> print(wall(1.0))  # at rest only the spring acts: K
        1000.0
    """
    finite("stiffness", stiffness, "N/m")
    finite("damping", damping, "N s/m")
    positive("period", period, "s")
    not_negative("velocity_lag", velocity_lag, "s")
    share = period / (period + velocity_lag)
    viscous = damping * share / period
    numerator = np.array([stiffness + viscous, -stiffness * (1.0 - share) - viscous])
    return delayed(Transfer(numerator, np.array([1.0, share - 1.0])), delay_samples)


@overload
def delayed(transfer: Transfer, samples: float) -> Transfer: ...
@overload
def delayed(transfer: Response, samples: float) -> Response: ...
def delayed(transfer: Response, samples: float) -> Response:
    """H(z) z^−N: a transfer function, or any other callable, delayed by a whole number of samples.

    Raises ValueError if `samples` is not a whole number, at least 0.

    Args:
        transfer: H(z).
        samples: N.

    Examples:
        >>> from haptic_device.theory.transfer import delayed, wall_transfer
        >>> late = delayed(wall_transfer(1000.0, 0.0, 0.001), 1)
        >>> print(late(-1.0))  # at z = -1 one sample of delay changes the sign
        -1000.0
    """
    if samples != int(samples) or samples < 0:
        raise ValueError(f"delay_samples is {samples:g}, but it must be a whole number of samples, at least 0")
    if not isinstance(transfer, Transfer):
        return lambda z: transfer(z) * z ** -int(samples)
    return Transfer(transfer.numerator, np.concatenate([transfer.denominator, np.zeros(int(samples))]))


def value_at_rest(transfer: Response) -> tuple[Array, Array]:
    """H(1) and its slope dH/dz there.

    The slope is the imaginary part of H(1 + jε)/ε, which has no cancellation error because H has real coefficients.
    """
    step = 1e-20
    value = np.asarray(transfer(np.array([1.0 + 1j * step])))
    return value.real, value.imag / step
