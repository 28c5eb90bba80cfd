# SPDX-License-Identifier: Apache-2.0
"""One MCAP file being written: messages gathered in a chunk, chunks with their index, at last the summary.

The `mcap` library's writer would do, at four times the time for a message; its records are used for all the rest.
"""

import errno
import os
import struct
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from haptic_device.mcapfile import MAGIC, RECORD
from haptic_device.node.bag_index import Index, summary
from haptic_device.node.bag_information import FileSpan

CHUNK_BYTES = 4 * 2**20  # more than comes between two flushes at 10 kHz
_LEVEL = 1  # of zstd: a third of the time of its default for a tenth more bytes
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of the list of (log time, offset)
_HEAD = 22  # bytes of a message's content before its data
_UINT32, _FUTURE = 0xFFFFFFFF, 2**63


class _Packed(bytes):
    """Records of the summary, as they will stand there."""

    def write(self, builder: RecordBuilder) -> None:
        """As the library's records do."""
        builder.write(self)


class _ChunkIndices:
    """The chunks' records of the summary, in a file without a name beside the bag: memory does not grow with it."""

    def __init__(self, folder: Path):
        self._count, self._stream = 0, tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115

    def append(self, record: records.ChunkIndex) -> None:
        """Adds one. Raises OSError if the disk does not take it."""
        content = _bytes(record)
        if self._stream.write(content) < len(content):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[_Packed]:
        self._stream.seek(0)
        yield _Packed(self._stream.read())

    def close(self) -> None:
        """Lets the file go."""
        self._stream.close()


class BagFile:
    """A new file; what `flush` has returned from is the operating system's."""

    def __init__(self, path: Path):
        self.path, self.size = path, 0
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._chunks, self._compressor = _ChunkIndices(path.parent), zstandard.ZstdCompressor(level=_LEVEL)
        self._index = Index(FileSpan(path.name), chunks=self._chunks)
        self._chunk, self._places = bytearray(), {}
        self._first, self._last, self._count = _FUTURE, 0, 0
        self._write(MAGIC + _bytes(records.Header("ros2", "haptic_display")))

    @property
    def span(self) -> FileSpan:
        """Times and number of the messages that were flushed."""
        return self._index.span

    def add_schema(self, name: str, definition: bytes) -> int:
        """Number of a new schema."""
        schema = records.Schema(len(self._index.schemas) + 1, definition, "ros2msg", name)
        self._index.schemas[schema.id] = schema
        self._chunk += _bytes(schema)
        return schema.id

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Number of a new channel."""
        channel = records.Channel(len(self._index.channels) + 1, topic, "cdr", metadata, schema)
        self._index.channels[channel.id], self._index.counts[channel.id] = channel, 0
        self._chunk += _bytes(channel)
        return channel.id

    def add_message(self, channel: int, data: bytes, received: int, published: int, sequence: int) -> None:
        """Adds a message; times in ns of the system clock."""
        places = self._places.get(channel)
        if places is None:
            places = self._places[channel] = []
        places.append((received, len(self._chunk)))
        length = _HEAD + len(data)
        self._chunk += _MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence & _UINT32, received, published)
        self._chunk += data
        if len(self._chunk) > CHUNK_BYTES:
            self.flush()

    def attach(self, name: str, media_type: str, data: bytes, now: int) -> None:
        """Adds an attachment."""
        content, at = _bytes(records.Attachment(now, now, name, media_type, data)), self.size
        index = records.AttachmentIndex(at, len(content), now, now, len(data), name, media_type)
        self._index.attachments.append(index)
        self._write(content)

    def flush(self) -> None:
        """Writes the messages so far as a chunk. Raises OSError if the disk does not take it."""
        if not self._places:
            return
        data, places = bytes(self._chunk), self._places
        self._chunk, self._places = bytearray(), {}
        times = [time for entries in places.values() for time, _ in entries]
        stored = self._compressor.compress(data)
        chunk = records.Chunk("zstd", stored, max(times), min(times), zlib.crc32(data), len(data))
        self._write_chunk(_bytes(chunk), chunk, places)
        self._first, self._last = min(self._first, *times), max(self._last, *times)
        self._count += len(times)
        self._index.span = FileSpan(self.path.name, self._first, self._last, self._count)
        for channel, entries in places.items():
            self._index.counts[channel] += len(entries)

    def finish(self, metadata: dict[str, dict[str, str]]) -> None:
        """Writes what is left, metadata records and the summary, and closes the file."""
        self.flush()
        for name, content in metadata.items():
            data = _bytes(records.Metadata(name, content))
            self._index.metadata.append(records.MetadataIndex(self.size, len(data), name))
            self._write(data)
        self._index.data_end = self.size
        self._write(summary(self._index))
        self.close()

    def close(self) -> None:
        """Closes the file as it is."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._chunks.close()
        self._descriptor = -1

    def _write_chunk(self, content: bytes, chunk: records.Chunk, places: dict) -> None:
        begin, indices, offsets = self.size, bytearray(), {}
        for channel, entries in places.items():
            offsets[channel] = begin + len(content) + len(indices)
            listed = np.array(entries, "<u8").tobytes()
            indices += _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX.size - RECORD.size + len(listed), channel, len(listed))
            indices += listed
        self._write(content + indices)
        index = records.ChunkIndex(
            len(content), begin, "zstd", len(chunk.data), chunk.message_end_time, len(indices), offsets,
            chunk.message_start_time, chunk.uncompressed_size,
        )  # fmt: skip
        self._chunks.append(index)

    def _write(self, data: bytes) -> None:
        left = memoryview(data)
        while left:
            count = os.write(self._descriptor, left)
            self.size, left = self.size + count, left[count:]


def _bytes(record) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
