# SPDX-License-Identifier: Apache-2.0
"""Condition (1) with any delay: closed forms, and the worst path of a horizon, which finds a leak just below only."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from adversary.horizon import least_damping_over_horizon
from bench.reference.closed_forms import (
    delayed_wall_damping,
    fractionally_delayed_spring_damping,
    lagged_wall_damping,
    late_tick_damping,
    wall_damping,
)
from haptic_device.control import passivity
from haptic_device.theory.assessment import coulomb_friction_needed
from haptic_device.theory.delay import largest_passive_stiffness, least_damping_delayed, wall_damping_needed
from haptic_device.theory.passivity import damping_demand, least_damping
from haptic_device.theory.stability import largest_stable_stiffness
from haptic_device.theory.transfer import wall_transfer

DRAWS = 500  # `python -m bench theory`: 2000
STIFFNESS = st.floats(1.0, 1e5)
DAMPING = st.floats(-2.0, 2.0)
DELAY = st.floats(0.0, 4.0)
TABLE = {
    0.0: {0.0: 0.5, 0.25: 0.75, 1.0: 1.5, -0.25: 0.75},
    1.0: {0.0: 1.5, 0.25: 1.25, 1.0: 1.625},
    2.0: {0.0: 2.5, 0.25: 2.25, 1.0: 1.9397, 2.0: 2.7034},
    0.1: {0.0: 0.6354},
    0.25: {0.0: 0.8080},
    0.5: {0.0: 1.0590},
    0.75: {0.0: 1.2864},
}
"""{delay [T]: {B [KT]: least b [KT]}}"""


def energy_given(worst, damping, physical_damping, delay):
    """Energy given along a worst path at constant speeds, K = T = 1, by walking through every instant [J]."""
    force_on_handle = written = 0.0
    given, samples, writes, (_, times, path) = 0.0, {}, {}, worst
    for here, now in enumerate(times[:-1]):
        tick = int(np.floor(now + 1e-9))
        if abs(now - tick) < 1e-9:
            samples[tick] = path[here]
            writes[tick] = -path[here] - damping * (path[here] - samples.get(tick - 1, path[here]))
        answered = int(np.floor(now - delay + 1e-9))
        written = writes.get(answered, written)
        force_on_handle = written if answered >= 0 else 0.0
        moved, took = path[here + 1] - path[here], times[here + 1] - now
        given += force_on_handle * moved - physical_damping * moved**2 / took
    return given


def test_condition_agrees_with_the_closed_forms_of_wall_lagging_velocity_and_whole_samples_of_delay():
    rng = np.random.default_rng(1)
    period, stiffness = 10.0 ** rng.uniform(-4.5, -2.0, (DRAWS, 1)), 10.0 ** rng.uniform(0.0, 5.0, (DRAWS, 1))
    damping = rng.choice([-1.0, 1.0], (DRAWS, 1)) * 10.0 ** rng.uniform(-3.0, 2.0, (DRAWS, 1))
    lag, samples = period * 10.0 ** rng.uniform(-1.0, 2.5, (DRAWS, 1)), rng.integers(0, 12, (DRAWS, 1))
    share = period / (period + lag)

    def wall(z, share=1.0):
        return stiffness + damping / period * share * (z - 1.0) / (z - 1.0 + share)

    for transfer, expected in (
        (wall, wall_damping(stiffness, damping, period)),
        (lambda z: wall(z, share), lagged_wall_damping(stiffness, damping, period, lag)),
        (lambda z: wall(z) * z**-samples, delayed_wall_damping(stiffness, damping, period, samples)),
    ):
        assert least_damping(transfer, period).damping == pytest.approx(np.squeeze(expected), rel=1e-9)
    for row in zip(*(part[:20, 0].tolist() for part in (stiffness, damping, period, lag)), strict=True):
        pair = wall_transfer(*row, delay_samples=2)
        by_coefficients = least_damping((pair.numerator, pair.denominator), row[2]).damping
        assert by_coefficients == pytest.approx(least_damping(lambda z, pair=pair: pair(z), row[2]).damping, rel=1e-12)


def test_delay_costs_what_the_table_says():
    """More than (½ + delay) K T for a fraction of a sample; a little damping helps a wall that is late."""
    for delay, row in TABLE.items():
        for damping, expected in row.items():
            found = wall_damping_needed(1.0, damping, 1.0, delay_samples=delay).damping
            assert found == pytest.approx(expected, abs=5e-5), (delay, damping)


@few(12)
@given(DELAY, STIFFNESS, st.floats(1e-4, 1e-2), DAMPING)
def test_any_delay_of_a_spring_and_whole_samples_of_a_wall_agree_with_their_closed_forms(
    delay, stiffness, period, damping
):
    spring = wall_damping_needed(stiffness, 0.0, period, delay_samples=delay).damping
    assert spring == pytest.approx(fractionally_delayed_spring_damping(stiffness, period, delay), rel=1e-9)
    samples = int(delay)
    beside = [wall_damping_needed(1.0, damping, 1.0, delay_samples=samples + s).damping for s in (0.0, 1e-9)]
    assert beside[0] == pytest.approx(float(delayed_wall_damping(1.0, damping, 1.0, samples)), rel=1e-9)
    assert beside[1] == pytest.approx(beside[0], rel=1e-6)


def test_positive_damping_binds_at_half_the_sample_rate_and_negative_damping_at_rest():
    assert least_damping(wall_transfer(1e3, 0.2, 1e-3), 1e-3).frequency == pytest.approx(np.pi / 1e-3, rel=1e-6)
    assert least_damping(wall_transfer(1e3, -0.2, 1e-3), 1e-3).frequency == 0.0


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 1.5])
@pytest.mark.parametrize("damping", [0.0, 0.4, -0.4, 2.0])
def test_the_worst_path_of_a_horizon_draws_energy_just_below_the_bound_and_none_just_above(delay, damping):
    ticks = np.arange(120.0)
    bound = wall_damping_needed(1.0, damping, 1.0, delay_samples=delay).damping
    worst = least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks + delay)
    assert 0.98 * bound < worst.damping < bound * (1.0 + 1e-9)
    assert energy_given(worst, damping, 0.98 * bound, delay) > 0.0 > energy_given(worst, damping, 1.02 * bound, delay)


@pytest.mark.parametrize("late", [0.1, 0.5, 0.999])
@pytest.mark.parametrize("damping", [-0.3, 0.0, 0.3, 2.0])
def test_no_sequence_of_delays_up_to_the_one_that_is_counted_needs_more_of_a_wall(damping, late):
    rng, ticks = np.random.default_rng(6), np.arange(60.0)
    asked = passivity.least_damping(1.0, damping, 1.0, late)
    shares = [np.round(rng.beta(shape, shape, ticks.size), 3) for shape in (0.05, 0.2, 1.0, 5.0)]
    for share in (*shares, ticks % 2, ticks % 3 < 1, ticks % 3 < 2):
        assert least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks + late * share).damping < asked


@pytest.mark.parametrize("damping", [0.0, 0.3, -0.3])
def test_sampling_and_writing_late_together_counts_by_the_longest_period(damping):
    rng = np.random.default_rng(5)
    bound = late_tick_damping(1.0, damping, 1.0, 1.3)
    always = np.arange(200) * 1.3
    assert least_damping_over_horizon(1.0, damping, 1.0, always, always).damping == pytest.approx(bound, rel=2e-3)
    for _ in range(10):
        ticks = np.cumsum(rng.choice([0.7, 1.0, 1.3], 60))
        assert least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks).damping < bound * (1.0 + 1e-9)


@few(8)
@given(st.floats(0.1, 5.0), st.floats(-0.09, 1.0), DELAY, st.sampled_from([0.0, 1e-3, 2e-2]))
def test_the_largest_passive_stiffness_needs_exactly_the_damping_there_is(physical_damping, damping, delay, lag):
    largest = largest_passive_stiffness(physical_damping, damping, 1e-3, lag, delay)
    if largest == 0.0:
        assert wall_damping_needed(0.0, damping, 1e-3, lag, delay).damping >= physical_damping
        return
    assert wall_damping_needed(0.999 * largest, damping, 1e-3, lag, delay).damping < physical_damping
    assert wall_damping_needed(1.001 * largest, damping, 1e-3, lag, delay).damping > physical_damping


@few(10)
@given(STIFFNESS, DAMPING, STIFFNESS, DAMPING, st.integers(0, 4))
def test_two_walls_together_never_need_more_than_the_sum_of_both(first, damping, second, other, delay):
    parts = [wall_transfer(first, damping, 1e-3, 0.0, delay), wall_transfer(second, other, 1e-3, 0.002, delay)]
    together = least_damping(lambda z: parts[0](z) + parts[1](z), 1e-3).damping
    assert together <= sum(least_damping(part, 1e-3).damping for part in parts) * (1.0 + 1e-9)


def test_a_narrow_resonance_in_the_environment_is_not_missed():
    pole = (1.0 - 1e-5) * np.exp(0.7j)
    resonator = ([1e-3, 0.0, 0.0], [1.0, -2.0 * pole.real, abs(pole) ** 2])
    around = 0.7 + np.linspace(-1e-4, 1e-4, 400001)
    brute = np.max(damping_demand(lambda z: np.polyval(resonator[0], z) / np.polyval(resonator[1], z), 1e-3, around))
    assert least_damping(resonator, 1e-3).damping == pytest.approx(brute, rel=1e-8)


def test_an_environment_unstable_by_itself_has_no_damping_that_is_enough_however_late():
    assert least_damping(([1.0], [1.0, -0.9999]), 1e-3).damping < np.inf
    assert least_damping(([1.0], [1.0, -1.0001]), 1e-3).damping == np.inf
    assert least_damping_delayed(([1.0], [1.0, -1.1]), 1e-3, 0.5).damping == np.inf


@pytest.mark.parametrize(("damping", "lag"), [(0.0, 0.0), (0.2, 2e-3), (-0.2, 0.0)])
def test_friction_just_covers_the_worst_rounding_of_the_encoder(damping, lag):
    stiffness, period, step = 500.0, 1e-3, 1e-5
    response, velocity, share, last = [], 0.0, period / (period + lag), 0.0
    for position in np.eye(1, 200)[0]:
        velocity += share * ((position - last) / period - velocity)
        response.append(stiffness * position + damping * velocity)
        last = position
    worst_force = np.sum(np.abs(response)) * step / 2.0
    assert coulomb_friction_needed(stiffness, damping, period, step, lag) == pytest.approx(worst_force, rel=1e-9)


def test_an_encoder_edge_feeds_a_tremor_just_below_the_friction_needed_and_not_just_above():
    """The handle crosses one edge to and fro by a nanometre at every tick; K = 500, B = 0.2."""
    stiffness, damping, period, step = 500.0, 0.2, 1e-3, 1e-5
    path = 0.5e-9 * (-1.0) ** np.arange(1000)
    counted, moved = step * np.round(path / step + 0.5), np.diff(path[1:])
    force_on_handle = -stiffness * counted[1:-1] - damping * np.diff(counted[:-1]) / period
    viscous = wall_damping(stiffness, damping, period) * moved**2 / period
    needed = coulomb_friction_needed(stiffness, damping, period, step)
    below, above = (
        np.sum(force_on_handle * moved - share * needed * np.abs(moved) - viscous) for share in (0.99, 1.01)
    )
    assert below > 0.0 > above


def test_over_a_grid_of_gains_each_answer_is_that_of_its_own_gains():
    stiffness, damping, late = np.array([100.0, 1000.0]), np.array([[-0.2], [0.4]]), np.array([0.0, 0.5])
    needed = wall_damping_needed(stiffness, damping, 1e-3, 2e-4, 1.5)
    passive = largest_passive_stiffness(2.0, damping, 1e-3, delay_samples=late)
    stable = largest_stable_stiffness(0.1, 2.0, damping, 1e-3, late)
    for i, j in np.ndindex(2, 2):
        one = wall_damping_needed(stiffness[j], damping[i, 0], 1e-3, 2e-4, 1.5)
        assert (needed.damping[i, j], needed[1][i, j]) == tuple(one)
        assert passive[i, j] == largest_passive_stiffness(2.0, damping[i, 0], 1e-3, delay_samples=late[j])
        assert stable[i, j] == largest_stable_stiffness(0.1, 2.0, damping[i, 0], 1e-3, late[j])


@pytest.mark.parametrize(
    "wrong, sentence",
    [
        (lambda: least_damping(([1.0], [1.0]), 0.0), "period is 0 s"),
        (lambda: least_damping(([1.0], [1.0]), np.nan), "period is nan s"),
        (lambda: least_damping(([1.0], [0.0]), 1.0), "denominator must not be zero"),
        (lambda: least_damping(([np.inf], [1.0]), 1.0), "must be finite numbers"),
        (lambda: wall_transfer(np.nan, 0.0, 1e-3), "stiffness is nan N/m"),
        (lambda: wall_transfer(1.0, 0.0, 1e-3, delay_samples=0.5), "whole number of samples"),
        (lambda: wall_damping_needed(1.0, 0.0, 1e-3, delay_samples=-0.1), "delay_samples is -0.1 samples"),
        (lambda: wall_damping_needed(1.0, 0.0, 1e-3, delay_samples=np.inf), "delay_samples is inf samples"),
        (lambda: largest_stable_stiffness(0.0, 0.5, 0.0, 1e-3), "mass is 0 kg"),
        (lambda: largest_stable_stiffness(0.1, -1.0, 0.0, 1e-3), "physical_damping is -1 N s/m"),
        (lambda: largest_stable_stiffness(0.1, 0.5, 0.0, 0.0), "period is 0"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(wrong, sentence):
    with pytest.raises(ValueError, match=sentence):
        wrong()
