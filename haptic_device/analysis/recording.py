# SPDX-License-Identifier: Apache-2.0
"""A bag as named numpy arrays. `load(bag)` is the way in; works wherever Python does, without ROS.

Clocks: `deadline` in the trace is CLOCK_MONOTONIC [ns]; stamps, received and published are the system clock [ns];
`Recording.monotonic` turns the latter into the former.
"""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rosbags.typesys import Stores, get_typestore

from haptic_device.analysis.bagfile import Raw, read
from haptic_device.analysis.cdr import joint_arrays, joint_layout, same_layout

TOPICS = ("encoder", "motor", "handle", "tool", "trace", "wrench", "pose", "operator/state", "operator/target")
PORT_UNITS = {"position": "m | rad", "velocity": "m/s | rad/s", "effort": "N | N·m"}
TRACE_UNITS = {
    "deadline": "ns, CLOCK_MONOTONIC",
    "latched": "ns, CLOCK_MONOTONIC",
    "lateness": "s",
    "compute": "s",
    "drag": "N | N·m",
    "tool_age": "s, -1 = none yet",
    "tool_energy": "J",
    "exchange_energy": "J",
    "energy_given": "J",
    "margin": "N s/m | N m s/rad",
    "motor": "N | N·m",
    **{name: PORT_UNITS["position"] for name in ("tool_position", "position", "coupling_position")},
    **{name: PORT_UNITS["velocity"] for name in ("tool_velocity", "velocity", "coupling_velocity")},
    "tool_effort": PORT_UNITS["effort"],
    **{f"force_{what}": PORT_UNITS["effort"] for what in ("walls", "coupling", "cancellation", "gravity")},
    **{f"force_{what}": PORT_UNITS["effort"] for what in ("passivity", "on_handle")},
}
_FORMATS = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}  # sensor_msgs/PointField


class Joints(NamedTuple):
    """A JointState topic: arrays (messages, names); times in ns of the system clock; units as PORT_UNITS."""

    names: tuple[str, ...]
    stamp: np.ndarray
    received: np.ndarray
    published: np.ndarray
    sequence: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray

    def entry(self, name: str, part: str = "position") -> np.ndarray:
        """One named entry over time; `part` is position, velocity or effort. Raises ValueError if it is not there."""
        if name not in self.names:
            raise ValueError(f"the topic has no entry {name}; it has {', '.join(self.names)}")
        return getattr(self, part)[:, self.names.index(name)]


class Status(NamedTuple):
    """One diagnostic status: time in ns of the system clock, level 0 fine, 1 warning, 2 error, 3 stale."""

    time: int
    level: int
    message: str
    values: dict[str, str]


@dataclass(frozen=True)
class Recording:
    """The topics of one namespace by their short names, the diagnostics by name, and what was wrong with the bag."""

    bag: Path
    namespace: str
    joints: dict[str, Joints]
    clouds: dict[str, np.ndarray]
    diagnostics: dict[str, tuple[Status, ...]]
    notes: tuple[str, ...]

    def joint(self, topic: str) -> Joints:
        """A JointState topic by its short name, such as `operator/state`. Raises ValueError if it was not recorded."""
        return self._named(self.joints, topic)

    @property
    def trace(self) -> np.ndarray:
        """Every servo tick, a structured array; units in TRACE_UNITS. Raises ValueError if it was not recorded."""
        return self._named(self.clouds, "trace")

    @property
    def trace_rows_missing(self) -> int:
        """Ticks between first and last row of the trace that have no row."""
        steps = np.diff(self.trace["tick"])
        return int(np.sum(steps[steps > 1] - 1))

    def statuses(self, node: str) -> tuple[Status, ...]:
        """What the named node said on /diagnostics, oldest first; empty if it never spoke."""
        found = (name for name in self.diagnostics if node in name.replace(":", "/").split("/"))
        return tuple(sorted((status for name in found for status in self.diagnostics[name]), key=lambda s: s.time))

    def last_values(self, node: str) -> dict[str, str]:
        """The entries of the node's last diagnostic status; empty if it never spoke."""
        statuses = self.statuses(node)
        return statuses[-1].values if statuses else {}

    def monotonic(self, time: np.ndarray) -> np.ndarray:
        """System-clock times [ns] as CLOCK_MONOTONIC [ns], by the offset that `operator/state` shows.

        Its entry `time` is read before the message is published, so the least difference is nearest the truth.
        """
        state = self.joint("operator/state")
        measured = np.round(state.entry("time") * 1e9).astype(np.int64)
        return np.asarray(time, np.int64) - int(np.min(state.published - measured))

    def _named(self, found: dict, topic: str):
        if topic not in found:
            there = ", ".join(found) or "none of its kind"
            raise ValueError(f"bag {self.bag} has no topic {topic} under {self.namespace or '/'}; it has {there}")
        return found[topic]


