# SPDX-License-Identifier: Apache-2.0
"""Walls in a moving hand: what the account says of them, and what it takes back."""

import numpy as np
import pytest
import stalling
from examples import few, half
from hypothesis import given
from hypothesis import strategies as st
from led import Led, line, store
from lockstep_systems import wall_system

from haptic_device.control import faults, gain_check

TICK = 1 / 4000.0
ROUNDING = 1e-9  # [J] against stores of 10 to 100 mJ
BUDGET = 0.005  # [J] exchange.budget


def covered(share, damping, angle, **system):
    """A wall system whose stiffness is this share of what its damping B leaves room for."""
    stiff = (wall_system(k, damping, angle, **system).settings[0] for k in (1e6, 2e6))
    one, two = (gain_check.margins(settings, 0.0)[1] for settings in stiff)
    return wall_system(share * 1e6 * (2.0 * one - two) / (one - two), damping, angle, **system)


def led(stiffness, angle=0.0, **system):
    return Led(wall_system(stiffness, 0.0, angle, counts=1e9, engage__time=TICK, **system).settings)


@few(8)
@given(
    share=st.floats(0.05, 0.98),
    damping=st.floats(0.0, 0.5),
    angle=st.floats(0.0, 360.0),
    counts=st.sampled_from([1e7, 2e5, 2e4]),
)
def test_a_standing_wall_within_the_margin_never_costs_the_account_anything_in_a_moving_hand(
    share, damping, angle, counts
):
    rows = covered(share, damping, angle, counts=counts).run(1.2)
    standing = rows[rows.engage == 1.0]
    assert np.diff(standing.exchange_tank).min() >= -ROUNDING and np.abs(standing.force_on_handle).max() > 1.0


def test_forces_that_rise_while_the_handle_is_off_the_wall_cost_nothing_however_coarse_the_encoder():
    rows = covered(0.98, 0.1, 90.0, counts=2e4).run(0.1)
    assert (rows.exchange_tank + rows.promised).min() >= BUDGET - ROUNDING  # what is kept for a tick comes back


PATHS = st.lists(st.floats(-1e-3, 1e-3), min_size=3, max_size=40)


@given(share=st.floats(0.01, 0.98), damping=st.floats(0.0, 0.9), path=PATHS)
def test_nor_does_it_whatever_the_path(share, damping, path):
    hand = Led(covered(share, damping, 0.0, counts=1e9, engage__time=TICK).settings)
    for place in np.cumsum(path):
        before = hand.free
        hand.go((place,))
        assert hand.free >= before - ROUNDING
    assert hand.most <= ROUNDING


@half(
    "motion, source, estimator, band",
    ["tap", "press_wall"],
    ["model", "measured"],
    ["backward_difference", "lowpass"],
    [0.004, 1e-6],
)
def test_cancellation_that_fades_before_a_wall_within_the_margin_is_paid_however_narrow_the_band(
    motion, source, estimator, band
):
    cancelled = {"cancellation__ratio": 0.9, "cancellation__source": source, "coupling__rotational_damping": 0.0}
    cancelled |= {"cancellation__band": band, "velocity__estimator": estimator}
    for share, damping in ((0.98, 0.0), (0.95, 0.03)):
        system = covered(share, damping, 35.0, motion=motion, **cancelled)
        rows = system.run(1.2)
        assert set(np.unique(rows.cancellation_fade)) >= {0.0, 1.0}
        assert rows.exchange_tank.min() >= -ROUNDING and system.plant_memory["energy_given"][0] <= BUDGET
        if band > 0.001:  # a narrower one costs the wall its first tick
            assert rows.energy_given.sum(axis=1).max() <= ROUNDING
        assert np.abs(rows.force_on_handle).max() > 1.0


@pytest.mark.parametrize("control", [False, True])
def test_a_wall_far_beyond_the_margin_gives_energy_to_a_hand_that_shakes_and_in_debt_it_lets_go_of_as_much(control):
    """30000 N/m on 0.3 N s/m, to and fro by 0.1 mm a tick: 0.28 mJ each time."""
    hand = led(30000.0, passivity__policy="warn", physical_damping=0.3, passivity__control=control)
    hand.follow(line((0.0,), (-3e-4,)))
    for _ in range(100):
        hand.go((-2e-4,))
        hand.go((-3e-4,))
    assert hand.most <= BUDGET if control else hand.most > 4.0 * BUDGET and hand.free < -3.0 * BUDGET


