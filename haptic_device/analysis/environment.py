# SPDX-License-Identifier: Apache-2.0
"""Kinds of passive simulation behind a coupling, and what the sampled exchange with each keeps and gives away.

A simulation integrates speed into position by I = T i(z)/(z − 1). In the μ test of Colgate, Stanley & Brown 1995 the
display's sampled position per speed is r = T z^{−N}/(z − 1), N samples late; only Re{Ī/H} and |I r| − Re{Ī r} decide.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from haptic_device.analysis.delay import split_delay


class Environment(NamedTuple):
    """How a simulation turns speed into position: coefficients of i(z), and i(e^{jθ}) = gain(θ) e^{j lead θ}."""

    integrator: np.ndarray
    lead: float
    gain: Callable


ENVIRONMENTS = {
    "synchronous": Environment(np.array([1.0, 0.0]), 1.0, np.ones_like),
    "forward": Environment(np.array([1.0]), 0.0, np.ones_like),
    "late": Environment(np.array([1.0]), 0.0, np.ones_like),
    "tustin": Environment(np.array([0.5, 0.5]), 0.5, lambda angle: np.cos(0.5 * angle)),
}
"""Backward difference in the same tick; forward difference, which is also the backward difference one sample late;
trapezoidal rule."""


def kind_of(environment):
    """The Environment of a name; ValueError with the names there are."""
    if environment not in ENVIRONMENTS:
        raise ValueError(f"environment is {environment!r}, but it must be one of {', '.join(ENVIRONMENTS)}")
    return ENVIRONMENTS[environment]


def supply(response, angle, environment):
    """|H|² Re{Ī/H} |z − 1|²/T over 1 − cos θ: what the coupling itself takes from an exchange [N/m]."""
    turned = np.exp(1j * (environment.lead - 0.5) * angle) * response
    return environment.gain(angle) * np.imag(turned) / np.sin(0.5 * angle)


def leak(angle, environment, delay_samples):
    """(|i| − Re{ī e^{−jNθ}})/(1 − cos θ): what the held force may give away. A fraction of a delay is interpolated."""
    whole, fraction = split_delay(delay_samples)

    def ratio(lead):
        return (np.sin(0.5 * lead * angle) / np.sin(0.5 * angle)) ** 2

    lead = whole + environment.lead
    return environment.gain(angle) * ((1.0 - fraction) * ratio(lead) + fraction * ratio(lead + 1.0))


def supply_at_rest(value, slope, environment):
    """`supply` at θ = 0 from H(1) and dH/dz there [N/m]."""
    return (2.0 * environment.lead - 1.0) * value + 2.0 * slope


def leak_at_rest(environment, delay_samples):
    """`leak` at θ = 0."""
    whole, fraction = split_delay(delay_samples)
    lead = whole + environment.lead
    return (1.0 - fraction) * lead**2 + fraction * (lead + 1.0) ** 2
