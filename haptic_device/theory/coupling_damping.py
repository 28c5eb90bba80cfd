# SPDX-License-Identifier: Apache-2.0
"""Physical damping for a coupling between any operator and any passive simulation: eq. 5 in closed form.

In 1 + |det M|² − F of the μ test (`haptic_device.theory.mu`) every term with D drops out, which leaves

    (4/b₀) [Re{Ī/H} + (Re{Ī r} − |I r|)/(2b)] / |D|² > 0:

b₀ is irrelevant and b stands alone. For the synchronous simulation, N samples of delay in the display's loop, θ = ωT,

    b > (T/2) (1 − cos (N+1)θ) / Re{(1 − e^{−jθ})/H},   the denominator being positive.

It is the least dissipation of display and coupling together, minimal over the handle's paths, so a fractional delay
only interpolates the cosine: (1 − s) cos (N+1)θ + s cos (N+2)θ. For the wall of eq. 2 and N = 0 it reads
(T/2) |H|²/(K + 2B/T), whose supremum is KT/2 + B for B ≥ 0 and (KT/2)²/(KT/2 + B) for −KT/2 < B < 0. With delay a
spring needs (N + 1)² KT/2 here, where a wall needs (N + ½) KT. The driver asks no more of a coupling than of a wall
(control/passivity.least_damping), since it pays for what the tool moves (control/account).
"""

import numpy as np

from haptic_device.theory.delay import split_delay
from haptic_device.theory.passivity import LeastDamping, as_transfer, larger_of_rest, sharp_angles
from haptic_device.theory.quantity import Array, Complexes, Quantity, positive
from haptic_device.theory.supremum import supremum
from haptic_device.theory.transfer import AnyTransfer, Response, value_at_rest

POLE = 1e12
"""A demand this many times T|H| is a pole of the closed form that rounding has made finite."""


def least_damping_for_any_simulation(transfer: AnyTransfer, period: float, delay_samples: float = 0.0) -> LeastDamping:
    """Least physical damping with any operator and any passive simulation behind the coupling, as a LeastDamping.

    Eq. 5 of Colgate, Stanley & Brown 1995 in closed form; see this module. Raises ValueError if the period is not above
    0, or the delay is below 0.

    Args:
        transfer: H(z), as in `least_damping`.
        period: T [s].
        delay_samples: delay in the display's own loop, in periods, any number ≥ 0.

    Examples:
        >>> from haptic_device.theory.coupling_damping import least_damping_for_any_simulation
        >>> from haptic_device.theory.transfer import wall_transfer
        >>> spring = wall_transfer(1000.0, 0.0, 0.001)
        >>> print(round(least_damping_for_any_simulation(spring, 0.001, 1.0).damping, 9))  # 2² KT/2
        2.0
    """
    positive("period", period, "s")
    transfer = as_transfer(transfer)
    moving, angle = supremum(lambda angle: _demand(angle, transfer, period, delay_samples), sharp_angles(transfer))
    return larger_of_rest(_demand_at_rest(transfer, period, delay_samples), moving, angle, period)


def supply(response: Complexes, angle: Array) -> Array:
    """|H|² Re{Ī/H} |z − 1|²/T over 1 − cos θ: what the coupling itself takes from an exchange [N/m].

    response: H at the angles θ [rad], both (angles). At rest it is H(1) + 2 dH/dz.
    """
    return np.imag(np.exp(0.5j * angle) * response) / np.sin(0.5 * angle)


def leak(angle: Array, delay_samples: float) -> Array:
    """(1 − cos (N+1)θ)/(1 − cos θ): what the held force may give away; a fraction of a delay is interpolated."""
    whole, fraction = split_delay(delay_samples)

    def ratio(lead: float) -> Array:
        return (np.sin(0.5 * lead * angle) / np.sin(0.5 * angle)) ** 2

    return (1.0 - fraction) * ratio(whole + 1.0) + fraction * ratio(whole + 2.0)


def _leak_at_rest(delay_samples: float) -> float:
    whole, fraction = split_delay(delay_samples)
    return (1.0 - fraction) * (whole + 1.0) ** 2 + fraction * (whole + 2.0) ** 2


def _demand(angle: Array, transfer: Response, period: float, delay_samples: float) -> Array:
    response = transfer(np.exp(1j * angle))
    given = 0.5 * period * leak(angle, delay_samples) * np.abs(response) ** 2
    demand = _ratio(given, supply(response, angle))
    return np.where(demand > POLE * period * np.abs(response), np.inf, demand)


def _demand_at_rest(transfer: Response, period: float, delay_samples: float) -> Quantity:
    value, slope = value_at_rest(transfer)
    given = 0.5 * period * _leak_at_rest(delay_samples) * value**2
    return _ratio(given, value + 2.0 * slope)


def _ratio(given: Quantity, kept: Quantity) -> Array:
    """given/kept; infinite where nothing is kept, unless nothing is given either."""
    with np.errstate(divide="ignore", invalid="ignore"):
        idle = (given == 0.0) & (kept == 0.0)
        return np.where(idle, 0.0, np.where(kept > 0.0, given / kept, np.inf))
