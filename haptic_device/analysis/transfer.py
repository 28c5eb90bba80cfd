# SPDX-License-Identifier: Apache-2.0
"""Transfer functions in z with real coefficients: what the sampled side of the display does, u(z) = H(z) x(z)."""

from collections.abc import Callable
from typing import NamedTuple, cast, overload

import numpy as np
import numpy.typing as npt

from haptic_device.analysis.quantity import Array, Complexes, Quantity, finite, not_negative, positive


class Transfer(NamedTuple):
    """A ratio of two polynomials in z, coefficients from the highest power down; call it with complex z."""

    numerator: Array
    denominator: Array

    def __call__(self, z: Complexes) -> Complexes:
        return cast(Complexes, np.polyval(self.numerator, z) / np.polyval(self.denominator, z))

    def poles(self) -> npt.NDArray[np.inexact]:
        """Poles, those at the origin included."""
        return np.roots(self.denominator)


Response = Transfer | Callable[[Complexes], Complexes]
"""H(z) with real coefficients, as a function of complex z of any shape."""
AnyTransfer = Response | tuple[npt.ArrayLike, npt.ArrayLike]
"""A Response, or a pair (numerator, denominator) of coefficients in z from the highest power down."""


def wall_transfer(
    stiffness: Quantity, damping: Quantity, period: Quantity, velocity_lag: Quantity = 0.0, delay_samples: float = 0
) -> Transfer:
    """Spring and damper on a sampled position, force on the device against the motion [N per m].

    H(z) = K + B (z−1)/(T z) (Colgate, Stanley & Brown 1995, eq. 2). With velocity_lag τ > 0 [s] the velocity passes a
    first-order lag, discretized by backward Euler: α (z−1)/(T (z−1+α)), α = T/(T+τ); τ = 0 is eq. 2 again.
    delay_samples whole samples of delay multiply by z^−N. K [N/m], B [N s/m], T [s].
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
    """The transfer function a whole number of samples late: H(z) z^−N; any callable will do."""
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
