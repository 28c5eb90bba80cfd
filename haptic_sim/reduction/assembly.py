# SPDX-License-Identifier: Apache-2.0
"""Makes the record of a scene, see `model`: bodies, shapes, pairs, joints, and what follows from them (`layout`)."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from haptic_sim.reduction.layout import lay_out
from haptic_sim.reduction.model import PIN, SLIDER, SPRING, Model, empty
from haptic_sim.scene.geometry import Lamina, Outline, Point, Pose, framed, merged, turned
from haptic_sim.scene.joints import WORLD, AnyJoint, Slider
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import AnySolid

_KINDS = {"pin": PIN, "slider": SLIDER, "spring": SPRING}
_BODY = "mass", "inertia", "pose", "velocity"
_PAIR = "pairs", "pair_friction", "pair_restitution", "pair_surface"
_JOINT = tuple(
    f"joint_{name}" for name in ("kind", "bodies", "anchor", "axis", "angle", "limit", "friction", "motor", "spring")
)


_Body = tuple[float, float, Pose, Pose]
ShapePair = tuple[tuple[int, int], float, float, Point]
"""Two shapes that can touch, by their place among the shapes of the groups, and what the record says of a pair."""


class Place(NamedTuple):
    """Where a named body of the scene is found: in the frame of which body, at which pose."""

    body: int
    pose: Pose

    def at(self, frame: Pose) -> Pose:
        """Its pose in the plane where the body's frame is at this one."""
        return *turned(self.pose[:2], frame), frame[2] + self.pose[2]


def shapes_of(scene: Scene, groups: Sequence[Sequence[str]]) -> list[tuple[int, str, Outline]]:
    """(group, body's name, outline in the body's frame) of all shapes, in the order of the groups."""
    solids = scene.solids
    return [
        (i, name, outline)
        for i, group in enumerate(groups)
        for name in group
        if name != WORLD
        for outline in solids[name].outlines
    ]


def build(
    scene: Scene, groups: Sequence[Sequence[str]], pairs: Sequence[ShapePair]
) -> tuple[Model, dict[str, Place], tuple[str, ...]]:
    """Arrays of a scene, the places of its bodies, and the body name of each shape.

    `groups` are the names that make one body each: the tool's first, the world's last.
    """
    solids = scene.solids
    bodies = [_body([solids[name] for name in group]) for group in groups[:-1]] + [_WORLD_BODY]
    places = {
        name: Place(i, _local(solids[name].pose, bodies[i][2])) if name != WORLD else Place(i, (0.0, 0.0, 0.0))
        for i, group in enumerate(groups)
        for name in group
    }
    outlines = [(name, outline) for _, name, outline in shapes_of(scene, groups)]
    vertices = [[turned(vertex, places[name].pose) for vertex in outline.vertices] for name, outline in outlines]
    joints = _joints(scene, places, bodies)
    model = empty(len(bodies), len(outlines), sum(map(len, vertices)), len(pairs), len(joints))
    for names, rows in ((_BODY, bodies), (_PAIR, pairs), (_JOINT, joints)):
        _fill(model, names, rows)
    model.fixed[-1], model.gravity[:] = True, scene.gravity
    model.shape_body[:] = [places[name].body for name, _ in outlines]
    model.shape_start[1:] = np.cumsum([*map(len, vertices)])
    model.vertices[:] = [vertex for corners in vertices for vertex in corners]
    model.radius[:] = [outline.radius for _, outline in outlines]
    lay_out(model)
    return model, places, tuple(name for name, _ in outlines)


def _fill(model: Model, names: Sequence[str], rows: Iterable[tuple[Any, ...]]) -> None:
    """Columns of these rows into the arrays of these names."""
    for name, column in zip(names, zip(*rows, strict=True), strict=False):
        getattr(model, name)[:] = column


_WORLD_BODY: _Body = (math.inf, math.inf, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _body(solids: Sequence[AnySolid]) -> _Body:
    """Mass, inertia, pose and velocity of solids that move as one."""
    parts = ((solid.mass_properties, solid.pose) for solid in solids)
    mass, (x, y), inertia = merged([Lamina(mass, turned(center, at), own) for (mass, own, center), at in parts])
    (px, py, angle), (vx, vy, turn) = solids[0].pose, solids[0].velocity
    return mass, inertia, (x, y, angle), (vx - turn * (y - py), vy + turn * (x - px), turn)


def _local(pose: Pose, frame: Pose) -> Pose:
    return *framed(pose[:2], frame), pose[2] - frame[2]


def _joints(scene: Scene, places: Mapping[str, Place], bodies: Sequence[_Body]) -> list[tuple[Any, ...]]:
    """A row of each joint that is left between two bodies of the model."""
    kept = [
        joint
        for joint in scene.joints
        if joint.type in _KINDS and len({places[name].body for name in joint.bodies}) == 2
    ]
    return [_joint(joint, scene.solids, places, [pose for _, _, pose, _ in bodies]) for joint in kept]


def _joint(
    joint: AnyJoint, solids: Mapping[str, AnySolid], places: Mapping[str, Place], poses: Sequence[Pose]
) -> tuple[Any, ...]:
    bodies = tuple(places[name].body for name in joint.bodies)
    frames = [poses[body] for body in bodies]
    on_a, on_b = joint.places(*(solids.get(name) for name in joint.bodies))
    if joint.holds:
        on_a = on_b
    motor, friction = joint.drive, joint.friction
    if motor[0] == 0.0:
        motor, friction = (0.0, 0.0), friction + motor[1]
    axis = framed(joint.unit_axis, (0.0, 0.0, frames[0][2])) if isinstance(joint, Slider) else (0.0, 0.0)
    anchors, angle = (framed(on_a, frames[0]), framed(on_b, frames[1])), frames[1][2] - frames[0][2]
    spring = joint.spring(math.dist(on_a, on_b))
    return _KINDS[joint.type], bodies, anchors, axis, angle, joint.range, friction, motor, spring
