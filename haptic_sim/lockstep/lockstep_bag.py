# SPDX-License-Identifier: Apache-2.0
"""A lock-step run as a bag like the live nodes' ones, so that one report, one reader and one player serve both."""

import contextlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.config.description import Device
from haptic_device.config.parameter_sections import SECTION
from haptic_device.config.yaml_reader import dump
from haptic_device.control import exchange_samples
from haptic_device.message_fields import TAIL, frame_id
from haptic_device.nodes.bag_attachments import YAML
from haptic_device.realtime import tick_replay
from haptic_device.recording import provenance
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, CloudLayout, JointLayout, types
from haptic_device.recording.writer import Bag
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.scene.language import Scene

NAMESPACE = "/haptic"
FRAME = frame_id(NAMESPACE, "base_link")
EPOCH = 1_000_000_000_000_000_000  # [ns] system clock at lock-step's time 0: lock-step knows no date
BLOCK = 400  # ticks
SECOND = 1_000_000_000


class Point(NamedTuple):
    """An operating point with its device and scene, as a bag keeps it.

    Attributes:
        device: the device.
        scene: the scene, or None for a handle in free space.
        driver: all parameters of haptic_driver, {name: value}.
        loopback: all parameters of haptic_loopback.
        simulation: all parameters of haptic_simulation.

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> from haptic_sim.lockstep.lockstep_bag import Point
        >>> nodes = "haptic_driver", "haptic_loopback", "haptic_simulation"
        >>> point = Point(load_device("desktop"), None, *(defaults(NODES[node]) for node in nodes))
        >>> point.driver["servo.rate"]  # [Hz]
        4000.0
    """

    device: Device
    scene: Scene | None
    driver: dict[str, Any]
    loopback: dict[str, Any]
    simulation: dict[str, Any]


