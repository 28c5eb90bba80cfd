# SPDX-License-Identifier: Apache-2.0
"""Messages and attachments of a bag, topic by topic, in the order in which they came; needs no ROS.

Each topic's messages go to a collector in batches, so that a bag of gigabytes is read with the memory of what is kept
of it.
"""

import itertools
from array import array
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from mcap.records import Attachment, Channel, Message, Schema

from haptic_device.recording.bag_files import files_of
from haptic_device.recording.clock_steps import ClockStep, Written, steps_of, without_steps
from haptic_device.recording.layouts import HEADED, STAMP_END, stamp_of
from haptic_device.recording.mcap_records import Records

_BATCH = 2**20  # bytes of one topic's messages that are decoded together


class Collector(Protocol):
    """Takes batches of one topic's serialized messages, in the order of the files."""

    def add(self, data: list[bytes]) -> None:
        """Takes the next messages. Raises ValueError if they are not what it can take."""

    def reorder(self, order: npt.NDArray[np.intp]) -> None:
        """Puts all that were taken into another order; order: of each place, which message belongs there."""


class Keep:
    """The collector that keeps the messages as they are."""

    def __init__(self) -> None:
        self.data: list[bytes] = []

    def add(self, data: list[bytes]) -> None:
        """Keeps them."""
        self.data += data

    def reorder(self, order: npt.NDArray[np.intp]) -> None:
        """Puts them into this order."""
        self.data = [self.data[place] for place in order]


Choice = Callable[[str, str], Collector | None]
"""Who takes a topic's messages, by its name and its type."""


class Times(NamedTuple):
    """Of each message, (messages): stamp (0: none), received, published [ns of the system clock], its number."""

    stamp: npt.NDArray[np.int64]
    received: npt.NDArray[np.int64]
    published: npt.NDArray[np.int64]
    sequence: npt.NDArray[np.int64]


class StampOrder(NamedTuple):
    """Order of the stamps of one topic.

    Attributes:
        stamped: messages with a stamp.
        back: how many of these have an earlier stamp than the one before.
        same: how many have the same stamp as the one before.

    Examples:
        >>> from haptic_device.recording import load
        >>> load("run/bag").orders["/haptic/operator/state"]
        StampOrder(stamped=1000, back=0, same=0)
    """

    stamped: int = 0
    back: int = 0
    same: int = 0


class Topic:
    """One topic as it is read: its type, its times, the stamps of its messages, its collector (None: only counted), and
    why that took no more. After `end` all is in the order in which the messages came.
    """

    def __init__(self, type_name: str, collector: Collector | None) -> None:
        self.type_name, self.collector, self.refused = type_name, collector, ""
        self._headed, self._stamps = type_name in HEADED, array("q")
        self._taken, self._bytes = array("Q"), 0
        self._waiting: list[bytes] = []

    def __len__(self) -> int:
        return len(self._taken) // 4

    def take(self, message: Message, place: int) -> None:
        """The next message; place: how many of the bag were before it."""
        self._taken.extend((place, message.log_time, message.publish_time, message.sequence))
        self._stamps.append(stamp_of(message.data) if self._headed and len(message.data) >= STAMP_END else 0)
        if self.collector is not None:
            self._waiting.append(message.data)
            self._bytes += len(message.data)
            if self._bytes >= _BATCH:
                self._hand_on()

    @cached_property
    def written(self) -> Written:
        """Its messages as they were written, with the steps of the clock."""
        taken = np.array(self._taken).reshape(-1, 4).T.astype(np.int64, "C")
        return Written(taken[0], np.array(self._stamps, np.int64), *taken[1:])

    def end(self, steps: Sequence[ClockStep]) -> None:
        """All is there: the rest goes to the collector, all into its order, and the clock's steps out of the times.

        Numbers that rise as they were written are that order, else the times received are, as for every reader of bags.
        """
        self._hand_on()
        raw = self.written
        shifts = [(int(np.searchsorted(raw.place, step.place)), step.size) for step in steps]
        self.times = Times._make([*(without_steps(one, raw.received, shifts) for one in raw[1:4]), raw.sequence])
        if not np.all(np.diff(raw.sequence) > 0):
            order = np.lexsort((raw.sequence, self.times.published, self.times.received))
            self.times = Times(*(column[order] for column in self.times))
            if self.collector is not None and not self.refused:
                self.collector.reorder(order)
        ways = np.diff(stamps := self.times.stamp[self.times.stamp != 0])
        self.order = StampOrder(len(stamps), int(np.sum(ways < 0)), int(np.sum(ways == 0)))

    def _hand_on(self) -> None:
        """Hands what waits to the collector, unless that has refused before."""
        waiting, self._waiting, self._bytes = self._waiting, [], 0
        if self.collector is not None and waiting and not self.refused:
            try:
                self.collector.add(waiting)
            except ValueError as error:
                self.refused = str(error)


