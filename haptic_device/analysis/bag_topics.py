# SPDX-License-Identifier: Apache-2.0
"""A bag as named numpy arrays. `load(bag)` is the way in; works wherever Python does, without ROS.

Clocks: `deadline` in the trace is CLOCK_MONOTONIC [ns]; stamps, received and published are the system clock [ns];
`Recording.monotonic` turns the latter into the former.
"""

import importlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.recording.columns import CloudColumns, JointColumns
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, STAMPED, STRING, types
from haptic_device.recording.reader import Keep, Topic, read
from haptic_device.sequence_gaps import SequenceGaps, counted
from haptic_device.status import Status, named_statuses

TOPICS = ("encoder", "motor", "handle", "tool", "trace", "wrench", "pose", "operator/state", "operator/target")
PORT_UNITS = {"position": "m | rad", "velocity": "m/s | rad/s", "effort": "N | N·m"}
ENTRY_UNITS = {  # of a JointState's entries that are no axes, in their position; the others count
    "energy_given": "J",
    "time": "s, CLOCK_MONOTONIC",
    "energy": "J",
    "stiffness": "N/m",
    "damping": "N s/m",
    "rotational_stiffness": "N m/rad",
    "rotational_damping": "N m s/rad",
    **{f"orientation.{axis}": "1" for axis in "xyzw"},
}
TRACE_UNITS = {
    "deadline": "ns, CLOCK_MONOTONIC",
    "latched": "ns, CLOCK_MONOTONIC",
    "lateness": "s",
    "compute": "s",
    "write_delay": "s",
    "generated": "J",
    "injected": "N s/m | N m s/rad",
    "drag": "N | N·m",
    "tool_age": "s, -1 = none yet",
    "tool_energy": "J",
    "exchange_energy": "J",
    "energy_given": "J",
    "margin": "N s/m | N m s/rad",
    "surplus": "N s/m | N m s/rad",
    "exchange_tank": "J",
    "exchange_effort": "N | N·m, of waves N s | N·m·s",
    "motor": "N | N·m",
    **{name: PORT_UNITS["position"] for name in ("tool_position", "position", "coupling_position")},
    **{name: PORT_UNITS["velocity"] for name in ("tool_velocity", "velocity", "coupling_velocity")},
    "tool_effort": PORT_UNITS["effort"],
    "contact_age": "s, -1 = none yet",
    "tools_apart": "m",
    **{f"force_{what}": PORT_UNITS["effort"] for what in ("walls", "coupling", "cancellation", "gravity")},
    **{f"force_{what}": PORT_UNITS["effort"] for what in ("passivity", "on_handle")},
}
MARK = "mark"
_NODE = "haptic_"  # begins the name of every node of ours
_SECOND = 1_000_000_000


class Joints(NamedTuple):
    """A JointState topic: arrays (messages, names); times in ns of the system clock; units as PORT_UNITS, ENTRY_UNITS.

    The position of `motor` is its command in motor units. `wrench` has an effort only and `pose` a position only, each
    by the names of the message's fields.
    """

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


class Mark(NamedTuple):
    """A marker that somebody set: time in ns of the system clock, and its text."""

    time: int
    text: str


