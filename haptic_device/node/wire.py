# SPDX-License-Identifier: Apache-2.0
"""Messages: the only file that knows their fields and their bytes.

A JointState whose names and frame never change has bytes of one size in which only stamp and numbers vary. JointLayout
keeps that template, so that a sample is written and read by offsets, and foreign bytes are told at once.
"""

import struct
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, PointCloud2, PointField

from haptic_device.law import exchange

__all__ = ["DiagnosticArray", "JointLayout", "JointState", "PointCloud2", "PoseStamped", "WrenchStamped"]

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
LEVELS = {"ok": DiagnosticStatus.OK, "warn": DiagnosticStatus.WARN, "error": DiagnosticStatus.ERROR}


def exchange_names(axes):
    """Names of a handle or tool message with that many axes."""
    return AXES[:axes] + exchange.TAIL


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
        self._fixed_bytes = np.frombuffer(self.template, np.uint8) * self.fixed

    def matches(self, data):
        """Whether these bytes have exactly this layout."""
        return len(data) == self.size and np.array_equal(np.frombuffer(data, np.uint8) * self.fixed, self._fixed_bytes)

    def pack(self, stamp_ns, position, velocity, effort):
        """Bytes of one message; each array of length count."""
        data = bytearray(self.template)
        struct.pack_into("<iI", data, 4, stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000)
        for offset, numbers in zip(self.offsets, (position, velocity, effort), strict=True):
            data[offset : offset + 8 * self.count] = np.asarray(numbers, "<f8").tobytes()
        return bytes(data)

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


def trace_cloud(stamp_ns, frame_id, rows):
    """PointCloud2 of servo ticks: one point a row, one FLOAT64 field a column."""
    fields = []
    for name in rows.dtype.names:
        kind, offset = rows.dtype.fields[name][:2]
        fields.append(PointField(name=name, offset=offset, datatype=PointField.FLOAT64, count=kind.itemsize // 8))
    cloud = PointCloud2(height=1, width=len(rows), fields=fields, point_step=rows.dtype.itemsize, is_dense=True)
    cloud.header.stamp, cloud.header.frame_id = to_time(stamp_ns), frame_id
    cloud.row_step = rows.nbytes
    cloud._data = _bytes_array(rows)
    return cloud


def _bytes_array(rows):
    import array

    data = array.array("B")
    data.frombytes(rows.tobytes())
    return data


def wrench(stamp_ns, frame_id, force):
    """WrenchStamped of a planar (f_x, f_y, torque)."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = to_time(stamp_ns), frame_id
    message.wrench.force.x, message.wrench.force.y, message.wrench.torque.z = (float(value) for value in force)
    return message


def pose(stamp_ns, frame_id, position):
    """PoseStamped of a planar (x, y, theta)."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = to_time(stamp_ns), frame_id
    message.pose.position.x, message.pose.position.y = float(position[0]), float(position[1])
    half = float(position[2]) / 2
    message.pose.orientation.z, message.pose.orientation.w = float(np.sin(half)), float(np.cos(half))
    return message


def diagnostics(stamp_ns, name, hardware_id, level, message, values):
    """DiagnosticArray with one status; level `ok`, `warn` or `error`; values {name: anything}."""
    entries = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    status = DiagnosticStatus(level=LEVELS[level], name=name, message=message, hardware_id=hardware_id, values=entries)
    array_message = DiagnosticArray(status=[status])
    array_message.header.stamp = to_time(stamp_ns)
    return array_message
