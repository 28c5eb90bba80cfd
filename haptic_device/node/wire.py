# SPDX-License-Identifier: Apache-2.0
"""Messages: the only file that knows their fields and their bytes.

A JointState whose names and frame never change has bytes of one size in which only stamp and numbers vary. JointLayout
keeps that template, so that a sample is written and read by offsets, and foreign bytes are told at once.
"""

import math
import struct
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import String

from haptic_device.entries import COMMON, EACH, TAIL
from haptic_device.status import Status, named_statuses

__all__ = [
    "CloudLayout", "DiagnosticArray", "JointLayout", "JointState", "PointCloud2", "PoseStamped", "StampedLayout",
    "String", "WrenchStamped",
]  # fmt: skip

AXES = ("x", "y", "theta")
LATEST = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
)
STREAM = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=50,
)
TRACE = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
)
STATE = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
)
LEVELS = {"ok": DiagnosticStatus.OK, "warn": DiagnosticStatus.WARN, "error": DiagnosticStatus.ERROR}


def exchange_names(axes):
    """Names of a handle or tool message with that many axes."""
    return AXES[:axes] + TAIL


def truth_names(axes):
    """Names of `operator/state` with that many axes."""
    return AXES[:axes] + tuple(f"motor_{name}" for name in AXES[:axes]) + ("energy_given", "time", "motion_done")


class JointSample(NamedTuple):
    """One JointState's stamp [ns of the sender's ROS clock] and numbers, each array in the order of the names."""

    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


class JointLayout:
    """Bytes (CDR, little endian) of a JointState with fixed names and frame; n numbers in each of its three arrays."""

    def __init__(self, names, frame_id=""):
        self.names = tuple(names)
        self.count = len(self.names)
        head = _Template()
        head.varying(8)
        head.text(frame_id)
        head.word(self.count)
        for name in self.names:
            head.text(name)
        self.offsets = [head.numbers(self.count) for _ in range(3)]
        self.template = bytes(head.data)
        self.size = len(head.data)
        self.fixed = np.frombuffer(bytes(head.mask), np.uint8)  # 1 where a byte never varies, padding is the sender's
        self._mask = int.from_bytes(bytes(0xFF * self.fixed), "little")
        self._known = int.from_bytes(self.template, "little") & self._mask
        self._reals = struct.Struct(f"<{self.count}d")

    def matches(self, data):
        """Whether these bytes have exactly this layout."""
        return len(data) == self.size and int.from_bytes(data, "little") & self._mask == self._known

    def pack(self, stamp_ns, position, velocity, effort):
        """Bytes of one message; each array of length count."""
        data = bytearray(self.template)
        struct.pack_into("<iI", data, 4, stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000)
        for offset, numbers in zip(self.offsets, (position, velocity, effort), strict=True):
            self._reals.pack_into(data, offset, *numbers)
        return bytes(data)

    def numbers(self, data):
        """Stamp [ns], positions, velocities and efforts of bytes that match, as tuples: quicker than unpack if few."""
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
        blocks = (self._reals.unpack_from(data, offset) for offset in self.offsets)
        return seconds * 1_000_000_000 + nanoseconds, *blocks

    def unpack(self, data):
        """JointSample of bytes that match."""
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
        blocks = (np.frombuffer(data, "<f8", self.count, offset) for offset in self.offsets)
        return JointSample(seconds * 1_000_000_000 + nanoseconds, *blocks)


class _Template:
    """CDR bytes as they grow, and beside them which of them are fixed; alignment counts from behind the header."""

    def __init__(self):
        self.data, self.mask = bytearray(b"\x00\x01\x00\x00"), bytearray(b"\x01" * 4)

    def varying(self, count):
        self.data += bytes(count)
        self.mask += bytes(count)

    def fixed(self, data):
        self.data += data
        self.mask += b"\x01" * len(data)

    def align(self, size):
        self.varying(-(len(self.data) - 4) % size)

    def word(self, value):
        self.align(4)
        self.fixed(struct.pack("<I", value))
        return len(self.data) - 4

    def text(self, value):
        encoded = value.encode() + b"\0"
        self.word(len(encoded))
        self.fixed(encoded)

    def numbers(self, count):
        self.word(count)
        self.align(8)
        self.varying(8 * count)
        return len(self.data) - 8 * count


