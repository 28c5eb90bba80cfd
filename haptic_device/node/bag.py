# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 folder (MCAP, metadata version 9 of ROS 2 Jazzy) written message by message; needs no ROS.

Layout: `<folder>/<folder>_0.mcap` and, once closed, `<folder>/metadata.yaml`. Times are ns of the system clock:
log time = received, publish time = as stamped by the publisher's middleware; the sequence is the publisher's.
"""

import os
from pathlib import Path

import yaml
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

CHUNK_BYTES = 256 * 1024
_UINT32 = 0xFFFFFFFF


class Bag:
    """One bag being written; what has been flushed survives the death of the process."""

    def __init__(self, folder: Path):
        """Creates `folder` and the file in it. Raises ValueError if the folder already holds something."""
        self.folder = folder
        self.messages = 0
        self._file_name = f"{folder.name}_0.mcap"
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[int, dict] = {}
        self._counts: dict[int, int] = {}
        self._schemas: dict[str, int] = {}
        self._first = self._last = 0
        self._stream = _create(folder, self._file_name)
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="haptic_display")

    def add_topic(self, name: str, type_name: str, offered_qos: list[dict]) -> int:
        """Registers a topic, returns its channel. Raises ValueError for a type that Jazzy's common messages lack."""
        type_hash = self._type_hash(name, type_name)
        qos = yaml.safe_dump(offered_qos, sort_keys=False)
        channel = self._writer.register_channel(
            name, "cdr", self._schema(type_name), {"offered_qos_profiles": qos, "topic_type_hash": type_hash}
        )
        self._topics[channel] = {
            "name": name,
            "type": type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": offered_qos,
            "type_description_hash": type_hash,
        }
        self._counts[channel] = 0
        return channel

    def write(self, channel: int, data: bytes, received: int, published: int, sequence: int) -> None:
        """Adds one serialized message; times in ns of the system clock."""
        self._first = received if self.messages == 0 else min(self._first, received)
        self._last = max(self._last, received)
        self.messages += 1
        self._counts[channel] += 1
        self._writer.add_message(channel, received, data, published, sequence & _UINT32)

    def flush(self) -> None:
        """Hands everything written so far to the operating system, as a whole chunk."""
        self._writer.flush()

    def close(self, custom_data: dict[str, str]) -> None:
        """Ends the file, then writes metadata.yaml, complete or not at all."""
        information = self._information(custom_data)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": yaml.safe_dump(information, sort_keys=False)})
        self._writer.finish()
        self._stream.close()
        _replace(self.folder / "metadata.yaml", {"rosbag2_bagfile_information": information})

    def _type_hash(self, topic: str, type_name: str) -> str:
        try:
            return self._types.hash_rihs01(type_name)
        except KeyError:
            raise ValueError(f"topic {topic} has the type {type_name}, unknown to ROS 2 Jazzy's packages") from None

    def _schema(self, type_name: str) -> int:
        if type_name not in self._schemas:
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", definition.encode())
        return self._schemas[type_name]

    def _information(self, custom_data: dict[str, str]) -> dict:
        span = {
            "duration": {"nanoseconds": self._last - self._first},
            "starting_time": {"nanoseconds_since_epoch": self._first},
            "message_count": self.messages,
        }
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **span,
            "topics_with_message_count": [
                {"topic_metadata": topic, "message_count": self._counts[channel]}
                for channel, topic in self._topics.items()
            ],
            "compression_format": "",  # of the folder's own compression; the MCAP chunks name theirs
            "compression_mode": "",
            "relative_file_paths": [self._file_name],
            "files": [{"path": self._file_name, **span}],
            "custom_data": custom_data,
            "ros_distro": "jazzy",
        }


def _create(folder: Path, file_name: str):
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise ValueError(f"bag folder {folder} is not empty; name a new one")
    return open(folder / file_name, "xb")


def _replace(path: Path, content: dict) -> None:
    half = path.with_suffix(".yaml.part")
    half.write_text(yaml.safe_dump(content, sort_keys=False))
    os.replace(half, path)
