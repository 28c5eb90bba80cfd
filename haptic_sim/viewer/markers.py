# SPDX-License-Identifier: Apache-2.0
"""The scene and what happens in it as markers for RViz 2 and Foxglove: the same outlines and poses as on the page."""

import math
import time
from typing import NamedTuple

from haptic_device.message_fields import frame_id
from haptic_device.nodes.marker_messages import MarkerArray, markers
from haptic_device.nodes.messages import STREAM
from haptic_sim.scene.drawing import Drawing
from haptic_sim.scene.geometry import Outline, rectangle

LOOK_PERIOD = 0.5  # s between two looks whether somebody listens
THICKNESS = 0.01  # m, of bodies along z
NEWTON = 0.003  # m of arrow for each newton
SHAFT = 0.0012  # m
CIRCLE = 32  # corners of a disc
JOINT = 0.004  # m, diameter of a pin, side of the others
HANDLE_RADIUS = 0.004  # m
TARGET_RADIUS = 1.6 * HANDLE_RADIUS  # m
WALL_LENGTH, WALL_DEPTH = 2.0, 0.05  # m of a half-plane that is shown
FIXED, MOVING, TOOL = (0.55, 0.60, 0.65, 1.0), (0.34, 0.71, 0.91, 1.0), (0.90, 0.62, 0.0, 0.85)
HANDLE, COUPLING, FORCE, CONTACT = (
    (0.0, 0.45, 0.70, 1.0),
    (0.0, 0.62, 0.45, 1.0),
    (0.84, 0.37, 0.0, 1.0),
    (0.64, 0.27, 0.50, 1.0),
)
DARK, WALL, EDGE = (0.09, 0.10, 0.11, 1.0), (0.0, 0.45, 0.70, 0.25), (0.34, 0.36, 0.40, 1.0)
NOWHERE = (0.0, 0.0, 0.0)  # pose of what is given in the world itself
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

    def __init__(self, node, rate: float):
        self._node, self._period = node, 1.0 / rate
        self._markers = node.create_publisher(MarkerArray, "markers", STREAM)
        self._due = self._look_due = 0.0
        self._heard = False

    def show(self, scene, frame: dict, walls, workspace, now: float) -> None:
        """A frame of the state, if it is time. scene: None while there is none; walls, workspace: as
        `surroundings` has them; now [s]."""
        if now >= self._look_due:
            self._look_due = now + LOOK_PERIOD
            self._heard = self._markers.get_subscription_count() > 0
        if now < self._due:
            return
        self._due = max(self._due + self._period, now)
        if self._heard and (wanted := self._wanted(scene, frame, walls, workspace)):
            self._markers.publish(markers(time.time_ns(), frame_id(self._node.get_namespace(), "map"), wanted))

    def _wanted(self, scene, frame, walls, workspace):
        there = (frame["tool"], frame["bodies"])
        solids = bodies(scene, *there) + joints(scene, *there) if scene and frame["tool"] else []
        return solids + surroundings(walls, workspace) + happenings(frame)


def bodies(scene: Drawing, tool, poses) -> list[Marker]:
    """Tool and bodies where they are now; poses: of the scene's bodies, in its order, None where one is not known."""
    found = []
    for number, (solid, pose) in enumerate(zip(scene.solids, (tool, *poses), strict=True)):
        if pose is None:
            continue
        colour = TOOL if number == 0 else FIXED if solid.fixed else MOVING
        triangles = tuple(corner for outline in solid.outlines for corner in prism(outline))
        found.append(Marker("bodies", number, "triangles", tuple(pose), triangles, colour))
    return found


def joints(scene: Drawing, tool, poses) -> list[Marker]:
    """Where each joint holds on to its first body: a ball for a pin, else a cube; a spring with a line to the other."""
    known = {"": NOWHERE} | {s.name: pose for s, pose in zip(scene.solids, (tool, *poses), strict=True) if pose}
    found = []
    for number, ends in enumerate(scene.joints):
        if any(mark.solid not in known for mark in ends):
            continue
        a, b = (mark.place(known) for mark in ends)
        kind = "sphere" if ends[0].type == "pin" else "cube"
        turn = known[ends[0].solid][2]
        found.append(Marker("joints", number, kind, (*a, turn), (), DARK, JOINT))
        if ends[0].type == "spring":
            found.append(Marker("springs", number, "line", NOWHERE, (_raised(a), _raised(b)), DARK, SHAFT))
    return found