def load(bag: Path | str, namespace: str | None = None) -> Recording:
    """Reads a bag folder or one .mcap file; `namespace` is needed only where the bag holds several devices.

    Raises FileNotFoundError or ValueError with a sentence; a bag cut off in the middle is read as far as it goes and
    `notes` says so.
    """
    bag = Path(bag)
    raw, notes = read(bag)
    namespace = _only_namespace(raw, bag) if namespace is None else namespace.rstrip("/")
    ours = {topic[len(namespace) + 1 :]: found for topic, found in raw.items() if topic.startswith(namespace + "/")}
    return Recording(
        bag,
        namespace,
        _each(ours, "sensor_msgs/msg/JointState", _joints, notes),
        _each(ours, "sensor_msgs/msg/PointCloud2", _cloud, notes),
        diagnostics_of(raw.get("/diagnostics")),
        tuple(notes),
    )


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)


def _only_namespace(raw: dict[str, Raw], bag: Path) -> str:
    found = {topic[: -len(name) - 1] for topic in raw for name in TOPICS if topic.endswith("/" + name)}
    if not found:
        raise ValueError(f"bag {bag} is of no haptic display: it has {', '.join(sorted(raw))}, no {', '.join(TOPICS)}")
    if len(found) > 1:
        raise ValueError(f"bag {bag} holds several devices, name one namespace: {', '.join(sorted(found))}")
    return found.pop()


def _each(raw: dict[str, Raw], type_name: str, decode, notes: list[str]) -> dict:
    decoded = {}
    for topic, found in raw.items():
        if found.type_name != type_name:
            continue
        try:
            decoded[topic], others = decode(found)
        except ValueError as error:
            notes.append(f"topic {topic} is left out: {error}")
            continue
        if others:
            notes.append(f"topic {topic}: {others} messages of another layout than the first are left out")
    return decoded


def _joints(raw: Raw) -> tuple[Joints, int]:
    layout = joint_layout(raw.data[0])
    keep = [index for index, data in enumerate(raw.data) if same_layout(layout, data)]
    stamp, parts = joint_arrays(layout, [raw.data[index] for index in keep])
    times = (np.array(column, np.int64)[keep] for column in (raw.received, raw.published, raw.sequence))
    return Joints(layout.names, stamp, *times, *parts), len(raw.data) - len(keep)


def _cloud(raw: Raw) -> tuple[np.ndarray, int]:
    blocks = [_block(_types().deserialize_cdr(data, raw.type_name)) for data in raw.data]
    same = [block for block in blocks if block.dtype == blocks[0].dtype]
    return np.concatenate(same), len(blocks) - len(same)


def _block(message) -> np.ndarray:
    fields = message.fields
    kind = np.dtype(
        {
            "names": [field.name for field in fields],
            "formats": [(_FORMATS[field.datatype], (field.count,) if field.count > 1 else ()) for field in fields],
            "offsets": [field.offset for field in fields],
            "itemsize": message.point_step,
        }
    )
    return np.frombuffer(message.data.tobytes(), kind, count=message.width * message.height)


def diagnostics_of(raw: Raw | None) -> dict[str, tuple[Status, ...]]:
    """Statuses by name, oldest first, out of serialized DiagnosticArrays."""
    statuses: dict[str, list[Status]] = {}
    for data, time in zip(raw.data, raw.received, strict=True) if raw else ():
        for status in _types().deserialize_cdr(data, raw.type_name).status:
            values = {pair.key: pair.value for pair in status.values}
            statuses.setdefault(status.name, []).append(Status(time, int(status.level), status.message, values))
    return {name: tuple(found) for name, found in statuses.items()}