@dataclass(frozen=True)
class Recording:
    """The topics of one namespace by their short names, the diagnostics by name, and what was wrong with the bag.

    pairs: times [ns] at once on the system clock and on CLOCK_MONOTONIC, for `monotonic`. counts, skipped: of each
    topic the messages, and what its publisher's numbers say of those that never came.
    """

    bag: Path
    namespace: str
    joints: dict[str, Joints]
    clouds: dict[str, np.ndarray]
    diagnostics: dict[str, tuple[Status, ...]]
    marks: tuple[Mark, ...]
    attachments: dict[str, bytes]
    counts: dict[str, int]
    skipped: dict[str, SequenceGaps]
    pairs: tuple[np.ndarray, np.ndarray]
    notes: tuple[str, ...]

    def joint(self, topic: str) -> Joints:
        """A JointState topic by its short name, such as `operator/state`. Raises ValueError if it was not recorded."""
        return self._named(self.joints, topic)

    @property
    def trace(self) -> np.ndarray:
        """Every servo tick, a structured array; units in TRACE_UNITS. Raises ValueError if it was not recorded."""
        return self._named(self.clouds, "trace")

    @property
    def lost(self) -> dict[str, int]:
        """Of each topic the publisher's numbers that were skipped (several publishers' cannot be told apart)."""
        return {name: skipped.lost for name, skipped in self.skipped.items()}

    @property
    def trace_rows_missing(self) -> int:
        """Ticks between first and last row of the trace that have no row."""
        steps = np.diff(self.trace["tick"])
        return int(np.sum(steps[(steps > 1) & np.isfinite(steps)] - 1))

    def statuses(self, node: str) -> tuple[Status, ...]:
        """What the named node said on /diagnostics, oldest first; empty if it never spoke."""
        found = (name for name in self.diagnostics if name.rsplit("/", 1)[-1] == node)  # not those of its figures
        return tuple(sorted((status for name in found for status in self.diagnostics[name]), key=lambda s: s.time))

    def last_values(self, node: str) -> dict[str, str]:
        """The entries of the node's last diagnostic status; empty if it never spoke."""
        statuses = self.statuses(node)
        return statuses[-1].values if statuses else {}

    def monotonic(self, time: np.ndarray) -> np.ndarray:
        """System-clock times [ns] as CLOCK_MONOTONIC [ns], the one clock that deadlines and all nodes' data share.

        The offset is the median of each second's pairs: each activation of the driver has its own. Raises ValueError if
        the bag has neither a trace nor `operator/state`.
        """
        system, monotonic = self.pairs
        if len(system) == 0:
            raise ValueError(f"bag {self.bag} has neither trace nor operator/state, which join the nodes' clocks")
        time = np.asarray(time, np.int64)
        second = (system - system[0]) // _SECOND
        begins = np.flatnonzero(np.diff(second, prepend=-1))
        offsets = [np.median(part) for part in np.split(system - monotonic, begins[1:])]
        return time - np.interp(time, system[begins], offsets).round().astype(np.int64)

    def columns(self, topic: str) -> dict[str, np.ndarray]:
        """A topic as flat named columns over `time` [s of CLOCK_MONOTONIC]; vectors as name.x, name.y, name.theta."""
        return flat_cloud(self._named(self.clouds, topic)) if topic in self.clouds else self._flat_joints(topic)

    def to_dataframe(self, topic: str, library: str = "pandas"):
        """`columns` as a DataFrame of pandas or polars, whichever is named; ImportError if it is not installed."""
        return importlib.import_module(library).DataFrame(self.columns(topic))

    def _flat_joints(self, topic: str) -> dict[str, np.ndarray]:
        joints = self.joint(topic)
        flat = {"time": self.monotonic(joints.stamp) * 1e-9}
        parts = [part for part in PORT_UNITS if getattr(joints, part).shape[1]]  # those that were read
        for index, name in enumerate(joints.names):
            flat |= {f"{name}.{part}": getattr(joints, part)[:, index] for part in parts}
        return flat

    def _named(self, found: dict, topic: str):
        if topic not in found:
            there = ", ".join(found) or "none of its kind"
            why = "".join(f"; {note}" for note in self.notes)
            raise ValueError(f"bag {self.bag} has no topic {topic} under {self.namespace or '/'}; it has {there}{why}")
        return found[topic]


