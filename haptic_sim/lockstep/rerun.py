# SPDX-License-Identifier: Apache-2.0
"""A recorded hand on other gains: what a bag says of its run, made into a lock-step system, and run into a new bag."""

import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.config import description, yaml_reader
from haptic_device.config.description import Device, load_device
from haptic_device.config.files import ConfigError, find
from haptic_device.config.parameter_files import read_operating_point
from haptic_device.config.parameter_sections import SECTION
from haptic_device.config.parameter_types import check_value, defaults
from haptic_device.control import controller_config, gain_check
from haptic_device.process import say
from haptic_device.recording import load
from haptic_device.recording.bag_contents import Recording
from haptic_device.recording.columns import Entries
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep, Network
from haptic_sim.lockstep.lockstep_bag import LockstepBag, Point
from haptic_sim.lockstep.recorded_operator import PlayedDevice, PlayedTarget
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene, parse
from haptic_sim.scene.language import load as load_scene

AXES = ("x", "y", "theta")
STEP = 0.002  # [s] between truths written, to a whole tick
SECOND = 1_000_000_000
PLAYED = np.dtype([("tick", "f8"), ("deadline", "f8"), ("position", "f8", (3,)), ("engage", "f8"), ("tool_age", "f8")])
ONLY = {"trace": PLAYED, "operator/state": Entries((*(f"motor_{name}" for name in AXES), "time"), ("position",))}


class Hand(NamedTuple):
    """A recorded motion.

    Attributes:
        played: the argument `hand` of a `Lockstep`.
        seconds: its length [s].

    Examples:
        >>> from pathlib import Path
        >>> from haptic_sim.lockstep.rerun import hand_of, recorded
        >>> print(f"{hand_of(recorded(Path('run/bag')), as_device=False).seconds:.3f} s")
        2.000 s
    """

    played: PlayedTarget | PlayedDevice
    seconds: float


def recorded(bag: Path, namespace: str | None = None) -> Recording:
    """Loads the parts of a bag that a replay needs, as a `Recording`; errors as in `load`.

    Args:
        bag: path of the bag.
        namespace: needed only if the bag has several devices.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_sim.lockstep.rerun import recorded
        >>> recorded(Path("run/bag")).trace.dtype.names
        ('tick', 'deadline', 'position', 'engage', 'tool_age')
    """
    return load(bag, namespace, ONLY)


def hand_of(recording: Recording, as_device: bool) -> Hand:
    """The recorded motion, from the first tick with the motor engaged to the last.

    Raises ValueError if the bag has no such motion.

    Args:
        recording: from `recorded`.
        as_device: if true, the handle repeats its recorded positions, whatever the display does. Else the hand's target
            is replayed, and the forces of the display move the handle.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_sim.lockstep.rerun import hand_of, recorded
        >>> hand = hand_of(recorded(Path("run/bag")), as_device=False)
        >>> print(hand.played.points[0].round(4))  # target of the hand [m, m, rad]
        [0.03 0.   0.  ]
    """
    trace = recording.trace
    engaged = np.flatnonzero(trace["engage"] > 0)
    if len(engaged) < 2:
        raise ValueError(f"bag {recording.bag} has no tick with the motor engaged: there is no motion to replay")
    begin, end = trace["deadline"][engaged[0]], trace["deadline"][engaged[-1]]
    seconds = (end - begin) / SECOND
    if as_device:
        rows = trace[engaged[0] : engaged[-1] + 1]
        return Hand(PlayedDevice(rows["deadline"] - begin, rows["position"]), seconds)
    return Hand(_target(recording, begin, end), seconds)


def _target(recording: Recording, begin: float, end: float) -> PlayedTarget:
    """The hand's target between these times [ns], from the loopback's truth, from time 0 on."""
    state = recording.joints.get("operator/state")
    if state is None or "motor_x" not in state.names:
        raise ValueError(f"bag {recording.bag} does not say the hand's target; replay it --as device")
    times = state.entry("time") * SECOND - begin
    during = (times >= -SECOND / 10) & (times <= end - begin)
    if during.sum() < 2:
        raise ValueError(f"bag {recording.bag} has no operator/state while engaged; replay it --as device")
    points = np.zeros((int(during.sum()), 3))
    for index, name in enumerate(AXES):
        if f"motor_{name}" in state.names:
            points[:, index] = state.entry(f"motor_{name}")[during]
    return PlayedTarget(np.round(times[during]).astype(np.int64), points)


def given_at(params: str | None) -> dict[str, dict[str, Any]]:
    """Reads an operating point by name or file: {node: {parameter: value}}; empty for None.

    Raises ValueError or FileNotFoundError with one sentence.

    Args:
        params: a name in config/, the path of a file, or None.

    Examples:
        >>> from haptic_sim.lockstep.rerun import given_at
        >>> given_at("demo")["haptic_driver"]["coupling.stiffness"]  # [N/m]
        2000.0
    """
    return {} if params is None else read_operating_point(find("", params), NODES)