class Contents(NamedTuple):
    """Topics by name, attachments by name, and a sentence for whatever was wrong."""

    topics: dict[str, Topic]
    attachments: dict[str, bytes]
    notes: list[str]


def read(bag: Path, collector: Choice) -> Contents:
    """Everything in the bag; collector(topic, type name) says who takes a topic's messages.

    Raises FileNotFoundError or ValueError when there is nothing to read.
    """
    files, refused, places = files_of(bag), [], itertools.count()
    contents = Contents({}, {}, files.notes)
    for file in files.paths:
        try:
            with open(file, "rb") as stream:
                _read_file(file.name, Records(stream), contents, collector, places)
        except ValueError as error:
            refused.append(f"{file}: {error} ({file.stat().st_size} bytes)")
    for name in [name for name, topic in contents.topics.items() if not len(topic)]:
        del contents.topics[name]
    steps = steps_of({name: topic.written for name, topic in contents.topics.items()})
    for topic in contents.topics.values():
        topic.end(steps)
    contents.notes.extend([*refused, *map(_told, steps)])
    if not contents.topics:
        raise ValueError(f"bag {bag} holds no message" + "".join(f"; {note}" for note in contents.notes))
    return contents


def _told(step: ClockStep) -> str:
    """By how much the clock was set, and when."""
    set_by = f"{'back' if step.size < 0 else 'forward'} by {abs(step.size) * 1e-9:.3f} s"
    when = f"{step.since * 1e-9:.3f} s after the first message"
    return f"{when} the system clock was set {set_by}: times count on without it"


def _read_file(name: str, records: Records, contents: Contents, collector: Choice, places: Iterator[int]) -> None:
    """One file, with its own schemas and channels, into the bag's topics."""
    types: dict[int, str] = {}
    channels: dict[int, Topic] = {}
    notes, strangers = contents.notes, 0
    for record in records:
        if isinstance(record, Message):
            topic = channels.get(record.channel_id)
            if topic is None:
                strangers += 1
            else:
                topic.take(record, next(places))
        elif isinstance(record, Schema):
            types[record.id] = record.name
        elif isinstance(record, Attachment):
            contents.attachments[record.name] = record.data
        elif isinstance(record, Channel) and record.id not in channels:
            channels[record.id] = _topic(name, record.topic, types.get(record.schema_id, ""), contents, collector)
    if records.damaged:
        notes.append(f"{name} is damaged in {records.damaged} places; the rest is read")
    if strangers:
        notes.append(f"{name} has {strangers} messages of channels that it does not describe")
    if records.wrong:
        notes.append(f"{name} {records.wrong}: what was written up to there is read")


def _topic(file: str, name: str, type_name: str, contents: Contents, collector: Choice) -> Topic:
    found = contents.topics.get(name)
    if found is None:
        found = contents.topics[name] = Topic(type_name, collector(name, type_name))
    if found.type_name != type_name:
        contents.notes.append(f"{file} has {name} as {type_name}, before it was {found.type_name}: left out here")
        return Topic(type_name, None)
    return found