def surroundings(walls, workspace) -> list[Marker]:
    """The servo's walls, (normal x, normal y, offset [m]) each, and the device's workspace, (least, most) of x and y in
    the world [m]; either may be empty: not known."""
    band = prism(Outline(rectangle((WALL_DEPTH, WALL_LENGTH), (-WALL_DEPTH / 2.0, 0.0), 0.0)))
    found = [
        Marker("walls", number, "triangles", (nx * offset, ny * offset, math.atan2(ny, nx)), tuple(band), WALL)
        for number, (nx, ny, offset) in enumerate(walls)
    ]
    if workspace:
        (left, right), (bottom, top) = workspace[0], workspace[1] if len(workspace) > 1 else (0.0, 0.0)
        corners = ((left, bottom), (right, bottom), (right, top), (left, top), (left, bottom))
        found.append(Marker("workspace", 0, "line", NOWHERE, tuple((*corner, 0.0) for corner in corners), EDGE, SHAFT))
    return found


def happenings(frame: dict) -> list[Marker]:
    """The hand's target, handle, coupling, force on the hand and contact forces; what is not known is left out,
    and a coupling that does not hold."""
    found, handle, tool = [], frame["handle"], frame["tool"]
    force = frame["felt"] or frame["force"]
    if frame["target"]:
        ring = (*_corners(Outline(((0.0, 0.0),), TARGET_RADIUS)), (TARGET_RADIUS, 0.0), (1.6 * TARGET_RADIUS, 0.0))
        found.append(Marker("target", 0, "line", tuple(frame["target"]), tuple(map(_raised, ring)), DARK, SHAFT / 2.0))
    if handle:
        found.append(Marker("handle", 0, "sphere", tuple(handle), (), HANDLE, 2.0 * HANDLE_RADIUS))
    if handle and tool and frame["coupled"]:
        ends = (_raised(handle), _raised(tool))
        found.append(Marker("coupling", 0, "line", NOWHERE, ends, COUPLING, SHAFT))
    if handle and force and math.hypot(*force[:2]) > 0.0:
        found.append(_arrow("force", 0, handle, force, FORCE))
    for number, (_, _, x, y, _, _, fx, fy, _) in enumerate(frame["contacts"]):
        if math.hypot(fx, fy) > 0.0:
            found.append(_arrow("contacts", number, (x, y), (fx, fy), CONTACT))
    return found


def prism(outline) -> list[Point]:
    """Triangles of an outline drawn out along z, from −THICKNESS/2 to THICKNESS/2: both faces and the rim."""
    corners = _corners(outline)
    top, bottom = ([(x, y, z) for x, y in corners] for z in (THICKNESS / 2.0, -THICKNESS / 2.0))
    faces = [point for i in range(1, len(corners) - 1) for point in (top[0], top[i], top[i + 1])]
    faces += [point for i in range(1, len(corners) - 1) for point in (bottom[0], bottom[i + 1], bottom[i])]
    for i, j in zip(range(len(corners)), [*range(1, len(corners)), 0], strict=True):
        faces += [bottom[i], bottom[j], top[j], bottom[i], top[j], top[i]]
    return faces


def _corners(outline):
    if outline.radius == 0.0:
        return outline.vertices
    (x, y), r = outline.vertices[0], outline.radius
    angles = [2.0 * math.pi * i / CIRCLE for i in range(CIRCLE)]
    return [(x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles]


def _raised(place):
    return (place[0], place[1], THICKNESS)


def _arrow(group, number, place, force, colour):
    x, y, z = _raised(place)
    ends = ((x, y, z), (x + NEWTON * force[0], y + NEWTON * force[1], z))
    return Marker(group, number, "arrow", NOWHERE, ends, colour, SHAFT)
