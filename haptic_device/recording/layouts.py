# SPDX-License-Identifier: Apache-2.0
"""Layouts of the messages that do not vary in size, for who writes them and for who reads thousands at once.

CDR as ROS 2 writes it: 4 bytes of encapsulation, then little-endian fields, each aligned to its size counted from
there; a sequence is its uint32 length, then its elements. A message whose names and frame never change has bytes in
which only stamp and numbers vary: a layout keeps that template, reads and writes by offsets, and tells foreign bytes at
once. Needs no ROS.
"""

import functools
import math
import struct
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

JOINTS, CLOUD = "sensor_msgs/msg/JointState", "sensor_msgs/msg/PointCloud2"
STRING, DIAGNOSTICS = "std_msgs/msg/String", "diagnostic_msgs/msg/DiagnosticArray"
PARTS = ("position", "velocity", "effort")
WRENCH, POSE = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped"
STAMPED = {  # messages of a header and float64 fields, and the parts of a joint that these are
    WRENCH: ("force.x force.y force.z torque.x torque.y torque.z", ("effort",)),
    POSE: ("position.x position.y position.z orientation.x orientation.y orientation.z orientation.w", ("position",)),
}
FORMATS = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}  # sensor_msgs/PointField
_CODES = {np.dtype(kind): code for code, kind in FORMATS.items()}
_SECOND = 1_000_000_000
HEADED = (JOINTS, CLOUD, *STAMPED)  # types that begin with a std_msgs/Header
STAMP_END = 12  # bytes of a message up to the end of its header's stamp
_STAMP_AT, _STAMP, _WORD = 4, struct.Struct("<iI"), struct.Struct("<I")


class JointSample(NamedTuple):
    """One JointState's stamp [ns of the sender's ROS clock] and numbers, each array in the order of the names."""

    stamp_ns: int
    position: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    effort: npt.NDArray[np.float64]


class _Template:
    """CDR bytes as they grow, and beside them which of them are fixed; alignment counts from behind the header."""

    def __init__(self, frame_id: str) -> None:
        self.data, self.mask = bytearray(b"\x00\x01\x00\x00"), bytearray(b"\x01" * 4)
        self.varying(8)  # stamp
        self.text(frame_id)

    def varying(self, count: int) -> None:
        self.data += bytes(count)
        self.mask += bytes(count)

    def fixed(self, data: bytes) -> None:
        self.data += data
        self.mask += b"\x01" * len(data)

    def align(self, size: int) -> None:
        self.varying(-(len(self.data) - 4) % size)

    def word(self, value: int) -> None:
        self.align(4)
        self.fixed(_WORD.pack(value))

    def text(self, value: str) -> None:
        encoded = value.encode() + b"\0"
        self.word(len(encoded))
        self.fixed(encoded)

    def counted(self) -> int:
        self.align(4)
        self.varying(4)
        return len(self.data) - 4

    def reals(self, count: int) -> int:
        self.align(8)
        self.varying(8 * count)
        return len(self.data) - 8 * count


class _Layout:
    """A template, and whether other bytes begin as it does where it is fixed; padding and options are the sender's."""

    def __init__(self, head: _Template) -> None:
        self.template = bytes(head.data)
        mask = head.mask[:2] + bytes(2) + head.mask[4:]  # bytes 2 and 3 are the sender's options
        self._mask = int.from_bytes(bytes(0xFF * byte for byte in mask), "little")
        self._known = int.from_bytes(self.template, "little") & self._mask

    def begins(self, data: bytes) -> bool:
        """Whether the fixed bytes of the template stand in these bytes too."""
        return int.from_bytes(data[: len(self.template)], "little") & self._mask == self._known

    def stamped(self, stamp_ns: int) -> bytearray:
        """The template with this stamp."""
        data = bytearray(self.template)
        _STAMP.pack_into(data, _STAMP_AT, *divmod(stamp_ns, _SECOND))
        return data


