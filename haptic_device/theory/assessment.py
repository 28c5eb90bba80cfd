# SPDX-License-Identifier: Apache-2.0
"""Assessment of a display: passive, stable, with any simulation behind the coupling; by how much, what to change."""

from collections.abc import Iterator
from math import inf, isfinite, sqrt, tau
from typing import NamedTuple

import numpy as np

from haptic_device.control.passivity import largest_stiffness, least_damping
from haptic_device.digits import amount, apart
from haptic_device.theory.coupling_damping import leak, least_damping_for_any_simulation
from haptic_device.theory.delay import largest_passive_stiffness, wall_damping_needed
from haptic_device.theory.mu import mu_margin
from haptic_device.theory.quantity import Quantity, not_negative, positive, within
from haptic_device.theory.stability import largest_stable_stiffness, spectral_radius
from haptic_device.theory.transfer import wall_transfer

LIMITS = {
    "stiffness": (0.0, 1e12, "N/m"),
    "damping": (-1e9, 1e9, "N s/m"),
    "physical_damping": (1e-9, 1e9, "N s/m"),
    "period": (1e-9, 1e3, "s"),
    "mass": (1e-9, 1e9, "kg"),
    "delay_samples": (0.0, 100.0, "samples"),
    "resolution": (0.0, 1e3, "m"),
    "coulomb": (0.0, 1e9, "N"),
}
"""Far beyond any device, and inside what double precision carries; each sample of delay is a root to be found."""


class Display(NamedTuple):
    """A device and the wall or coupling that it shows.

    Attributes:
        stiffness: K of the wall or coupling [N/m].
        damping: B of the wall or coupling, of either sign [N s/m].
        physical_damping: b of the device [N s/m].
        period: T of the servo [s].
        mass: moving mass m of the device [kg].
        delay_samples: delay of the loop in periods.
        velocity_lag: time constant τ of the filter on the velocity [s].
        resolution: step of the encoder [m].
        coulomb: Coulomb friction of the device [N].

    Examples:
        >>> from haptic_device.theory.assessment import Display
        >>> display = Display(stiffness=1000.0, damping=0.1, physical_damping=1.0, period=0.001)
        >>> display.delay_samples, display._replace(stiffness=500.0).stiffness
        (0.0, 500.0)
    """

    stiffness: float
    damping: float
    physical_damping: float
    period: float
    mass: float = 0.1
    delay_samples: float = 0.0
    velocity_lag: float = 0.0
    resolution: float = 0.0
    coulomb: float = 0.0


class Assessment(NamedTuple):
    """Result of `assess`. A positive margin is safe; an infinite need means that no damping is enough.

    Attributes:
        passive: whether b is larger than the wall needs and friction covers the encoder step, for any operator.
        stable: whether the display is stable when nobody holds it.
        margin: physical damping beyond what the wall needs [N s/m].
        b_required: physical damping that the wall needs [N s/m].
        binding_hz: frequency at which the wall needs the most damping [Hz].
        coulomb_required: Coulomb friction that covers the encoder step [N].
        mu_passive: whether b is enough for a coupling with these gains to any passive simulation in step.
        mu_margin: margin of the μ test, see `mu_margin`.
        b_required_mu: physical damping for such a coupling [N s/m], as the driver requires it, which pays for what the
            tool moves. A velocity lag does not reduce it.
        stiffness_max_passive: largest stiffness of a passive wall [N/m].
        stiffness_max_stable: largest stiffness that is stable when nobody holds the device [N/m].
        stiffness_max_mu: largest stiffness of such a coupling [N/m]; friction is not part of this condition.

    Examples:
        >>> from haptic_device.theory.assessment import Display, assess
        >>> found = assess(Display(stiffness=1000.0, damping=0.1, physical_damping=1.0, period=0.001))
        >>> found.passive, round(found.margin, 9), round(found.stiffness_max_passive, 6)
        (True, 0.4, 1800.0)
    """

    passive: bool
    stable: bool
    margin: float
    b_required: float
    binding_hz: float
    coulomb_required: float
    mu_passive: bool
    mu_margin: float
    b_required_mu: float
    stiffness_max_passive: float
    stiffness_max_stable: float
    stiffness_max_mu: float