def flat_cloud(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a structured array, one for each axis, after the time [s] of their deadline."""
    flat = {"time": rows["deadline"] * 1e-9} if "deadline" in rows.dtype.names else {}
    for name in rows.dtype.names:
        if rows[name].ndim == 1:
            flat[name] = np.ascontiguousarray(rows[name])
        else:
            flat |= {f"{name}.{axis}": rows[name][:, i].copy() for i, axis in enumerate(_axes(rows[name].shape[1]))}
    return flat


def _axes(count: int) -> Iterable[str]:
    return ("x", "y", "theta") if count == 3 else map(str, range(count))


def load(bag: Path | str, namespace: str | None = None, only: Mapping[str, Any] | None = None) -> Recording:
    """Reads a bag folder or one .mcap file; `namespace` is needed only where the bag holds several devices.

    only: the topics to read and what of them, {short name: Entries of a JointState | structured type of a trace | None
    for all}, for bags that would not fit into memory; diagnostics and marks are read in any case. Raises
    FileNotFoundError or ValueError with a sentence; a bag that is cut off or damaged is read as far as it goes and
    `notes` says so.
    """
    bag = Path(bag)
    topics, attachments, notes = read(bag, lambda topic, type_name: _collector(topic, type_name, only))
    notes += [f"topic {name} is left out: {topic.refused}" for name, topic in topics.items() if topic.refused]
    diagnostics = _diagnostics(topics.get("/diagnostics"), notes)
    namespace = _only_namespace(topics, diagnostics, bag) if namespace is None else namespace.rstrip("/")
    ours = {name[len(namespace) + 1 :]: topic for name, topic in topics.items() if name.startswith(namespace + "/")}
    found = {name: topic for name, topic in ours.items() if not topic.refused}
    joints, clouds = (
        {name: taken(name, topic, notes) for name, topic in found.items() if isinstance(topic.collector, kind)}
        for kind, taken in ((JointColumns, _joints), (CloudColumns, _cloud))
    )
    return Recording(
        bag,
        namespace,
        joints,
        clouds,
        diagnostics,
        _marks(found.get(MARK), notes),
        attachments,
        {name: len(topic) for name, topic in topics.items()},
        {name: counted(topic.times.sequence) for name, topic in topics.items()},
        _pairs(found.get("trace"), clouds.get("trace"), joints.get("operator/state")),
        tuple(notes),
    )


def _collector(topic: str, type_name: str, only):
    short = next((name for name in only or () if topic.endswith(f"/{name}")), None)
    if topic == "/diagnostics" or type_name == STRING:
        return Keep()
    if only is not None and short is None:
        return None
    wanted = only[short] if only else None
    if type_name == JOINTS or type_name in STAMPED:
        return JointColumns(type_name, wanted)
    return CloudColumns(wanted) if type_name == CLOUD else None


def _only_namespace(topics: Iterable[str], diagnostics: Iterable[str], bag: Path) -> str:
    """By our topics, else by the markers; none where our nodes spoke on /diagnostics only."""
    found = _namespaces(topics, TOPICS) or _namespaces(topics, (MARK,))
    if not found and any(name.startswith(_NODE) for name in diagnostics):
        return ""
    if not found:
        there = ", ".join(sorted(topics))
        raise ValueError(f"bag {bag} is of no haptic display: it has {there}, no {', '.join(TOPICS)}")
    if len(found) > 1:
        raise ValueError(f"bag {bag} holds several devices, name one namespace: {', '.join(sorted(found))}")
    return found.pop()


def _namespaces(topics: Iterable[str], names: Iterable[str]) -> set[str]:
    return {topic[: -len(name) - 1] for topic in topics for name in names if topic.endswith("/" + name)}


def _joints(name: str, topic: Topic, notes: list[str]) -> Joints:
    columns, times = topic.collector, topic.times
    kept = columns.kept
    if others := int(np.sum(~kept)):
        notes.append(f"topic {name}: {others} messages of another layout than the first are left out")
    stamp, *parts = columns.arrays()
    return Joints(columns.names, stamp, *(times if kept.all() else (column[kept] for column in times)), *parts)


def _cloud(name: str, topic: Topic, notes: list[str]) -> np.ndarray:
    columns = topic.collector
    if columns.others:
        notes.append(f"topic {name}: {columns.others} messages of another layout than the first are left out")
    if columns.missing:
        notes.append(f"topic {name} has no {', '.join(columns.missing)}")
    return columns.records()


def _pairs(trace: Topic | None, rows: np.ndarray | None, state: Joints | None) -> tuple[np.ndarray, np.ndarray]:
    """Times on the system clock and on CLOCK_MONOTONIC: of the trace's blocks, else of `operator/state`."""
    if rows is not None and "deadline" in rows.dtype.names:
        columns = trace.collector
        begins, stamps = np.array(columns.begins, np.int64), np.array(columns.stamps, np.int64)
        some = begins < len(rows)
        first = rows["deadline"][begins[some]]
        known = np.isfinite(first)
        return stamps[some][known], first[known].round().astype(np.int64)
    if state is not None and "time" in state.names:
        known = np.isfinite(state.entry("time"))
        return state.published[known], np.round(state.entry("time")[known] * 1e9).astype(np.int64)
    return np.empty(0, np.int64), np.empty(0, np.int64)


def _diagnostics(topic: Topic | None, notes: list[str]) -> dict[str, tuple[Status, ...]]:
    """Statuses by name, oldest first."""
    statuses: dict[str, list[Status]] = {}
    for time, message in _messages(topic, notes, "diagnostics", DIAGNOSTICS):
        for name, status in named_statuses(message, time):
            statuses.setdefault(name, []).append(status)
    return {name: tuple(found) for name, found in statuses.items()}


def _marks(topic: Topic | None, notes: list[str]) -> tuple[Mark, ...]:
    return tuple(Mark(time, message.data) for time, message in _messages(topic, notes, MARK, STRING))


def _messages(topic: Topic | None, notes: list[str], name: str, type_name: str) -> Iterator[tuple[int, Any]]:
    """(received, message) of a topic whose messages were kept; those that cannot be read are noted and left out."""
    if topic is None or not isinstance(topic.collector, Keep):
        return
    if topic.type_name != type_name:
        notes.append(f"topic {name} is left out: it is {topic.type_name}, not {type_name}")
        return
    broken = 0
    for data, time in zip(topic.collector.data, topic.times.received.tolist(), strict=True):
        try:
            message = types().deserialize_cdr(data, topic.type_name)
        except Exception:  # whatever a message of another version makes the decoder say
            broken += 1
            continue
        yield time, message
    if broken:
        notes.append(f"topic {name}: {broken} messages cannot be read")
