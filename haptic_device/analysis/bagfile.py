# SPDX-License-Identifier: Apache-2.0
"""Messages and attachments out of an MCAP bag, complete, cut off or damaged in the middle; pure Python, no ROS.

Each topic's messages go to a collector in batches of some megabytes, so that a bag of gigabytes is read with the
memory of what is kept of it.
"""

import io
import struct
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from haptic_device.mcapfile import MESSAGE, Records, places, unpack

_BATCH = 4 * 2**20  # bytes of one topic's messages that are decoded together


class Collector(Protocol):
    """Takes batches of one topic's serialized messages, in the order of the file."""

    def add(self, data: list[bytes]) -> None:
        """Takes the next messages."""


class Keep:
    """The collector that keeps the messages as they are."""

    def __init__(self):
        self.data: list[bytes] = []

    def add(self, data: list[bytes]) -> None:
        """Keeps them."""
        self.data += data


class Times(NamedTuple):
    """Of each message: received and published in ns of the system clock, and the publisher's sequence."""

    received: np.ndarray
    published: np.ndarray
    sequence: np.ndarray


class Topic:
    """One topic as it is read: its type, its times, and its collector (None: only counted)."""

    def __init__(self, type_name: str, collector: Collector | None):
        self.type_name, self.collector = type_name, collector
        self._times = array("q"), array("q"), array("q")
        self._waiting: list[bytes] = []
        self._size = 0

    @property
    def times(self) -> Times:
        """Times and sequences of all messages."""
        return Times(*(np.array(column, np.int64) for column in self._times))

    def __len__(self) -> int:
        return len(self._times[0])

    def note(self, sequence: int, received: int, published: int) -> None:
        """Notes the times of one message."""
        for column, value in zip(self._times, (received, published, sequence), strict=True):
            column.append(value)

    def take(self, data: bytes) -> None:
        """Takes one message's bytes."""
        self._waiting.append(data)
        self._size += len(data)
        if self._size >= _BATCH:
            self.finish()

    def finish(self) -> None:
        """Hands what waits to the collector."""
        if self._waiting:
            self.collector.add(self._waiting)
        self._waiting, self._size = [], 0


class Contents(NamedTuple):
    """Topics by name, attachments by name, and a sentence for whatever was wrong."""

    topics: dict[str, Topic]
    attachments: dict[str, bytes]
    notes: list[str]


def read(bag: Path, collector: Callable[[str, str], Collector | None]) -> Contents:
    """Everything in the bag; collector(topic, type name) says who takes a topic's messages.

    Raises FileNotFoundError or ValueError when there is nothing to read.
    """
    contents, refused = Contents({}, {}, []), []
    for file in files(bag):
        try:
            with open(file, "rb") as stream:
                _File(file.name, stream, contents, collector).read()
        except ValueError as error:
            refused.append(f"{file}: {error} ({file.stat().st_size} bytes)")
    for name, topic in list(contents.topics.items()):
        topic.finish()
        if not len(topic):
            del contents.topics[name]
    contents.notes.extend(refused)
    if not contents.topics:
        raise ValueError(f"bag {bag} holds no message" + "".join(f"; {note}" for note in contents.notes))
    return contents


def files(bag: Path) -> list[Path]:
    """The MCAP files of a bag folder in their order, or the one file given."""
    if bag.is_file():
        return [bag]
    if not bag.is_dir():
        raise FileNotFoundError(f"bag {bag} does not exist")
    found = sorted(bag.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    if not found:
        raise ValueError(f"folder {bag} holds no .mcap file, so it is no bag of this kind")
    return found


class _File:
    """One file being read: its own schemas and channels, the bag's topics."""

    def __init__(self, name, stream, contents, collector):
        self._name, self._records = name, Records(stream)
        self._contents, self._collector = contents, collector
        self._types: dict[int, str] = {}
        self._channels: dict[int, Topic] = {}
        self._damaged, self._strangers, self._ended = 0, 0, False

    def read(self) -> None:
        """Reads it to its end, or to where it is cut off."""
        for record in self._records:
            if record.opcode == Opcode.DATA_END:
                self._ended = True
            elif not self._ended:
                self._take(record.opcode, record.content)
        if self._damaged:
            self._say(f"is damaged in {self._damaged} places; the rest is read")
        if self._strangers:
            self._say(f"has {self._strangers} messages of channels that it does not describe")
        if self._records.wrong:
            self._say(f"{self._records.wrong}: what was written up to there is read")

    def _say(self, sentence: str) -> None:
        self._contents.notes.append(f"{self._name} {sentence}")

    def _take(self, opcode: int, content: bytes) -> None:
        try:
            if opcode == Opcode.CHUNK:
                self._take_chunk(unpack(content).records)
            elif opcode == Opcode.ATTACHMENT:
                found = records.Attachment.read(_stream(content))
                self._contents.attachments[found.name] = found.data
            else:
                self._take_part(opcode, content)
        except (ValueError, struct.error, EndOfFile):  # a text that is none is a ValueError too
            self._damaged += 1

    def _take_chunk(self, data: bytes) -> None:
        parts = list(places(data))
        parse, head, channels = MESSAGE.unpack_from, MESSAGE.size, self._channels
        for opcode, begin, end in parts:
            if opcode != Opcode.MESSAGE:
                self._take_part(opcode, data[begin:end])
                continue
            channel, sequence, received, published = parse(data, begin)
            topic = channels.get(channel)
            if topic is None:
                self._strangers += 1
                continue
            topic.note(sequence, received, published)
            if topic.collector is not None:
                topic.take(data[begin + head : end])

    def _take_part(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = records.Schema.read(_stream(content))
            self._types[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = records.Channel.read(_stream(content))
            self._channels[channel.id] = self._topic(channel.topic, self._types.get(channel.schema_id, ""))
        elif opcode == Opcode.MESSAGE and len(content) >= MESSAGE.size:  # of a file without chunks
            self._take_alone(content)

    def _take_alone(self, content: bytes) -> None:
        channel, sequence, received, published = MESSAGE.unpack_from(content)
        if topic := self._channels.get(channel):
            topic.note(sequence, received, published)
            if topic.collector is not None:
                topic.take(content[MESSAGE.size :])

    def _topic(self, name: str, type_name: str) -> Topic:
        found = self._contents.topics.get(name)
        if found is None:
            found = self._contents.topics[name] = Topic(type_name, self._collector(name, type_name))
        if found.type_name != type_name:
            self._say(f"has {name} as {type_name}, before it was {found.type_name}: left out here")
            return Topic(type_name, None)
        return found


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(content))
