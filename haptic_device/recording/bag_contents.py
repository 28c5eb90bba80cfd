# SPDX-License-Identifier: Apache-2.0
"""What a bag holds, as named numpy arrays with their units; `load` of the package reads it.

Clocks: `deadline` in the trace is CLOCK_MONOTONIC [ns]; stamps, received and published are the system clock [ns];
`Recording.monotonic` turns the latter into the former.
"""

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.recording.reader import StampOrder
from haptic_device.recording.sequence_gaps import SequenceGaps
from haptic_device.recording.status import Status, number

Array = npt.NDArray[np.float64]
Nanoseconds = npt.NDArray[np.int64]
Records = npt.NDArray[np.void]
"""Structured arrays of one record a tick, as the trace has them."""

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
_FORCES = "walls", "coupling", "cancellation", "gravity", "passivity", "on_handle"
TRACE_UNITS = {
    **dict.fromkeys(("deadline", "latched"), "ns, CLOCK_MONOTONIC"),
    **dict.fromkeys(("lateness", "compute", "write_delay", "lateness_least", "lateness_counted"), "s"),
    **dict.fromkeys(("tool_age", "contact_age"), "s, -1 = none yet"),
    **dict.fromkeys(("stored", "promised", "tool_energy", "exchange_energy", "energy_given", "exchange_tank"), "J"),
    **dict.fromkeys(("margin", "surplus"), "N s/m | N m s/rad"),
    **dict.fromkeys(("tool_position", "position", "coupling_position"), PORT_UNITS["position"]),
    **dict.fromkeys(("tool_velocity", "velocity", "coupling_velocity"), PORT_UNITS["velocity"]),
    **dict.fromkeys(("drag", "tool_effort", "exchange_effort"), PORT_UNITS["effort"]),
    **{f"force_{what}": PORT_UNITS["effort"] for what in _FORCES},
    **{"stamp_error": "ns", "lateness_ratio": "", "motor": "motor units", "joint": "rad", "torque": "N m"},
    "tools_apart": "m",
}
LIBRARIES = ("pandas", "polars")
_SECOND = 1_000_000_000


class Joints(NamedTuple):
    """A JointState topic as arrays: n messages, m names. Units: PORT_UNITS and ENTRY_UNITS.

    The position of `motor` is its command in motor units. `wrench` has only an effort, and `pose` has only a position.
    Their names are those of the message fields.

    Attributes:
        names: names of the entries, (m).
        stamp: stamp of each message, of the system clock [ns], (n).
        received: when the recorder received it, of the system clock [ns], (n).
        published: when it was published, of the system clock [ns], (n).
        sequence: number that its publisher gave it, (n).
        position: (n, m) [m | rad].
        velocity: (n, m) [m/s | rad/s].
        effort: (n, m) [N | N m].

    Examples:
        >>> from haptic_device.recording import load
        >>> state = load("run/bag").joint("operator/state")
        >>> state
        Joints(1000 messages of x, y, theta, motor_x, motor_y, motor_theta, energy_given, time, motion_done)
        >>> print(f"{state.entry('x')[0]:.3f} m")
        0.030 m
    """

    names: tuple[str, ...]
    stamp: Nanoseconds
    received: Nanoseconds
    published: Nanoseconds
    sequence: npt.NDArray[np.int64]
    position: Array
    velocity: Array
    effort: Array

    def __repr__(self) -> str:
        return f"Joints({len(self.stamp)} messages of {', '.join(self.names) or 'nothing'})"

    def entry(self, name: str, part: str = "position") -> Array:
        """One entry over time, (n); `part` is position, velocity or effort.

        Raises ValueError, with what there is, if the topic has no such entry or this part of it is not there.
        """
        if said := self.lacks(name):
            raise ValueError(said)
        if part not in (there := self._parts()):
            raise ValueError(f"the topic has no {part} of {name}; it has {', '.join(there) or 'names only'}")
        return getattr(self, part)[:, self.names.index(name)]

    def lacks(self, name: str) -> str:
        """That the topic has no such entry, a sentence; "" if it has."""
        return "" if name in self.names else f"the topic has no entry {name}; it has {', '.join(self.names) or 'none'}"

    def _parts(self) -> list[str]:
        """Of position, velocity and effort those that were read."""
        return [part for part in PORT_UNITS if getattr(self, part).shape[1]]


class Mark(NamedTuple):
    """A marker that somebody set.

    Attributes:
        time: when the recorder received it, of the system clock [ns].
        text: its text.

    Examples:
        >>> from haptic_device.recording import load
        >>> load("run/bag").marks  # nobody set one
        ()
    """

    time: int
    text: str