def recorded_point(recording: Recording, given: dict[str, dict[str, Any]]) -> Point:
    """The operating point of a recording, with some values replaced.

    Raises ValueError with one sentence.

    Args:
        recording: from `recorded`.
        given: {node: {parameter: value}}, from `given_at`.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_sim.lockstep.rerun import recorded, recorded_point
        >>> point = recorded_point(recorded(Path("run/bag")), {"haptic_driver": {"coupling.stiffness": 500.0}})
        >>> point.scene.name, point.driver["coupling.stiffness"], point.driver["coupling.damping"]
        ('wall', 500.0, 1.0)
    """
    nodes = "haptic_driver", "haptic_loopback", "haptic_simulation"
    driver, loopback, simulation = (_values(recording, node) | given.get(node, {}) for node in nodes)
    given_device = "device" in given.get("haptic_driver", {})
    device = load_device(driver["device"]) if given_device else _device(recording, driver["device"])
    given_scene = "scene" in given.get("haptic_simulation", {})
    scene = load_scene(simulation["scene"]) if given_scene else _scene(recording, simulation["scene"])
    return Point(device, scene, driver, loopback, simulation)


def replay(hand: Hand, point: Point, network: Network, bag: Path) -> float:
    """Replays a recorded hand at an operating point into a new bag; returns processor time per simulated second [s].

    The time does not include the first step, which compiles functions. Raises ValueError with one sentence for an
    operating point that the driver would refuse. Raises OSError if the disk is full: the bag then ends with what it
    has, and standard error says where it is.

    Args:
        hand: from `hand_of`.
        point: from `recorded_point`.
        network: between driver and simulation.
        bag: a new or empty folder.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_device.recording import load
        >>> from haptic_sim.lockstep.lockstep import Network
        >>> from haptic_sim.lockstep.rerun import hand_of, recorded, recorded_point, replay
        >>> recording = recorded(Path("run/bag"))
        >>> softer = recorded_point(recording, {"haptic_driver": {"coupling.stiffness": 500.0}})
        >>> _ = replay(hand_of(recording, as_device=True), softer, Network(), Path("softer/bag"))
        >>> forces = [load(bag).trace["force_coupling"][-1, 0] for bag in ("run/bag", "softer/bag")]
        >>> bool(forces[0] > forces[1] > 0.0)  # the same motion is felt less
        True
    """
    _judge(point)
    simulation = _simulation(point.scene, point.simulation) if point.scene else None
    system = Lockstep(point.device, point.driver, point.loopback, simulation, network, hand=hand.played)
    hand.played.begin(system)
    written, costs = LockstepBag(bag, system, point), []
    step, ticks = (round(seconds * SECOND / system.period) for seconds in (STEP, hand.seconds))
    try:
        for done in range(0, ticks, step):
            began = time.process_time()
            rows = system.run(min(step, ticks - done) * system.period / SECOND)
            costs.append(time.process_time() - began)
            written.add(rows)
        share = sum(costs[1:]) / max(STEP, (ticks - step) * system.period / SECOND)
        written.close({"cpu_share": f"{share:.4f}"})
    except BaseException:  # a full disk, or Ctrl-C: what there is stays
        written.break_off()
        say(f"broken off: what was played is in {bag}")
        raise
    return share


def _judge(point: Point) -> None:
    """As the driver judges an operating point before it runs."""
    settings = controller_config.settings_from(point.device, point.driver)
    refused = gain_check.refusal(settings[0], gain_check.delays(settings[0]))
    if refused and point.driver["passivity.policy"] == "enforce":
        raise ValueError(refused)


def _simulation(scene: Scene, values: dict[str, Any]) -> Simulation:
    return Simulation.by_parameters(reduce_scene(scene, values["method"]), values)


def _values(recording: Recording, node: str) -> dict[str, Any]:
    """A node's values as the bag has them; the defaults for what it does not say."""
    content = _attached(recording, f"parameters/{node}.yaml", ros=True) or {}
    found: dict[str, Any] = next((section.get(SECTION, {}) for section in content.values()), {})
    known = {parameter.name: parameter for parameter in NODES[node]}
    return defaults(NODES[node]) | {name: check_value(known[name], found[name]) for name in found if name in known}


def _device(recording: Recording, name: str) -> Device:
    content = _attached(recording, file := f"device/{Path(name).stem}.yaml")
    return load_device(name) if content is None else description.parse(content, f"{file} of {recording.bag}")


def _scene(recording: Recording, name: str) -> Scene | None:
    content = _attached(recording, file := f"scene/{Path(name).stem}.yaml")
    if content is not None:
        return parse(content, f"{file} of {recording.bag}")
    there = "tool_age" in (recording.trace.dtype.names or ()) and (recording.trace["tool_age"] >= 0).any()
    return load_scene(name) if there else None


def _attached(recording: Recording, file: str, ros: bool = False) -> dict[str, Any] | None:
    """The mapping in a file that the bag has; None if it has no such file."""
    content = recording.attachments.get(file)
    try:
        return yaml_reader.loads(content, ros) if content is not None else None
    except ValueError as error:
        raise ConfigError(f"{file} of {recording.bag}: {error}") from None
