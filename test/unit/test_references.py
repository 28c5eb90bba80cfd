# SPDX-License-Identifier: Apache-2.0
"""References of the comparison: closed forms against what is known otherwise, stored ones against another method."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.methods.measure import run
from bench.reference.case import NAMES, case
from bench.reference.exact_axis import Axis, axis_motion
from bench.reference.exact_four_bar import angles
from bench.reference.reference import CLOSED, apart, make, reference

STORED = [name for name in NAMES if name not in CLOSED]
G = 9.81


@pytest.mark.parametrize("name", NAMES)
def test_each_case_has_a_reference_for_every_body_at_every_look(name):
    of = case(name)
    poses = reference(name).poses
    assert set(of.bodies()) <= set(poses)
    assert {len(poses[body]) for body in of.bodies()} == {round(of.seconds * 1e9) // of.look + 1}


@pytest.mark.parametrize("name", STORED)
def test_a_stored_reference_starts_where_the_scene_does_and_says_how_far_it_may_be_off(name):
    of, stored = case(name), reference(name)
    solids = {body.name: body for body in of.scene.bodies} | {"tool": of.scene.tool}
    for body in of.bodies():
        assert stored.poses[body][0] == pytest.approx(solids[body].pose, abs=1e-9)
    assert 0.0 < stored.doubt < 1e-3
    assert "partitioned" in stored.source


def test_a_stored_reference_is_made_again_as_near_as_it_says():
    of, stored = case("corner"), reference("corner")
    again = make(of._replace(seconds=0.5))
    for body, radius in of.bodies().items():
        short = stored.poses[body][: len(again.poses[body])]
        assert apart(again.poses[body], short, radius).max() < stored.doubt


@pytest.mark.parametrize(
    ("name", "other", "bound"),
    [("push_block", "impulse", 2e-2), ("stack", "mujoco_rk4", 2e-3), ("wrench_on_nut", "pymunk", 5e-3)],
)
def test_a_stored_reference_is_where_others_come_to_as_well(name, other, bound):
    if other.startswith("mujoco"):
        pytest.importorskip("mujoco")
    assert run(case(name), reference(name), other, 100).error < bound


def test_the_pendulum_swings_to_the_other_side_in_half_its_period():
    """1.933334854 s from level for a rod of 1 m."""
    poses = reference("pendulum").poses["rod"][:, 2]
    times = np.arange(len(poses)) * case("pendulum").look * 1e-9
    lowest = np.interp(0.5 * math.pi, -poses[:20], times[:20])
    assert lowest == pytest.approx(1.933334854 / 4.0, abs=1e-3)
    assert np.interp(1.933334854, times, poses) == pytest.approx(0.0, abs=2e-2)


def test_the_four_bar_has_the_angles_of_its_closure():
    coupler, rocker = (math.degrees(angle) for angle in angles((4.0, 1.5, 3.5, 3.0), math.radians(60.0)))
    assert (coupler, rocker) == pytest.approx((28.967078, 93.590144), abs=1e-6)


def test_the_four_bar_let_go_keeps_its_energy():
    of, poses = case("four_bar_free"), reference("four_bar_free").poses
    middle = 0.5 * (poses["crank"][2:, 2] - poses["crank"][:-2, 2]) / (of.look * 1e-9)
    bars = {body.name: body.mass_properties for body in of.scene.bodies}
    height = (
        sum(bars[name].mass * (poses[name][:, 1] + bars[name].center[0] * np.sin(poses[name][:, 2])) for name in bars)
        + of.scene.tool.mass * poses["tool"][:, 1]
    )
    fallen = G * (height[0] - height)
    assert fallen.min() > -1e-9
    assert abs(middle[np.argmin(fallen[1:-1])]) < 0.3 * abs(middle).max()


def test_a_mass_between_stops_with_friction_moves_as_a_fine_integration_says():
    axis = Axis(0.5, 2000.0, 2.0, 0.5, 0.0, -0.01, 0.02)
    times = np.arange(201) * 1e-3
    places = 0.03 * np.sin(40.0 * times)
    found = axis_motion(axis, places, np.gradient(places, 1e-3), 1e-3, 0.0)
    assert found.max() == pytest.approx(0.02, abs=1e-15)
    assert found.min() == pytest.approx(-0.01, abs=1e-15)

    def rate(t, state):
        place, speed = np.interp(t, times, places), np.interp(t, times, np.gradient(places, 1e-3))
        push = 2000.0 * (place - state[0]) + 2.0 * (speed - state[1])
        return state[1], (push - 0.5 * math.tanh(state[1] / 1e-4)) / 0.5

    until = int(np.argmax(found >= 0.0199)) - 1
    smooth = solve_ivp(rate, (0.0, times[until]), (0.0, 0.0), max_step=1e-4, rtol=1e-8, atol=1e-10)
    assert found[until] == pytest.approx(smooth.y[0, -1], abs=2e-5)


def test_a_block_held_by_friction_stays_until_the_push_exceeds_it():
    push = np.linspace(0.0, 1e-3, 101)
    found = axis_motion(Axis(1.0, 1000.0, 0.0, 0.5), push, np.zeros_like(push), 1e-3, 0.0)
    assert np.all(found[push < 0.4999e-3] == 0.0)
    assert found[-1] > 0.0


def test_a_scene_without_a_case_is_refused_with_those_that_have_one():
    with pytest.raises(ValueError, match="'ratchets'; those that have a reference are free_space"):
        case("ratchets")
