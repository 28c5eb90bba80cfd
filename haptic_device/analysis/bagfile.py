# SPDX-License-Identifier: Apache-2.0
"""Messages and attachments out of an MCAP bag, complete, cut off or damaged in the middle; pure Python, no ROS.

Each topic's messages go to a collector in batches of some megabytes, so that a bag of gigabytes is read with the
memory of what is kept of it.
"""

import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from haptic_device.mcapfile import DAMAGE, MESSAGE, RECORD, Records, described, unpack

_BATCH = 2**20  # bytes of one topic's messages that are decoded together


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


_HEAD = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("received", "<u8"), ("published", "<u8")])


class Topic:
    """One topic as it is read: its type, its times, and its collector (None: only counted)."""

    def __init__(self, type_name: str, collector: Collector | None):
        self.type_name, self.collector = type_name, collector
        self.heads = bytearray()  # of every message, as the file has them
        self.waiting: list[bytes] = []

    @property
    def times(self) -> Times:
        """Times and sequences of all messages."""
        heads = np.frombuffer(self.heads, _HEAD)
        return Times(*(heads[name].astype(np.int64) for name in ("received", "published", "sequence")))

    def __len__(self) -> int:
        return len(self.heads) // MESSAGE.size

    def hand_on(self, least: int = 1) -> None:
        """Hands what waits to the collector, if it is at least so many bytes."""
        if self.waiting and len(self.waiting) * max(1, len(self.waiting[-1])) >= least:
            self.collector.add(self.waiting)
            self.waiting = []


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
        topic.hand_on()
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
        self._name, self._described, self._records = name, described(stream), Records(stream)
        self._contents, self._collector = contents, collector
        self._types: dict[int, str] = {}
        self._channels: dict[int, Topic] = {}
        self._damaged, self._strangers, self._ended = 0, 0, False

    def read(self) -> None:
        """Reads it to its end, or to where it is cut off."""
        for opcode, content in self._described:
            self._take(opcode, content)
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
        except DAMAGE:
            self._damaged += 1

    def _take_chunk(self, data: bytes) -> None:
        """The loop that a long bag spends its time in: a microsecond a message."""
        at, size, parse, head, channels = 0, len(data), RECORD.unpack_from, MESSAGE.size, self._channels
        while at < size:
            opcode, length = parse(data, at)
            begin = at + RECORD.size
            at = begin + length
            if opcode != Opcode.MESSAGE or length < head or at > size:
                self._take_part(opcode, data[begin:at])
                continue
            topic = channels.get(data[begin] + 256 * data[begin + 1])
            if topic is None:
                self._strangers += 1
                continue
            topic.heads += data[begin : begin + head]
            if topic.collector is not None:
                topic.waiting.append(data[begin + head : at])
        for topic in channels.values():
            topic.hand_on(_BATCH)

    def _take_part(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = records.Schema.read(_stream(content))
            self._types[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = records.Channel.read(_stream(content))
            if channel.id not in self._channels:
                self._channels[channel.id] = self._topic(channel.topic, self._types.get(channel.schema_id, ""))
        elif opcode == Opcode.MESSAGE and len(content) >= MESSAGE.size:  # of a file without chunks
            self._take_alone(content)

    def _take_alone(self, content: bytes) -> None:
        if topic := self._channels.get(MESSAGE.unpack_from(content)[0]):
            topic.heads += content[: MESSAGE.size]
            if topic.collector is not None:
                topic.waiting.append(content[MESSAGE.size :])
                topic.hand_on(_BATCH)

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
