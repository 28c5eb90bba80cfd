# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP, metadata version 9 of ROS 2 Jazzy) written message by message; needs no ROS.

Layout: `<folder>/<folder>_0.mcap`, `_1.mcap` … and, once closed, `<folder>/metadata.yaml`. Times are ns of the system
clock: log time = received, publish time = as stamped by the publisher's middleware; the sequence is the publisher's.
Each file holds all schemas, channels and attachments, so that it can be read alone.
"""

import os
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

from haptic_device.node.bag_file import BagFile
from haptic_device.node.bag_index import Index, complete, scan, summary
from haptic_device.node.bag_information import FileSpan, dump, information, write_metadata

RESERVE_BYTES = 4 * 2**20  # given back when the disk is full, so that there is room to end the bag
RESERVE = ".reserve"


class Bag:
    """One bag being written; what has been flushed survives the death of the process."""

    def __init__(self, folder: Path, split_bytes: int = 0, split_seconds: float = 0.0):
        """Creates `folder` and its first file; 0 never splits. Raises ValueError if the folder holds something."""
        self.folder = folder
        self._split_bytes, self._split_ns = split_bytes, int(split_seconds * 1e9)
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: list[dict] = []
        self._counts: list[int] = []
        self._attachments: dict[str, tuple[str, bytes, int]] = {}
        self._files: list[FileSpan] = []
        _prepare(folder)
        self._begin_file()

    @property
    def messages(self) -> int:
        """Messages written so far."""
        return sum(self._counts)

    def attach(self, name: str, media_type: str, data: bytes, now: int) -> None:
        """Adds a file to the bag, or its newer state; now in ns of the system clock."""
        self._attachments[name] = media_type, data, now
        self._file.attach(name, media_type, data, now)

    def add_topic(self, name: str, type_name: str, offered_qos: list[dict]) -> int:
        """Registers a topic, returns its channel. Raises ValueError for a type that Jazzy's common messages lack."""
        topic = {
            "name": name,
            "type": type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": offered_qos,
            "type_description_hash": self._type_hash(name, type_name),
        }
        self._topics.append(topic)
        self._counts.append(0)
        return self._register(topic)

    def write(self, channel: int, data: bytes, received: int, published: int, sequence: int) -> None:
        """Adds one serialized message; times in ns of the system clock. Raises OSError as flush does."""
        self._counts[channel - 1] += 1
        self._file.add_message(channel, data, received, published, sequence)

    def flush(self) -> None:
        """Hands everything written so far to the operating system, as a whole chunk; splits if it is time to.

        Raises OSError if the disk does not take it; `abandon` then ends the bag.
        """
        self._file.flush()
        self._keep()
        span = self._file.span
        large = 0 < self._split_bytes <= self._file.size
        if span.messages and (large or 0 < self._split_ns <= span.last - span.first):
            self._file.finish({})
            self._begin_file()

    def close(self, custom_data: dict[str, str]) -> None:
        """Ends the file, then writes metadata.yaml, complete or not at all."""
        (self.folder / RESERVE).unlink(missing_ok=True)
        self._file.flush()
        self._keep()
        content = information(self._files, self._topics, self._counts, custom_data)
        self._file.finish({"rosbag2": {"serialized_metadata": dump(content)}})
        write_metadata(self.folder, content)

    def abandon(self, custom_data: dict[str, str]) -> None:
        """Ends a bag that the disk no longer takes: with the chunks that are on it, in the room held in reserve.

        Raises OSError if not even an index of nothing finds room.
        """
        (self.folder / RESERVE).unlink(missing_ok=True)
        self._file.close()
        size, before, files = self._kept
        for file in self._files[len(files) :]:  # one that the disk had no room to begin
            (self.folder / file.name).unlink(missing_ok=True)
        index = _complete(self.folder / files[-1].name, size)
        before = before + [0] * (len(self._topics) - len(before))  # topics that came after the file's beginning
        self._files = [*files[:-1], index.span]
        self._counts = [count + index.counts.get(channel, 0) for channel, count in enumerate(before, start=1)]
        write_metadata(self.folder, information(self._files, self._topics, self._counts, custom_data))

    def _begin_file(self) -> None:
        self._before = list(self._counts)
        self._files.append(FileSpan(f"{self.folder.name}_{len(self._files)}.mcap"))
        self._schemas: dict[str, int] = {}
        self._file = BagFile(self.folder / self._files[-1].name)
        self._keep()
        for name, (media_type, data, now) in self._attachments.items():
            self._file.attach(name, media_type, data, now)
        for topic in self._topics:
            self._register(topic)

    def _keep(self) -> None:
        """What is on the disk now stays, whatever happens next."""
        self._files[-1] = self._file.span
        self._kept = self._file.size, self._before, list(self._files)

    def _register(self, topic: dict) -> int:
        metadata = {
            "offered_qos_profiles": dump(topic["offered_qos_profiles"]),
            "topic_type_hash": topic["type_description_hash"],
        }
        return self._file.add_channel(topic["name"], self._schema(topic["type"]), metadata)

    def _type_hash(self, topic: str, type_name: str) -> str:
        try:
            return self._types.hash_rihs01(type_name)
        except KeyError:
            raise ValueError(f"topic {topic} has the type {type_name}, unknown to ROS 2 Jazzy's packages") from None

    def _schema(self, type_name: str) -> int:
        if type_name not in self._schemas:
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._file.add_schema(type_name, definition.encode())
        return self._schemas[type_name]


def _complete(path: Path, size: int) -> Index:
    """Completes the file's first `size` bytes; where the disk has no room for an index, chunks at the end make it."""
    while True:
        os.truncate(path, size)
        try:
            return complete(path)
        except OSError:
            with open(path, "rb") as stream:
                index = scan(stream, path.name)
            if not index.chunks:
                raise
            size = index.data_end - len(summary(index))


def _prepare(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise ValueError(f"bag folder {folder} is not empty; name a new one")
    with open(folder / RESERVE, "wb") as reserve:
        reserve.write(bytes(RESERVE_BYTES))
