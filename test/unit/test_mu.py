# SPDX-License-Identifier: Apache-2.0
"""The μ test against the wall's condition: where the paper's statement holds, and the two cases where it does not."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from haptic_device.analysis.coupling_damping import least_damping_for_any_simulation
from haptic_device.analysis.mu import margin_at, mu_margin
from haptic_device.analysis.transfer import wall_transfer
from reference.closed_forms import delayed_wall_damping, wall_damping, wall_damping_for_any_simulation

ANGLES = np.concatenate([np.geomspace(2e-3, 0.05, 40), np.linspace(0.06, np.pi, 400)])
IN_STEP = [1.0, 0.0]
OTHERS = {"late or forward": [1.0], "trapezoidal": [0.5, 0.5]}
"""Coefficients of i(z) in I = T i(z)/(z − 1), by which a simulation integrates speed into position."""


def two_port(transfer, period, physical_damping, angle, integrator=IN_STEP, reference=1.0, delay_samples=0):
    """The matrix M of the μ test at the angles θ, shape (…, 2, 2); reference: b₀ [N s/m]."""
    z = np.exp(1j * np.asarray(angle))
    display = period * z**-delay_samples / (z - 1.0) / (2.0 * physical_damping)
    simulation = period * np.polyval(integrator, z) / (z - 1.0) / reference
    loop = 1.0 / transfer(z) + display + simulation
    rows = [[-display / loop, simulation / loop], [-2.0 * display / loop, 2.0 * simulation / loop - 1.0]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def size_of(matrix):
    """F of the formulas for two complex scalar blocks."""
    cross = matrix[..., 0, 1] * matrix[..., 1, 0]
    return np.abs(matrix[..., 0, 0]) ** 2 + np.abs(matrix[..., 1, 1]) ** 2 + 2.0 * np.abs(cross)


def structured_singular_value(matrix):
    """μ of 2 × 2 matrices for two complex scalar blocks."""
    size, product = size_of(matrix), np.abs(np.linalg.det(matrix)) ** 2
    return np.sqrt(0.5 * (size + np.sqrt(np.maximum(size**2 - 4.0 * product, 0.0))))


def margin_of(matrix, angle):
    """(1 + |det M|² − F)/(1 − cos θ)."""
    return (1.0 + np.abs(np.linalg.det(matrix)) ** 2 - size_of(matrix)) / (2.0 * np.sin(0.5 * angle) ** 2)


def test_for_positive_damping_mu_agrees_with_the_condition_of_the_wall_in_every_case():
    rng = np.random.default_rng(7)
    for draw in range(120):  # `python -m bench theory`: 2000
        period = 10.0 ** rng.uniform(-4.0, -2.0)
        stiffness = 10.0 ** rng.uniform(0.0, 5.0)
        damping = stiffness * period * 10.0 ** rng.uniform(-3.0, 1.0) * (draw % 10 > 0)
        share = [0.999, 1.001, 10.0 ** rng.uniform(-0.5, 0.5)][draw % 3]
        margin = mu_margin(
            wall_transfer(stiffness, damping, period), period, share * wall_damping(stiffness, damping, period)
        )
        assert (margin > 0.0) == (share > 1.0)


@pytest.mark.parametrize("damping", [-0.05, -0.2, -0.4])
def test_for_negative_damping_the_threshold_of_mu_is_not_that_of_the_wall(damping):
    expected = 0.25 / (0.5 + damping)
    low, high = 0.1, 10.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        matrix = two_port(wall_transfer(1.0, damping, 1.0), 1.0, middle, ANGLES)
        low, high = (low, middle) if np.all(margin_of(matrix, ANGLES) > 0.0) else (middle, high)
    assert low == pytest.approx(expected, rel=1e-3)
    assert wall_damping_for_any_simulation(1.0, damping, 1.0) == pytest.approx(expected, rel=1e-12)
    assert abs(low - wall_damping(1.0, damping, 1.0)) > 0.005


@pytest.mark.parametrize("damping", [-0.5, -0.7])
def test_below_minus_half_the_spring_no_physical_damping_is_enough(damping):
    assert wall_damping_for_any_simulation(1.0, damping, 1.0) == np.inf
    assert least_damping_for_any_simulation(wall_transfer(1.0, damping, 1.0), 1.0).damping == np.inf
    assert all(mu_margin(wall_transfer(1.0, damping, 1.0), 1.0, b) <= 0.0 for b in (0.1, 1.0, 1e3, 1e6))


@pytest.mark.parametrize("integrator", OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("damping", [0.0, 0.1, 0.5, 2.0])
def test_a_simulation_late_explicit_or_trapezoidal_is_never_passive(integrator, damping):
    wall = wall_transfer(1.0, damping, 1.0)
    angles = np.concatenate([ANGLES, np.pi - np.geomspace(1e-6, 0.01, 100)])  # there the trapezoidal rule shows it
    for physical_damping in np.geomspace(0.1, 1e3, 13):
        assert np.min(margin_of(two_port(wall, 1.0, physical_damping, angles, integrator), angles)) < -1e-13
    in_step = two_port(wall, 1.0, 1.01 * wall_damping(1.0, damping, 1.0), angles)
    assert np.min(margin_of(in_step, angles)) > 1e-3


@pytest.mark.parametrize("share, passive", [(0.998, False), (1.002, True)])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_late_simulation_with_damping_acts_as_two_dampers_in_series(share, passive, damping):
    environment_damping = 2.5
    physical_damping = share / (1.0 / wall_damping(1.0, damping, 1.0) - 1.0 / environment_damping)
    z = np.exp(1j * ANGLES)
    display = 1.0 / (z - 1.0) / (2.0 * physical_damping)
    simulation = 1.0 / (z - 1.0) / (2.0 * environment_damping)
    loop = 1.0 / wall_transfer(1.0, damping, 1.0)(z) + display + simulation
    rows = np.array([[display, simulation], [display, simulation]]) / -loop
    largest = np.max(structured_singular_value(np.moveaxis(rows, (0, 1), (-2, -1))))
    assert bool(largest < 1.0) is passive


@few(20)
@given(st.lists(st.complex_numbers(min_magnitude=0.05, max_magnitude=3.0), min_size=4, max_size=4))
def test_the_formula_for_two_blocks_is_the_least_scaled_norm(entries):
    matrix = np.array(entries).reshape(2, 2)

    def scaled(logarithm):
        scale = np.exp(logarithm)
        return np.linalg.norm(matrix * [[1.0, scale], [1.0 / scale, 1.0]], 2)

    least = minimize_scalar(scaled, bounds=(-6.0, 6.0), method="bounded", options={"xatol": 1e-10}).fun
    assert structured_singular_value(matrix) == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_margin_cleared_of_its_poles_is_that_of_the_matrix(delay):
    wall, grid = wall_transfer(1000.0, 0.4, 1e-3), ANGLES[ANGLES > 0.05]
    matrix = two_port(wall, 1e-3, 1.1, grid, reference=1.1, delay_samples=delay)
    cleared = margin_at(wall, 1e-3, 1.1, grid, delay)
    assert cleared == pytest.approx(margin_of(matrix, grid), rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("delay", [0, 2])
def test_the_damping_of_reference_does_not_move_the_boundary(delay):
    wall = wall_transfer(1000.0, 0.4, 1e-3)
    need = least_damping_for_any_simulation(wall, 1e-3, delay_samples=delay).damping
    for reference in (0.01, 1.0, 100.0):
        for share, passive in ((0.999, False), (1.001, True)):
            matrix = two_port(wall, 1e-3, share * need, ANGLES, reference=reference, delay_samples=delay)
            assert bool(np.all(structured_singular_value(matrix) < 1.0)) is passive


@few(12)
@given(st.floats(1.0, 1e5), st.floats(-0.49, 3.0), st.floats(1e-4, 1e-2))
def test_the_closed_form_for_any_simulation_agrees_with_that_for_the_wall(stiffness, share, period):
    damping = share * stiffness * period
    found = least_damping_for_any_simulation(wall_transfer(stiffness, damping, period), period).damping
    assert found == pytest.approx(float(wall_damping_for_any_simulation(stiffness, damping, period)), rel=1e-9)


@few(10)
@given(st.floats(0.05, 0.95), st.integers(0, 2), st.floats(0.0, 2.0), st.floats(0.05, 3.0))
def test_with_a_fractional_delay_the_sign_of_the_margin_is_that_of_the_energy_form(fraction, whole, damping, angle):
    """Positions at samples and switchings and the coupling's force, the environment taking energy: 3 × 3, exact."""
    wall, z = wall_transfer(1.0, damping, 1.0), np.exp(1j * angle)

    def leftover(physical_damping):
        own = physical_damping / (fraction * (1.0 - fraction))
        cross = -physical_damping * (1.0 / fraction + z / (1.0 - fraction))
        taken = np.real((1.0 - np.conj(z)) / wall(z))
        best = -np.inf
        for share in np.concatenate([[1.0], np.geomspace(0.2, 5.0, 41)]):
            lower = np.array([[0, 0, 0], [cross, 0, 0], [-share * (1 - np.conj(z)) / 2, z**whole * (z - 1) / 2, 0]])
            form = np.diag([own, own, share * taken]) + lower + lower.conj().T
            best = max(best, np.linalg.eigvalsh(form)[0])
        return best

    grid = np.array([angle])
    low, high = 1e-3, 1e3
    while high / low > 1.0 + 1e-9:
        middle = np.sqrt(low * high)
        passive = margin_at(wall, 1.0, middle, grid, whole + fraction)[0] > 0.0
        low, high = (low, middle) if passive else (middle, high)
    if 2e-3 < low < 5e2:
        assert leftover(1.01 * low) > 0.0
        assert leftover(0.99 * low) < 0.0


