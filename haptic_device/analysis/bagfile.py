# SPDX-License-Identifier: Apache-2.0
"""Serialized messages out of an MCAP bag, complete or cut off in the middle; pure Python, no ROS."""

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import EndOfFile, InvalidMagic
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

_RECORD_LIMIT = 64 * 2**20  # bytes; a damaged length must not ask for the whole memory


class Raw(NamedTuple):
    """What one topic holds, in the order of the file; times in ns of the system clock."""

    type_name: str
    data: list[bytes]
    received: list[int]
    published: list[int]
    sequence: list[int]


def read(bag: Path) -> tuple[dict[str, Raw], list[str]]:
    """Messages by topic, and one sentence for each file that ends too early.

    Raises FileNotFoundError or ValueError when there is nothing to read.
    """
    topics: dict[str, Raw] = {}
    notes = [note for file in files(bag) if (note := _read_file(file, topics))]
    if not topics:
        raise ValueError(f"bag {bag} holds no message" + "".join(f"; {note}" for note in notes))
    return topics, notes


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


def _read_file(path: Path, topics: dict[str, Raw]) -> str:
    with open(path, "rb") as stream:
        try:
            _collect(StreamReader(stream, validate_crcs=True, record_size_limit=_RECORD_LIMIT), topics)
        except InvalidMagic as error:
            raise ValueError(f"{path} is no MCAP file ({path.stat().st_size} bytes)") from error
        except EndOfFile:
            return f"{path.name} ends without its index: what was written up to there is read"
        except Exception as error:  # whatever a damaged chunk makes the decompressor say
            return f"{path.name} is damaged after the part that is read ({type(error).__name__}: {error})"
    return ""


def _collect(reader: StreamReader, topics: dict[str, Raw]) -> None:
    types: dict[int, str] = defaultdict(str)
    channels: dict[int, Channel] = {}
    for record in reader.records:
        if isinstance(record, Message):
            channel = channels[record.channel_id]
            raw = topics.setdefault(channel.topic, Raw(types[channel.schema_id], [], [], [], []))
            raw.data.append(record.data)
            raw.received.append(record.log_time)
            raw.published.append(record.publish_time)
            raw.sequence.append(record.sequence)
        elif isinstance(record, Schema):
            types[record.id] = record.name
        elif isinstance(record, Channel):
            channels[record.id] = record
