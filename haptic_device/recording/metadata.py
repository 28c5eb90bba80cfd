# SPDX-License-Identifier: Apache-2.0
"""What metadata.yaml of a rosbag2 folder says (version 9, ROS 2 Jazzy), written complete or not at all."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from haptic_device.config.yaml_reader import dump
from haptic_device.os_errors import naming

METADATA = "metadata.yaml"


@dataclass
class FileSpan:
    """One file of a bag: name, times of its first and last message [ns of the system clock], number of messages."""

    name: str
    first: int = 0
    last: int = 0
    messages: int = 0

    def count(self, received: int) -> None:
        """One more message."""
        if received < self.first or not self.messages:
            self.first = received
        if received > self.last:
            self.last = received
        self.messages += 1


def topic_metadata(name: str, type_name: str, offered_qos: list[Any], type_hash: str) -> dict[str, Any]:
    """A topic as metadata.yaml lists it."""
    return {
        "name": name,
        "type": type_name,
        "serialization_format": "cdr",
        "offered_qos_profiles": offered_qos,
        "type_description_hash": type_hash,
    }


def information(
    files: list[FileSpan], topics: list[dict[str, Any]], counts: list[int], custom_data: dict[str, str]
) -> dict[str, Any]:
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


def _times(span: FileSpan) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span.last - span.first},
        "starting_time": {"nanoseconds_since_epoch": span.first},
        "message_count": span.messages,
    }


def write_metadata(folder: Path, content: dict[str, Any]) -> None:
    """Writes metadata.yaml into the bag's folder."""
    half = folder / f"{METADATA}.part"
    try:
        with naming(half):
            half.write_text(dump({"rosbag2_bagfile_information": content}), encoding="utf-8")
    except OSError:
        half.unlink(missing_ok=True)
        raise
    os.replace(half, folder / METADATA)


def said_in(folder: Path) -> dict[str, Any]:
    """What metadata.yaml of this folder says; empty if there is none, or it is none."""
    try:
        content = yaml.safe_load((folder / METADATA).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError, yaml.YAMLError):
        return {}
    said = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    return said if isinstance(said, dict) else {}