@dataclass(frozen=True, repr=False)
class Recording:
    """Contents of a bag from one namespace. Topics have short names: `trace`, `handle`, `operator/state`.

    Attributes:
        bag: path of the bag.
        namespace: namespace of the topics, such as `/haptic`.
        joints: JointState topics, and wrench and pose, by short name.
        clouds: PointCloud2 topics as structured arrays, by short name: the rows of all messages, one after the other.
        cloud_stamps: of clouds whose rows have no `deadline`, such as `scene/contacts`: for each row the stamp of its
            message, of the system clock [ns], by short name.
        diagnostics: statuses of nodes, {name: statuses, oldest first}.
        marks: markers, in the order of time.
        attachments: files in the bag, {name: bytes}.
        counts: messages of each topic, by full name.
        skipped: gaps in the message numbers of each topic, by full name: messages that are not in the bag.
        lost: messages of each topic that were published but did not reach the recorder, by full name. None if this is
            unknown because several nodes publish.
        orders: order of the stamps of each topic with stamps, by full name.
        seconds: from the first message to the last [s].
        pairs: simultaneous times of the system clock and of CLOCK_MONOTONIC [ns], for `monotonic`.
        notes: problems of the bag, one sentence each. Steps of the system clock are here, and no time has them.

    Examples:
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> recording.seconds, recording.lost["/haptic/trace"]
        (2.0, 0)
        >>> recording.trace["force_coupling"].shape  # [N, N, N m], a row a tick
        (8000, 3)
    """

    bag: Path
    namespace: str
    joints: dict[str, Joints]
    clouds: dict[str, Records]
    cloud_stamps: dict[str, Nanoseconds]
    diagnostics: dict[str, tuple[Status, ...]]
    marks: tuple[Mark, ...]
    attachments: dict[str, bytes]
    counts: dict[str, int]
    skipped: dict[str, SequenceGaps]
    lost: dict[str, int | None]
    orders: dict[str, StampOrder]
    seconds: float
    pairs: tuple[Nanoseconds, Nanoseconds]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """One line: bag, namespace, length, topics with their numbers of messages."""
        begin = f"{self.namespace}/"
        topics = ", ".join(f"{name.removeprefix(begin)} {count}" for name, count in self.counts.items())
        return f"Recording({str(self.bag)!r}, {self.namespace or '/'}, {self.seconds:.3f} s: {topics})"

    def joint(self, topic: str) -> Joints:
        """A JointState topic by its short name, such as `operator/state`. Raises ValueError if it was not recorded."""
        return self._named(self.joints, "JointState topic", topic)

    def lacks(self, topic: str, *entries: str) -> str:
        """That a JointState topic, or one of these entries of it, was not recorded, a sentence; "" if all were."""
        if topic not in self.joints:
            return self._missing("JointState topic", topic)
        return next(filter(None, map(self.joints[topic].lacks, entries)), "")

    @property
    def trace(self) -> Records:
        """Every servo tick: a structured array, units in TRACE_UNITS. Raises ValueError if it was not recorded."""
        return self._named(self.clouds, "cloud", "trace")

    @property
    def trace_rows_missing(self) -> int:
        """Ticks between first and last row of the trace that have no row."""
        steps = np.diff(self.trace["tick"])
        return int(np.sum(steps[(steps > 1) & np.isfinite(steps)] - 1))

    @property
    def left_out(self) -> dict[str, int]:
        """What the driver could not publish from its first status in the bag to its last: rows of the trace that found
        its ring full, and samples (encoder with motor, or wrench with pose and joint_states) that were skipped.

        `lost` knows nothing of these: they never were messages. Empty if the driver did not say.
        """
        names = {"trace rows": "trace_dropped", "samples": "telemetry_skipped"}
        grown = {what: self.grown("haptic_driver", name) for what, name in names.items()}
        return {what: int(count) for what, count in grown.items() if count is not None}

    def statuses(self, node: str) -> tuple[Status, ...]:
        """What the named node said on /diagnostics, oldest first; empty if it never spoke."""
        found = (name for name in self.diagnostics if name.rsplit("/", 1)[-1] == node)  # not those of its figures
        return tuple(sorted((status for name in found for status in self.diagnostics[name]), key=lambda s: s.time))

    def last_values(self, node: str) -> dict[str, str]:
        """The entries of the node's last diagnostic status; empty if it never spoke."""
        statuses = self.statuses(node)
        return statuses[-1].values if statuses else {}

    def grown(self, node: str, name: str, counter: str = "") -> float | None:
        """By how much a value that the node counts since its start grew from its first status in the bag to its last.

        counter: another value of the same status that only rises, where this one may fall. Where it falls all the
        same, the node began anew, at zero. None where fewer than two statuses say it.
        """
        values = [status.values for status in self.statuses(node)]
        said = [(number(one.get(name, "")), number(one.get(counter or name, ""))) for one in values]
        known = [(value, count) for value, count in said if np.isfinite(value)]
        if len(known) < 2:
            return None
        return sum(value - (0.0 if count < before else start) for (start, before), (value, count) in pairwise(known))

    def monotonic(self, time: Nanoseconds) -> Nanoseconds:
        """Times of the system clock [ns] as times of CLOCK_MONOTONIC [ns], the clock of deadlines and of all nodes.

        The offset is the median of each second's pairs, because each activation of the driver has its own. Raises
        ValueError if the bag has neither a trace nor `operator/state`.
        """
        system, monotonic = self.pairs
        if len(system) == 0:
            raise ValueError(f"bag {self.bag} has neither trace nor operator/state, which join the nodes' clocks")
        time = np.asarray(time, np.int64)
        second = (system - system[0]) // _SECOND
        begins = np.flatnonzero(np.diff(second, prepend=-1))
        offsets = [np.median(part) for part in np.split(system - monotonic, begins[1:])]
        return time - np.interp(time, system[begins], offsets).round().astype(np.int64)

    def columns(self, topic: str) -> dict[str, npt.NDArray[Any]]:
        """A topic as flat named columns over `time` [s of CLOCK_MONOTONIC]; vectors as name.x, name.y, name.theta.

        `time` is the stamp of the message; of a cloud the row's `deadline`, else the stamp of the row's message. A
        message of several rows, such as one of `scene/contacts`, gives them all one time. Such a cloud has no `time`
        where nothing in the bag joins the clocks. Raises ValueError if the topic was not recorded, or as `monotonic`.
        """
        if topic not in self.clouds:
            return self._flat_joints(topic)
        flat = flat_cloud(self.clouds[topic])
        if topic not in self.cloud_stamps or len(self.pairs[0]) == 0:
            return flat
        return {"time": self.monotonic(self.cloud_stamps[topic]) * 1e-9} | flat

    def to_dataframe(self, topic: str, library: str = "pandas") -> Any:
        """`columns` as a DataFrame of pandas or polars, as `library` says.

        Raises ValueError as `columns`, or if `library` is another; ImportError if it is not installed.
        """
        if library not in LIBRARIES:
            raise ValueError(f"library {library} is none of {', '.join(LIBRARIES)}")
        return importlib.import_module(library).DataFrame(self.columns(topic))

    def _flat_joints(self, topic: str) -> dict[str, npt.NDArray[Any]]:
        joints = self._named(self.joints, "topic", topic)
        flat = {"time": self.monotonic(joints.stamp) * 1e-9}
        for index, name in enumerate(joints.names):
            flat |= {f"{name}.{part}": getattr(joints, part)[:, index] for part in joints._parts()}
        return flat

    def _named(self, found: dict[str, Any], kind: str, topic: str) -> Any:
        if topic not in found:
            raise ValueError(self._missing(kind, topic))
        return found[topic]

    def _missing(self, kind: str, topic: str) -> str:
        kinds: dict[str, Iterable[str]] = {"JointState topics": self.joints, "clouds": self.clouds}
        there = " and the ".join(f"{name} {', '.join(names)}" for name, names in kinds.items() if names)
        told = f"the {there}" if there else "neither JointState topics nor clouds"
        why = "".join(f"; {note}" for note in self.notes)
        what = f"{kind} {topic}" if topic in self.joints | self.clouds else f"topic {topic}"
        return f"bag {self.bag} has no {what} under {self.namespace or '/'}; it has {told}{why}"


def flat_cloud(rows: Records) -> dict[str, npt.NDArray[Any]]:
    """Columns of a structured array, one for each axis, after the time [s] of their deadline."""
    names = rows.dtype.names or ()
    flat = {"time": rows["deadline"] * 1e-9} if "deadline" in names else {}
    for name in names:
        if rows[name].ndim == 1:
            flat[name] = np.ascontiguousarray(rows[name])
        else:
            flat |= {f"{name}.{axis}": rows[name][:, i].copy() for i, axis in enumerate(_axes(rows[name].shape[1]))}
    return flat


def _axes(count: int) -> Iterable[str]:
    return ("x", "y", "theta") if count == 3 else map(str, range(count))
