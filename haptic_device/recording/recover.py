# SPDX-License-Identifier: Apache-2.0
"""A bag made whole after its recorder died: files written anew from what can be read of them, metadata.yaml beside.

Needs no ROS.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import yaml
from mcap.records import Attachment, Channel, McapRecord, Message, Schema
from mcap.writer import Writer

from haptic_device.os_errors import naming
from haptic_device.recording.bag_files import files_of
from haptic_device.recording.mcap_records import Records
from haptic_device.recording.metadata import METADATA, FileSpan, information, said_in, topic_metadata, write_metadata
from haptic_device.recording.reader import Topic
from haptic_device.recording.writer import CHUNK_BYTES
from haptic_device.sequence_gaps import counted


@dataclass
class Found:
    """What can be read of the bag's files: their spans, and by topic its metadata, and the times of its messages."""

    spans: list[FileSpan] = field(default_factory=list)
    described: dict[str, dict[str, Any]] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    renewed: bool = False

    def take(self, path: Path) -> str:
        """The next file, written anew if it is not whole; what was done. Raises ValueError if it is no MCAP file."""
        span, channels, types, strangers = FileSpan(path.name), {}, {}, 0
        with open(path, "rb") as stream:
            records = Records(stream)
            for record in records:
                if isinstance(record, Schema):
                    types[record.id] = record.name
                elif isinstance(record, Channel):
                    channels[record.id] = self._topic(record, types.get(record.schema_id, ""))
                elif isinstance(record, Message) and record.channel_id not in channels:
                    strangers += 1
                elif isinstance(record, Message):
                    span.count(record.log_time)
                    channels[record.channel_id].take(record, span.messages)
        self.spans.append(span)
        lost = {"damaged records": records.damaged, "messages of channels that it does not describe": strangers}
        said = [f"{number} {what} are passed over" for what, number in lost.items() if number]
        done = " and ".join([*said, *filter(None, [records.wrong])]) or "whole"
        if records.damaged or records.wrong:
            self.renewed = True
            done += f", written anew (as it was: {_rewritten(path).name})"
        return f"{path.name}: {done}; {span.messages} messages"

    def lost(self) -> dict[str, str]:
        """Of each topic how many messages were lost, as text, by the numbers of their publishers."""
        for topic in self.topics.values():
            topic.end(())
        gaps = {name: counted(topic.times.sequence) for name, topic in self.topics.items()}
        return {name: found.told(name) for name, found in gaps.items()}

    def _topic(self, channel: Channel, type_name: str) -> Topic:
        name, said = channel.topic, channel.metadata
        qos = yaml.safe_load(said.get("offered_qos_profiles", "[]"))
        type_hash = said.get("topic_type_hash", "")
        self.described[name] = topic_metadata(name, type_name, channel.message_encoding, qos, type_hash)
        return self.topics.setdefault(name, Topic(type_name, None))


def recovered(bag: Path) -> Iterator[str]:
    """Repairs a bag that was cut off or damaged. Yields one sentence for each file about what was done.

    The readable part goes into a file of the same name. The old file is kept in the same folder as `NAME.mcap.damaged`.
    metadata.yaml is written again if it was missing or wrong. A file that is empty, not an MCAP file or not part of the
    bag is not changed. Raises FileNotFoundError, OSError or ValueError.

    Args:
        bag: a folder or one .mcap file.

    Examples:
        >>> import shutil
        >>> from pathlib import Path
        >>> from haptic_device.recording.recover import recovered
        >>> _ = shutil.copytree("run/bag", "torn/bag")
        >>> file = Path("torn/bag/bag_0.mcap")
        >>> _ = file.write_bytes(file.read_bytes()[:-100])  # the end is lost, as after a kill
        >>> Path("torn/bag/metadata.yaml").unlink()
        >>> for sentence in recovered(Path("torn/bag")):
        ...     print(sentence)
        bag_0.mcap: ends without its index, written anew (as it was: bag_0.mcap.damaged); 1026 messages
        metadata.yaml is written: 1026 messages in 1 files
    """
    found, files = Found(), files_of(bag)
    yield from files.notes
    for path in files.paths:
        try:
            yield found.take(path)
        except ValueError as error:
            yield f"{path.name} is left out: {error} ({path.stat().st_size} bytes)"
    if not found.spans:
        raise ValueError(f"bag {bag} has no file that could be repaired")
    if bag.is_dir():
        yield _metadata(bag, found)


def _rewritten(path: Path) -> Path:
    """Writes what can be read of the file into a new one of its name; where the file itself is then."""
    half = path.with_name(f"{path.name}.part")
    names = (path.with_name(f"{path.name}.damaged{number or ''}") for number in count())
    kept = next(name for name in names if not name.exists())
    try:
        with naming(half), open(path, "rb") as source, open(half, "wb") as target:
            writer = Writer(target, CHUNK_BYTES)
            numbers: dict[tuple[type, int], int] = {}
            writer.start("ros2", "haptic_display")
            for record in Records(source):
                _copy(record, writer, numbers)
            writer.finish()
    except BaseException:
        half.unlink(missing_ok=True)
        raise
    try:
        os.link(path, kept)  # a kill between this and the next leaves a file of that name
    except OSError:  # a file system without links
        path.rename(kept)
    os.replace(half, path)
    return kept


def _copy(record: McapRecord, writer: Writer, numbers: dict[tuple[type, int], int]) -> None:
    """numbers: of schemas and channels in the new file, by those in the one that is read."""
    if isinstance(record, Message) and (Channel, record.channel_id) in numbers:
        channel = numbers[Channel, record.channel_id]
        writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
    elif isinstance(record, Schema) and (Schema, record.id) not in numbers:
        numbers[Schema, record.id] = writer.register_schema(record.name, record.encoding, record.data)
    elif isinstance(record, Channel) and (Channel, record.id) not in numbers:
        schema = numbers.get((Schema, record.schema_id), 0)
        told = record.topic, record.message_encoding, schema, record.metadata
        numbers[Channel, record.id] = writer.register_channel(*told)
    elif isinstance(record, Attachment):
        writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)


def _metadata(bag: Path, found: Found) -> str:
    before = said_in(bag)
    named = before.get("relative_file_paths") == [span.name for span in found.spans]
    if named and not found.renewed:
        return f"{METADATA} is there"
    custom, counts = _with_losses(before.get("custom_data"), found.lost()), [len(one) for one in found.topics.values()]
    write_metadata(bag, information(found.spans, list(found.described.values()), counts, custom))
    return f"{METADATA} is written: {sum(counts)} messages in {len(found.spans)} files"


def _with_losses(before: Any, lost: dict[str, str]) -> dict[str, str]:
    """custom_data with what the files lack; `missing` beside a `lost` that the recorder itself has counted."""
    custom = before if isinstance(before, dict) else {}
    words = {name: "missing" if f"lost {name}" in custom else "lost" for name in lost}
    return {**custom, "recovered": "true", **{f"{words[name]} {name}": told for name, told in lost.items()}}