@pytest.mark.parametrize("method, longest", [("wall", 40), ("local", 40), ("pspm", 16)])
def test_missed_ticks_by_the_hundred_give_no_more_than_the_budget_and_much_where_nothing_lets_go(method, longest):
    """A wall, or a tool at one, of 0.95 of its bound; a hold of two periods is beyond."""
    given, rows = stalling.pressed(method, 0.95, 0.05, longest)
    assert np.count_nonzero(np.diff(rows.latched) == 0.0) > 1000  # ticks
    assert np.abs((rows.force_walls + rows.force_coupling)[:, 0]).max() > 1.5
    assert given <= BUDGET
    assert method != "wall" or stalling.pressed("wall", 0.95, 0.05, 40, control=False)[0] > 0.02


@pytest.mark.parametrize("axes, angle", [(2, 0.0), (1, 0.0), (1, 360.0)])  # sin 360° is not 0 by rounding
def test_a_wall_that_a_missed_tick_left_owing_is_weaker_by_that_energy_and_whole_again_once_left(axes, angle):
    stiffness, depth, step = 0.9 * 2.0 / TICK, 1e-3, 4e-4
    hand = led(stiffness, angle, axes=axes, exchange__budget=1e-6)
    for k in range(11):
        assert hand.go((-0.1 * depth * k,))[0] == pytest.approx(0.1 * stiffness * depth * k)
    made = 0.5 * stiffness * step**2 - step**2 / (3.0 * TICK)  # leak of the hold, less what the damper took for certain
    owed, stored = made - hand.free, store(stiffness, 15.0, depth + step)
    weaker = stiffness * (depth + step) * (1.0 - owed / stored)
    assert owed > 0.02 * stored
    assert hand.go((-depth - step,), 3.0)[0] == pytest.approx(weaker, rel=1e-3)
    assert hand.go((-depth - step,))[0] == pytest.approx(weaker, rel=1e-3)
    assert hand.go((step,))[0] == 0.0
    assert hand.go((-depth,))[0] == pytest.approx(stiffness * depth)


def test_a_wall_left_from_the_motors_limit_in_one_long_hold_gives_that_once_and_is_not_there_until_it_is_paid():
    hand, given = led(7000.0), []
    for _ in range(4):
        for depth in np.linspace(-1e-3, 3.4e-3, 200):
            hand.go((-depth,))
        hand.go((1e-3,), 40.0)
        given.append(hand.given)
    assert given[0] > 0.01 and max(given) == given[0]
    assert hand.free < 0.0 and hand.go((-1e-3,))[0] == 0.0


@pytest.mark.parametrize("depth, periods", [(1.5e-3, 1.0), (8e-3, 800.0)])
def test_a_device_that_cut_its_motor_owes_nothing(depth, periods):
    hand = led(7000.0)
    hand.go((-1e-3,))
    cut = {"fault": faults.DEVICE_WATCHDOG, "device_status": faults.FRESH | faults.WATCHDOG}
    hand.go((-depth,), periods, **cut)
    hand.go((-depth,), fault=faults.DEVICE_WATCHDOG)
    assert hand.free >= 0.0


def test_who_lets_go_and_engages_anew_owes_what_was_given_and_nothing_that_was_booked_beyond():
    hand = led(7000.0)
    hand.go((-1e-3,))
    hand.go((-8e-3,), 40.0)
    assert 0.0 < hand.row.force_on_handle[0, 0] < 15.0
    hand.follow([(-8e-3,)])
    for _ in range(4):
        hand.go((-8e-3,), command=0)
    assert hand.given < 0.0 <= hand.free


@pytest.mark.parametrize("damping", [0.01, 0.3, 1.0])
@pytest.mark.parametrize("part", [0.25, 0.9])
def test_the_best_way_under_two_forces_in_a_hold_is_booked_but_none_beyond_the_speed_limit(part, damping):
    """A wall of 70 N/m is let go 30 mm deep, and the motor's write acts only after a part of the period."""
    hand = led(70.0, physical_damping=damping).follow(line((0.0,), (-0.03,)))
    force, before = hand.forces[-1][0], float(hand.row.energy_given[0, 0])
    hand.go((-0.03,), command=0)
    hand.go((-0.03,), command=0, write_delay=part * TICK)
    square = part * (1.0 - part) * force**2 * TICK  # of both forces about their mean
    most = min(square / (4.0 * damping), 10.0 * np.sqrt(square * TICK))
    assert force == pytest.approx(2.1) and hand.row.energy_given[0, 0] - before == pytest.approx(most, rel=1e-6)


def test_booked_energy_follows_the_truth_of_a_press():
    system = wall_system(3000.0, 0.2, motion="press_wall")
    rows = system.run(1.2)
    truth = system.plant_memory["energy_given"][0]
    assert rows.energy_given[-1].sum() == pytest.approx(truth, rel=0.02)
    assert np.all(rows.fault == 0)