def check_display(display: Display) -> None:
    """Refuse what cannot be a display (ValueError, one sentence)."""
    for name in ("physical_damping", "period", "mass"):
        positive(name, getattr(display, name), LIMITS[name][2])
    for name, (low, high, unit) in LIMITS.items():
        within(name, getattr(display, name), low, high, unit)
    within("velocity_lag", display.velocity_lag, 0.0, 1e6 * display.period, "s")


def assess(display: Display) -> Assessment:
    """Computes whether a display is passive and stable, its margins, and its largest stiffness.

    Raises ValueError if b, T or m is not above 0, K is below 0, or a value is not finite or beyond LIMITS.

    Args:
        display: the device and its wall or coupling.

    Examples:
        >>> from haptic_device.theory.assessment import Display, assess
        >>> found = assess(Display(stiffness=3000.0, damping=0.0, physical_damping=1.0, period=0.001))
        >>> found.passive, round(found.b_required, 9)  # KT/2
        (False, 1.5)
    """
    check_display(display)
    stiffness, damping, physical_damping, period, mass, delay, lag, resolution, coulomb = display
    wall = wall_damping_needed(stiffness, damping, period, lag, delay)
    friction = float(coulomb_friction_needed(stiffness, damping, period, resolution, lag))
    coupling = wall_transfer(stiffness, damping, period, lag)
    any_simulation = _coupling_need(display)
    return Assessment(
        passive=bool(wall.damping < physical_damping and friction <= coulomb),
        stable=bool(spectral_radius(stiffness, damping, mass, physical_damping, period, delay, lag) < 1.0),
        margin=float(physical_damping - wall.damping),
        b_required=float(wall.damping) + 0.0,
        binding_hz=float(wall.frequency) / tau,
        coulomb_required=friction,
        mu_passive=any_simulation < physical_damping,
        mu_margin=float(mu_margin(coupling, period, physical_damping, delay_samples=delay)),
        b_required_mu=any_simulation,
        stiffness_max_passive=_largest_passive(display),
        stiffness_max_stable=largest_stable_stiffness(mass, physical_damping, damping, period, delay, lag),
        stiffness_max_mu=_largest_coupling(display),
    )


def coulomb_friction_needed(
    stiffness: Quantity, damping: Quantity, period: Quantity, resolution: Quantity, velocity_lag: Quantity = 0.0
) -> Quantity:
    """Coulomb friction f_c [N] that covers the encoder step Δ: half of Δ Σ|h_k|, with h the impulse response of H.

    The arguments broadcast. Each sample has an error of at most Δ/2. So the error of the force is at most f_c, and
    friction takes at least as much energy from every displacement. The condition on b holds in addition. For B ≥ 0 and
    no lag it is (K + 2B/T) Δ/2 (Abbott & Okamura 2005 for B = 0). Raises ValueError if the resolution is below 0.

    Args:
        stiffness: K [N/m].
        damping: B [N s/m].
        period: T [s].
        resolution: Δ [m].
        velocity_lag: τ [s].

    Examples:
        >>> from haptic_device.theory.assessment import coulomb_friction_needed
        >>> print(round(coulomb_friction_needed(1000.0, 0.0, 0.001, 1e-5), 9))  # K Δ/2
        0.005
    """
    not_negative("resolution", resolution, "m")
    viscous = np.asarray(damping) / (period + velocity_lag)
    return 0.5 * resolution * (np.abs(stiffness + viscous) + np.abs(viscous))


