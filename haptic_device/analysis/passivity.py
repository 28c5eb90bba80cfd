# SPDX-License-Identifier: Apache-2.0
"""Passivity of a sampled display: the physical damping that any H(z) needs (Colgate & Schenkel 1997).

A device `m ẍ + b ẋ = f_operator − u(t)` whose u is held over each period is passive at the handle if and only if

    b > (T/2) · Re{(1 − e^{−jωT}) H(e^{jωT})} / (1 − cos ωT)   for 0 ≤ ω ≤ π/T                                  (1)

(Colgate, Stanley & Brown 1995), H having all its poles inside the unit circle. The mass stores and never gives
more than it got, so it does not enter. For a wall or coupling (1) has the closed form that control/passivity has; here
any H is searched. Near ω = 0 both parts vanish; with 1 − e^{−jθ} = 2j sin(θ/2) e^{−jθ/2} the
ratio is −(T/2) Im{e^{−jθ/2} H}/sin(θ/2), and its limit at rest is T (H(1)/2 − H′(1)).
"""

from typing import NamedTuple

import numpy as np

from haptic_device.analysis.quantity import Array, Quantity, positive
from haptic_device.analysis.supremum import supremum
from haptic_device.analysis.transfer import AnyTransfer, Response, Transfer, value_at_rest


class LeastDamping(NamedTuple):
    """The physical damping b that must be exceeded [N s/m] and the frequency at which it binds [rad/s]."""

    damping: Quantity
    frequency: Quantity


def damping_demand(transfer: Response, period: float, angle: Array) -> Array:
    """Right-hand side of (1) at the angles θ = ωT in (0, π] [N s/m]."""
    half = 0.5 * angle
    return -0.5 * period * np.imag(np.exp(-1j * half) * transfer(np.exp(1j * angle))) / np.sin(half)


def least_damping(transfer: AnyTransfer, period: float) -> LeastDamping:
    """Least physical damping for passivity by condition (1), necessary and sufficient.

    `transfer` is a Transfer, a pair (numerator, denominator) of coefficients in z from the highest power down, or any
    callable H(z) with real coefficients. A callable may broadcast parameters that carry a trailing axis of length one
    (and `period` likewise); the answer then has one entry for each. Poles on or outside the unit circle make
    coefficients need an infinite b; a callable is taken to be stable. Refuses a period that is not positive.
    """
    positive("period", period, "s")
    transfer = as_transfer(transfer)
    if (unstable := unstable_pole(transfer)) is not None:
        return LeastDamping(np.inf, abs(np.angle(unstable)) / period)
    moving, angle = supremum(lambda angle: damping_demand(transfer, period, angle), sharp_angles(transfer))
    value, slope = value_at_rest(transfer)
    return larger_of_rest(period * (0.5 * value - slope), moving, angle, period)


def as_transfer(transfer: AnyTransfer) -> Response:
    """Coefficients become a Transfer, a callable stays itself."""
    if callable(transfer):
        return transfer
    numerator, denominator = (np.trim_zeros(np.atleast_1d(np.asarray(part, float)), "f") for part in transfer)
    if denominator.size == 0 or not np.all(np.isfinite(np.concatenate([numerator, denominator]))):
        raise ValueError("the coefficients of H(z) must be finite numbers, and its denominator must not be zero")
    return Transfer(numerator if numerator.size else np.zeros(1), denominator)


def unstable_pole(transfer: Response) -> complex | None:
    """A pole on or outside the unit circle, or None; None for a callable too."""
    poles = transfer.poles() if isinstance(transfer, Transfer) else np.zeros(0)
    outside = poles[np.abs(poles) >= 1.0 - 1e-12]
    return outside[0] if outside.size else None


def sharp_angles(transfer: Response) -> Array:
    """Angles near which poles close to the unit circle may raise a narrow peak [rad]."""
    poles = transfer.poles() if isinstance(transfer, Transfer) else np.zeros(0)
    sharp = poles[np.abs(poles) > 0.9]
    return np.unique(np.abs(np.angle(sharp)))


def larger_of_rest(rest: Quantity, moving: Quantity, angle: Quantity, period: Quantity) -> LeastDamping:
    """The supremum over 0 ≤ ω ≤ π/T from its limit at rest and its largest value elsewhere."""
    shape = np.shape(moving)
    rest, period = np.broadcast_to(np.squeeze(rest), shape), np.broadcast_to(np.squeeze(period), shape)
    binds = (rest >= moving) | np.isclose(rest, moving, rtol=1e-12, atol=0.0)
    return LeastDamping(np.maximum(rest, moving)[()], np.where(binds, 0.0, angle / period)[()])
