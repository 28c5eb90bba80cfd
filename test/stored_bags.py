# SPDX-License-Identifier: Apache-2.0
"""One bag stored in other ways, as tools leave it: compressed, without an index, in other orders, beside strangers."""

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import yaml
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from haptic_device.recording.metadata import METADATA


def records_of(file: Path) -> tuple[list, list]:
    """(schema, channel, message) of every message in the order of the file, and its attachments."""
    with open(file, "rb") as stream:
        reader = make_reader(stream)
        messages = list(reader.iter_messages(log_time_order=False))
        return messages, list(reader.iter_attachments())


def write(file: Path, messages: list, attachments: list, **options) -> None:
    """An MCAP file with these messages in this order; options of the library's writer."""
    with open(file, "wb") as stream:
        writer, numbers = Writer(stream, 32 * 2**10, **options), {}
        writer.start("ros2", "test")
        for schema, channel, message in messages:
            if channel.topic not in numbers:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                told = channel.topic, channel.message_encoding, kind, channel.metadata
                numbers[channel.topic] = writer.register_channel(*told)
            place = numbers[channel.topic]
            writer.add_message(place, message.log_time, message.data, message.publish_time, message.sequence)
        for one in attachments:
            writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        writer.finish()


def change_metadata(bag: Path, **changes) -> None:
    """Other values in metadata.yaml."""
    content = yaml.safe_load((bag / METADATA).read_text())
    content["rosbag2_bagfile_information"] |= changes
    (bag / METADATA).write_text(yaml.safe_dump(content))


def anew(order=lambda messages: range(len(messages)), **options):
    """The one file of the bag written with its messages in another order, or with other options."""

    def store(bag):
        file = next(bag.glob("*.mcap"))
        messages, attachments = records_of(file)
        write(file, [messages[place] for place in order(messages)], attachments, **options)

    return store


def by_topic(messages):
    """All of a topic, then all of the next."""
    return sorted(range(len(messages)), key=lambda place: messages[place][1].topic)


def shuffled(messages):
    """Each message up to 40 places from its own."""
    return np.argsort(np.arange(len(messages)) + np.random.default_rng(1).uniform(0, 40, len(messages)))


def split_against_names(bag):
    """Three files, the last messages in the first."""
    file = next(bag.glob("*.mcap"))
    messages, attachments = records_of(file)
    messages.sort(key=lambda found: found[2].log_time)
    third, names = len(messages) // 3 + 1, [f"{bag.name}_{number}.mcap" for number in range(3)]
    for number, name in enumerate(reversed(names)):
        write(bag / name, messages[number * third : (number + 1) * third], attachments)
    change_metadata(bag, relative_file_paths=names)


def copy_beside(bag):
    shutil.copy(next(bag.glob("*.mcap")), bag / "copy.mcap")


def foreign_beside(bag):
    """A file of another run, named as if it came next."""
    messages, attachments = records_of(next(bag.glob("*.mcap")))
    for _, _, message in messages:
        message.log_time += 10**12
    write(bag / f"{bag.name}_1.mcap", messages, attachments)


def messages_compressed(bag):
    file = next(bag.glob("*.mcap"))
    messages, attachments = records_of(file)
    for _, _, message in messages:
        message.data = zstandard.compress(message.data)
    write(file, messages, attachments)
    change_metadata(bag, compression_mode="MESSAGE", compression_format="zstd")


def file_compressed(bag):
    file = next(bag.glob("*.mcap"))
    packed = file.with_name(f"{file.name}.zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    change_metadata(bag, compression_mode="FILE", compression_format="zstd", relative_file_paths=[packed.name])


def as_sqlite3(bag):
    """As rosbag2_storage_sqlite3 lays it out, as far as a reader has to tell it."""
    file = next(bag.glob("*.mcap"))
    stored = file.with_suffix(".db3")
    with sqlite3.connect(stored) as base:
        base.execute("create table messages (id integer primary key, topic_id, timestamp, data)")
    base.close()
    file.unlink()
    change_metadata(bag, storage_identifier="sqlite3", relative_file_paths=[stored.name])


def file_missing(bag):
    split_against_names(bag)
    (bag / f"{bag.name}_1.mcap").unlink()


def metadata_missing(bag):
    (bag / METADATA).unlink()


def metadata_empty(bag):
    change_metadata(bag, relative_file_paths=[])


WHOLE = {  # how it is stored, and what of the folder is left out, if anything
    "lz4 chunks": (anew(compression=CompressionType.LZ4), ()),
    "zstd chunks": (anew(compression=CompressionType.ZSTD), ()),
    "chunks not compressed": (anew(compression=CompressionType.NONE), ()),
    "no chunks": (anew(use_chunking=False), ()),
    "no index": (anew(index_types=IndexType.NONE, use_statistics=False, use_summary_offsets=False), ()),
    "topic by topic": (anew(by_topic), ()),
    "shuffled": (anew(shuffled), ()),
    "split against names": (split_against_names, ()),
    "a copy beside": (copy_beside, ("copy.mcap is left out: metadata.yaml does not name it",)),
    "another run beside": (foreign_beside, ("run_1.mcap is left out: metadata.yaml does not name it",)),
    "no metadata": (metadata_missing, ()),
    "metadata that says nothing": (metadata_empty, ()),
}
REFUSED = {  # and the words of the refusal
    "messages compressed": (messages_compressed, r"is compressed \(compression_mode: message\)"),
    "file compressed": (file_compressed, r"is compressed \(compression_mode: file\)"),
    "sqlite3": (as_sqlite3, r"is stored as sqlite3 \(storage_identifier\)"),
}
