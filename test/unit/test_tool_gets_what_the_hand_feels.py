# SPDX-License-Identifier: Apache-2.0
"""At rest the tool gets the force that the hand feels; where energy or limit make less of it, the hand feels less."""

from itertools import product

import numpy as np
import pytest
import yaml
from exchange_systems import GAINS, demo_system

from haptic_device.config.files import names
from haptic_device.control import tool_side_tank
from haptic_sim.exchange import BUDGET, Limits
from haptic_sim.exchange.left_out_time import KEPT_SHORT, short_sentence
from haptic_sim.exchange.port import UNSHIPPED, PspmPort, port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.protocol import STILL, StepResult, along
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load, parse

MS, DEVICE, NEAR = 1_000_000, (15.0, 15.0, 1.0), 0.02  # [ns]; limits [N, N, N m]; mismatch at rest [N]
DEMO, SHIPPED = tuple(GAINS.values()), (1000.0, 1.0, 1.0, 0.001)
LEVER = """
name: lever
description: A lever on a pin, with a return spring, and a sprung button at its far end
bodies:
  - {name: lever, mass: 0.2, shapes: [{box: {size: [0.16, 0.01]}}]}
  - {name: button, mass: 0.05, pose: [0.07, -0.02, 0.0], shapes: [{box: {size: [0.02, 0.02]}}]}
  - {name: frame, fixed: true, shapes: [{box: {size: [0.02, 0.02], center: [0.0, -0.06]}}]}
joints:
  - {name: pivot, type: pin, bodies: [world, lever], at: [0.0, 0.0], limits: [-0.4, 0.4], friction_torque: 0.005}
  - {name: back, type: spring, bodies: [frame, lever], anchors: [[0.0, -0.05], [-0.03, 0.0]], stiffness: 60.0,
     damping: 0.5}
  - {name: travel, type: slider, bodies: [world, button], at: [0.07, -0.02], axis: [0.0, -1.0], limits: [0.0, 0.01],
     stiffness: 200.0, damping: 1.0, rest: -0.002}
tool: {mass: 0.05, pose: [0.06, 0.03, 0.0], shapes: [{circle: {radius: 0.008}}]}
motion: {name: waypoints, start: [0.06, 0.03, 0.0], waypoints: [0.06, -0.03, 0.0], duration: 1.5}
"""


def pressed_lever(force, port=None):
    """A hand that presses the lever to its end and goes on until it pushes down with a force [N]; the last ticks."""
    system = demo_system("pspm", parse(yaml.safe_load(LEVER), "lever"))
    if port is not None:
        system.simulation.attach(port)
    rows = system.run(1.8)
    for _ in range(15):
        pushes = rows.force_on_handle[-20:, 1].mean()
        system.plant["gravity"][0, 1] -= np.clip(0.7 * (force - pushes), -2.0, 2.0)
        rows = system.run(0.05)
    return system, system.run(0.2)


@pytest.mark.parametrize("force", [5.0, 10.0, 12.25, 14.9])
def test_a_hand_that_presses_a_lever_and_the_tool_on_it_have_the_same_force_at_rest(force):
    system, rows = pressed_lever(force)
    assert rows.force_on_handle[:, 1].mean() == pytest.approx(force, abs=0.1)
    assert np.abs(rows.force_on_handle[:, :2] + rows.tool_effort[:, :2]).max() <= NEAR
    assert system.simulation.counters.short_ns == 0


def test_where_the_ports_energy_is_short_the_hand_feels_the_shortened_force_too_and_it_is_said_for_how_long():
    system, rows = pressed_lever(14.0, PspmPort(0.02))
    assert 1.0 < rows.force_on_handle[:, 1].mean() < 13.0
    assert np.abs(rows.force_on_handle[:, :2] + rows.tool_effort[:, :2]).mean(axis=0).max() <= NEAR
    assert system.simulation.counters.short_ns > 50 * MS


class Held:
    """A tool that stays where it is whatever pulls at it, in a world of such sub-steps."""

    def __init__(self, inner=1):
        self.inner, self.position, self.force_on_tool, self.gains = inner, STILL, STILL, None

    def step(self, target, n):
        stiff, damping, turning, _ = self.gains
        x, y, turn, vx, vy, _ = target[-1].tolist()
        self.force_on_tool = stiff * x + damping * vx, stiff * y + damping * vy, turning * turn
        return StepResult()


