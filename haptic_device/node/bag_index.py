# SPDX-License-Identifier: Apache-2.0
"""Ends an MCAP file that was cut off: a torn last record goes, the index that was never written is computed anew.

Nothing is copied, so that a bag of many gigabytes is repaired where it lies. A damaged record in the middle stays in
the file as a private one, which every reader passes over.
"""

import io
import struct
import zlib
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode

from haptic_device.mcapfile import DAMAGE, MAGIC, MESSAGE, RECORD, Record, Records, described, places, unpack
from haptic_device.node.bag_information import FileSpan
from haptic_device.skipped import Skipped

PRIVATE = 0x80  # first opcode that the MCAP specification leaves to applications


@dataclass
class Index:
    """What one file holds, as its summary tells it; offsets in bytes.

    counts: messages by channel. skipped: by topic, of the bag's files up to here. data_end: where the last whole record
    of messages and attachments ends. torn: bytes after the last whole record. wrong: why it is not whole, or "".
    """

    span: FileSpan
    data_end: int = len(MAGIC)
    torn: int = 0
    wrong: str = ""
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    skipped: dict[str, Skipped] = field(default_factory=dict)
    chunks: Collection[records.ChunkIndex] = field(default_factory=list)
    attachments: list[records.AttachmentIndex] = field(default_factory=list)
    metadata: list[records.MetadataIndex] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)

    def message(self, channel: int, sequence: int, received: int) -> None:
        """Counts one message and the numbers that were skipped before it."""
        if described := self.channels.get(channel):
            self.skipped.setdefault(described.topic, Skipped()).count(sequence)
        self.counts[channel] = self.counts.get(channel, 0) + 1
        self.span = self.span.with_message(received)


def complete(path: Path, skipped: dict[str, Skipped] | None = None) -> Index:
    """Makes the file whole in place, if it is not; index of what it holds. skipped: goes on from the files before.

    Bytes that are neither a whole record nor the beginning of one are kept beside it, in <name>.rest. Raises ValueError
    if the file is no MCAP file, OSError if it cannot be written.
    """
    with open(path, "r+b") as stream:
        index = scan(stream, path.name, skipped)
        if index.wrong.startswith("is damaged"):
            stream.seek(index.data_end)
            path.with_name(path.name + ".rest").write_bytes(stream.read())
        for offset in index.damaged:
            stream.seek(offset)
            stream.write(bytes([PRIVATE]))
        if index.wrong or index.damaged:
            stream.seek(index.data_end)
            stream.truncate()
            stream.write(summary(index))
    return index


def scan(stream: BinaryIO, name: str, skipped: dict[str, Skipped] | None = None) -> Index:
    """What the file holds up to where it is cut off. Raises ValueError if it is no MCAP file."""
    known, found = described(stream), Records(stream)
    index, ended = Index(FileSpan(name), skipped={} if skipped is None else skipped), False
    for opcode, content in known:
        _note_part(index, opcode, content)
    for record in found:
        ended = ended or record.opcode == Opcode.DATA_END
        if not ended:
            index.data_end = record.end
            try:
                _note(index, record)
            except DAMAGE:
                index.damaged.append(record.offset)
    index.wrong = found.wrong
    index.torn = stream.seek(0, io.SEEK_END) - found.end if found.wrong else 0
    return index


def _note(index: Index, record: Record) -> None:
    if record.opcode == Opcode.CHUNK:
        _note_chunk(index, record)
    elif record.opcode == Opcode.MESSAGE_INDEX:
        _note_message_index(index, record)
    elif record.opcode == Opcode.ATTACHMENT:
        found = records.Attachment.read(_stream(record.content))
        length, size = record.end - record.offset, len(found.data)
        index.attachments.append(
            records.AttachmentIndex(
                record.offset, length, found.log_time, found.create_time, size, found.name, found.media_type
            )
        )
    elif record.opcode == Opcode.METADATA:
        name = records.Metadata.read(_stream(record.content)).name
        index.metadata.append(records.MetadataIndex(record.offset, record.end - record.offset, name))
    else:
        _note_part(index, record.opcode, record.content)


def _note_chunk(index: Index, record: Record) -> None:
    chunk = unpack(record.content)
    parts = list(places(chunk.records))
    for opcode, begin, end in parts:
        _note_part(index, opcode, chunk.records[begin:end])
    index.chunks.append(
        records.ChunkIndex(
            record.end - record.offset, record.offset, chunk.compression, chunk.stored, chunk.last, 0, {}, chunk.first,
            len(chunk.records),
        )
    )  # fmt: skip


def _note_message_index(index: Index, record: Record) -> None:
    """Of the last chunk, if it stands right behind that one: those of a damaged chunk belong to none."""
    chunk = index.chunks[-1] if index.chunks else None
    if chunk and record.offset == chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length:
        (channel,) = struct.unpack_from("<H", record.content)
        chunk.message_index_offsets[channel] = record.offset
        chunk.message_index_length += record.end - record.offset


def _note_part(index: Index, opcode: int, content: bytes) -> None:
    if opcode == Opcode.MESSAGE:
        channel, sequence, received, _ = MESSAGE.unpack_from(content)
        index.message(channel, sequence, received)
    elif opcode == Opcode.SCHEMA:
        schema = records.Schema.read(_stream(content))
        index.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = records.Channel.read(_stream(content))
        index.channels[channel.id] = channel


def summary(index: Index) -> bytes:
    """End of data, summary section, footer and closing magic, to stand at index.data_end."""
    end = RecordBuilder()
    records.DataEnd(0).write(end)
    head = end.end()
    start, builder, offsets = index.data_end + len(head), RecordBuilder(), []
    groups = {
        Opcode.SCHEMA: index.schemas.values(),
        Opcode.CHANNEL: index.channels.values(),
        Opcode.STATISTICS: [_statistics(index)],
        Opcode.CHUNK_INDEX: index.chunks,
        Opcode.ATTACHMENT_INDEX: index.attachments,
        Opcode.METADATA_INDEX: index.metadata,
    }
    for opcode, group in groups.items():
        before = builder.count
        for record in group:
            record.write(builder)
        offsets.append(records.SummaryOffset(opcode, builder.count - before, start + before))
    offsets_start = start + builder.count
    for offset in offsets:
        offset.write(builder)
    return head + _footed(builder.end(), start, offsets_start)


def _footed(content: bytes, start: int, offsets_start: int) -> bytes:
    builder = RecordBuilder()
    checked = content + RECORD.pack(Opcode.FOOTER, 20) + struct.pack("<QQ", start, offsets_start)
    records.Footer(start, offsets_start, zlib.crc32(checked)).write(builder)
    return content + builder.end() + MAGIC


def _statistics(index: Index) -> records.Statistics:
    return records.Statistics(
        attachment_count=len(index.attachments),
        channel_count=len(index.channels),
        channel_message_counts=index.counts,
        chunk_count=len(index.chunks),
        message_count=index.span.messages,
        message_end_time=index.span.last,
        message_start_time=index.span.first,
        metadata_count=len(index.metadata),
        schema_count=len(index.schemas),
    )


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(content))
