# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP, metadata version 9 of ROS 2 Jazzy) written message by message; needs no ROS.

Layout: `<folder>/<folder>_0.mcap`, `_1.mcap` … and, once closed, `<folder>/metadata.yaml`. Times are ns of the system
clock: log time = received, publish time = as stamped by the publisher's middleware; the sequence is the publisher's.
Each file holds all schemas, channels and attachments, so that it can be read alone.
"""

import os
from pathlib import Path
from typing import NamedTuple

import yaml
from mcap.writer import Writer

from haptic_device.recording.layouts import types

METADATA = "metadata.yaml"
CHUNK_BYTES = 256 * 2**10
RESERVE = ".reserve"
RESERVE_BYTES = 16 * 2**20  # given back when the disk is full: a chunk, and the index of some two hours at 4 kHz
_UINT32 = 0xFFFFFFFF


class FileSpan(NamedTuple):
    """One file of a bag: name, times of its first and last message [ns of the system clock], number of messages."""

    name: str
    first: int = 0
    last: int = 0
    messages: int = 0

    def with_message(self, received: int) -> "FileSpan":
        """The span with one more message."""
        first = min(self.first, received) if self.messages else received
        return FileSpan(self.name, first, max(self.last, received), self.messages + 1)


class _Disk:
    """A new file as the MCAP writer sees it: nothing waits in it for a later write.

    full: what the disk said when it took no more; from then on, what was held in reserve takes the rest.
    """

    def __init__(self, path: Path, reserve: Path):
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._reserve, self._size = reserve, 0
        self.full: OSError | None = None

    def write(self, data: bytes) -> None:
        left = memoryview(data)
        while left:
            try:
                count = os.write(self._descriptor, left)
            except OSError as error:
                if self.full:
                    raise
                self.full = error
                self._reserve.unlink(missing_ok=True)
            else:
                self._size, left = self._size + count, left[count:]

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """All is written."""

    def close(self) -> None:
        os.close(self._descriptor)


class Bag:
    """One bag being written; what has been flushed survives the death of the process."""

    def __init__(self, folder: Path, split_bytes: int = 0, split_seconds: float = 0.0):
        """Creates `folder` and its first file; 0 never splits. Raises ValueError if the folder holds something."""
        self.folder = folder
        self._split_bytes, self._split_ns = split_bytes, int(split_seconds * 1e9)
        self._topics: list[dict] = []
        self._counts: list[int] = []
        self._attachments: dict[str, tuple[int, int, str, str, bytes]] = {}
        self._files: list[FileSpan] = []
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ValueError(f"bag folder {folder} is not empty; name a new one")
        (folder / RESERVE).write_bytes(bytes(RESERVE_BYTES))
        self._begin_file()

    @property
    def messages(self) -> int:
        """Messages written so far."""
        return sum(self._counts)

    def attach(self, name: str, media_type: str, data: bytes, now: int) -> None:
        """Adds a file to the bag, or its newer state; now in ns of the system clock."""
        self._attachments[name] = now, now, name, media_type, data
        self._writer.add_attachment(*self._attachments[name])

    def add_topic(self, name: str, type_name: str, offered_qos: list[dict]) -> int:
        """Registers a topic, returns its channel. Raises ValueError for a type that Jazzy's common messages lack."""
        try:
            type_hash = types().hash_rihs01(type_name)
        except KeyError:
            raise ValueError(f"topic {name} has the type {type_name}, unknown to ROS 2 Jazzy's packages") from None
        self._topics.append(topic_metadata(name, type_name, "cdr", offered_qos, type_hash))
        self._counts.append(0)
        return self._register(self._topics[-1])

    def write(self, channel: int, data: bytes, received: int, published: int, sequence: int) -> None:
        """Adds one serialized message; times in ns of the system clock."""
        self._counts[channel - 1] += 1
        self._files[-1] = self._files[-1].with_message(received)
        self._writer.add_message(channel, received, data, published, sequence & _UINT32)

    def flush(self) -> None:
        """Hands everything written so far to the operating system, as a whole chunk; splits if it is time to.

        Raises OSError if the disk takes no more; all is in the bag then too, and `close` ends it.
        """
        self._writer.flush()
        if self._disk.full:
            raise self._disk.full
        span = self._files[-1]
        large = 0 < self._split_bytes <= self._disk.tell()
        if span.messages and (large or 0 < self._split_ns <= span.last - span.first):
            self._end_file()
            self._begin_file()

    def close(self, custom_data: dict[str, str]) -> None:
        """Ends the file, then writes metadata.yaml, complete or not at all.

        Raises OSError if that finds no room even in what was held in reserve.
        """
        (self.folder / RESERVE).unlink(missing_ok=True)
        self._writer.flush()
        content = information(self._files, self._topics, self._counts, custom_data)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": dump(content)})
        self._end_file()
        write_metadata(self.folder, content)

    def _begin_file(self) -> None:
        self._files.append(FileSpan(f"{self.folder.name}_{len(self._files)}.mcap"))
        self._disk = _Disk(self.folder / self._files[-1].name, self.folder / RESERVE)
        self._writer, self._schemas = Writer(self._disk, CHUNK_BYTES), {}
        self._writer.start("ros2", "haptic_display")
        for attachment in self._attachments.values():
            self._writer.add_attachment(*attachment)
        for topic in self._topics:
            self._register(topic)

    def _end_file(self) -> None:
        try:
            self._writer.finish()
        finally:
            self._disk.close()

    def _register(self, topic: dict) -> int:
        metadata = {
            "offered_qos_profiles": dump(topic["offered_qos_profiles"]),
            "topic_type_hash": topic["type_description_hash"],
        }
        return self._writer.register_channel(topic["name"], "cdr", self._schema(topic["type"]), metadata)

    def _schema(self, type_name: str) -> int:
        if type_name not in self._schemas:
            definition, _ = types().generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", definition.encode())
        return self._schemas[type_name]