def pulled(port, sub_step, inner, gains, stretch, limit=DEVICE, times=60):
    """Forces on a held tool after each exchange of 1 ms, the handle so far from it [m] in x and y."""
    world, row, forces = Held(inner), ((*stretch, 0.0), STILL), []
    for k in range(times):
        sample = HandleSample(k * MS, *row, *gains, limit=limit)
        world.gains = port.receive(sample, sub_step, inner)
        for _ in range(round(1e-3 / sub_step)):
            port.step(world, along(row, row), 1)
            forces.append(world.force_on_tool[:2])
        port.send(0.0)
    return np.array(forces)


@pytest.mark.parametrize("gains", [DEMO, SHIPPED], ids=["demo", "shipped"])
@pytest.mark.parametrize("scene", names("scenes"))
def test_in_every_scene_a_tool_that_is_held_gets_what_the_hand_feels_up_to_the_devices_limit_and_no_more(scene, gains):
    """What the device keeps before it ships is gone, in the worst case."""
    simulation = Simulation(reduce_scene(load(scene)))
    sub_step, inner = simulation.sub_step_ns * 1e-9, simulation.method.inner
    for force, way in product((1.0, 5.0, 10.0, 15.0, 40.0), ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8))):
        port, wanted = PspmPort(), force * np.array(way)
        port.receive(HandleSample(0, STILL, STILL, *gains, limit=DEVICE), sub_step, inner)
        port.memory[tool_side_tank.TANK] -= UNSHIPPED
        felt = np.clip(wanted, -15.0, 15.0)
        if np.hypot(*felt) <= Limits().force:
            forces = pulled(port, sub_step, inner, gains, wanted / gains[0])
            assert np.hypot(*(forces[-1] - felt)) <= NEAR
            assert port.kept_back(HandleSample(0, STILL, STILL, *gains)) is None


def test_the_reserve_is_what_the_devices_largest_pull_needs_and_never_more_than_the_budget():
    for limit, force, torque in (DEVICE, 20.0, 1.0), ((3.0, 4.0, 0.5), 5.0, 0.5), (STILL, 20.0, 1.0):
        port = PspmPort()
        port.receive(HandleSample(0, STILL, STILL, *DEMO, limit=limit), 0.25e-3)
        needed = tool_side_tank.kept(port.rules, 0, force) + tool_side_tank.kept(port.rules, 1, torque)
        assert port.tank == port.granted == pytest.approx(needed + UNSHIPPED) and port.granted < BUDGET
    port = PspmPort(0.1)
    port.receive(HandleSample(0, STILL, STILL, *DEMO, limit=DEVICE), 0.25e-3)
    assert port.tank == port.granted == 0.1


def test_a_smaller_limit_takes_back_what_of_the_reserve_is_left_and_what_is_spent_is_owed_by_nobody():
    port = PspmPort()
    port.receive(HandleSample(0, STILL, STILL, *DEMO, limit=DEVICE), 0.25e-3)
    spent = port.granted - 1e-3
    port.memory[tool_side_tank.TANK] -= spent
    port.receive(HandleSample(MS, STILL, STILL, *DEMO, limit=(1.0, 1.0, 0.1)), 0.25e-3)
    assert port.tank == 0.0 and port.granted == pytest.approx(spent)
    assert port.send(0.0) == 0.0


def test_limits_that_are_told_anew_with_every_sample_change_the_pull_no_faster_than_the_slew():
    port, sub_step, last = PspmPort(), 0.25e-3, 0.0
    for limit in (15.0, 1.0, 15.0, 0.5, 15.0, 8.0):
        forces = pulled(port, sub_step, 1, DEMO, (0.006, 0.0), (limit, limit, 1.0), times=3)[:, 0]
        assert np.abs(np.diff([last, *forces])).max() <= Limits().slew * sub_step * (1.0 + 1e-9)
        last = forces[-1]


@pytest.mark.parametrize("told", [np.nan, -1.0, np.inf])
def test_a_limit_that_none_can_mean_is_taken_as_not_told(told):
    forces = pulled(PspmPort(), 0.25e-3, 1, DEMO, (0.008, 0.0), (told, told, told))
    assert forces[-1, 0] == pytest.approx(16.0, abs=NEAR)


def test_below_the_ports_own_limit_the_hand_feels_that_limit():
    port = port_of("pspm", limits=Limits(force=5.0))
    pulled(port, 0.25e-3, 1, DEMO, (0.005, 0.0))
    nearer = port.kept_back(HandleSample(0, (0.005, 0.0, 0.0), STILL, *DEMO))
    assert DEMO[0] * (0.005 - nearer[0]) == pytest.approx(5.0)


def test_force_kept_short_is_said_where_it_lasts_longer_than_an_impact():
    assert not short_sentence(0.999 * KEPT_SHORT, 1.0, 0.01)
    assert "10 mJ" in short_sentence(1.001 * KEPT_SHORT, 1.0, 0.01)
