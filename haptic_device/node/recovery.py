# SPDX-License-Identifier: Apache-2.0
"""A bag folder made whole after its recorder died: each file ended, metadata.yaml written anew; needs no ROS."""

from collections.abc import Iterator
from pathlib import Path

import yaml

from haptic_device.analysis.bagfile import files
from haptic_device.node.bag import RESERVE
from haptic_device.node.bag_index import Index, complete
from haptic_device.node.bag_information import METADATA, information, write_metadata
from haptic_device.skipped import Skipped


def recovered(bag: Path) -> Iterator[str]:
    """Repairs the bag in place, and says of each file what was done. Raises FileNotFoundError, OSError, ValueError.

    A file that is empty or no MCAP file is left alone and out of metadata.yaml.
    """
    indices, skipped = [], {}
    for path in files(bag):
        try:
            index = complete(path, skipped)
        except ValueError as error:
            yield f"{path.name} is left out: {error} ({path.stat().st_size} bytes)"
            continue
        indices.append(index)
        yield f"{path.name}: {_what_was_done(index)}; {index.span.messages} messages"
    if not indices:
        raise ValueError(f"bag {bag} has no file that could be repaired")
    if bag.is_dir():
        (bag / RESERVE).unlink(missing_ok=True)
        yield _metadata(bag, indices, skipped)


def _what_was_done(index: Index) -> str:
    done = []
    if index.damaged:
        done.append(f"{len(index.damaged)} damaged records are passed over")
    if index.wrong:
        done.append(f"{index.wrong}, {index.torn} bytes of a torn record are cut off and the index is written")
    return " and ".join(done) or "whole"


def _metadata(bag: Path, indices: list[Index], skipped: dict[str, Skipped]) -> str:
    before = _said(bag / METADATA)
    named = before.get("relative_file_paths") == [index.span.name for index in indices]
    if named and not any(index.wrong or index.damaged for index in indices):
        return f"{METADATA} is there"
    topics, counts = _topics(indices)
    custom = _with_losses(before.get("custom_data"), {name: _told(skipped, name) for name in topics})
    spans = [index.span for index in indices]
    write_metadata(bag, information(spans, list(topics.values()), [counts[name] for name in topics], custom))
    return f"{METADATA} is written: {sum(counts.values())} messages in {len(indices)} files"


def _said(path: Path) -> dict:
    """What metadata.yaml says; empty if there is none, or it is none."""
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, yaml.YAMLError):
        return {}
    said = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    return said if isinstance(said, dict) else {}


def _with_losses(before, lost: dict[str, str]) -> dict[str, str]:
    """custom_data with what the files lack; `missing` beside a `lost` that the recorder itself has counted."""
    custom = before if isinstance(before, dict) else {}
    words = {name: "missing" if f"lost {name}" in custom else "lost" for name in lost}
    return {**custom, "recovered": "true", **{f"{words[name]} {name}": told for name, told in lost.items()}}


def _told(skipped: dict[str, Skipped], topic: str) -> str:
    return skipped.get(topic, Skipped()).told(topic)


def _topics(indices: list[Index]) -> tuple[dict[str, dict], dict[str, int]]:
    """Topics as metadata.yaml lists them, and their messages; by name."""
    topics, counts = {}, {}
    for index in indices:
        for number, channel in index.channels.items():
            schema = index.schemas.get(channel.schema_id)
            topics[channel.topic] = {
                "name": channel.topic,
                "type": schema.name if schema else "",
                "serialization_format": channel.message_encoding,
                "offered_qos_profiles": yaml.safe_load(channel.metadata.get("offered_qos_profiles", "[]")),
                "type_description_hash": channel.metadata.get("topic_type_hash", ""),
            }
            counts[channel.topic] = counts.get(channel.topic, 0) + index.counts.get(number, 0)
    return topics, counts
