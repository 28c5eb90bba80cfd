# SPDX-License-Identifier: Apache-2.0
"""The simulation's ledger: each item is what a closed form says, and together they leave nothing over."""

import math

import pytest

from bench.reference.trial import attempt
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.lockstep.rollout import EXCHANGE_NS, GAINS, hand
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

STILL = (0.0, 0.0, 0.0)


def led(name, method, seconds, sub_step=None):
    scene = load(name)
    simulation, lead = Simulation(reduce_scene(scene, method), sub_step), hand(scene)
    for k in range(round(seconds * 1e3)):
        simulation.exchange(HandleSample(k * EXCHANGE_NS, lead(k * 1e-3), STILL, *GAINS))
    return simulation


@pytest.mark.parametrize("method", ["partitioned", "event_driven"])
def test_each_rebound_takes_its_share_of_the_fall_and_the_flight_takes_nothing(method):
    """1 - e² of m g h at the first impact of a ball, e = 0.5; 0.5 s: √(2 h/g) is .4515 s."""
    scene = load("zeno_ball")
    balance = attempt(scene, 0.5, method=method).simulation.ledger.balance
    floor, ball = scene.bodies[:2]
    low = floor.shapes[0].point[1] + ball.shapes[0].radius
    fall = ball.mass * -scene.gravity[1] * (ball.pose[1] - low)
    assert balance.contacts == pytest.approx(0.75 * fall, rel=1e-9)
    assert abs(balance.numerical) < (1e-9 if method == "event_driven" else 1e-4)  # the tool sags on its coupling
    assert abs(balance.correction) < 1e-12


@pytest.mark.parametrize("method", ["partitioned", "impulse"])
def test_friction_takes_its_force_times_the_way(method):
    """μ m g over the way of a block that is pushed along a floor; the tool adds its own little."""
    simulation = led("push_block", method, 2.5)
    scene, way = simulation.scene, simulation.method.pose("block")[0]
    block = scene.bodies[1]
    floor = scene.material(block).friction * block.mass * -scene.gravity[1] * way
    assert way > 0.02
    assert floor * 0.98 < simulation.ledger.balance.contacts < floor * 1.1


@pytest.mark.parametrize("method", ["partitioned", "event_driven"])
def test_dry_friction_of_a_guide_is_booked_with_the_contacts(method):
    simulation = led("slider", method, 1.0)
    way = abs(simulation.method.position[0] - simulation.scene.tool.pose[0])
    force = simulation.scene.joints[0].friction
    assert simulation.ledger.balance.contacts >= force * way * (1.0 - 1e-6)


@pytest.mark.parametrize("method", ["partitioned", "event_driven"])
def test_a_belt_gives_a_block_what_it_has_of_motion_when_it_goes_along(method):
    """½ m v² by the contacts, as much again becomes heat at the belt and is in no account; nothing else is lost."""
    scene = load("push_block")
    belt, block, *_ = scene.bodies
    bodies = belt.model_copy(update={"surface_velocity": (0.2, 0.0)}), block
    tool = scene.tool.model_copy(update={"layers": frozenset({7})})
    simulation = Simulation(reduce_scene(scene.model_copy(update={"bodies": bodies, "tool": tool}), method), 0.25e-3)
    for k in range(400):
        simulation.exchange(HandleSample(k * EXCHANGE_NS, tool.pose, STILL, 0.0, 0.0, 0.0, 0.0))
    balance = simulation.ledger.balance
    assert balance.contacts == pytest.approx(-0.5 * block.mass * 0.2**2, rel=1e-9)
    assert balance.dissipated == pytest.approx(balance.contacts, rel=1e-6)


@pytest.mark.parametrize(("name", "seconds"), [("wall", 1.5), ("stack", 0.8)])
def test_what_push_out_has_put_in_at_the_tool_is_booked_and_less_than_was_lost(name, seconds):
    balance = led(name, "impulse", seconds).ledger.balance
    assert balance.numerical > 0.0
    assert abs(balance.correction) < balance.dissipated
    assert balance.contacts == pytest.approx(balance.dissipated - balance.numerical + balance.correction, abs=1e-15)


def test_backward_difference_pays_half_the_square_of_what_it_changes_and_flight_pays_nothing():
    held, free = (led("free_space", method, 1.0).ledger.balance for method in ("partitioned", "event_driven"))
    assert held.numerical > 0.0
    assert abs(free.numerical) < 1e-9 * free.supplied
    assert held.contacts == held.correction == free.contacts == free.correction == 0.0


@pytest.mark.parametrize("name", ["four_bar", "wrench_on_nut", "stack"])
def test_putting_constraints_right_moves_little_energy_and_is_made_up_for(name):
    balance = led(name, "partitioned", 0.8).ledger.balance
    assert balance.dissipated >= -1e-9
    assert abs(balance.correction) < 0.01 * max(balance.supplied, balance.dissipated)


@pytest.mark.parametrize("method", ["partitioned", "closed_form", "event_driven", "impulse"])
def test_a_wall_that_is_met_takes_the_speed_it_is_met_with(method):
    """The tool comes in at a speed v and stays: ½ m v² in the wall, whatever the method."""
    scene = load("wall")
    tool = scene.tool.model_copy(update={"velocity": (-0.5, 0.0, 0.0)})
    simulation = Simulation(reduce_scene(scene.model_copy(update={"tool": tool}), method), 0.25e-3)
    gains = (0.0, 0.0, 0.0, 0.0)
    for k in range(1000):
        simulation.exchange(HandleSample(k * EXCHANGE_NS, STILL, STILL, *gains))
    balance = simulation.ledger.balance
    expected = 0.5 * tool.mass * 0.25
    assert balance.kinetic == pytest.approx(0.0, abs=1e-12)
    assert balance.contacts == pytest.approx(expected, rel=0.02 if method != "event_driven" else 1e-9)
    assert balance.contacts + balance.numerical == pytest.approx(expected, rel=1e-9)
    assert math.isclose(balance.dissipated, expected, rel_tol=1e-9)
