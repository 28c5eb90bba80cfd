# SPDX-License-Identifier: Apache-2.0
"""Transforms on /tf and /tf_static, where tf2_msgs is installed; the only file that knows their fields."""

import math
from collections.abc import Iterable

from geometry_msgs.msg import TransformStamped

from haptic_device.nodes.messages import STATE, TRACE, to_time

try:  # the wheels of ROS 2 from the package index have no tf
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

Transform = tuple[str, str, tuple[float, float, float]]
"""Frame of the parent, frame of the child, and the child's pose (x, y, θ) [m, m, rad] in the parent's frame."""


class Transforms:
    """Publishes transforms; without tf2_msgs it does nothing. fixed: those that never change, told once."""

    def __init__(self, node, fixed: Iterable[Transform] = ()):
        self._node, self._publishers = node, []
        if TFMessage is None:
            return
        self._publishers = [node.create_publisher(TFMessage, "/tf", TRACE)]
        if fixed := tuple(fixed):
            self._publishers.append(node.create_publisher(TFMessage, "/tf_static", STATE))
            self._publishers[1].publish(_message(node.get_clock().now().nanoseconds, fixed))

    def publish(self, stamp_ns: int, transforms: Iterable[Transform]) -> None:
        """Tells these as they are at this stamp [ns]."""
        if self._publishers:
            self._publishers[0].publish(_message(stamp_ns, transforms))

    def close(self) -> None:
        """Ends the publishers."""
        for publisher in self._publishers:
            self._node.destroy_publisher(publisher)


def _message(stamp_ns, transforms):
    return TFMessage(transforms=[_stamped(to_time(stamp_ns), *one) for one in transforms])


def _stamped(stamp, parent, child, pose):
    found = TransformStamped(child_frame_id=child)
    found.header.stamp, found.header.frame_id = stamp, parent
    found.transform.translation.x, found.transform.translation.y = float(pose[0]), float(pose[1])
    found.transform.rotation.z, found.transform.rotation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    return found
