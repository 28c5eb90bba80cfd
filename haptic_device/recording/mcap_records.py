# SPDX-License-Identifier: Apache-2.0
"""The records of one MCAP file, complete, cut off or damaged in the middle; needs no ROS.

https://mcap.dev/spec: a file is magic, records (1 byte opcode, 8 bytes length, content), magic. The `mcap` library
parses the records; here they are found also where a file ends too early or one of them is damaged.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

LARGEST = 256 * 2**20  # bytes; a damaged length must not ask for the whole memory
_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI8s")  # opcode, length, begin of the summary, of its offsets, checksum, magic
_PARTS: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.ATTACHMENT: Attachment}
_ZSTD = b"\x28\xb5\x2f\xfd"  # begins what is compressed, and no message in CDR
_FOREIGN = {b"SQLite": "it is stored as sqlite3, not as MCAP", _ZSTD: "it is compressed (compression_mode: file)"}
_DAMAGE = (ValueError, struct.error, OverflowError, MemoryError, RuntimeError, McapError, ZstdError)


class Records:
    """Iterates over schemas, channels, messages and attachments of an open file, up to its end of data.

    What the summary at the end describes comes first: the chunk that says it too may be damaged, and without it the
    messages of all later ones mean nothing. Afterwards `damaged` counts the records that cannot be read, and `wrong`
    says why the file is not whole, "" if it is. Raises ValueError if the file does not begin as MCAP files do, and on
    the way if its messages are compressed each.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._described = stream, described(stream)
        self.damaged, self.wrong = 0, "ends without its index"
        if (magic := stream.read(len(MCAP0_MAGIC))) != MCAP0_MAGIC:
            foreign = (said for head, said in _FOREIGN.items() if magic.startswith(head))
            raise ValueError(next(foreign, "it is no MCAP file"))

    def __iter__(self) -> Iterator[McapRecord]:
        yield from self._described
        ended, first = False, True
        for opcode, content in self._framed():
            ended = ended or opcode == Opcode.DATA_END
            if not ended:
                try:
                    found = _parsed(opcode, content)
                except _DAMAGE:
                    self.damaged += 1
                    continue
                if first and (messages := [one for one in found if isinstance(one, Message)]):
                    first = False
                    if messages[0].data.startswith(_ZSTD):
                        raise ValueError("its messages are compressed (compression_mode: message)")
                yield from found

    def _framed(self) -> Iterator[tuple[int, bytes]]:
        """(opcode, content) of each whole record."""
        at = len(MCAP0_MAGIC)
        while len(head := self._stream.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(head)
            if length > LARGEST or opcode == 0:
                self.wrong = f"is damaged at byte {at}"
                return
            content = self._stream.read(length)
            if len(content) < length:
                return
            at += len(head) + length
            yield opcode, content
            if opcode == Opcode.FOOTER:
                self.wrong = "" if self._stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC else self.wrong
                return


def _parsed(opcode: int, content: bytes) -> list[McapRecord]:
    stream = ReadDataStream(io.BytesIO(content))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        if chunk.uncompressed_size > LARGEST:
            raise ValueError(f"it claims {chunk.uncompressed_size} bytes")
        return breakup_chunk(chunk, validate_crc=True)
    if opcode == Opcode.MESSAGE:  # of a file without chunks
        return [Message.read(stream, len(content))]
    return [_PARTS[opcode].read(stream)] if opcode in _PARTS else []


def described(stream: BinaryIO) -> list[McapRecord]:
    """What the summary holds; nothing if the file has no whole one. Leaves the stream at its beginning."""
    end = stream.seek(0, io.SEEK_END) - _FOOTER.size
    stream.seek(max(0, end))
    tail = stream.read(_FOOTER.size)  # no more: a file that is still written may have grown by now
    opcode, _, begin, _, checksum, magic = _FOOTER.unpack(tail.ljust(_FOOTER.size))
    data = b""
    if opcode == Opcode.FOOTER and magic == MCAP0_MAGIC and 0 < begin <= end <= begin + LARGEST:
        stream.seek(begin)
        data = stream.read(end - begin) + tail
    stream.seek(0)
    try:
        whole = data and checksum in (0, zlib.crc32(data[: -len(MCAP0_MAGIC) - 4]))
        return list(StreamReader(io.BytesIO(data), skip_magic=True).records) if whole else []
    except _DAMAGE:
        return []
