# SPDX-License-Identifier: Apache-2.0
"""Messages and attachments out of an MCAP bag, complete, cut off or damaged in the middle; needs no ROS.

https://mcap.dev/spec: a file is magic, records (1 byte opcode, 8 bytes length, content), magic. The `mcap` library
parses the records; here they are found also where a file ends too early or one of them is damaged. Each topic's
messages go to a collector in batches, so that a bag of gigabytes is read with the memory of what is kept of it.
"""

import io
import struct
import zlib
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from haptic_device.recording.layouts import HEADED, STAMP_END, stamp_of

LARGEST = 256 * 2**20  # bytes; a damaged length must not ask for the whole memory
_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI8s")  # opcode, length, begin of the summary, of its offsets, checksum, magic
_BATCH = 2**20  # bytes of one topic's messages that are decoded together
_PARTS: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.ATTACHMENT: Attachment}
_DAMAGE = (ValueError, struct.error, OverflowError, MemoryError, RuntimeError, McapError, ZstdError)


class Records:
    """Iterates over schemas, channels, messages and attachments of an open file, up to its end of data.

    What the summary at the end describes comes first: the chunk that says it too may be damaged, and without it the
    messages of all later ones mean nothing. Afterwards `damaged` counts the records that cannot be read, and `wrong`
    says why the file is not whole, "" if it is. Raises ValueError if the file does not begin as MCAP files do.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._described = stream, described(stream)
        self.damaged, self.wrong = 0, "ends without its index"
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise ValueError("it is no MCAP file")

    def __iter__(self) -> Iterator[McapRecord]:
        yield from self._described
        ended = False
        for opcode, content in self._framed():
            ended = ended or opcode == Opcode.DATA_END
            if not ended:
                try:
                    found = _parsed(opcode, content)
                except _DAMAGE:
                    self.damaged += 1
                    continue
                yield from found

    def _framed(self) -> Iterator[tuple[int, bytes]]:
        """(opcode, content) of each whole record."""
        at = len(MCAP0_MAGIC)
        while len(head := self._stream.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(head)
            if length > LARGEST or opcode == 0:
                self.wrong = f"is damaged at byte {at}"
                return
            content = self._stream.read(length)
            if len(content) < length:
                return
            at += len(head) + length
            yield opcode, content
            if opcode == Opcode.FOOTER:
                self.wrong = "" if self._stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC else self.wrong
                return


def _parsed(opcode: int, content: bytes) -> list[McapRecord]:
    stream = ReadDataStream(io.BytesIO(content))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        if chunk.uncompressed_size > LARGEST:
            raise ValueError(f"it claims {chunk.uncompressed_size} bytes")
        return breakup_chunk(chunk, validate_crc=True)
    if opcode == Opcode.MESSAGE:  # of a file without chunks
        return [Message.read(stream, len(content))]
    return [_PARTS[opcode].read(stream)] if opcode in _PARTS else []


def described(stream: BinaryIO) -> list[McapRecord]:
    """What the summary holds; nothing if the file has no whole one. Leaves the stream at its beginning."""
    end = stream.seek(0, io.SEEK_END) - _FOOTER.size
    stream.seek(max(0, end))
    tail = stream.read(_FOOTER.size)  # no more: a file that is still written may have grown by now
    opcode, _, begin, _, checksum, magic = _FOOTER.unpack(tail.ljust(_FOOTER.size))
    data = b""
    if opcode == Opcode.FOOTER and magic == MCAP0_MAGIC and 0 < begin <= end <= begin + LARGEST:
        stream.seek(begin)
        data = stream.read(end - begin) + tail
    stream.seek(0)
    try:
        whole = data and checksum in (0, zlib.crc32(data[: -len(MCAP0_MAGIC) - 4]))
        return list(StreamReader(io.BytesIO(data), skip_magic=True).records) if whole else []
    except _DAMAGE:
        return []


class Collector(Protocol):
    """Takes batches of one topic's serialized messages, in the order of the file."""

    def add(self, data: list[bytes]) -> None:
        """Takes the next messages. Raises ValueError if they are not what it can take."""


class Keep:
    """The collector that keeps the messages as they are."""

    def __init__(self) -> None:
        self.data: list[bytes] = []

    def add(self, data: list[bytes]) -> None:
        """Keeps them."""
        self.data += data


Choice = Callable[[str, str], Collector | None]
"""Who takes a topic's messages, by its name and its type."""


class Times(NamedTuple):
    """Of each message, (messages): received and published in ns of the system clock, and the publisher's sequence."""

    received: npt.NDArray[np.int64]
    published: npt.NDArray[np.int64]
    sequence: npt.NDArray[np.int64]


class StampOrder(NamedTuple):
    """Of one topic: messages with a stamp; how many of these have an earlier one, and the same, as the one before."""

    stamped: int = 0
    back: int = 0
    same: int = 0


class Topic:
    """One topic as it is read: its type, its times, the order of its stamps, its collector (None: only counted), and
    why that took no more."""

    def __init__(self, type_name: str, collector: Collector | None) -> None:
        self.type_name, self.collector, self.refused = type_name, collector, ""
        self.order, self._stamp, self._headed = StampOrder(), 0, type_name in HEADED
        self._times, self._bytes = array("Q"), 0
        self._waiting: list[bytes] = []

    @property
    def times(self) -> Times:
        """Times and sequences of all messages."""
        return Times(*np.array(self._times).reshape(-1, 3).T.astype(np.int64, "C"))

    def __len__(self) -> int:
        return len(self._times) // 3

    def take(self, message: Message) -> None:
        """The next message."""
        self._times.extend((message.log_time, message.publish_time, message.sequence))
        if self._headed and len(message.data) >= STAMP_END and (stamp := stamp_of(message.data)):
            stamped, back, same = self.order
            again = stamped > 0
            self.order = StampOrder(
                stamped + 1, back + (again and stamp < self._stamp), same + (again and stamp == self._stamp)
            )
            self._stamp = stamp
        if self.collector is not None:
            self._waiting.append(message.data)
            self._bytes += len(message.data)
            if self._bytes >= _BATCH:
                self.hand_on()

    def hand_on(self) -> None:
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
    contents, refused = Contents({}, {}, []), []
    for file in files(bag):
        try:
            with open(file, "rb") as stream:
                _read_file(file.name, Records(stream), contents, collector)
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


def _read_file(name: str, records: Records, contents: Contents, collector: Choice) -> None:
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
                topic.take(record)
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