class LockstepBag:
    """A bag of a lock-step run, with the topics of live nodes: `trace`, `snapshot`, `handle`, `operator/state`.

    Raises ValueError if the folder is not empty, and OSError if the disk is full.

    Args:
        folder: a new or empty folder.
        system: the display; its run must not have started.
        point: its operating point.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.exchange.simulation import Simulation
        >>> from haptic_sim.node.parameters import NODES
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.lockstep.lockstep import Lockstep
        >>> from haptic_sim.lockstep.lockstep_bag import LockstepBag, Point
        >>> from haptic_sim.scene.language import load
        >>> device, scene = load_device("desktop"), load("wall")
        >>> nodes = "haptic_driver", "haptic_loopback", "haptic_simulation"
        >>> driver, loopback, simulation = (defaults(NODES[node]) for node in nodes)
        >>> loopback |= {f"motion.{name}": value for name, value in scene.motion.items()}
        >>> simulation["scene"] = "wall"
        >>> world = Simulation.by_parameters(reduce_scene(scene), simulation)
        >>> system = Lockstep(device, driver, loopback, world)
        >>> bag = LockstepBag(Path("run/bag"), system, Point(device, scene, driver, loopback, simulation))
        >>> for _ in range(1000):  # 2 s; after each 2 ms the bag gets the truth of the plant
        ...     bag.add(system.run(0.002))
        >>> bag.close({})
    """

    def __init__(self, folder: Path, system: Lockstep, point: Point):
        self._system, self._bag = system, Bag(folder)
        topics = {"trace": CLOUD, "snapshot": CLOUD, "handle": JOINTS, "operator/state": JOINTS}
        self._channels = {name: self._bag.add_topic(f"{NAMESPACE}/{name}", kind, []) for name, kind in topics.items()}
        self._channels["diagnostics"] = self._bag.add_topic("/diagnostics", DIAGNOSTICS, [])
        self._axes = tuple(axis.name for axis in point.device.axes)
        self._point, self._waiting = point, 0
        self._rows: list[np.ndarray] = []
        self._sequences = dict.fromkeys(self._channels, 0)  # of each topic, as a publisher counts
        self._attach()
        start = tick_replay.snapshot_of(-1, system.settings[0], system.memory[0])
        self._write("snapshot", CloudLayout(start.dtype, FRAME).pack(EPOCH, start), EPOCH)
        self._write("handle", self._handle(), EPOCH)
        self._write("diagnostics", self._status("haptic_simulation", self._simulation()), EPOCH)

    def add(self, rows: np.ndarray) -> None:
        """Takes the next rows of `Lockstep.run`, and the plant as it is then. Raises OSError once the disk is full."""
        self._rows.append(rows.view(np.ndarray))
        self._waiting += len(rows)
        if self._waiting >= BLOCK:
            self._write_rows()
        if self._system.plant_memory["time"][0] > 0:
            now = int(rows["deadline"][-1]) + EPOCH
            self._write("operator/state", self._truth(now), now)

    def break_off(self) -> None:
        """Ends the bag with all rows so far, as far as the disk has space."""
        with contextlib.suppress(OSError):
            self._write_rows()
        with contextlib.suppress(OSError):
            self._bag.close({"namespace": NAMESPACE, "lockstep": "true"})

    def close(self, facts: dict[str, str]) -> None:
        """Writes the rest and what nodes say at the end. facts: {name: text}, kept as the status `haptic_replay`."""
        self._write_rows()
        now = EPOCH + self._system.ticks * self._system.period
        said = {"haptic_driver": self._driver(), "haptic_simulation": self._simulation(), "haptic_replay": facts}
        for name, values in said.items():
            self._write("diagnostics", self._status(name, values), now)
        self._bag.close({"namespace": NAMESPACE, "lockstep": "true"})

    def _attach(self) -> None:
        nodes = {"haptic_driver": self._point.driver, "haptic_loopback": self._point.loopback}
        nodes["haptic_simulation"] = self._point.simulation
        for name, values in nodes.items():
            plain = {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
            content = dump({f"{NAMESPACE}/{name}": {SECTION: plain}}).encode()
            self._bag.attach(f"parameters/{name}.yaml", YAML, content, EPOCH)
        self._bag.attach("made.yaml", YAML, dump(provenance.facts()).encode(), EPOCH)
        device = dump(self._point.device.model_dump(mode="json")).encode()
        self._bag.attach(f"device/{Path(self._point.driver['device']).stem}.yaml", YAML, device, EPOCH)
        if self._point.scene is not None:
            scene = dump(self._point.scene.model_dump(mode="json", by_alias=True, exclude_defaults=True)).encode()
            self._bag.attach(f"scene/{Path(self._point.simulation['scene']).stem}.yaml", YAML, scene, EPOCH)

    def _write(self, topic: str, data: bytes, now: int) -> None:
        self._sequences[topic] += 1
        self._bag.write(self._channels[topic], data, now, now, self._sequences[topic])

    def _write_rows(self) -> None:
        if self._rows:
            rows = np.concatenate(self._rows)
            self._rows, self._waiting = [], 0  # first: an interrupt in the next lines writes nothing twice
            first, last = (EPOCH + int(rows["deadline"][i]) for i in (0, -1))
            self._write("trace", CloudLayout(rows.dtype, FRAME).pack(first, rows), last)

    def _truth(self, now: int) -> bytes:
        memory, n = self._system.plant_memory[0], len(self._axes)
        names = (*self._axes, *(f"motor_{name}" for name in self._axes), "energy_given", "time", "motion_done")
        extra = (memory["energy_given"], memory["time"] * 1e-9, 0.0)
        return JointLayout(names, FRAME).pack(
            now,
            (*memory["position"][:n], *memory["target"][:n], *extra),
            (*memory["velocity"][:n], *memory["target_velocity"][:n], 0.0, 0.0, 0.0),
            (*memory["operator_force"][:n], *memory["motor_force"][:n], 0.0, 0.0, 0.0),
        )

    def _handle(self) -> bytes:
        driver = self._point.driver
        gains = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
        known = {name: driver[f"coupling.{name}"] for name in gains}
        known["layout_version"] = exchange_samples.LAYOUT_VERSION
        known["exchange_method"] = exchange_samples.METHODS[driver["exchange.method"]]
        names = self._axes + TAIL
        zeros = np.zeros(len(names))
        return JointLayout(names, FRAME).pack(EPOCH, [known.get(name, 0.0) for name in names], zeros, zeros)

    def _driver(self) -> dict[str, str]:
        damping = ", ".join(f"{axis.damping:g}" for axis in self._point.device.axes)
        return {"physical_damping": damping, "realtime": "lock-step", "trace_dropped": "0"}

    def _simulation(self) -> dict[str, str]:
        simulation = self._system.simulation
        if simulation is None:
            return {}
        counters = simulation.counters
        figures = {"max_contact_force": counters.max_contact_force, "max_penetration": counters.max_penetration}
        figures["tool_port_energy"] = simulation.ledger.supplied
        results = {f"result.{name}": value for name, value in simulation.measure().items()}
        return {name: str(value) for name, value in {**figures, **results}.items()}

    def _status(self, name: str, values: dict[str, str]) -> bytes:
        kinds = types().types
        pairs = [kinds["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in values.items()]
        status = kinds["diagnostic_msgs/msg/DiagnosticStatus"](0, name, "", "", pairs)
        header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](*divmod(EPOCH, SECOND)), FRAME)
        return bytes(types().serialize_cdr(kinds[DIAGNOSTICS](header, [status]), DIAGNOSTICS))
