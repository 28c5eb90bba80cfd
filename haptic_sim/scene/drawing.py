# SPDX-License-Identifier: Apache-2.0
"""A scene as what is drawn, for the picture, the page and markers alike: solids with outlines, joints with marks."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from haptic_sim.scene.geometry import Outline, Point, Pose, framed, turned
from haptic_sim.scene.joints import WORLD, AnyJoint
from haptic_sim.scene.language import Scene
from haptic_sim.scene.motion import SECONDS, Place, seconds_of, way_of
from haptic_sim.scene.shapes import TOOL, AnySolid

MARGIN = 0.12  # share of the room left free on each side


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
    seconds."""

    name: str
    description: str
    solids: tuple[Solid, ...]
    joints: tuple[tuple[Mark, Mark], ...]
    room: tuple[float, float, float, float]
    results: tuple[str, ...]
    task: dict[str, Any] | None
    way: tuple[Place, ...]
    seconds: float


def drawing_of(scene: Scene) -> Drawing:
    """What is drawn of a scene."""
    there = {TOOL: scene.tool} | {body.name: body for body in scene.bodies}
    solids = tuple(Solid(one.name, one.fixed, one.outlines, one.pose) for one in there.values())
    joints = tuple(_marks(joint, there | {WORLD: None}) for joint in scene.joints)
    task = scene.task.model_dump(exclude={"way", "seconds"}) if scene.task else None
    way, seconds = _shown_way(scene)
    room = _room(scene, way)
    return Drawing(scene.name, scene.description, solids, joints, room, tuple(scene.measure), task, way, seconds)


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
