# SPDX-License-Identifier: Apache-2.0
"""The recording that a notebook takes where none is given: a run of a few seconds in lock-step, without nodes.

Lock-step has no clock and no network: the same run gives the same numbers on every machine.
"""

import tempfile
from pathlib import Path

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.recording import Recording, load
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.lockstep.lockstep_bag import LockstepBag, Point
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load as load_scene

DEVICE = load_device("desktop")
STEP = 0.002  # [s] between two states of the hand in the bag


def recorded(bag, make, topic: str = "trace") -> Recording:
    """The bag in this folder; without one, what `make()` returns.

    Raises SystemExit with a sentence if the folder is no bag, or if the bag lacks the topic.
    """
    try:
        recording = load(str(bag)) if bag else make()
    except (OSError, ValueError) as error:
        raise SystemExit(str(error)) from None
    if topic not in recording.joints and topic not in recording.clouds:
        raise SystemExit(f"bag {bag} has no topic {topic}, which this notebook needs")
    return recording


def tap_a_wall(stiffness: float = 1000.0) -> Recording:
    """The hand taps three times on a wall at x = 0 of this stiffness [N/m], which the servo computes itself."""
    wall = {"wall.normals": (1.0, 0.0), "wall.offsets": (0.0,), "wall.stiffness": (stiffness,), "wall.damping": (1.0,)}
    hand = {"name": "tap", "start": (0.01, 0.0, 0.0), "target": (-0.01, 0.0, 0.0), "duration": 1.0, "taps": 3}
    return _run(4.0, wall | {"coupling.stiffness": 0.0, "coupling.damping": 0.0}, hand)


def press_a_tool(stiffness: float = 2000.0) -> Recording:
    """The hand presses the tool of scene `wall` against its wall through a coupling of this stiffness [N/m]."""
    scene = load_scene("wall")
    return _run(3.0, {"coupling.stiffness": stiffness, "coupling.damping": 2.0}, scene.motion, scene)


def _run(seconds: float, driver: dict, motion: dict, scene=None) -> Recording:
    """driver: parameters of haptic_driver that are no defaults; motion: of the hand, as a scene has it."""
    values = {name: defaults(NODES[name]) for name in ("haptic_driver", "haptic_loopback", "haptic_simulation")}
    values["haptic_driver"] |= driver
    values["haptic_loopback"] |= {f"motion.{key}": value for key, value in motion.items()}
    point = Point(DEVICE, scene, *values.values())
    simulation = Simulation.by_parameters(reduce_scene(scene), values["haptic_simulation"]) if scene else None
    system = Lockstep(DEVICE, point.driver, point.loopback, simulation)
    with tempfile.TemporaryDirectory() as folder:
        bag = LockstepBag(Path(folder) / "bag", system, point)
        for _ in range(round(seconds / STEP)):
            bag.add(system.run(STEP))
        bag.close({})
        return load(Path(folder) / "bag")