def topic_metadata(name: str, type_name: str, encoding: str, offered_qos: list, type_hash: str) -> dict:
    """A topic as metadata.yaml lists it."""
    return {
        "name": name,
        "type": type_name,
        "serialization_format": encoding,
        "offered_qos_profiles": offered_qos,
        "type_description_hash": type_hash,
    }


def information(files: list[FileSpan], topics: list[dict], counts: list[int], custom_data: dict[str, str]) -> dict:
    """The content of rosbag2_bagfile_information; counts: messages of each topic."""
    spans = [file for file in files if file.messages]
    first = min((file.first for file in spans), default=0)
    whole = FileSpan("", first, max((file.last for file in spans), default=0), sum(file.messages for file in files))
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **_times(whole),
        "topics_with_message_count": [
            {"topic_metadata": topic, "message_count": count} for topic, count in zip(topics, counts, strict=True)
        ],
        "compression_format": "",  # of the folder's own compression; the MCAP chunks name theirs
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **_times(file)} for file in files],
        "custom_data": custom_data,
        "ros_distro": "jazzy",
    }


def _times(span: FileSpan) -> dict:
    return {
        "duration": {"nanoseconds": span.last - span.first},
        "starting_time": {"nanoseconds_since_epoch": span.first},
        "message_count": span.messages,
    }


class _Plain(yaml.SafeDumper):
    """Writes what stands twice twice: not every reader of metadata.yaml knows anchors."""

    def ignore_aliases(self, data):
        return True


def dump(content) -> str:
    """YAML text without anchors, in the order given."""
    return yaml.dump(content, Dumper=_Plain, sort_keys=False, allow_unicode=True)


def write_metadata(folder: Path, content: dict) -> None:
    """Writes metadata.yaml into the bag's folder."""
    half = folder / f"{METADATA}.part"
    half.write_text(dump({"rosbag2_bagfile_information": content}), encoding="utf-8")
    os.replace(half, folder / METADATA)
