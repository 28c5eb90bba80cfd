# SPDX-License-Identifier: Apache-2.0
"""Whole and fractional loop delay: the exact damping, found from below by the worst handle path over a horizon."""

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from adversary.horizon import least_damping_over_horizon
from haptic_device.analysis.delay import (
    delayed_demand,
    largest_passive_stiffness,
    least_damping_delayed,
    wall_damping_needed,
)
from haptic_device.analysis.stability import largest_stable_stiffness
from haptic_device.analysis.transfer import wall_transfer
from haptic_device.control.passivity import least_damping
from reference.closed_forms import delayed_wall_damping, fractionally_delayed_spring_damping

TABLE = {0.1: 0.6354, 0.25: 0.8080, 0.5: 1.0590, 0.75: 1.2864, 1.0: 1.5}
DELAY = st.floats(0.0, 4.0)
DAMPING = st.floats(-2.0, 2.0)


def energy_given(times, path, stiffness, damping, physical_damping, delay):
    """Energy given along a path at constant speeds between `times`, T = 1, by walking through every instant [J]."""
    force_on_handle = written = 0.0
    given, samples, writes = 0.0, {}, {}
    for here, now in enumerate(times[:-1]):
        tick = int(np.floor(now + 1e-9))
        if abs(now - tick) < 1e-9:
            samples[tick] = path[here]
            writes[tick] = -stiffness * path[here] - damping * (path[here] - samples.get(tick - 1, path[here]))
        answered = int(np.floor(now - delay + 1e-9))
        written = writes.get(answered, written)
        force_on_handle = written if answered >= 0 else 0.0
        moved, took = path[here + 1] - path[here], times[here + 1] - now
        given += force_on_handle * moved - physical_damping * moved**2 / took
    return given


@pytest.mark.parametrize("delay, expected", TABLE.items())
def test_a_spring_that_acts_late_needs_what_the_table_says(delay, expected):
    assert wall_damping_needed(1.0, 0.0, 1.0, delay_samples=delay).damping == pytest.approx(expected, abs=5e-5)
    assert fractionally_delayed_spring_damping(1.0, 1.0, delay) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("delay", [0.1, 0.25, 0.5, 0.75])
def test_half_a_period_plus_the_delay_times_the_stiffness_is_not_enough(delay):
    ticks = np.arange(100.0)
    popular = 0.5 + delay
    assert least_damping_over_horizon(1.0, 0.0, 1.0, ticks, ticks + delay).damping > popular * 1.02


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.5, 2.0])
@pytest.mark.parametrize("damping", [0.0, 0.4, -0.4, 2.0])
def test_the_worst_path_of_a_long_horizon_comes_up_to_the_bound_from_below(delay, damping):
    ticks = np.arange(150.0)
    bound = wall_damping_needed(1.0, damping, 1.0, delay_samples=delay).damping
    found = least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks + delay).damping
    assert 0.99 * bound < found < bound * (1.0 + 1e-9)


@pytest.mark.parametrize("delay", [0.3, 1.0, 1.5])
@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_energy_is_found_just_below_the_bound_and_none_just_above(delay, damping):
    ticks = np.arange(120.0)
    bound = wall_damping_needed(1.0, damping, 1.0, delay_samples=delay).damping
    worst = least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks + delay)
    inside = worst.times <= ticks[-1] + delay
    arguments = worst.times[inside], worst.positions[inside], 1.0, damping
    assert energy_given(*arguments, 0.98 * bound, delay) > 0.0
    assert energy_given(*arguments, 1.02 * bound, delay) < 0.0


@pytest.mark.parametrize("late", [0.5, 0.999])
@pytest.mark.parametrize("damping", [-0.3, 0.0, 0.3, 2.0])
def test_no_sequence_of_delays_up_to_the_one_that_is_counted_needs_more_of_a_wall(damping, late):
    rng, ticks = np.random.default_rng(6), np.arange(60.0)
    asked = least_damping(1.0, damping, 1.0, late)
    shares = [np.round(rng.beta(shape, shape, ticks.size), 3) for shape in (0.05, 0.2, 1.0, 5.0)]
    for share in (*shares, ticks % 2, ticks % 3 < 1, ticks % 3 < 2):
        assert least_damping_over_horizon(1.0, damping, 1.0, ticks, ticks + late * share).damping < asked


@few(12)
@given(DAMPING, st.integers(0, 6))
def test_whole_samples_agree_with_the_chebyshev_form(damping, samples):
    found = wall_damping_needed(1.0, damping, 1.0, delay_samples=float(samples)).damping
    assert found == pytest.approx(float(delayed_wall_damping(1.0, damping, 1.0, samples)), rel=1e-9)