class _Sized(_Layout):
    """A layout of one size: blocks of `count` float64 behind the head, one for each of these parts of a joint."""

    def __init__(self, head: _Template, names: Sequence[str], parts: Sequence[str], offsets: Sequence[int]) -> None:
        super().__init__(head)
        self.names, self.offsets, self.size = tuple(names), offsets, len(self.template)
        self.count = len(self.names)
        self._reals = struct.Struct(f"<{self.count}d")
        fields: dict[str, tuple[Any, int]] = {"seconds": ("<i4", _STAMP_AT), "nanoseconds": ("<u4", _STAMP_AT + 4)}
        fields |= {part: (("<f8", (self.count,)), at) for part, at in zip(parts, offsets, strict=True)}
        formats, places = zip(*fields.values(), strict=True)
        told: Any = {"names": list(fields), "formats": formats, "offsets": places, "itemsize": self.size}
        self._record = np.dtype(told)

    def matches(self, data: bytes) -> bool:
        """Whether these bytes have exactly this layout."""
        return len(data) == self.size and self.begins(data)

    def packed(self, stamp_ns: int, *blocks: Iterable[float]) -> bytes:
        """Bytes of one message with these numbers in its blocks."""
        data = self.stamped(stamp_ns)
        for offset, numbers in zip(self.offsets, blocks, strict=True):
            self._reals.pack_into(data, offset, *numbers)
        return bytes(data)

    def arrays(self, messages: list[bytes]) -> list[npt.NDArray[Any]]:
        """Of bytes that match: stamps [ns], then position, velocity, effort (messages, names), NaN if not there."""
        rows = np.frombuffer(b"".join(messages), self._record)
        none = np.full((len(rows), self.count), np.nan)
        parts = [rows[part] if part in self._record.names else none for part in PARTS]
        return [rows["seconds"].astype(np.int64) * _SECOND + rows["nanoseconds"], *parts]


class JointLayout(_Sized):
    """A JointState with fixed names and frame: n numbers in each of its arrays, none in those not filled."""

    def __init__(self, names: Sequence[str], frame_id: str = "", filled: Sequence[str] = PARTS) -> None:
        head, offsets = _Template(frame_id), []
        head.word(len(names))
        for name in names:
            head.text(name)
        for part in PARTS:
            head.word(len(names) if part in filled else 0)
            if part in filled:
                offsets.append(head.reals(len(names)))
        super().__init__(head, names, filled, offsets)
        self.fixed = np.frombuffer(bytes(head.mask), np.uint8)  # 1 where a byte never varies

    def pack(
        self, stamp_ns: int, position: Iterable[float], velocity: Iterable[float], effort: Iterable[float]
    ) -> bytes:
        """Bytes of one message; each array of length count."""
        return self.packed(stamp_ns, position, velocity, effort)

    def numbers(self, data: bytes) -> tuple[Any, ...]:
        """Stamp [ns], positions, velocities and efforts of bytes that match, as tuples: quicker than unpack if few."""
        return stamp_of(data), *(self._reals.unpack_from(data, offset) for offset in self.offsets)

    def unpack(self, data: bytes) -> JointSample:
        """JointSample of bytes that match."""
        return JointSample(stamp_of(data), *(np.frombuffer(data, "<f8", self.count, at) for at in self.offsets))


class StampedLayout(_Sized):
    """A message that is a header and then one float64 for each name: WrenchStamped, PoseStamped (STAMPED)."""

    def __init__(self, type_name: str, frame_id: str = "") -> None:
        (fields, parts), head = STAMPED[type_name], _Template(frame_id)
        names = fields.split()
        super().__init__(head, names, parts, [head.reals(len(names))])

    def pack(self, stamp_ns: int, numbers: Iterable[float]) -> bytes:
        """Bytes of one message."""
        return self.packed(stamp_ns, numbers)


