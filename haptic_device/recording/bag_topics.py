# SPDX-License-Identifier: Apache-2.0
"""Reads a bag as named numpy arrays. Works wherever Python does, without ROS."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.recording.bag_contents import Joints, Mark, Nanoseconds, Recording, Records
from haptic_device.recording.columns import CloudColumns, JointColumns
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, STAMPED, STRING, types
from haptic_device.recording.metadata import said_in
from haptic_device.recording.reader import Collector, Keep, Topic, read
from haptic_device.recording.sequence_gaps import SHARED, SequenceGaps, counted
from haptic_device.recording.status import Status, named_statuses, of_namespace

TOPICS = ("encoder", "motor", "handle", "tool", "trace", "wrench", "pose", "operator/state", "operator/target")
MARK = "mark"
# which not every bag has
OTHERS = "/diagnostics", MARK, "snapshot", "local_contacts", "joint_states", "scene/state", "scene/contacts"
RESTARTS = 3  # of a publisher, in a recording; if its numbers fall more often, and one in a hundred, there are two
_NODE = "haptic_"  # begins the name of every node of ours


def load(bag: Path | str, namespace: str | None = None, only: Mapping[str, Any] | None = None) -> Recording:
    """Reads a bag folder or one .mcap file. Needs no ROS.

    Raises FileNotFoundError or ValueError with one sentence if there is nothing to read. A bag that is cut off or
    damaged is read as far as possible, and `notes` reports this. Raises ValueError too if the bag has no such
    namespace, or if `only` names a topic that the bag lacks and that no node of this project publishes; TypeError if
    `only` is no mapping.

    Args:
        bag: path of the bag.
        namespace: needed only if the bag has several devices.
        only: topics and parts to read, for bags that do not fit into memory: {short name: Entries of a JointState |
            structured type of a trace | None for all}. Diagnostics and marks are always read.

    Examples:
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> recording
        Recording('run/bag', /haptic, 2.000 s: trace 20, snapshot 1, handle 1, operator/state 1000, /diagnostics 4)
        >>> recording.trace.shape, recording.notes
        ((8000,), ())
        >>> load("nowhere")
        Traceback (most recent call last):
            ...
        FileNotFoundError: bag nowhere does not exist
    """
    if not isinstance(only, Mapping | None):
        raise TypeError(f"only is a {type(only).__name__}, not a mapping of topics such as {{'trace': None}}")
    bag = Path(bag)
    topics, attachments, notes = read(bag, lambda topic, type_name: _collector(topic, type_name, only))
    notes += [f"topic {name} is left out: {topic.refused}" for name, topic in topics.items() if topic.refused]
    said = [
        named_statuses(message, time)
        for time, message in _messages(topics.get("/diagnostics"), notes, "diagnostics", DIAGNOSTICS)
    ]
    names = {name for one in said for name, _ in one}
    namespace = _only_namespace(topics, names, bag) if namespace is None else namespace.rstrip("/")
    ours = {name[len(namespace) + 1 :]: topic for name, topic in topics.items() if name.startswith(namespace + "/")}
    _refuse_unknown(bag, namespace, ours, topics, only or ())
    found = {name: topic for name, topic in ours.items() if not topic.refused}
    skipped = {name: counted(topic.times.sequence) for name, topic in topics.items()}
    back = {one: skipped[f"{namespace}/{one}"].back for one in ours if not f"/{one}".endswith(SHARED)}
    if twice := [name for name, count in back.items() if count > max(RESTARTS, len(ours[name]) / 100)]:
        where = f"numbers alternate in {', '.join(twice)}"
        notes.append(f"{namespace or '/'} has messages of two publishers, or none in its order: {where}")
    joints, clouds, cloud_stamps = {}, {}, {}
    for name, topic in found.items():
        columns = topic.collector
        if isinstance(columns, JointColumns):
            joints[name] = Joints._make((columns.names, *(one[columns.kept] for one in topic.times), *columns.arrays()))
        elif isinstance(columns, CloudColumns):
            clouds[name] = columns.records()
            notes += [f"topic {name} has no {', '.join(columns.missing)}"] if columns.missing else []
            notes += _not_numbers(clouds[name], columns.missing) if name == "trace" else []
            if "deadline" not in (clouds[name].dtype.names or ()):
                cloud_stamps[name] = columns.of_rows(topic.times.stamp)
        if isinstance(columns, JointColumns | CloudColumns) and (others := columns.kept.count(False)):
            notes.append(f"topic {name}: {others} messages of another layout than the first are left out")
    diagnostics, marks = _diagnostics(said, namespace), _marks(found.get(MARK), notes)
    counts, length = {name: len(topic) for name, topic in topics.items()}, _length(topics.values())
    orders = {name: order for name, topic in topics.items() if (order := topic.order).stamped}
    pairs = _pairs(found.get("trace"), clouds.get("trace"), joints.get("operator/state"))
    told = diagnostics, marks, attachments, counts, skipped, _lost(bag, skipped), orders, length, pairs, tuple(notes)
    return Recording(bag, namespace, joints, clouds, cloud_stamps, *told)


def _collector(topic: str, type_name: str, only: Mapping[str, Any] | None) -> Collector | None:
    short = next((name for name in only or () if topic.endswith(f"/{name}")), None)
    if topic == "/diagnostics" or type_name == STRING:
        return Keep()
    if only is not None and short is None:
        return None
    wanted = only[short] if only and short else None
    if type_name == JOINTS or type_name in STAMPED:
        return JointColumns(type_name, wanted)
    return CloudColumns(wanted) if type_name == CLOUD else None


def _refuse_unknown(bag: Path, namespace: str, ours: Iterable[str], topics: Iterable[str], only: Iterable[str]) -> None:
    """Raises ValueError for a namespace, or a name in `only`, that the bag lacks. A bag may lack topics of ours."""
    there = sorted(_namespaces(topics, TOPICS) or _namespaces(topics, (MARK,)))
    if there and not ours:
        raise ValueError(
            f"bag {bag} has no namespace {namespace or '/'}; it has {', '.join(name or '/' for name in there)}"
        )
    if unknown := [name for name in only if name not in (*ours, *TOPICS, *OTHERS)]:
        raise ValueError(f"only names {', '.join(unknown)}, which bag {bag} lacks; it has {', '.join(sorted(ours))}")


def _lost(bag: Path, skipped: Mapping[str, SequenceGaps]) -> dict[str, int | None]:
    """As metadata.yaml says it, whose recorder knows how many publish; else by the numbers of the messages."""
    said = said_in(bag).get("custom_data")
    counts = said if isinstance(said, dict) else {}
    told = {name: str(counts.get(f"lost {name}", found.told(name))) for name, found in skipped.items()}
    return {name: int(text) if text.isdecimal() else None for name, text in told.items()}


def _length(topics: Iterable[Topic]) -> float:
    """Time [s] from the first message received to the last."""
    received = [topic.times.received for topic in topics]
    return (max(int(times.max()) for times in received) - min(int(times.min()) for times in received)) * 1e-9


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


def _not_numbers(rows: Records, missing: list[str]) -> Iterator[str]:
    """A sentence for each column of the trace with values that are no numbers."""
    for name in rows.dtype.names or ():
        if name not in missing and (wrong := np.isnan(rows[name]).reshape(len(rows), -1).any(axis=1).sum()):
            yield f"trace column {name} is no number in {wrong} of {len(rows)} ticks, which are kept"


def _pairs(trace: Topic | None, rows: Records | None, state: Joints | None) -> tuple[Nanoseconds, Nanoseconds]:
    """Times on the system clock and on CLOCK_MONOTONIC: of the trace's blocks, else of `operator/state`."""
    columns = trace.collector if trace else None
    if trace and isinstance(columns, CloudColumns) and rows is not None and "deadline" in (rows.dtype.names or ()):
        begins, stamps = np.array(columns.begins, np.int64), trace.times.stamp[columns.kept]
        some = begins < len(rows)
        first = rows["deadline"][begins[some]]
        known = np.isfinite(first)
        return stamps[some][known], first[known].round().astype(np.int64)
    if state is not None and "time" in state.names:
        known = np.isfinite(state.entry("time"))
        return state.published[known], np.round(state.entry("time")[known] * 1e9).astype(np.int64)
    return np.empty(0, np.int64), np.empty(0, np.int64)


def _diagnostics(said: list[list[tuple[str, Status]]], namespace: str) -> dict[str, tuple[Status, ...]]:
    """Statuses by name, oldest first, of messages from this namespace."""
    statuses: dict[str, list[Status]] = {}
    for message in said:
        if of_namespace((status for _, status in message), namespace):
            for name, status in message:
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
