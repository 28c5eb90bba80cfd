# SPDX-License-Identifier: Apache-2.0
"""The scene and what happens in it as markers for RViz 2 and Foxglove: the same outlines and poses as on the page."""

import math
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from rclpy.node import Node

from haptic_device.message_fields import frame_id
from haptic_device.nodes.marker_messages import MarkerArray, markers
from haptic_device.nodes.messages import STREAM
from haptic_sim.scene.drawing import NOWHERE, Drawing, Shape, shapes_of
from haptic_sim.scene.geometry import Outline

LOOK_PERIOD = 0.5  # s between two looks whether somebody listens
THICKNESS = 0.01  # m, of bodies along z
NEWTON = 0.003  # m of arrow for each newton
SHAFT = 0.0012  # m
CIRCLE = 32  # corners of a disc
JOINT = 0.004  # m, diameter of a pin, side of the others
HANDLE_RADIUS = 0.004  # m
TARGET_RADIUS = 1.6 * HANDLE_RADIUS  # m
COLOURS = {
    "fixed": (0.55, 0.60, 0.65, 1.0),
    "moving": (0.34, 0.71, 0.91, 1.0),
    "tool": (0.90, 0.62, 0.0, 0.85),
    "handle": (0.0, 0.45, 0.70, 1.0),
    "coupling": (0.0, 0.62, 0.45, 1.0),
    "force": (0.84, 0.37, 0.0, 1.0),
    "contact": (0.64, 0.27, 0.50, 1.0),
    **dict.fromkeys(("joint", "spring", "target"), (0.09, 0.10, 0.11, 1.0)),
    "wall": (0.0, 0.45, 0.70, 0.25),
    "workspace": (0.34, 0.36, 0.40, 1.0),
}
GROUPS = dict.fromkeys(("tool", "moving", "fixed"), "bodies")
GROUPS |= {role: f"{role}s" for role in ("joint", "spring", "wall", "contact")}
Point = tuple[float, float, float]


class Marker(NamedTuple):
    """kind: triangles, arrow, line, sphere or cube; pose (x, y, θ) [m, m, rad] in the world; points in that pose's
    frame [m]; size: thickness of lines and arrows, diameter, or side [m]."""

    group: str
    number: int
    kind: str
    pose: tuple[float, float, float]
    points: tuple[Point, ...]
    colour: tuple[float, float, float, float]
    size: float = 1.0


class MarkerPublisher:
    """Publishes `markers` while somebody listens. rate: markers a second [Hz]."""

    def __init__(self, node: Node, rate: float):
        self._node, self._period = node, 1.0 / rate
        self._markers = node.create_publisher(MarkerArray, "markers", STREAM)
        self._due = self._look_due = 0.0
        self._heard = False

    def show(self, scene: Drawing | None, frame: dict[str, Any], walls: Any, workspace: Any, now: float) -> None:
        """A frame of the state, if it is time. scene: None while there is none; walls, workspace: as
        `surroundings` has them; now [s]."""
        if now >= self._look_due:
            self._look_due = now + LOOK_PERIOD
            self._heard = self._markers.get_subscription_count() > 0
        if now < self._due:
            return
        self._due = max(self._due + self._period, now)
        if not self._heard:
            return
        shapes = shapes_of(scene, frame, walls, workspace)
        wanted = [marker(shape) for shape in shapes if shape.kind != "arrow" or any(shape.force)]
        if wanted:
            self._markers.publish(markers(time.time_ns(), frame_id(self._node.get_namespace(), "map"), wanted))


def marker(shape: Shape) -> Marker:
    """What RViz shows of a shape."""
    return Marker(GROUPS.get(shape.role, shape.role), shape.number, *_form(shape))


def _form(shape: Shape) -> tuple[str, Point, tuple[Point, ...], tuple[float, float, float, float], float]:
    """kind, pose, points, colour and size of its marker."""
    colour = COLOURS[shape.role]
    if shape.kind == "solid":
        points = tuple(corner for outline in shape.outlines for corner in prism(outline))
        x, y, theta = shape.pose
        return "triangles", (x, y, theta), points, colour, 1.0
    if shape.kind == "arrow":
        (x, y), (fx, fy) = shape.pose[:2], shape.force
        return "arrow", NOWHERE, (_raised((x, y)), _raised((x + NEWTON * fx, y + NEWTON * fy))), colour, SHAFT
    if shape.kind == "ring":
        return "line", shape.pose, RING, colour, SHAFT / 2.0
    if shape.points:
        return "line", NOWHERE, tuple(map(_raised, shape.points)), colour, SHAFT
    ball = shape.kind in ("pin", "dot")
    return "sphere" if ball else "cube", shape.pose, (), colour, 2.0 * HANDLE_RADIUS if shape.kind == "dot" else JOINT


def prism(outline: Outline) -> list[Point]:
    """Triangles of an outline drawn out along z, from −THICKNESS/2 to THICKNESS/2: both faces and the rim."""
    corners = _corners(outline)
    top, bottom = ([(x, y, z) for x, y in corners] for z in (THICKNESS / 2.0, -THICKNESS / 2.0))
    faces = [point for i in range(1, len(corners) - 1) for point in (top[0], top[i], top[i + 1])]
    faces += [point for i in range(1, len(corners) - 1) for point in (bottom[0], bottom[i + 1], bottom[i])]
    for i, j in zip(range(len(corners)), [*range(1, len(corners)), 0], strict=True):
        faces += [bottom[i], bottom[j], top[j], bottom[i], top[j], top[i]]
    return faces


def _corners(outline: Outline) -> Sequence[tuple[float, float]]:
    if outline.radius == 0.0:
        return outline.vertices
    (x, y), r = outline.vertices[0], outline.radius
    angles = [2.0 * math.pi * i / CIRCLE for i in range(CIRCLE)]
    return [(x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles]


def _raised(place: tuple[float, float]) -> Point:
    return (place[0], place[1], THICKNESS)


RING = tuple(
    map(_raised, (*_corners(Outline(((0.0, 0.0),), TARGET_RADIUS)), (TARGET_RADIUS, 0.0), (1.6 * TARGET_RADIUS, 0.0)))
)
