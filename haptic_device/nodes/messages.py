# SPDX-License-Identifier: Apache-2.0
"""ROS messages and their QoS; names of our fields: message_fields.py, layouts of bytes: recording/layouts.py."""

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import String

from haptic_device.recording.status import Status, named_statuses

__all__ = ["DiagnosticArray", "JointState", "PointCloud2", "PoseStamped", "String", "WrenchStamped"]


def _newest(depth, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE):
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST, reliability=reliability, durability=durability)


LATEST, STREAM, TRACE = _newest(1), _newest(50), _newest(100, ReliabilityPolicy.RELIABLE)
STATE = _newest(10, ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
LEVELS = {"ok": DiagnosticStatus.OK, "warn": DiagnosticStatus.WARN, "error": DiagnosticStatus.ERROR}


def planar_target(message, names):
    """Positions of a JointState with exactly these names, in their order; None if names, sizes or numbers are wrong."""
    given = dict(zip(message.name, message.position, strict=False))
    if len(message.name) != len(message.position) or len(given) != len(message.name) or set(given) != set(names):
        return None
    target = [given[name] for name in names]
    return target if target and np.isfinite(target).all() else None


def to_time(stamp_ns):
    return Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)


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