def test_a_late_display_needs_more_with_a_simulation_behind_the_coupling_than_with_a_wall():
    spring = wall_transfer(1.0, 0.0, 1.0)
    assert least_damping_for_any_simulation(spring, 1.0, delay_samples=1.0).damping == pytest.approx(2.0)
    matrix = two_port(spring, 1.0, 1.6, ANGLES, delay_samples=1)
    assert np.max(structured_singular_value(matrix)) > 1.0
    assert delayed_wall_damping(1.0, 0.0, 1.0, 1) < 1.6


def test_without_any_gain_between_them_every_device_is_passive():
    assert least_damping_for_any_simulation(([0.0], [1.0]), 1e-3).damping == 0.0


def test_a_callable_that_broadcasts_gives_the_margin_of_each_as_alone():
    stiffness, damping, period = np.array([500.0, 1000.0, 2000.0]), np.array([0.2, 0.8, 2.0]), 1e-3

    def springs(z):
        return stiffness[:, None] + 0.1 * (z - 1.0) / (period * z)

    alone = [mu_margin(wall_transfer(k, 0.1, period), period, b) for k, b in zip(stiffness, damping, strict=True)]
    assert mu_margin(springs, period, damping[:, None]) == pytest.approx(alone, rel=1e-9)
    assert alone[0] < 0.0 < alone[1]
