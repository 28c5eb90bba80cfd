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

from haptic_device.theory.quantity import Array, Quantity, positive
from haptic_device.theory.supremum import supremum
from haptic_device.theory.transfer import AnyTransfer, Response, Transfer, value_at_rest


class LeastDamping(NamedTuple):
    """Result of a passivity condition.

    Attributes:
        damping: physical damping b that must be exceeded [N s/m]; infinite if none is enough.
        frequency: angular frequency at which the most damping is needed [rad/s].

    Examples:
        >>> from haptic_device.theory.passivity import least_damping
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> need = least_damping(wall_transfer(1000.0, 0.1, 0.001), 0.001)
        >>> print(f"b > {need.damping:.3f} N s/m, at {need.frequency * 0.001:.3f} rad a sample")
        b > 0.600 N s/m, at 3.142 rad a sample
    """

    damping: Quantity
    frequency: Quantity


def damping_demand(transfer: Response, period: float, angle: Array) -> Array:
    """Right-hand side of condition (1) of this module [N s/m], at the angles θ = ωT in (0, π].

    Args:
        transfer: H(z) as a callable.
        period: T [s].
        angle: θ [rad], (angles).

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.passivity import damping_demand
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> spring = wall_transfer(1000.0, 0.0, 0.001)
        >>> print(damping_demand(spring, 0.001, np.array([0.5, 1.0, 2.0])).round(9))  # KT/2 at all frequencies
        [0.5 0.5 0.5]
    """
    half = 0.5 * angle
    return -0.5 * period * np.imag(np.exp(-1j * half) * transfer(np.exp(1j * angle))) / np.sin(half)


def least_damping(transfer: AnyTransfer, period: float) -> LeastDamping:
    """Least physical damping for passivity with any H(z), as a LeastDamping.

    The condition is necessary and sufficient (Colgate, Stanley & Brown 1995, eq. 1; Colgate & Schenkel 1997). A
    callable can broadcast parameters with a last axis of length one, and so can the period. The result then has one
    entry for each. With a pole on or outside the unit circle no damping is enough. A callable must be stable; this is
    not checked. Raises ValueError if the period is not above 0.

    Args:
        transfer: a Transfer, a pair (numerator, denominator) of coefficients from the highest power of z down, or a
            callable H(z) with real coefficients.
        period: T [s].

    Examples:
        >>> from haptic_device.theory.passivity import least_damping
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> need = least_damping(wall_transfer(1000.0, 0.1, 0.001), 0.001)
        >>> print(round(need.damping, 9))  # KT/2 + B
        0.6
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
