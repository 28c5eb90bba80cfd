# SPDX-License-Identifier: Apache-2.0
"""A scene and what happens in it as what is drawn, for pictures, films, the page and markers alike."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from haptic_sim.scene.geometry import Outline, Point, Pose, framed, rectangle, turned
from haptic_sim.scene.joints import WORLD, AnyJoint
from haptic_sim.scene.language import Scene
from haptic_sim.scene.motion import SECONDS, Place, seconds_of, way_of
from haptic_sim.scene.shapes import TOOL, AnySolid

MARGIN = 0.12  # share of the room left free on each side
WALL_LENGTH, WALL_DEPTH = 2.0, 0.05  # m of a half-plane that is shown
NOWHERE = (0.0, 0.0, 0.0)  # pose of what is given in the plane itself
BAND = Outline(rectangle((WALL_DEPTH, WALL_LENGTH), (-WALL_DEPTH / 2.0, 0.0), 0.0))


@dataclass(frozen=True)
class Solid:
    """A body or the tool: name, whether it is fixed, outlines in its own frame [m], pose at the start [m, m, rad]."""

    name: str
    fixed: bool
    outlines: tuple[Outline, ...]
    pose: Pose


@dataclass(frozen=True)
class Mark:
    """One end of a joint: its type, the solid it is on (empty: the world), the point in that solid's frame [m]."""

    type: str
    solid: str
    point: Point

    def place(self, poses: dict[str, Pose]) -> Point:
        """Where it is in the plane [m], the solids at these poses."""
        return turned(self.point, poses[self.solid]) if self.solid else self.point


@dataclass(frozen=True)
class Drawing:
    """solids: the tool first, then the bodies in the order of the scene; joints: both ends of each; room: left, bottom,
    right, top [m] of everything that ends somewhere and of the tool on the suggested way, with a margin. task: what
    people do, as the scene has it, but for its way; way: places [m, m, rad] that it suggests, led through in so many
    seconds. sprung: whether each joint has a spring."""

    name: str
    description: str
    solids: tuple[Solid, ...]
    joints: tuple[tuple[Mark, Mark], ...]
    room: tuple[float, float, float, float]
    results: tuple[str, ...]
    task: dict[str, Any] | None
    way: tuple[Place, ...]
    seconds: float
    sprung: tuple[bool, ...]


class Shape(NamedTuple):
    """One thing that is drawn. kind: solid (outlines), line or spring (points), arrow (force [N]), ring, dot, or the
    type of a joint that is held here. role: what a palette colours; number: which one of its role, tool and bodies
    counted together. Outlines and points [m] are in the frame of the pose [m, m, rad]."""

    kind: str
    role: str
    number: int
    pose: Pose
    outlines: tuple[Outline, ...] = ()
    points: tuple[Point, ...] = ()
    force: Point = (0.0, 0.0)


def drawing_of(scene: Scene) -> Drawing:
    """What is drawn of a scene."""
    there = {TOOL: scene.tool} | {body.name: body for body in scene.bodies}
    solids = tuple(Solid(one.name, one.fixed, one.outlines, one.pose) for one in there.values())
    joints = tuple(_marks(joint, there | {WORLD: None}) for joint in scene.joints)
    task = scene.task.model_dump(exclude={"way", "seconds"}) if scene.task else None
    way, seconds = _shown_way(scene)
    told, room = (scene.name, scene.description), _room(scene, way)
    sprung = tuple(joint.spring(0.0)[0] > 0.0 for joint in scene.joints)
    return Drawing(*told, solids, joints, room, tuple(scene.measure), task, way, seconds, sprung)


def standing(scene: Drawing, poses: Iterable[Pose | None]) -> Iterator[Shape]:
    """Solids and joints, the solids at these poses, in their order; None: not known, left out with its joints."""
    solids = [(number, *one) for number, one in enumerate(zip(scene.solids, poses, strict=True))]
    known = {"": NOWHERE} | {solid.name: pose for _, solid, pose in solids if pose}
    for number, solid, pose in solids:
        if pose:
            role = "fixed" if solid.fixed else "moving"
            yield Shape("solid", role if number else "tool", number, pose, solid.outlines)
    for number, ends in enumerate(scene.joints):
        if all(mark.solid in known for mark in ends):
            first, second = (mark.place(known) for mark in ends)
            yield Shape(ends[0].type, "joint", number, (*first, known[ends[0].solid][2]))
            if ends[0].type == "spring":
                kind = "spring" if scene.sprung[number] else "line"
                yield Shape(kind, "spring", number, NOWHERE, points=(first, second))