class CloudLayout(_Layout):
    """A PointCloud2 of records: one point a record, one field a column."""

    def __init__(self, dtype: np.dtype[np.void], frame_id: str = "") -> None:
        head, self.record = _Template(frame_id), dtype
        head.word(1)  # height
        self._counts = [head.counted()]  # width
        fields: Any = dtype.fields
        head.word(len(fields))
        for name in dtype.names or ():
            kind, offset = fields[name][:2]
            head.text(name)
            head.word(offset)
            head.fixed(bytes([_CODES[kind.base]]))
            head.word(kind.itemsize // kind.base.itemsize)
        head.fixed(b"\0")  # is_bigendian
        head.word(dtype.itemsize)
        self._counts += [head.counted(), head.counted()]  # bytes of a row, of all
        super().__init__(head)
        self._fixed = np.frombuffer(bytes(head.mask), np.uint8)

    def fixed(self, count: int) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8], int]:
        """Template of a message of so many records, 1 where its bytes never vary, and where the records begin."""
        template = np.frombuffer(self.pack(0, np.zeros(count, self.record)), np.uint8)
        fixed = np.zeros(len(template), np.uint8)
        fixed[: len(self.template)] = self._fixed
        for place in self._counts:
            fixed[place : place + 4] = 1
        return template, fixed, len(self.template)

    def pack(self, stamp_ns: int, records: npt.NDArray[np.void]) -> bytes:
        """Bytes of one message."""
        data = self.stamped(stamp_ns)
        for place, number in zip(self._counts, (len(records), records.nbytes, records.nbytes), strict=True):
            _WORD.pack_into(data, place, number)
        whole = b"".join((data, records.tobytes(), b"\1"))  # is_dense
        return whole + bytes(-len(whole) % 4)  # as it arrives: RTPS rounds a payload up to four bytes

    def matches(self, data: bytes) -> bool:
        """Whether these bytes have this layout, with all of their records."""
        begin = len(self.template)
        if len(data) < begin or not self.begins(data):
            return False
        count, _, size = (_WORD.unpack_from(data, place)[0] for place in self._counts)
        return size == count * self.record.itemsize and len(data) >= begin + size

    def records(self, data: bytes) -> bytes:
        """The bytes of the records of bytes that match."""
        begin = len(self.template)
        return data[begin : begin + _WORD.unpack_from(data, self._counts[-1])[0]]


def wrench_numbers(force: Sequence[float]) -> tuple[float, ...]:
    """The numbers of a WrenchStamped of a planar (f_x, f_y, torque)."""
    return force[0], force[1], 0.0, 0.0, 0.0, force[2]


def pose_numbers(position: Sequence[float]) -> tuple[float, ...]:
    """The numbers of a PoseStamped of a planar (x, y, theta)."""
    half = float(position[2]) / 2
    return position[0], position[1], 0.0, 0.0, 0.0, math.sin(half), math.cos(half)


def stamp_of(data: bytes) -> int:
    """Stamp [ns] of a serialized message that begins with a std_msgs/Header."""
    seconds, nanoseconds = _STAMP.unpack_from(data, _STAMP_AT)
    return seconds * _SECOND + nanoseconds


def layout_of(type_name: str, data: bytes) -> JointLayout | StampedLayout | CloudLayout:
    """The layout of a message of a type above, and of all like it. Raises ValueError if the bytes are none."""
    try:
        layout = _described(type_name, types().deserialize_cdr(data, type_name))
    except Exception as error:  # whatever strange bytes make the decoder say
        said = str(error) or type(error).__name__
        raise ValueError(f"a message of {len(data)} bytes is no {type_name} ({said})") from None
    if not layout.matches(data):
        raise ValueError(f"a message of {len(data)} bytes is a {type_name} of another layout than is read here")
    return layout


def _described(type_name: str, message: Any) -> JointLayout | StampedLayout | CloudLayout:
    frame_id = message.header.frame_id
    if type_name == JOINTS:
        return JointLayout(message.name, frame_id, [part for part in PARTS if len(getattr(message, part))])
    if type_name in STAMPED:
        return StampedLayout(type_name, frame_id)
    fields = message.fields
    kinds = [(FORMATS[field.datatype], (field.count,) if field.count > 1 else ()) for field in fields]
    places = {"names": [field.name for field in fields], "offsets": [field.offset for field in fields]}
    record: Any = {**places, "formats": kinds, "itemsize": message.point_step}
    return CloudLayout(np.dtype(record), frame_id)


@functools.cache
def types() -> "Typestore":
    """The message types of ROS 2 Jazzy's common packages."""
    from rosbags.typesys import Stores, get_typestore  # which a node that only packs does without

    return get_typestore(Stores.ROS2_JAZZY)
