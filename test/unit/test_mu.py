# SPDX-License-Identifier: Apache-2.0
"""python-control as oracle of the analysis: stable loops, condition 1, and the μ test, which needs a world in step."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from bench.reference.closed_forms import wall_damping_for_any_simulation
from haptic_device.theory.coupling_damping import least_damping_for_any_simulation
from haptic_device.theory.mu import mu_margin
from haptic_device.theory.passivity import least_damping
from haptic_device.theory.stability import largest_stable_stiffness
from haptic_device.theory.transfer import wall_transfer

control = pytest.importorskip("control")

STIFFNESS, DAMPING = st.floats(10.0, 1e5), st.floats(0.0, 3.0)
PERIOD, DELAY = st.sampled_from([2e-4, 1e-3, 5e-3]), st.integers(0, 3)


def gains(stiffness, damping, period, lag=0.0):
    """H(z) of eq. 2 as python-control has it."""
    share = period / (period + lag)
    viscous = control.tf(np.array([1.0, -1.0]) * damping * share / period, [1.0, share - 1.0], period)
    return control.tf([stiffness], [1.0], period) + viscous


def integrator(numerator, period):
    """By which a simulation integrates speed into position: in step [1, 0], late or forward [1], trapezoidal."""
    return control.tf(np.array(numerator) * period, [1.0, -1.0], period)


def largest_mu(stiffness, damping, period, physical_damping, in_world=(1.0, 0.0)):
    """Of the matrix M of the μ test for two complex blocks, b0 = b, over all angles: dense at both ends."""
    rest = np.geomspace(2e-3, 0.05, 200)
    z = np.exp(1j * np.concatenate([rest, np.linspace(0.05, np.pi, 800), np.pi - 0.01 * rest]))
    display = integrator([1.0], period)(z) / physical_damping
    simulation = integrator(in_world, period)(z) / physical_damping
    loop = 1.0 / gains(stiffness, damping, period)(z) + 0.5 * display + simulation
    m11, m12, m21, m22 = -0.5 * display / loop, simulation / loop, -display / loop, 2.0 * simulation / loop - 1.0
    size = np.abs(m11) ** 2 + np.abs(m22) ** 2 + 2.0 * np.abs(m12 * m21)
    product = np.abs(m11 * m22 - m12 * m21) ** 2
    return np.sqrt(0.5 * (size + np.sqrt(np.maximum(size**2 - 4.0 * product, 0.0)))).max()


@few(20)
@given(st.floats(0.02, 1.0), st.floats(0.05, 3.0), DAMPING, PERIOD, DELAY)
def test_loops_of_python_control_are_stable_just_below_our_boundary_and_unstable_just_above(
    mass, physical_damping, damping, period, delay
):
    boundary = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
    plant = control.c2d(control.tf([1.0], [mass, physical_damping, 0.0]), period, "zoh")
    late = control.tf([1.0], [1.0, *np.zeros(delay)], period)

    def radius(stiffness):
        wall = control.tf([stiffness + damping / period, -damping / period], [1.0, 0.0], period)
        return np.abs(control.feedback(plant, wall * late).poles()).max()

    if boundary > 0.0:
        assert radius(0.99 * boundary) < 1.0
    assert radius(1.01 * boundary + 1e-3 * mass / period**2) > 1.0


@few(20)
@given(STIFFNESS, st.floats(-5.0, 5.0), PERIOD, st.sampled_from([0.0, 1e-3, 1e-2]))
def test_no_frequency_response_of_python_control_asks_for_more_damping_than_condition_1(
    stiffness, damping, period, lag
):
    angle = np.geomspace(1e-4, np.pi, 4001)
    held = (1.0 - np.exp(-1j * angle)) * gains(stiffness, damping, period, lag)(np.exp(1j * angle))
    asked = 0.5 * period * held.real / (1.0 - np.cos(angle))
    ours = float(least_damping(wall_transfer(stiffness, damping, period, lag), period).damping)
    assert asked.max() == pytest.approx(ours, rel=1e-3)
    assert asked.max() <= ours * (1.0 + 1e-6)


@few(12)
@given(STIFFNESS, st.floats(-0.4, 3.0), PERIOD)
def test_mu_of_python_controls_responses_gives_our_verdict_just_below_the_bound_and_just_above(
    stiffness, relative, period
):
    """relative: B/(KT). For negative B the need is not that of the wall."""
    damping = relative * stiffness * period
    wall = wall_transfer(stiffness, damping, period)
    bound = float(least_damping_for_any_simulation(wall, period).damping)
    assert bound == pytest.approx(float(wall_damping_for_any_simulation(stiffness, damping, period)), rel=1e-9)
    for share, passive in ((0.999, False), (1.001, True)):
        assert bool(largest_mu(stiffness, damping, period, share * bound) < 1.0) is passive
        assert bool(mu_margin(wall, period, share * bound) > 0.0) is passive


@pytest.mark.parametrize("in_world", [[1.0], [0.5, 0.5]], ids=["late or forward", "trapezoidal"])
@pytest.mark.parametrize("damping", [0.0, 0.1, 2.0])
def test_a_simulation_late_explicit_or_trapezoidal_is_never_passive(in_world, damping):
    for physical_damping in np.geomspace(0.6 + damping, 1e3, 7):
        assert largest_mu(1.0, damping, 1.0, physical_damping) < 1.0
        assert largest_mu(1.0, damping, 1.0, physical_damping, in_world) > 1.0


@pytest.mark.parametrize("damping", [-0.5, -0.7])
def test_below_minus_half_the_spring_no_physical_damping_is_enough(damping):
    wall = wall_transfer(1.0, damping, 1.0)
    assert wall_damping_for_any_simulation(1.0, damping, 1.0) == np.inf
    assert least_damping_for_any_simulation(wall, 1.0).damping == np.inf
    assert all(mu_margin(wall, 1.0, b) <= 0.0 for b in (0.1, 1.0, 1e3, 1e6))


@few(12)
@given(st.floats(-0.4, 2.0), st.floats(0.0, 3.0), st.sampled_from([0.0, 0.3]))
def test_the_margin_of_a_late_display_is_above_0_just_above_what_any_simulation_needs_and_not_just_below(
    damping, delay, lag
):
    wall = wall_transfer(1.0, damping, 1.0, lag)
    need = least_damping_for_any_simulation(wall, 1.0, delay).damping
    if np.isfinite(need):
        assert mu_margin(wall, 1.0, 1.001 * need, delay) > 0.0 > mu_margin(wall, 1.0, 0.999 * need, delay)


def test_without_any_gain_between_them_every_device_is_passive():
    assert least_damping_for_any_simulation(([0.0], [1.0]), 1e-3).damping == 0.0


def test_a_callable_that_broadcasts_gives_the_margin_of_each_as_alone():
    stiffness, damping, period = np.array([500.0, 1000.0, 2000.0]), np.array([0.2, 0.8, 2.0]), 1e-3

    def springs(z):
        return stiffness[:, None] + 0.1 * (z - 1.0) / (period * z)

    alone = [mu_margin(wall_transfer(k, 0.1, period), period, b) for k, b in zip(stiffness, damping, strict=True)]
    assert mu_margin(springs, period, damping[:, None]) == pytest.approx(alone, rel=1e-9)
    assert alone[0] < 0.0 < alone[1]