def surroundings(walls: Iterable[tuple[float, float, float]], workspace: Any = None) -> Iterator[Shape]:
    """The servo's walls, (normal x, normal y, offset [m]) each, and the device's workspace, (least, most) of x and y in
    the plane [m]; None: not known."""
    for number, (nx, ny, offset) in enumerate(walls):
        yield Shape("solid", "wall", number, (nx * offset, ny * offset, math.atan2(ny, nx)), (BAND,))
    if workspace:
        (left, right), (bottom, top) = workspace[0], workspace[1] if len(workspace) > 1 else (0.0, 0.0)
        corners = ((left, bottom), (right, bottom), (right, top), (left, top), (left, bottom))
        yield Shape("line", "workspace", 0, NOWHERE, points=corners)


def happenings(frame: dict[str, Any]) -> Iterator[Shape]:
    """The hand's target, coupling, contacts, force on the hand and handle; what is not known is left out, and a
    coupling that does not hold."""
    handle, tool, force = frame["handle"], frame["tool"], frame["felt"] or frame["force"]
    if frame["target"]:
        yield Shape("ring", "target", 0, tuple(frame["target"]))
    if handle and tool and frame["coupled"]:
        yield Shape("spring", "coupling", 0, NOWHERE, points=(tuple(handle[:2]), tuple(tool[:2])))
    for number, (_, _, x, y, _, _, fx, fy, *_) in enumerate(frame["contacts"]):
        yield Shape("arrow", "contact", number, (x, y, 0.0), force=(fx, fy))
    if handle and force:
        yield Shape("arrow", "force", 0, tuple(handle), force=(force[0], force[1]))
    if handle:
        yield Shape("dot", "handle", 0, tuple(handle))


def shapes_of(scene: Drawing | None, frame: dict[str, Any], walls: Any = (), workspace: Any = None) -> Iterator[Shape]:
    """All that is known of a frame (`tool`, `bodies` and what `happenings` takes)."""
    yield from surroundings(walls, workspace)
    if scene and frame["tool"]:
        yield from standing(scene, (frame["tool"], *frame["bodies"]))
    yield from happenings(frame)


def _shown_way(scene: Scene) -> tuple[tuple[Place, ...], float]:
    """The way and how long it takes [s]."""
    if scene.task and scene.task.way:
        return scene.task.way, scene.task.seconds
    try:
        return way_of(scene.motion, scene.tool.pose), seconds_of(scene.motion)
    except (TypeError, ValueError, OverflowError):  # what is wrong with a motion the hand says that gets it
        return (scene.tool.pose,), SECONDS


def corners(scene: Scene) -> list[Point]:
    """Of everything that ends somewhere, as it is at the start [m]; of a disc those of its box."""
    solids: tuple[AnySolid, ...] = (scene.tool, *scene.bodies)
    return [corner for solid in solids for corner in _corners(solid, solid.pose)]


def _corners(solid: AnySolid, pose: Pose) -> Iterator[Point]:
    for shape, outline in zip(solid.shapes, solid.outlines, strict=True):
        for x, y in (turned(vertex, pose) for vertex in outline.vertices) if shape.bounded else ():
            for sign in (1, -1):
                yield x + sign * outline.radius, y + sign * outline.radius


def _room(scene: Scene, way: tuple[Place, ...]) -> tuple[float, float, float, float]:
    led = [corner for place in dict.fromkeys(way) for corner in (place[:2], *_corners(scene.tool, place))]
    low, high = (tuple(map(pick, scene.tool.pose[:2], *led, *corners(scene))) for pick in (min, max))
    free = MARGIN * max(high[0] - low[0], high[1] - low[1], 0.01)
    return low[0] - free, low[1] - free, high[0] + free, high[1] + free


def _marks(joint: AnyJoint, there: dict[str, AnySolid | None]) -> tuple[Mark, Mark]:
    a, b = (there[name] for name in joint.bodies)
    ends = zip(joint.bodies, (a, b), joint.places(a, b), strict=True)
    first, second = (
        Mark(joint.type, name if solid else "", framed(place, solid.pose) if solid else place)
        for name, solid, place in ends
    )
    return first, second