def advise(display: Display, assessment: Assessment) -> str:
    """One sentence: whether the display is passive and stable, and what to change if it is not.

    Args:
        display: the device and its wall or coupling.
        assessment: of that display, from `assess`.

    Examples:
        >>> from haptic_device.theory.assessment import Display, advise, assess
        >>> display = Display(stiffness=3000.0, damping=0.0, physical_damping=1.0, period=0.001)
        >>> print(advise(display, assess(display)))
        Not passive: it needs b > 1.5 N s/m and the device has 1; supply that or lower the stiffness
        below 2000 N/m as a wall; it is not even stable on its own.
    """
    if not assessment.passive:
        lacks = "; ".join(_lacks(display, assessment))
        return f"Not passive: {lacks}; supply that or {_softer(assessment)}{_alone(assessment)}."
    spare = f"{assessment.margin:.3g} N s/m of physical damping to spare"
    if not assessment.mu_passive:
        need = f"b > {assessment.b_required_mu:.4g} N s/m" if isfinite(assessment.b_required_mu) else "no b is enough"
        return f"Passive as a wall, with {spare}, but not as a coupling to any passive simulation ({need})."
    wall = assessment.stiffness_max_passive
    coupling = min(wall, assessment.stiffness_max_mu)  # what friction has to cover holds for both
    return (
        f"Passive with {spare}; the stiffness could rise to {coupling:.5g} N/m as a coupling, "
        f"to {wall:.5g} N/m as a wall."
    )


def _lacks(display: Display, assessment: Assessment) -> Iterator[str]:
    if assessment.margin <= 0.0:
        need, has = apart(assessment.b_required, display.physical_damping)
        yield f"it needs b > {need} N s/m and the device has {has}"
    if assessment.coulomb_required > display.coulomb:
        need, has = apart(assessment.coulomb_required, display.coulomb)
        step = amount(display.resolution, "m")
        yield f"an encoder step of {step} needs {need} N of friction and the device has {has}"


def _softer(assessment: Assessment) -> str:
    if assessment.stiffness_max_passive > 0.0:
        return f"lower the stiffness below {assessment.stiffness_max_passive:.5g} N/m as a wall"
    return "bring the damping nearer to 0, for no stiffness is passive with it"


def _alone(assessment: Assessment) -> str:
    if not assessment.stable:
        return "; it is not even stable on its own"
    return "; on its own it is stable, so only an operator would find out" if assessment.margin <= 0.0 else ""


def _largest_passive(display: Display) -> float:
    """Both limits at once: (|K + v| + |v|) Δ/2 ≤ f_c with v = B/(T + τ), and the physical damping."""
    damped = largest_passive_stiffness(
        display.physical_damping, display.damping, display.period, display.velocity_lag, display.delay_samples
    )
    return float(min(damped, hidden_stiffness(display)))


def hidden_stiffness(display: Display) -> float:
    """Largest K [N/m] whose limit cycles friction hides: 2 f_c/Δ − |v| − v (Abbott & Okamura, Diolaiti et al. 2006)."""
    if display.resolution == 0.0:
        return inf
    viscous = display.damping / (display.period + display.velocity_lag)
    return max(2.0 * display.coulomb / display.resolution - abs(viscous) - viscous, 0.0)


def _coupling_need(display: Display) -> float:
    """As the driver requires it; it refuses a coupling with B < 0, which any simulation in step could drive."""
    stiffness, damping, period = (float(value) for value in (display.stiffness, display.damping, display.period))
    late = float(display.delay_samples * period)
    if damping >= 0.0:
        return float(least_damping(stiffness, damping, period, late, late))
    coupling = wall_transfer(stiffness, damping, period)
    return float(least_damping_for_any_simulation(coupling, period, display.delay_samples).damping)


def _largest_coupling(display: Display) -> float:
    """Largest K of such a coupling; 0: there is none. For B < 0 the larger root of L h² = b (h + B), h = KT/2."""
    b, damping, period = (float(value) for value in (display.physical_damping, display.damping, display.period))
    late = float(display.delay_samples * period)
    if damping >= 0.0:
        return largest_stiffness(b, damping, period, late, late)
    leaks = float(leak(np.array([1e-6]), display.delay_samples)[0])
    square = b * b + 4.0 * leaks * b * damping
    return max(0.0, (b + sqrt(square)) / (leaks * period)) if square > 0.0 else 0.0
