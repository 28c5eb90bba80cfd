# SPDX-License-Identifier: Apache-2.0
"""Stability without an operator: exact plant, boundaries from both sides, the closed form without physical damping."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.stability import held_plant, largest_stable_stiffness, spectral_radius, stable_ranges

MASS = st.floats(0.01, 1.0)
PHYSICAL_DAMPING = st.floats(0.005, 5.0)
PERIOD = st.floats(1e-4, 5e-3)
DELAY = st.sampled_from([0.0, 0.4, 1.0, 2.0, 2.5, 5.0])
LAG = st.sampled_from([0.0, 1e-3, 1e-2])


@pytest.mark.parametrize(
    "damping, samples, expected",
    [
        (0.0, 0, 1000.83),
        (0.0, 1, 333.80),
        (0.0, 2, 200.43),
        (0.25, 0, 1497.51),
        (1.0, 0, 2972.70),
        (5.0, 0, 10473.46),
        (20.0, 0, 33590.93),
    ],
)
def test_largest_stable_stiffness_agrees_with_the_reference_to_five_digits(damping, samples, expected):
    assert largest_stable_stiffness(0.1, 0.5, damping, 1e-3, samples) == pytest.approx(expected, abs=0.0051)


@few(20)
@given(MASS, PHYSICAL_DAMPING, st.floats(0.0, 20.0), PERIOD, DELAY, LAG)
def test_poles_are_inside_the_unit_circle_just_below_every_boundary_and_outside_just_above(
    mass, physical_damping, damping, period, delay, lag
):
    for low, high in stable_ranges(mass, physical_damping, damping, period, delay, lag):
        loop = damping, mass, physical_damping, period, delay, lag
        assert spectral_radius(high * (1.0 - 1e-4), *loop) < 1.0 < spectral_radius(high * (1.0 + 1e-4), *loop)
        if low > 0.0:
            assert spectral_radius(low * (1.0 - 1e-4), *loop) > 1.0 > spectral_radius(low * (1.0 + 1e-4), *loop)


@few(10)
@given(MASS, PERIOD, st.floats(0.01, 1.99))
def test_without_physical_damping_the_boundary_has_a_closed_form(mass, period, share):
    expected = mass / period**2 * 2.0 * share * (2.0 - share) / (2.0 + share)
    assert largest_stable_stiffness(mass, 0.0, share * mass / period, period) == pytest.approx(expected, rel=1e-6)


@few(15)
@given(MASS, st.floats(0.0, 50.0), PERIOD, st.floats(0.0, 0.99))
def test_the_held_plant_is_the_exact_response_to_a_force_switched_late(mass, physical_damping, period, fraction):
    matrix = np.array([[0.0, 1.0, 0.0], [0.0, -physical_damping / mass, 1.0 / mass], [0.0, 0.0, 0.0]])
    early, late = expm(matrix * fraction * period), expm(matrix * (1.0 - fraction) * period)
    z = 1.3 * np.exp(0.4j)
    drive = late[:2, :2] @ early[:2, 2] / z + late[:2, 2]
    expected = np.linalg.solve(z * np.eye(2) - (late @ early)[:2, :2], drive)[0]
    assert held_plant(mass, physical_damping, period, fraction)(z) == pytest.approx(expected, rel=1e-9)


@few(10)
@given(MASS, PHYSICAL_DAMPING, st.floats(-1.0, 5.0), PERIOD, DELAY)
def test_what_is_passive_is_stable(mass, physical_damping, damping, period, delay):
    passive = largest_passive_stiffness(physical_damping, damping, period, 0.0, delay)
    stable = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
    assert stable >= passive * (1.0 - 1e-6)


def test_a_loop_unstable_without_a_spring_may_be_stable_with_one_and_both_ends_are_reported():
    (low, high), *more = stable_ranges(1.0, 2.5, -2.95, 1.0, 0.0, 0.5)
    assert not more
    assert largest_stable_stiffness(1.0, 2.5, -2.95, 1.0, 0.0, 0.5) == 0.0
    radius = spectral_radius(np.array([0.99 * low, 1.01 * low, 0.99 * high, 1.01 * high]), -2.95, 1.0, 2.5, 1.0, 0, 0.5)
    assert list(radius < 1.0) == [False, True, True, False]


def test_without_a_spring_the_free_position_does_not_count_as_instability():
    assert spectral_radius(0.0, 0.1, 0.1, 0.5, 1e-3) < 1.0
    assert spectral_radius(0.0, 500.0, 0.1, 0.5, 1e-3) > 1.0
