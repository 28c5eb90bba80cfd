# SPDX-License-Identifier: Apache-2.0
"""Many serialized messages of one topic to numpy at once, by their common layout instead of one by one.

CDR as ROS 2 writes it: 4 bytes of encapsulation, then little-endian fields, each aligned to its size counted from
there; a sequence is its uint32 length, then its elements.
"""

import struct
from typing import NamedTuple

import numpy as np

PARTS = ("position", "velocity", "effort")
_ENCAPSULATION = 4
_FORMATS = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}  # sensor_msgs/PointField


class JointLayout(NamedTuple):
    """Where a JointState keeps its arrays: offsets [bytes] and counts of position, velocity, effort."""

    names: tuple[str, ...]
    head: bytes
    arrays: tuple[tuple[int, int], ...]
    size: int


class _Cursor:
    def __init__(self, data: bytes):
        if data[:2] != b"\x00\x01":
            raise ValueError("a message is not little-endian CDR")
        self.data, self.at = data, _ENCAPSULATION

    def align(self, size: int) -> None:
        self.at += -(self.at - _ENCAPSULATION) % size

    def count(self) -> int:
        self.align(4)
        (value,) = struct.unpack_from("<I", self.data, self.at)
        self.at += 4
        return value

    def text(self) -> str:
        length = self.count()
        self.at += length
        return self.data[self.at - length : self.at - 1].decode()

    def field(self) -> tuple[str, tuple, int]:
        """Name, format and offset of a sensor_msgs/PointField."""
        name, offset = self.text(), self.count()
        kind = _FORMATS[self.data[self.at]]
        self.at += 1
        count = self.count()
        return name, (kind, (count,) if count > 1 else ()), offset

    def doubles(self) -> tuple[int, int]:
        count = self.count()
        if count:
            self.align(8)
        start = self.at
        self.at += 8 * count
        return start, count


def joint_layout(data: bytes) -> JointLayout:
    """Layout of one serialized sensor_msgs/JointState. Raises ValueError if the bytes are none."""
    try:
        cursor = _Cursor(data)
        cursor.at += 8  # stamp: int32 s, uint32 ns
        cursor.text()
        names = tuple(cursor.text() for _ in range(cursor.count()))
        head = data[_ENCAPSULATION + 8 : cursor.at]
        arrays = tuple(cursor.doubles() for _ in range(3))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"a message of {len(data)} bytes is no JointState ({error})") from error
    if any(count not in (0, len(names)) for _, count in arrays) or cursor.at > len(data):
        raise ValueError(f"a JointState of {len(names)} names has arrays of other lengths")
    return JointLayout(names, head, arrays, len(data))


def stamped_layout(names: tuple[str, ...], part: str, data: bytes) -> JointLayout:
    """Layout of a header and then one float64 for each name (a WrenchStamped, a PoseStamped), taken for one part."""
    try:
        cursor = _Cursor(data)
        cursor.at += 8  # stamp
        cursor.text()
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"a message of {len(data)} bytes has no header ({error})") from error
    head = data[_ENCAPSULATION + 8 : cursor.at]
    cursor.align(8)
    if cursor.at + 8 * len(names) > len(data):
        raise ValueError(f"a message of {len(data)} bytes has not all of {', '.join(names)}")
    return JointLayout(names, head, tuple((cursor.at, len(names) * (one == part)) for one in PARTS), len(data))


class CloudLayout(NamedTuple):
    """Where a PointCloud2 keeps its records [bytes]: type of one, places of width and size, and what never varies."""

    record: np.dtype
    width: int
    size: int
    fixed: tuple[tuple[int, bytes], ...]


def cloud_layout(data: bytes) -> CloudLayout:
    """Layout of one serialized sensor_msgs/PointCloud2. Raises ValueError if the bytes are none."""
    try:
        cursor = _Cursor(data)
        cursor.at += 8  # stamp
        cursor.text()
        cursor.count()  # height
        width = cursor.at
        cursor.count()
        begin = cursor.at
        fields = [cursor.field() for _ in range(cursor.count())]
        cursor.at += 1  # is_bigendian
        step = cursor.count()
        fixed = (_ENCAPSULATION + 8, data[_ENCAPSULATION + 8 : width]), (begin, data[begin : cursor.at])
        cursor.count()  # row_step
        names, formats, offsets = zip(*fields, strict=True)
        record = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})
        size = cursor.at
        cursor.count()
    except (struct.error, UnicodeDecodeError, KeyError, IndexError, TypeError) as error:
        raise ValueError(f"a message of {len(data)} bytes is no PointCloud2 of named fields ({error})") from error
    return CloudLayout(record, width, size, fixed)


def cloud_records(layout: CloudLayout, data: bytes) -> bytes | None:
    """The bytes of one message's records; None if it is of another layout or cut off."""
    if any(data[at : at + len(same)] != same for at, same in layout.fixed) or len(data) < layout.size + 4:
        return None
    (count,), (size,) = struct.unpack_from("<I", data, layout.width), struct.unpack_from("<I", data, layout.size)
    begin = layout.size + 4
    whole = size == count * layout.record.itemsize and len(data) >= begin + size
    return data[begin : begin + size] if whole else None


def stamp_of(data: bytes) -> int:
    """Stamp [ns] of a serialized message that begins with a std_msgs/Header."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, _ENCAPSULATION)
    return seconds * 1_000_000_000 + nanoseconds


def same_layout(layout: JointLayout, data: bytes) -> bool:
    """Whether another message has its names and arrays in the same places."""
    start = _ENCAPSULATION + 8
    return len(data) == layout.size and data[start : start + len(layout.head)] == layout.head


def joint_arrays(layout: JointLayout, messages: list[bytes]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Stamps [ns, int64] and position, velocity, effort as (messages, names) float64; NaN where a message has none."""
    table = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), layout.size)
    seconds = _column(table, _ENCAPSULATION, "<i4", 1)[:, 0].astype(np.int64)
    nanoseconds = _column(table, _ENCAPSULATION + 4, "<u4", 1)[:, 0]
    return seconds * 1_000_000_000 + nanoseconds, [_doubles(table, layout, *array) for array in layout.arrays]


def _doubles(table: np.ndarray, layout: JointLayout, start: int, count: int) -> np.ndarray:
    if count == 0:
        return np.full((len(table), len(layout.names)), np.nan)
    return _column(table, start, "<f8", count)


def _column(table: np.ndarray, start: int, kind: str, count: int) -> np.ndarray:
    width = np.dtype(kind).itemsize * count
    return np.ascontiguousarray(table[:, start : start + width]).view(kind)