def planar_target(message, names):
    """Positions of a JointState with exactly these names, in their order; None if names, sizes or numbers are wrong."""
    given = dict(zip(message.name, message.position, strict=False))
    if len(message.name) != len(message.position) or len(given) != len(message.name) or set(given) != set(names):
        return None
    target = [given[name] for name in names]
    return target if target and np.isfinite(target).all() else None


def to_time(stamp_ns):
    return Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)


class CloudLayout:
    """Bytes (CDR, little endian) of a PointCloud2 of records: one point a record, one FLOAT64 field a column."""

    def __init__(self, dtype, frame_id=""):
        head, self._step = _Template(), dtype.itemsize
        head.varying(8)
        head.text(frame_id)
        head.word(1)  # height
        self._width = head.word(0)
        head.word(len(dtype.names))
        for name in dtype.names:
            kind, offset = dtype.fields[name][:2]
            head.text(name)
            head.word(offset)
            head.fixed(bytes([PointField.FLOAT64]))
            head.word(kind.itemsize // 8)
        head.fixed(b"\0")  # is_bigendian
        head.word(dtype.itemsize)
        self._row_step = head.word(0)
        self._size = head.word(0)
        self._head, self._mask = bytes(head.data), bytes(head.mask)

    def fixed(self, count):
        """Template of a message of so many records, 1 where its bytes never vary, and where the records begin."""
        template = np.frombuffer(self.pack(0, np.zeros(count * self._step, np.uint8).view(f"V{self._step}")), np.uint8)
        fixed = np.zeros(len(template), np.uint8)
        fixed[: len(self._mask)] = np.frombuffer(self._mask, np.uint8)
        return template, fixed, len(self._head)

    def pack(self, stamp_ns, records):
        """Bytes of one message."""
        data = bytearray(self._head)
        struct.pack_into("<iI", data, 4, stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000)
        struct.pack_into("<I", data, self._width, len(records))
        for place in (self._row_step, self._size):
            struct.pack_into("<I", data, place, records.nbytes)
        whole = b"".join((data, records.tobytes(), b"\1"))  # is_dense
        return whole + bytes(-len(whole) % 4)  # as it arrives: RTPS rounds a payload up to four bytes


NEAR = np.dtype([(name, "f8") for name in COMMON + EACH])
"""A point of `local_contacts`: what the whole set says, and one contact. A message has MOST (entries.py) of them."""


class StampedLayout:
    """Bytes (CDR, little endian) of a message that is a header and then so many float64: WrenchStamped, PoseStamped."""

    def __init__(self, count, frame_id=""):
        head = _Template()
        head.varying(8)
        head.text(frame_id)
        head.align(8)
        self._head, self._numbers = bytes(head.data), struct.Struct(f"<{count}d")

    def pack(self, stamp_ns, numbers):
        """Bytes of one message."""
        stamp = struct.pack("<iI", stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000)
        return b"".join((self._head[:4], stamp, self._head[12:], self._numbers.pack(*numbers)))


def wrench_numbers(force):
    """The numbers of a WrenchStamped of a planar (f_x, f_y, torque)."""
    return force[0], force[1], 0.0, 0.0, 0.0, force[2]


def pose_numbers(position):
    """The numbers of a PoseStamped of a planar (x, y, theta)."""
    half = float(position[2]) / 2
    return position[0], position[1], 0.0, 0.0, 0.0, math.sin(half), math.cos(half)


def diagnostics(stamp_ns, name, hardware_id, level, message, values, figures=()):
    """DiagnosticArray with a node's status and those of its figures, (name, level, message, values) each.

    level: `ok`, `warn` or `error`; values {name: anything}.
    """
    statuses = [_status(hardware_id, *status) for status in ((name, level, message, values), *figures)]
    array_message = DiagnosticArray(status=statuses)
    array_message.header.stamp = to_time(stamp_ns)
    return array_message


def statuses_of(data: bytes, time: int) -> dict[str, Status]:
    """Statuses by name, out of one serialized DiagnosticArray received at time [ns, system clock].

    None out of bytes that are no such message.
    """
    try:
        message = deserialize_message(data, DiagnosticArray)
    except Exception:  # whatever another vendor's node makes the decoder say
        return {}
    return dict(named_statuses(message, time))


def _status(hardware_id, name, level, message, values):
    entries = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=LEVELS[level], name=name, message=message, hardware_id=hardware_id, values=entries)
