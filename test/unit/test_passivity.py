# SPDX-License-Identifier: Apache-2.0
"""Condition (1) and its closed forms: just above the least damping nothing is given, just below something is."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from adversary.horizon import least_damping_over_horizon
from haptic_device.analysis.assessment import coulomb_friction_needed
from haptic_device.analysis.passivity import damping_demand, least_damping
from haptic_device.analysis.transfer import wall_transfer
from reference.closed_forms import (
    delayed_wall_damping,
    lagged_wall_damping,
    late_tick_damping,
    late_write_damping,
    wall_damping,
)

DRAWS = 2000
STIFFNESS = st.floats(1.0, 1e5)
DAMPING = st.floats(-50.0, 50.0)
PERIOD = st.floats(1e-4, 1e-2)


def random_walls(seed):
    """Stiffness, damping of either sign, period and velocity lag, one draw a row, each with a trailing axis of one."""
    rng = np.random.default_rng(seed)
    period = 10.0 ** rng.uniform(-4.5, -2.0, (DRAWS, 1))
    stiffness = 10.0 ** rng.uniform(0.0, 5.0, (DRAWS, 1))
    damping = rng.choice([-1.0, 1.0], (DRAWS, 1)) * 10.0 ** rng.uniform(-3.0, 2.0, (DRAWS, 1))
    return stiffness, damping, period, period * 10.0 ** rng.uniform(-1.0, 2.5, (DRAWS, 1))


def relative_error(found, expected):
    return np.max(np.abs(found / np.squeeze(expected) - 1.0))


def energy_given(path, stiffness, damping, physical_damping, period):
    """Energy a wall gives along a path of equal ticks at constant speeds, summed tick by tick [J]."""
    given, last = 0.0, path[0]
    for here, after in zip(path[:-1], path[1:], strict=True):
        force_on_handle = -stiffness * here - damping * (here - last) / period
        given += force_on_handle * (after - here) - physical_damping * (after - here) ** 2 / period
        last = here
    return given


def test_condition_agrees_with_the_closed_form_of_the_wall_for_damping_of_either_sign():
    stiffness, damping, period, _ = random_walls(1)
    found = least_damping(lambda z: stiffness + damping * (z - 1.0) / (period * z), period)
    assert relative_error(found.damping, wall_damping(stiffness, damping, period)) < 1e-9


def test_condition_agrees_with_the_closed_form_of_a_lagging_velocity():
    stiffness, damping, period, lag = random_walls(2)
    share = period / (period + lag)
    found = least_damping(lambda z: stiffness + damping / period * share * (z - 1.0) / (z - 1.0 + share), period)
    assert relative_error(found.damping, lagged_wall_damping(stiffness, damping, period, lag)) < 1e-9


def test_condition_agrees_with_the_chebyshev_form_of_whole_samples_of_delay():
    stiffness, damping, period, _ = random_walls(3)
    samples = np.random.default_rng(3).integers(0, 12, (DRAWS, 1))
    found = least_damping(lambda z: (stiffness + damping * (z - 1.0) / (period * z)) * z**-samples, period)
    assert relative_error(found.damping, delayed_wall_damping(stiffness, damping, period, samples)) < 1e-9


def test_coefficients_and_callable_describe_the_same_wall():
    for row in zip(*(part[:50, 0] for part in random_walls(4)), strict=True):
        stiffness, damping, period, lag = (float(value) for value in row)
        wall = wall_transfer(stiffness, damping, period, lag, delay_samples=2)
        by_pair = least_damping((wall.numerator, wall.denominator), period).damping
        assert by_pair == pytest.approx(least_damping(lambda z, wall=wall: wall(z), period).damping, rel=1e-12)


@pytest.mark.parametrize(
    "samples, expected",
    [
        (0, [0.5, 0.75, 1.0, 1.5, 2.5]),
        (1, [1.5, 1.25, 1.25, 1.625, 2.5625]),
        (2, [2.5, 2.25, 2.0, 1.9397, 2.7034]),
        (5, [5.5, 5.25, 5.0, 4.5, 3.7999]),
    ],
)
def test_delay_of_whole_samples_costs_what_the_table_says(samples, expected):
    found = delayed_wall_damping(1.0, [0.0, 0.25, 0.5, 1.0, 2.0], 1.0, samples)
    assert found == pytest.approx(expected, abs=5e-5)


def test_positive_damping_binds_at_half_the_sample_rate_and_negative_damping_at_rest():
    assert least_damping(wall_transfer(1e3, 0.2, 1e-3), 1e-3).frequency == pytest.approx(np.pi / 1e-3, rel=1e-6)
    assert least_damping(wall_transfer(1e3, -0.2, 1e-3), 1e-3).frequency == 0.0


@pytest.mark.parametrize("damping", [0.3, -0.3, 0.0])
def test_energy_is_found_just_below_the_bound_and_none_just_above(damping):
    bound, ticks = float(wall_damping(1000.0, damping, 1e-3)), np.arange(120) * 1e-3
    worst = least_damping_over_horizon(1000.0, damping, 1e-3, ticks, ticks)
    assert energy_given(worst.positions, 1000.0, damping, 0.99 * bound, 1e-3) > 0.0
    assert energy_given(worst.positions, 1000.0, damping, 1.01 * bound, 1e-3) < 0.0
    assert 0.99 * bound < worst.damping < 1.0001 * bound


def test_a_narrow_resonance_in_the_environment_is_not_missed():
    pole = (1.0 - 1e-5) * np.exp(0.7j)
    resonator = ([1e-3, 0.0, 0.0], [1.0, -2.0 * pole.real, abs(pole) ** 2])
    around = 0.7 + np.linspace(-1e-4, 1e-4, 400001)
    brute = np.max(damping_demand(lambda z: np.polyval(resonator[0], z) / np.polyval(resonator[1], z), 1e-3, around))
    assert least_damping(resonator, 1e-3).damping == pytest.approx(brute, rel=1e-8)


def test_an_environment_unstable_by_itself_has_no_damping_that_is_enough():
    assert least_damping(([1.0], [1.0, -1.0001]), 1e-3).damping == np.inf
    assert least_damping(([1.0], [1.0, -0.9999]), 1e-3).damping < np.inf


@few(10)
@given(STIFFNESS, DAMPING, PERIOD, st.floats(0.1, 10.0))
def test_scaling_all_gains_scales_the_damping_needed(stiffness, damping, period, factor):
    once = least_damping(wall_transfer(stiffness, damping, period), period).damping
    scaled = least_damping(wall_transfer(factor * stiffness, factor * damping, period), period).damping
    assert scaled == pytest.approx(factor * once, rel=1e-9)


@few(10)
@given(STIFFNESS, DAMPING, STIFFNESS, DAMPING, st.integers(0, 4))
def test_two_walls_together_never_need_more_than_the_sum_of_both(first, damping, second, other, delay):
    period = 1e-3
    parts = [wall_transfer(first, damping, period, 0.0, delay), wall_transfer(second, other, period, 0.002, delay)]
    together = least_damping(lambda z: parts[0](z) + parts[1](z), period).damping
    assert together <= sum(least_damping(part, period).damping for part in parts) * (1.0 + 1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("lag", [0.0, 2e-3])
def test_friction_just_covers_the_worst_rounding_of_the_encoder(damping, lag):
    stiffness, period, step = 500.0, 1e-3, 1e-5
    response = np.zeros(200)
    velocity, share, last = 0.0, period / (period + lag), 0.0
    for tick, position in enumerate(np.eye(1, 200)[0]):
        velocity += share * ((position - last) / period - velocity)
        response[tick], last = stiffness * position + damping * velocity, position
    worst_force = np.sum(np.abs(response)) * step / 2.0
    assert coulomb_friction_needed(stiffness, damping, period, step, lag) == pytest.approx(worst_force, rel=1e-9)


def tremor_energy(friction, excursion=1e-9, ticks=1000):
    """Energy given while the handle crosses one encoder edge to and fro at every tick (K = 500, B = 0.2)."""
    stiffness, damping, period, step = 500.0, 0.2, 1e-3, 1e-5
    path = 0.5 * excursion * (-1.0) ** np.arange(ticks)
    counted = step * np.round(path / step + 0.5)
    force_on_handle = -stiffness * counted[1:-1] - damping * np.diff(counted[:-1]) / period
    moved = np.diff(path[1:])
    lost = friction * np.abs(moved) + wall_damping(stiffness, damping, period) * moved**2 / period
    return np.sum(force_on_handle * moved - lost)


def test_an_encoder_edge_feeds_a_tremor_just_below_the_friction_needed_and_not_just_above():
    needed = coulomb_friction_needed(500.0, 0.2, 1e-3, 1e-5)
    assert tremor_energy(0.99 * needed) > 0.0
    assert tremor_energy(1.01 * needed) < 0.0


@pytest.mark.parametrize("damping", [0.0, 0.3, -0.3])
def test_sampling_and_writing_late_together_counts_by_the_longest_period(damping):
    rng = np.random.default_rng(5)
    bound = late_tick_damping(1.0, damping, 1.0, 1.3)
    always = np.arange(200) * 1.3
    assert least_damping_over_horizon(1.0, damping, 1.0, always, always).damping == pytest.approx(bound, rel=2e-3)
    for _ in range(20):
        ticks = np.cumsum(rng.choice([0.7, 1.0, 1.3], 60))
        assert least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks).damping < bound * (1.0 + 1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("lateness", [0.1, 0.5])
def test_no_sequence_of_late_writes_needs_more_than_the_bound(damping, lateness):
    rng, ticks = np.random.default_rng(6), np.arange(60.0)
    bound = late_write_damping(1.0, damping, 1.0, lateness)
    for shape in (1.0, 0.2, 5.0, 0.5):
        late = ticks + lateness * rng.beta(shape, shape, 60)
        assert least_damping_over_horizon(1.0, damping, 1.0, ticks, late).damping < bound * (1.0 + 1e-9)


def test_writing_late_by_a_tenth_costs_more_than_a_period_longer_by_a_tenth():
    ticks = np.arange(200.0)
    worst = least_damping_over_horizon(1.0, 0.0, 1.0, ticks, ticks + 0.1).damping
    assert late_tick_damping(1.0, 0.0, 1.0, 1.1) == pytest.approx(0.55)
    assert worst == pytest.approx(late_write_damping(1.0, 0.0, 1.0, 0.1), rel=1e-3)
    assert worst > 1.15 * 0.55


@pytest.mark.parametrize(
    "wrong, sentence",
    [
        (lambda: least_damping(([1.0], [1.0]), 0.0), "period is 0 s"),
        (lambda: least_damping(([1.0], [1.0]), np.nan), "period is nan s"),
        (lambda: least_damping(([1.0], [0.0]), 1.0), "denominator must not be zero"),
        (lambda: least_damping(([np.inf], [1.0]), 1.0), "must be finite numbers"),
        (lambda: wall_transfer(np.nan, 0.0, 1e-3), "stiffness is nan N/m"),
        (lambda: wall_transfer(1.0, 0.0, 1e-3, delay_samples=0.5), "whole number of samples"),
        (lambda: late_write_damping(1.0, 0.0, 1.0, 0.6), "lateness is 0.6 s, but it must lie between 0 and 0.5 s"),
        (lambda: least_damping_over_horizon(1.0, 0.0, 1.0, [0.0, 1.0], [0.5, 0.4]), "times must rise"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(wrong, sentence):
    with pytest.raises(ValueError, match=sentence):
        wrong()
