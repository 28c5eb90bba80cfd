# SPDX-License-Identifier: Apache-2.0
"""python-control as oracle: the held plant, stable loops, condition 1, Llewellyn's criterion and the μ test."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.analysis.coupling_damping import least_damping_for_any_simulation
from haptic_device.analysis.mu import mu_margin
from haptic_device.analysis.passivity import least_damping
from haptic_device.analysis.stability import held_plant, largest_stable_stiffness
from haptic_device.analysis.transfer import wall_transfer

control = pytest.importorskip("control")

MASS, PHYSICAL_DAMPING, DAMPING = st.floats(0.02, 1.0), st.floats(0.05, 3.0), st.floats(0.0, 3.0)
PERIOD, DELAY = st.sampled_from([2e-4, 1e-3, 5e-3]), st.integers(0, 3)


@few(20)
@given(MASS, PHYSICAL_DAMPING, PERIOD)
def test_the_held_plant_is_that_of_python_control(mass, physical_damping, period):
    theirs = control.c2d(control.tf([1.0], [mass, physical_damping, 0.0]), period, "zoh")
    z = np.exp(1j * np.linspace(0.3, 3.0, 7))
    np.testing.assert_allclose(held_plant(mass, physical_damping, period)(z), theirs(z), rtol=1e-6)


@few(20)
@given(MASS, PHYSICAL_DAMPING, DAMPING, PERIOD, DELAY)
def test_loops_of_python_control_are_stable_just_below_our_boundary_and_unstable_just_above(
    mass, physical_damping, damping, period, delay
):
    boundary = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
    plant = control.c2d(control.tf([1.0], [mass, physical_damping, 0.0]), period, "zoh")
    late = control.tf([1.0], [1.0, *np.zeros(delay)], period)

    def radius(stiffness):
        viscous = damping / period
        wall = control.tf([stiffness + viscous, -viscous], [1.0, 0.0], period)
        return np.abs(control.feedback(plant, wall * late).poles()).max()

    if boundary > 0.0:
        assert radius(0.99 * boundary) < 1.0
    assert radius(1.01 * boundary + 1e-3 * mass / period**2) > 1.0


@few(20)
@given(st.floats(10.0, 1e5), st.floats(-5.0, 5.0), PERIOD, st.sampled_from([0.0, 1e-3, 1e-2]))
def test_no_frequency_response_of_python_control_asks_for_more_damping_than_condition_1(
    stiffness, damping, period, lag
):
    share = period / (period + lag)
    theirs = control.tf([stiffness], [1.0], period) + control.tf(
        np.array([1.0, -1.0]) * damping * share / period, [1.0, share - 1.0], period
    )
    angle = np.geomspace(1e-4, np.pi, 4001)
    held = (1.0 - np.exp(-1j * angle)) * theirs(np.exp(1j * angle))
    asked = 0.5 * period * held.real / (1.0 - np.cos(angle))
    ours = float(least_damping(wall_transfer(stiffness, damping, period, lag), period).damping)
    assert asked.max() == pytest.approx(ours, rel=1e-3)
    assert asked.max() <= ours * (1.0 + 1e-6)


@few(20)
@given(st.floats(10.0, 1e5), st.floats(-0.4, 3.0), PERIOD)
def test_llewellyns_criterion_with_python_control_asks_for_our_bound_of_a_coupling(stiffness, share, period):
    """share: B/(KT)."""
    damping = share * stiffness * period
    viscous = damping / period
    coupling = control.tf([stiffness + viscous, -viscous], [1.0, 0.0], period)
    admittance = control.tf([1.0, -1.0], [period, 0.0], period) / coupling
    z = np.exp(1j * np.linspace(1e-3, np.pi, 4001))
    transmitted = -1.0 / z
    asked = (np.abs(transmitted) + transmitted.real) / (2.0 * admittance(z).real)
    ours = float(least_damping_for_any_simulation(wall_transfer(stiffness, damping, period), period).damping)
    assert asked.max() == pytest.approx(ours, rel=1e-3)


@pytest.mark.parametrize("share, passive", [(0.999, False), (1.001, True)])
@few(10)
@given(st.floats(10.0, 1e5), st.floats(-0.4, 3.0), PERIOD)
def test_mu_of_python_controls_responses_gives_our_verdict_just_below_the_bound_and_just_above(
    share, passive, stiffness, relative, period
):
    """relative: B/(KT). The angles are dense at rest too, where a coupling of negative B binds."""
    damping = relative * stiffness * period
    bound = float(least_damping_for_any_simulation(wall_transfer(stiffness, damping, period), period).damping)
    physical_damping = share * bound
    viscous = damping / period
    z = np.exp(1j * np.concatenate([np.geomspace(2e-3, 0.05, 200), np.linspace(0.05, np.pi, 800)]))
    coupling = control.tf([stiffness + viscous, -viscous], [1.0, 0.0], period)(z)
    display = control.tf([period], [1.0, -1.0], period)(z) / physical_damping
    simulation = control.tf([period, 0.0], [1.0, -1.0], period)(z) / physical_damping  # b0 = b
    loop = 1.0 / coupling + 0.5 * display + simulation
    m11, m12, m21, m22 = -0.5 * display / loop, simulation / loop, -display / loop, 2.0 * simulation / loop - 1.0
    size = np.abs(m11) ** 2 + np.abs(m22) ** 2 + 2.0 * np.abs(m12 * m21)
    product = np.abs(m11 * m22 - m12 * m21) ** 2
    largest = np.sqrt(0.5 * (size + np.sqrt(np.maximum(size**2 - 4.0 * product, 0.0)))).max()
    margin = float(mu_margin(wall_transfer(stiffness, damping, period), period, physical_damping))
    assert bool(largest < 1.0) is bool(margin > 0.0) is passive