@few(12)
@given(DELAY, st.floats(1.0, 1e5), st.floats(1e-4, 1e-2))
def test_a_spring_alone_agrees_with_its_closed_form_for_any_delay(delay, stiffness, period):
    found = wall_damping_needed(stiffness, 0.0, period, delay_samples=delay).damping
    assert found == pytest.approx(fractionally_delayed_spring_damping(stiffness, period, delay), rel=1e-9)


@few(8)
@given(DAMPING, st.integers(0, 3))
def test_the_damping_needed_is_continuous_where_a_fraction_becomes_a_whole_sample(damping, samples):
    before, whole, after = (
        wall_damping_needed(1.0, damping, 1.0, delay_samples=samples + 1 + shift).damping
        for shift in (-1e-9, 0.0, 1e-9)
    )
    assert before == pytest.approx(whole, rel=1e-6)
    assert after == pytest.approx(whole, rel=1e-6)


@few(10)
@given(st.floats(0.05, 0.95), DAMPING, st.floats(0.05, 3.0))
def test_the_demand_is_where_the_two_by_two_energy_form_loses_definiteness(fraction, damping, angle):
    demand = float(delayed_demand(wall_transfer(1.0, damping, 1.0), 1.0, fraction, np.array([angle]))[0])
    z = np.exp(1j * angle)
    work = 0.5 * (np.conj(z) - 1.0) * wall_transfer(1.0, damping, 1.0)(z)

    def smallest(physical_damping):
        own = physical_damping / (fraction * (1.0 - fraction))
        cross = -physical_damping * (1.0 / fraction + z / (1.0 - fraction)) + work
        return np.linalg.eigvalsh(np.array([[own, np.conj(cross)], [cross, own]]))[0]

    assert smallest(demand * 1.001 + 1e-9) > 0.0
    assert smallest(demand * 0.999 - 1e-9) < 0.0


@few(8)
@given(st.floats(0.1, 5.0), st.floats(-0.09, 1.0), DELAY, st.sampled_from([0.0, 1e-3, 2e-2]))
def test_the_largest_passive_stiffness_needs_exactly_the_damping_there_is(physical_damping, damping, delay, lag):
    largest = largest_passive_stiffness(physical_damping, damping, 1e-3, lag, delay)
    if largest == 0.0:
        assert wall_damping_needed(0.0, damping, 1e-3, lag, delay).damping >= physical_damping
        return
    assert wall_damping_needed(0.999 * largest, damping, 1e-3, lag, delay).damping < physical_damping
    assert wall_damping_needed(1.001 * largest, damping, 1e-3, lag, delay).damping > physical_damping


def test_a_little_virtual_damping_helps_a_late_wall_though_it_never_helps_a_prompt_one():
    late = [wall_damping_needed(1.0, damping, 1.0, delay_samples=1.0).damping for damping in (0.0, 0.25, 2.0)]
    prompt = [wall_damping_needed(1.0, damping, 1.0).damping for damping in (0.0, 0.25, 2.0)]
    assert late[1] < late[0] < late[2]
    assert prompt[0] < prompt[1] < prompt[2]


def test_an_unstable_environment_stays_unpassive_however_late():
    assert least_damping_delayed(([1.0], [1.0, -1.1]), 1e-3, 0.5).damping == np.inf


@pytest.mark.parametrize("delay", [-0.1, np.nan, np.inf])
def test_a_delay_that_is_none_is_refused(delay):
    with pytest.raises(ValueError, match="delay_samples is .* samples"):
        wall_damping_needed(1.0, 0.0, 1e-3, delay_samples=delay)


def test_over_a_grid_of_gains_each_answer_is_that_of_its_own_gains():
    stiffness, damping = np.array([100.0, 1000.0]), np.array([[-0.2], [0.0], [0.4]])
    needed = wall_damping_needed(stiffness, damping, 1e-3, 2e-4, 1.5)
    stiffest = {
        "passive": largest_passive_stiffness(2.0, damping, 1e-3, delay_samples=np.array([0.0, 0.5])),
        "stable": largest_stable_stiffness(0.1, 2.0, damping, 1e-3, np.array([0.0, 0.5])),
    }
    for i, j in np.ndindex(3, 2):
        one = wall_damping_needed(stiffness[j], damping[i, 0], 1e-3, 2e-4, 1.5)
        assert (needed.damping[i, j], needed[1][i, j]) == tuple(one)
        late = 0.5 * j
        assert stiffest["passive"][i, j] == largest_passive_stiffness(2.0, damping[i, 0], 1e-3, delay_samples=late)
        assert stiffest["stable"][i, j] == largest_stable_stiffness(0.1, 2.0, damping[i, 0], 1e-3, late)
