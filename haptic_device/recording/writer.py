# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP, metadata version 9 of ROS 2 Jazzy) written message by message; needs no ROS.

Layout: `<folder>/<folder>_0.mcap`, `_1.mcap` … and, once closed, `<folder>/metadata.yaml`. Times are ns of the system
clock: log time = received, publish time = as stamped by the publisher's middleware; the sequence is the publisher's.
Each file holds all schemas, channels and attachments, so that it can be read alone.
"""

import os
from pathlib import Path
from typing import Any, BinaryIO, cast

from mcap.writer import Writer

from haptic_device.config.yaml_reader import dump
from haptic_device.os_errors import naming
from haptic_device.recording.layouts import types
from haptic_device.recording.metadata import FileSpan, information, topic_metadata, write_metadata

CHUNK_BYTES = 256 * 2**10
_UINT32 = 0xFFFFFFFF


class _Disk:
    """A new file as the MCAP writer sees it: nothing waits in it for a later write, nothing follows a torn record."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._path, self._size = path, 0
        self._torn: OSError | None = None

    def write(self, data: bytes) -> None:
        if self._torn:
            raise self._torn
        left = memoryview(data)
        try:
            with naming(self._path):
                while left:
                    left = left[os.write(self._descriptor, left) :]
        except OSError as error:
            self._torn = error
            raise
        self._size += len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """All is written."""

    def close(self) -> None:
        """Closes the file; once only, as its number may be another file's by then."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


class Bag:
    """One bag being written; what has been flushed survives the death of the process."""

    def __init__(self, folder: Path, split_bytes: int = 0, split_seconds: float = 0.0) -> None:
        """Creates `folder` and its first file; 0 never splits.

        Raises ValueError if the folder holds something, OSError with a name if the disk is full.
        """
        self.folder = folder
        self._split_bytes, self._split_ns = split_bytes, int(split_seconds * 1e9)
        self._topics: list[dict[str, Any]] = []
        self._counts: list[int] = []
        self._attachments: dict[str, tuple[int, int, str, str, bytes]] = {}
        self._files: list[FileSpan] = []
        types()  # takes long the first time: not while messages wait, nor beside a servo that runs
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ValueError(f"bag folder {folder} is not empty; name a new one")
        self._begin_file()

    @property
    def messages(self) -> int:
        """Messages written so far."""
        return sum(self._counts)

    def attach(self, name: str, media_type: str, data: bytes, now: int) -> None:
        """Adds a file to the bag, or its newer state; now in ns of the system clock."""
        self._attachments[name] = now, now, name, media_type, data
        self._writer.add_attachment(*self._attachments[name])

    def add_topic(self, name: str, type_name: str, offered_qos: list[dict[str, Any]]) -> int:
        """Registers a topic, returns its channel. Raises ValueError for a type that Jazzy's common messages lack."""
        try:
            type_hash = types().hash_rihs01(type_name)
        except KeyError:
            raise ValueError(f"topic {name} has the type {type_name}, unknown to ROS 2 Jazzy's packages") from None
        self._topics.append(topic_metadata(name, type_name, offered_qos, type_hash))
        self._counts.append(0)
        return self._register(self._topics[-1])

    def write(self, channel: int, data: bytes, received: int, published: int, sequence: int) -> None:
        """Adds one serialized message; times in ns of the system clock."""
        self._counts[channel - 1] += 1
        self._files[-1].count(received)
        self._writer.add_message(channel, received, data, published, sequence & _UINT32)

    def flush(self) -> None:
        """Hands everything written so far to the operating system, as a whole chunk; splits if it is time to.

        Raises OSError if the disk takes no more: the bag is cut off there, and `close` raises it too; or if no new file
        can be opened: all is in the bag then, and `close` ends it.
        """
        self._writer.flush()
        span = self._files[-1]
        large = 0 < self._split_bytes <= self._disk.tell()
        if span.messages and (large or 0 < self._split_ns <= span.last - span.first):
            self._end_file({})
            self._begin_file()

    def close(self, custom_data: dict[str, str]) -> None:
        """Ends the file, then writes metadata.yaml, complete or not at all.

        Raises OSError if that finds no room.
        """
        content = information(self._files, self._topics, self._counts, custom_data)
        if not self._ended:  # else a split has ended the last file, and could begin no other
            self._end_file({"rosbag2": {"serialized_metadata": dump(content)}})
        write_metadata(self.folder, content)

    def _begin_file(self) -> None:
        name = f"{self.folder.name}_{len(self._files)}.mcap"
        self._disk = _Disk(self.folder / name)
        self._files.append(FileSpan(name))
        self._ended = False
        self._writer = Writer(cast(BinaryIO, self._disk), CHUNK_BYTES)
        self._schemas: dict[str, int] = {}
        self._writer.start("ros2", "haptic_display")
        for attachment in self._attachments.values():
            self._writer.add_attachment(*attachment)
        for topic in self._topics:
            self._register(topic)

    def _end_file(self, metadata: dict[str, dict[str, str]]) -> None:
        try:
            for name, content in metadata.items():
                self._writer.add_metadata(name, content)
            self._writer.finish()
            self._ended = True
        finally:
            self._disk.close()

    def _register(self, topic: dict[str, Any]) -> int:
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
