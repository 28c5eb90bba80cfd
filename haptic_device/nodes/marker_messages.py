# SPDX-License-Identifier: Apache-2.0
"""Markers for RViz 2 and Foxglove; the only file that knows their fields."""

import math

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from haptic_device.nodes.messages import to_time

__all__ = ["MarkerArray", "markers"]

KINDS = {
    "triangles": Marker.TRIANGLE_LIST,
    "arrow": Marker.ARROW,
    "line": Marker.LINE_STRIP,
    "sphere": Marker.SPHERE,
    "cube": Marker.CUBE,
}
HEAD = 2.5  # an arrow's head is so many times as wide as its shaft, and twice that long
LIFETIME = 500_000_000  # ns after which a marker that is not said again disappears


def markers(stamp_ns, frame_id, wanted):
    """MarkerArray of (group, number, kind, pose (x, y, θ), points, colour (r, g, b, a), size) each, SI."""
    return MarkerArray(markers=[_marker(to_time(stamp_ns), frame_id, *one) for one in wanted])


def _marker(stamp, frame_id, group, number, kind, pose, points, colour, size):
    marker = Marker(ns=group, id=number, type=KINDS[kind], action=Marker.ADD)
    marker.header.stamp, marker.header.frame_id = stamp, frame_id
    marker.pose.position.x, marker.pose.position.y = float(pose[0]), float(pose[1])
    marker.pose.orientation.z, marker.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    marker.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in points]
    widths = (size, HEAD * size, 2.0 * HEAD * size) if kind == "arrow" else (size, size, size)
    marker.scale.x, marker.scale.y, marker.scale.z = widths
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
    marker.lifetime.nanosec = LIFETIME
    return marker
