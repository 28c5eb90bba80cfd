# SPDX-License-Identifier: Apache-2.0
"""The scene `maze` in lock-step: its waypoints lead the tool through, and no straight way would."""

import pytest
from lockstep_systems import values

from haptic_device.config.description import load_device
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

pytestmark = pytest.mark.timeout(600)  # kernels that nobody has used yet are compiled
FREE = 1.0  # s after the motion, in which the tool comes to rest


def led(**motion):
    """Simulation and rows after the hand has led the tool by the scene's motion with these changes."""
    scene = load("maze")
    simulation, motion = Simulation(reduce_scene(scene)), scene.motion | motion
    hand = values("haptic_loopback", **{f"motion__{key}": value for key, value in motion.items()})
    system = Lockstep(load_device("desktop"), values("haptic_driver", engage__time=0.1), hand, simulation)
    return simulation, system.run(motion["duration"] + FREE)


def test_the_maze_is_solved_by_its_waypoints():
    simulation, rows = led()
    assert simulation.measure()["arrived"] == pytest.approx(1.0, abs=0.01)
    assert rows["fault"].max() == 0.0 and rows["energy_given"].sum(axis=1).max() < 0.01
    assert simulation.counters.max_contact_force > 0.5  # it leans on walls on its way


def test_straight_ahead_the_first_wall_of_the_maze_is_in_the_way():
    simulation, _ = led(name="insert_peg", target=(0.035, -0.03, 0.0), duration=2.0)
    assert simulation.measure()["arrived"] < 0.3
