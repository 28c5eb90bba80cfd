# SPDX-License-Identifier: Apache-2.0
"""MCAP files record by record, whole or cut off: where each record lies, and what is in a chunk. Needs no ROS.

https://mcap.dev/spec: a file is magic, records (1 byte opcode, 8 bytes length, content), magic. The `mcap` library
parses the records; this file finds them also where a file ends too early or a chunk is damaged, and goes through the
messages of a chunk ten times as fast.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the data
LARGEST = 256 * 2**20  # bytes; a damaged length must not ask for the whole memory
_OPCODES = range(1, 256)
DAMAGE = (ValueError, struct.error, EndOfFile, OverflowError, MemoryError)  # what a damaged record makes a parser say
_FOOTER = struct.Struct("<BQQQI8s")  # opcode, length, begin of the summary, of its offsets, checksum, magic


class Record(NamedTuple):
    """One record: place of its opcode in the file [bytes], opcode, content."""

    offset: int
    opcode: int
    content: bytes

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.offset + RECORD.size + len(self.content)


class Records:
    """Iterates over the whole records of an open file, up to its footer.

    Afterwards `end` is where the last whole record ends, and `wrong` says why it was the last, "" if that was the
    footer and the closing magic. Raises ValueError if the file does not begin as MCAP files do.
    """

    def __init__(self, stream: BinaryIO):
        self._stream, self.end, self.wrong = stream, len(MAGIC), "ends without its index"
        if stream.read(len(MAGIC)) != MAGIC:
            raise ValueError("it is no MCAP file")

    def __iter__(self) -> Iterator[Record]:
        while len(head := self._stream.read(RECORD.size)) == RECORD.size:
            opcode, length = RECORD.unpack(head)
            if length > LARGEST or opcode not in _OPCODES:
                self.wrong = f"is damaged at byte {self.end}"
                return
            content = self._stream.read(length)
            if len(content) < length:
                return
            record = Record(self.end, opcode, content)
            self.end = record.end
            yield record
            if opcode == Opcode.FOOTER:
                self.wrong = "" if self._stream.read(len(MAGIC)) == MAGIC else self.wrong
                return


class Chunk(NamedTuple):
    """A chunk's times [ns], name of its compression, size as stored [bytes], and the unpacked records."""

    first: int
    last: int
    compression: str
    stored: int
    records: bytes


def unpack(content: bytes) -> Chunk:
    """The chunk in a record's content. Raises ValueError if it is damaged."""
    try:
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(content)))
        if chunk.uncompressed_size > LARGEST:
            raise ValueError(f"it claims {chunk.uncompressed_size} bytes")
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        data = stream.read(size)
    except (*DAMAGE, McapError, zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"its content is damaged: {' '.join(str(error).split())}") from None
    return Chunk(chunk.message_start_time, chunk.message_end_time, chunk.compression, len(chunk.data), data)


def places(data: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, begin, end) of the content of each record in an unpacked chunk. Raises ValueError if they do not fit."""
    at, size, unpack_head = 0, len(data), RECORD.unpack_from
    while at < size:
        if at + RECORD.size > size:
            raise ValueError("its last record is cut off")
        opcode, length = unpack_head(data, at)
        begin = at + RECORD.size
        at = begin + length
        if at > size:
            raise ValueError("its last record is cut off")
        yield opcode, begin, at


def described(stream: BinaryIO) -> list[tuple[int, bytes]]:
    """(opcode, content) of the schemas and channels in the summary; none if the file has no whole one.

    They stand in a chunk too, but that may be damaged: without them the messages of all later ones mean nothing. Leaves
    the stream at its beginning.
    """
    data = _summary(stream)
    stream.seek(0)
    try:
        parts = list(places(data))
    except ValueError:
        return []
    return [(opcode, data[begin:end]) for opcode, begin, end in parts if opcode in (Opcode.SCHEMA, Opcode.CHANNEL)]


def _summary(stream: BinaryIO) -> bytes:
    end = stream.seek(0, io.SEEK_END) - _FOOTER.size
    stream.seek(max(0, end))
    tail = stream.read(_FOOTER.size)  # no more: a file that is still written may have grown by now
    if len(tail) < _FOOTER.size:
        return b""
    opcode, _, begin, _, checksum, magic = _FOOTER.unpack(tail)
    if opcode != Opcode.FOOTER or magic != MAGIC or not 0 < begin <= end <= begin + LARGEST:
        return b""
    stream.seek(begin)
    data = stream.read(end - begin)
    checked = zlib.crc32(data + tail[: -len(MAGIC) - 4])
    return data if checksum in (0, checked) else b""
