# SPDX-License-Identifier: Apache-2.0
"""The operator's scripts: smooth, from where they should begin to where they should end, and over in their time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.device import operator_hand
from haptic_device.parameter_types import defaults
from haptic_device.parameters import OPERATOR, SCRIPTS

START, ABOVE, TARGET = (0.01, 0.05, 0.1), (0.03, 0.05, 0.1), (0.03, -0.02, -0.2)


def script(name, **given):
    values = defaults(OPERATOR)
    values |= {
        "motion.name": name,
        "motion.start": START,
        "motion.target": TARGET,
        "motion.waypoints": (*ABOVE, *TARGET),
    }
    return operator_hand.script(values | {f"motion.{key}": value for key, value in given.items()})[0]


def at(motion, time):
    target = np.zeros(3)
    grip = operator_hand.target_at(motion, time, target)
    return target, grip


def path(motion, count=4001):
    times = np.linspace(0.0, motion["duration"], count)
    return times, np.array([at(motion, time)[0] for time in times])


ENDS = {
    "hold": START,
    "insert_peg": TARGET,
    "press_wall": START,
    "tap": START,
    "circle": START,
    "let_go": TARGET,
    "waypoints": TARGET,
}


@pytest.mark.parametrize("name", ENDS)
def test_a_script_leads_from_its_start_to_its_end_and_stays_there(name):
    motion = script(name, duration=3.0)
    assert at(motion, 0.0)[0] == pytest.approx(START, abs=1e-12)
    for time in (3.0, 3.1, 1000.0):
        assert at(motion, time)[0] == pytest.approx(ENDS[name], abs=1e-12)


@pytest.mark.parametrize("name", ENDS)
def test_a_script_begins_and_ends_at_rest_and_its_velocity_has_no_step(name):
    times, points = path(script(name, duration=3.0, turns=1.0, taps=3))
    velocity = np.diff(points, axis=0) / np.diff(times)[:, None]
    largest = np.abs(velocity).max() + 1e-12
    assert np.abs(velocity[[0, -1]]).max() < 0.02 * largest
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.03 * largest


def test_every_script_but_follow_is_here():
    assert set(SCRIPTS) == {*ENDS, "follow"}


def test_between_waypoints_the_hand_moves_with_least_jerk():
    motion = script("insert_peg", duration=5.0)
    above = np.array([TARGET[0], START[1], TARGET[2]])
    for fraction in (0.1, 0.25, 0.5, 0.9):
        s = 10 * fraction**3 - 15 * fraction**4 + 6 * fraction**5
        assert at(motion, fraction * 1.0)[0] == pytest.approx(np.array(START) + s * (above - START))
    peak = np.diff([at(motion, t)[0][0] for t in (0.5 - 1e-4, 0.5 + 1e-4)])[0] / 2e-4
    assert peak == pytest.approx(1.875 * (above - START)[0], rel=1e-4)


def test_between_waypoints_of_its_own_the_hand_takes_time_by_the_way_and_stops_at_each():
    turn = 0.05 * 0.3  # m that 0.3 rad count as
    motion, first, second = script("waypoints", duration=3.0), 0.02, math.hypot(0.07, turn)
    reached = 3.0 * first / (first + second)
    assert at(motion, reached)[0] == pytest.approx(ABOVE)
    assert at(motion, reached / 2)[0] == pytest.approx(np.add(START, ABOVE) / 2)
    speed = np.linalg.norm(at(motion, reached + 1e-4)[0] - at(motion, reached - 1e-4)[0]) / 2e-4
    assert speed < 1e-3
    assert at(script("waypoints", waypoints=START), 1.0)[0] == pytest.approx(START)


@pytest.mark.parametrize(
    ("waypoints", "sentence"),
    [
        ((), "motion.waypoints has 0 numbers; write 3 for each waypoint: x, y, theta"),
        ((0.0,) * 4, "motion.waypoints has 4 numbers; write 3 for each waypoint: x, y, theta"),
        ((0.0,) * 96, "motion.waypoints names 32 waypoints; the limit is 31"),
    ],
)
def test_waypoints_of_a_wrong_length_are_refused_in_one_sentence(waypoints, sentence):
    assert at(script("waypoints", waypoints=(0.0,) * 90 + TARGET), 9.0)[0] == pytest.approx(TARGET)  # 31 are taken
    with pytest.raises(ValueError) as refusal:
        script("waypoints", waypoints=waypoints)
    assert str(refusal.value) == sentence


def test_the_peg_comes_from_straight_above_its_hole():
    times, points = path(script("insert_peg"))
    down = points[:, 1] < START[1] - 1e-9
    assert points[down][:, [0, 2]] == pytest.approx(np.tile(np.array(TARGET)[[0, 2]], (down.sum(), 1)))


@pytest.mark.parametrize("taps", [1, 5, 15])
def test_tap_reaches_its_target_as_often_as_asked(taps):
    times, points = path(script("tap", taps=taps), 40 * taps + 1)
    there = np.isclose(points[:, 0], TARGET[0], atol=1e-9)
    assert np.sum(there[1:] & ~there[:-1]) == taps


def test_the_circle_has_its_radius_and_starts_at_its_rightmost_point():
    times, points = path(script("circle", radius=0.02, turns=3.0))
    centre = np.array(START)[:2] - [0.02, 0.0]
    assert np.hypot(*(points[:, :2] - centre).T) == pytest.approx(np.full(len(times), 0.02))
    angle = np.unwrap(np.arctan2(*(points[:, :2] - centre).T[::-1]))
    assert angle[-1] - angle[0] == pytest.approx(2 * math.pi * 3.0)
    assert np.all(np.diff(angle) >= -1e-12)
    assert np.all(points[:, 2] == START[2])


def test_the_hand_lets_go_at_half_time_only_where_the_script_says_so():
    motion = script("let_go", duration=4.0)
    assert at(motion, 2.0 - 1e-9)[1] == 1.0 and at(motion, 2.0)[1] == at(motion, 99.0)[1] == 0.0
    for name in set(ENDS) - {"let_go"}:
        assert {at(script(name), time)[1] for time in (0.0, 2.0, 4.0, 9.0)} == {1.0}


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1e-3, 1.0), st.floats(0.0, 0.1))
def test_a_followed_goal_is_approached_behind_a_first_order_lag_in_one_step_or_in_two(goal, target, lag, elapsed):
    once = operator_hand.follow(goal, target, lag, elapsed)
    twice = operator_hand.follow(goal, operator_hand.follow(goal, target, lag, elapsed / 2), lag, elapsed / 2)
    assert once == pytest.approx(twice, abs=1e-12)
    assert abs(once - goal) == pytest.approx(abs(target - goal) * math.exp(-elapsed / lag), abs=1e-12)


@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
def test_least_jerk_rises_from_none_to_all_and_never_turns_back(one, two):
    low, high = operator_hand.minimum_jerk(min(one, two)), operator_hand.minimum_jerk(max(one, two))
    assert 0.0 <= low <= high + 1e-15 and high <= 1.0 + 1e-15
    assert operator_hand.minimum_jerk(0.0) == 0.0 and operator_hand.minimum_jerk(1.0) == 1.0


@pytest.mark.parametrize("name", ["start", "target"])
def test_a_place_with_too_few_numbers_is_refused_in_one_sentence(name):
    with pytest.raises(ValueError, match=rf"motion\.{name} has 2 numbers; write 3: x, y, theta"):
        script("hold", **{name: (0.0, 1.0)})
