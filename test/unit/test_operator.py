# SPDX-License-Identifier: Apache-2.0
"""The operator's scripts: smooth, from where they should begin to where they should end, and over in their time."""

import ctypes
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plants import FREE, InC

from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATOR, SCRIPTS
from haptic_device.device import operator_hand

START, ABOVE, TARGET = (0.01, 0.05, 0.1), (0.03, 0.05, 0.1), (0.03, -0.02, -0.2)
ENDS = {"insert_peg": TARGET, "let_go": TARGET, "waypoints": TARGET} | dict.fromkeys(
    ("hold", "press_wall", "tap", "circle"), START
)


def script(name, **given):
    places = {"motion.start": START, "motion.target": TARGET, "motion.waypoints": (*ABOVE, *TARGET)}
    given = {f"motion.{key}": value for key, value in given.items()}
    return operator_hand.script(defaults(OPERATOR) | places | {"motion.name": name} | given)[0]


def at(motion, time):
    target = np.zeros(3)
    grip = operator_hand.target_at(motion, time, target)
    return target, grip


def path(motion, count=4001):
    times = np.linspace(0.0, motion["duration"], count)
    return times, np.array([at(motion, time)[0] for time in times])


@pytest.mark.parametrize("name", sorted(set(SCRIPTS) - {"follow"}))
def test_a_script_leads_from_its_start_to_its_end_and_stays_there_at_rest_at_both_and_without_a_step(name):
    motion = script(name, duration=3.0, turns=1.0, taps=3)
    assert at(motion, 0.0)[0] == pytest.approx(START, abs=1e-12)
    for time in (3.0, 3.1, 1000.0):
        assert at(motion, time)[0] == pytest.approx(ENDS[name], abs=1e-12)
    times, points = path(motion)
    velocity = np.diff(points, axis=0) / np.diff(times)[:, None]
    largest = np.abs(velocity).max() + 1e-12
    assert np.abs(velocity[[0, -1]]).max() < 0.02 * largest
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.03 * largest
    grips = [at(motion, time)[1] for time in (0.0, 1.5 - 1e-9, 1.5, 99.0)]
    assert grips == ([1.0, 1.0, 0.0, 0.0] if name == "let_go" else [1.0] * 4)


def test_between_waypoints_the_hand_moves_with_least_jerk_and_a_peg_comes_from_straight_above_its_hole():
    motion = script("insert_peg", duration=5.0)
    above = np.array([TARGET[0], START[1], TARGET[2]])
    for fraction in (0.1, 0.25, 0.5, 0.9):
        s = 10 * fraction**3 - 15 * fraction**4 + 6 * fraction**5
        assert at(motion, fraction * 1.0)[0] == pytest.approx(np.array(START) + s * (above - START))
    times, points = path(motion)
    down = points[:, 1] < START[1] - 1e-9
    assert points[down][:, [0, 2]] == pytest.approx(np.tile(np.array(TARGET)[[0, 2]], (down.sum(), 1)))


def test_places_of_a_wrong_length_are_refused_in_one_sentence():
    for wrong, sentence in (
        ({"waypoints": ()}, "motion.waypoints has 0 numbers; write 3 for each waypoint: x, y, theta"),
        ({"waypoints": (0.0,) * 96}, "motion.waypoints names 32 waypoints; the limit is 31"),
        ({"start": (0.0, 1.0)}, "motion.start has 2 numbers; write 3: x, y, theta"),
        ({"target": (0.0, 1.0)}, "motion.target has 2 numbers; write 3: x, y, theta"),
    ):
        with pytest.raises(ValueError) as refusal:
            script("waypoints", **wrong)
        assert str(refusal.value) == sentence


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


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1e-3, 1.0), st.floats(0.0, 0.1))
def test_a_followed_goal_is_approached_behind_a_first_order_lag_in_one_step_or_in_two(goal, target, lag, elapsed):
    once = operator_hand.follow(goal, target, lag, elapsed)
    twice = operator_hand.follow(goal, operator_hand.follow(goal, target, lag, elapsed / 2), lag, elapsed / 2)
    assert once == pytest.approx(twice, abs=1e-12)
    assert abs(once - goal) == pytest.approx(abs(target - goal) * math.exp(-elapsed / lag), abs=1e-12)


# the hand of the firmware, where test_plant.py has it not


def test_the_firmwares_hand_waits_for_its_beginning_and_is_done_at_its_end():
    plant = InC()
    for when, x in ((0.0, 0.0), (0.2, 0.04), (0.5, -0.04)):
        plant.port.plant_port_waypoint(*map(ctypes.c_double, (when, x, 0.0, 0.0, 1.0)))
    assert plant.at(0.1).target[0] == 0.0
    plant.script()
    assert plant.at(0.2).target[0] == pytest.approx(0.02)
    for when, done in ((0.5999, False), (0.6, True)):
        assert plant.at(when).target[0] == pytest.approx(-0.04) and plant.port.plant_port_done() == done


def test_the_firmwares_hand_goes_round_at_an_even_rate_between_its_easing():
    plant = InC(x=(*FREE[:7], 0.05))
    plant.port.plant_port_circle(*map(ctypes.c_double, (0.03, 2.0, 4.0)))
    plant.script()
    for when in (0.4, 1.0, 2.5, 3.6):
        state = plant.at(when)
        angle = 2 * math.pi * 2.0 * (when / 4.0 - 0.05) / 0.9
        assert state.target[:2] == pytest.approx([0.02 + 0.03 * math.cos(angle), 0.03 * math.sin(angle)], abs=1e-12)
        assert math.hypot(*state.target_velocity[:2]) == pytest.approx(0.03 * 2 * math.pi * 2.0 / (0.9 * 4.0))
    ahead, behind = plant.at(3.9999), plant.at(4.0)
    assert behind.target[:2] == pytest.approx([0.05, 0.0], abs=1e-12)
    assert math.hypot(*ahead.target_velocity[:2]) < 1e-3
