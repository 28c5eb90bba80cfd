# SPDX-License-Identifier: Apache-2.0
"""Exchange methods as laws: what a tank pays, and what is believed of a message."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import exchange_samples, set_position, virtual_coupling

FORCE = st.floats(-50.0, 50.0)
STRETCH = st.floats(-0.1, 0.1)


@given(stiffness=st.floats(1.0, 1e5), limit=st.floats(0.1, 50.0), start=STRETCH, end=STRETCH)
def test_the_store_of_the_clamped_spring_is_the_integral_of_its_force(stiffness, limit, start, end):
    steps = 4000
    way = (end - start) / steps
    work = sum(virtual_coupling.spring_force(stiffness, limit, start + (k + 0.5) * way) * way for k in range(steps))
    grown = virtual_coupling.spring_store(stiffness, limit, end) - virtual_coupling.spring_store(
        stiffness, limit, start
    )
    assert grown == pytest.approx(work, rel=1e-3, abs=stiffness * way * way + 1e-12)


@given(
    stretches=st.lists(STRETCH, min_size=1, max_size=3),
    stiffness=st.floats(1.0, 1e5),
    limit=st.floats(0.1, 50.0),
    available=st.floats(0.0, 1.0),
)
def test_a_shortened_stretch_holds_no_more_than_is_available_and_all_that_can_be_paid_is_kept(
    stretches, stiffness, limit, available
):
    wanted = sum(virtual_coupling.spring_store(stiffness, limit, s) for s in stretches)
    square = sum(0.5 * stiffness * s * s for s in stretches)
    share = set_position.scale_to_available_energy(available, wanted, square)
    held = sum(virtual_coupling.spring_store(stiffness, limit, share * s) for s in stretches)
    assert held <= available * (1.0 + 1e-12) + 1e-300 or share == 1.0
    assert (share == 1.0) == (wanted <= available)
    if max(abs(s) for s in stretches) * stiffness < limit and wanted > available:
        assert held == pytest.approx(available, rel=1e-9, abs=1e-15)


@given(tank=st.floats(0.0, 0.1), force=FORCE, surplus=st.floats(1e-3, 5.0), moved=st.floats(-1e-3, 1e-3))
def test_no_motion_draws_more_from_the_tank_than_it_has_for_the_set_positions_own_velocity(tank, force, surplus, moved):
    period = 0.25e-3
    damped = set_position.damped_draw(force, surplus, period)
    share = set_position.damper_share(tank, damped, damped)
    assert tank - share * force * moved + surplus * moved * moved / period >= -1e-12
    worst = 0.5 * share * force * period / surplus
    if share < 1.0:
        assert tank - share * force * worst + surplus * worst**2 / period == pytest.approx(0.0, abs=1e-12)


@given(tank=st.floats(0.0, 0.01), force=FORCE, surplus=st.floats(0.0, 5.0), way=st.floats(-1.0, 1.0))
def test_nor_does_one_within_the_speed_limit_where_no_damping_is_left(tank, force, surplus, way):
    period, fastest = 0.25e-3, 2.0
    worst = set_position.worst_draw(force, surplus, fastest, period)
    share = set_position.damper_share(tank, worst, set_position.damped_draw(force, surplus, period))
    moved = way * fastest * period
    assert share * force * moved - surplus * moved * moved / period <= tank + 1e-12
    assert worst <= abs(force) * fastest * period and (surplus > 0.0 or worst == abs(force) * fastest * period)


@given(way=st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=16), step=st.floats(0.0, 1e-4))
def test_counted_dissipation_is_never_more_than_what_the_way_dissipates(way, step):
    period, counted, gone, truth = 0.25e-3, 0.0, 0.0, 0.0
    for number, moved in enumerate(way, 1):
        gone, truth = gone + moved, truth + moved * moved / period
        before, counted = counted, set_position.dissipated(counted, gone, step, number * period)
        assert before <= counted <= truth * (1.0 + 1e-9) + 1e-15
    assert set_position.dissipated(0.0, 5e-6, 5e-6, 0.25e-3) == 0.0  # an encoder that flickers by a step
    assert set_position.dissipated(0.0, 10e-6, 5e-6, 0.25e-3) == pytest.approx(25e-12 / 0.25e-3)


@given(before=STRETCH, wanted=STRETCH, moved=st.floats(-1e-3, 1e-3), reach=st.floats(0.0, 1e-3))
def test_the_set_position_changes_the_stretch_by_no_more_than_the_handle_does_and_the_slew(
    before, wanted, moved, reach
):
    after = set_position.slewed(before, wanted, moved, reach)
    assert abs((after - moved) - before) <= abs(moved) + reach + 1e-15
    if min(0.0, moved) - reach <= wanted - before <= max(0.0, moved) + reach:
        assert after == pytest.approx(wanted, abs=1e-15)


def test_a_free_tool_is_foretold_beside_the_handle_as_far_as_its_agility_lets_it():
    straight = set_position.predicted_position(0.010, 0.1, 0.002, 0.03)
    assert straight == pytest.approx(0.0102)
    assert set_position.predicted_beside_handle(straight, 0.01021, 0.0, 0.002, 20.0, 0.004) == pytest.approx(0.01021)
    assert set_position.predicted_beside_handle(straight, 0.02, 0.0, 0.002, 20.0, 0.004) == pytest.approx(0.0102 + 4e-5)
    assert set_position.predicted_position(0.010, 0.1, 1.0, 0.03) == pytest.approx(0.013)
    for trust, share in ((math.inf, 1.0), (0.002, 0.5), (0.0, 0.0)):  # of its force, half at the age of trust
        beside = set_position.predicted_beside_handle(0.01, 0.01, 1e-5, 0.002, 20.0, trust)
        assert beside == pytest.approx(0.01 - share * 1e-5, abs=1e-12)


def test_of_the_energy_that_a_message_brings_only_what_was_sent_is_believed():
    assert exchange_samples.believed(5.0, 1.0, 3.0, 0.0) == 3.0
    assert exchange_samples.believed(5.0, 1.0, 30.0, 0.0) == 4.0
    assert exchange_samples.believed(1.0, 5.0, 30.0, 0.0) == 0.0
    assert exchange_samples.believed(5.0, 0.0, 3.0, 3.0) == 0.0
