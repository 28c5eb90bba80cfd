# SPDX-License-Identifier: Apache-2.0
"""A scene as what is drawn: solids with their outlines, joints with their marks, the room that all of it takes."""

from typing import NamedTuple

from haptic_sim.scene.geometry import Outline, turned
from haptic_sim.scene.joints import WORLD
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

HANDLE_RADIUS = 0.004  # m
MARGIN = 0.12  # share of the room left free on each side


class Solid(NamedTuple):
    """A body or the tool: name, whether it is fixed, outlines in its own frame [m], pose at the start [m, m, rad]."""

    name: str
    fixed: bool
    outlines: tuple[Outline, ...]
    pose: tuple[float, float, float]


class Mark(NamedTuple):
    """One end of a joint: its type, the solid it is on (empty: the world), the point in that solid's frame [m]."""

    type: str
    solid: str
    point: tuple[float, float]


def solids(scene: Scene) -> list[Solid]:
    """The tool first, then the bodies in the order of the scene."""
    found = [Solid(TOOL, False, scene.tool.outlines, scene.tool.pose)]
    return found + [Solid(body.name, body.fixed, body.outlines, body.pose) for body in scene.bodies]


def joints(scene: Scene) -> list[tuple[Mark, Mark]]:
    """Both ends of each joint, in the frames of the solids that they are on."""
    there = {body.name: body for body in scene.bodies} | {TOOL: scene.tool, WORLD: None}
    return [
        tuple(
            _mark(joint.type, name, place, there[name])
            for name, place in zip(joint.bodies, joint.places(*(there[n] for n in joint.bodies)), strict=True)
        )
        for joint in scene.joints
    ]


def room(scene: Scene) -> tuple[float, float, float, float]:
    """Left, bottom, right, top [m] of everything that ends somewhere and of the suggested motion, with a margin."""
    corners = [scene.tool.pose[:2], *(scene.motion[end][:2] for end in ("start", "target") if end in scene.motion)]
    corners += [
        corner
        for solid, body in zip(solids(scene), (scene.tool, *scene.bodies), strict=True)
        for outline, shape in zip(solid.outlines, body.shapes, strict=True)
        if shape.bounded
        for corner in _around(outline, solid.pose)
    ]
    low, high = (tuple(pick(corner[i] for corner in corners) for i in (0, 1)) for pick in (min, max))
    free = MARGIN * max(high[0] - low[0], high[1] - low[1], 0.01)
    return low[0] - free, low[1] - free, high[0] + free, high[1] + free


def scene_drawing(scene: Scene) -> dict:
    """The scene for the page, as plain lists."""
    return {
        "name": scene.name,
        "description": scene.description,
        "solids": [
            {
                "name": solid.name,
                "fixed": solid.fixed,
                "pose": solid.pose,
                "outlines": [outline._asdict() for outline in solid.outlines],
            }
            for solid in solids(scene)
        ],
        "joints": [[mark._asdict() for mark in ends] for ends in joints(scene)],
        "room": room(scene),
        "results": list(scene.measure),
    }


def _mark(kind, name, place, solid):
    if solid is None:
        return Mark(kind, "", tuple(place))
    x, y, theta = solid.pose
    return Mark(kind, name, turned((place[0] - x, place[1] - y), (0.0, 0.0, -theta)))


def _around(outline, pose):
    r = outline.radius
    return [
        (x + dx * r, y + dy * r)
        for x, y in (turned(vertex, pose) for vertex in outline.vertices)
        for dx, dy in ((1, 1), (-1, -1))
    ]
