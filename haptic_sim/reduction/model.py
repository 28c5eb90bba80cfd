# SPDX-License-Identifier: Apache-2.0
"""The numbers of a scene: plain arrays, SI, for methods that calculate.

Body 0 is the tool; the last body is the world, to which everything fixed belongs. Bodies welded together are one body.
A body's frame has its origin in the mass centre, and the axes of the (first) body it was made of.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from haptic_sim.scene.geometry import Outline, Point, Pose, framed, turned
from haptic_sim.scene.joints import WORLD, AnyJoint, Slider
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import AnySolid

PIN, SLIDER, SPRING = range(3)
_KINDS = {"pin": PIN, "slider": SLIDER, "spring": SPRING}

MOST_BODIES, MOST_SHAPES, MOST_CORNERS, MOST_PAIRS, MOST_JOINTS = 40, 80, 400, 1000, 32
MOST_LINKED = 10
"""Bodies of one linkage. The compiled methods take no more, since their records have one size for all scenes."""


class Model(NamedTuple):
    """Arrays of n bodies, s shapes with v vertices, p pairs of shapes that can touch, j joints."""

    mass: np.ndarray
    """(n) kg; infinite for the world."""
    inertia: np.ndarray
    """(n) kg m² about the mass centre."""
    fixed: np.ndarray
    """(n) whether the body is the world."""
    pose: np.ndarray
    """(n, 3) mass centre and angle at the start [m, m, rad]."""
    velocity: np.ndarray
    """(n, 3) of the mass centre, and angular [m/s, m/s, rad/s]."""
    shape_body: np.ndarray
    """(s) body of each shape."""
    shape_start: np.ndarray
    """(s + 1) shape i has vertices[shape_start[i]:shape_start[i + 1]]."""
    vertices: np.ndarray
    """(v, 2) in the body's frame, counter-clockwise [m]; of a disc its centre."""
    radius: np.ndarray
    """(s) radius of a disc [m], 0 for a polygon."""
    pairs: np.ndarray
    """(p, 2) shapes that can touch; the body of the first comes before the body of the second."""
    pair_friction: np.ndarray
    """(p) Coulomb coefficient."""
    pair_restitution: np.ndarray
    """(p) coefficient of restitution."""
    pair_surface: np.ndarray
    """(p, 2) velocity in the plane [m/s] at which the surface of the second shape runs over its body: of a belt."""
    joint_kind: np.ndarray
    """(j) PIN, SLIDER or SPRING."""
    joint_bodies: np.ndarray
    """(j, 2) bodies a and b."""
    joint_anchor: np.ndarray
    """(j, 2, 2) anchor in the frame of a and of b [m]; pins' and sliders' coincide at the start."""
    joint_axis: np.ndarray
    """(j, 2) unit vector of a slider in the frame of a."""
    joint_angle: np.ndarray
    """(j) angle of b less angle of a at the start [rad]; a slider keeps it."""
    joint_limit: np.ndarray
    """(j, 2) least and largest joint coordinate, which is 0 at the start [rad | m]."""
    joint_friction: np.ndarray
    """(j) Coulomb friction against the joint coordinate [N m | N]."""
    joint_motor: np.ndarray
    """(j, 2) speed wished [rad/s | m/s] and largest torque or force [N m | N]; without a motor 0, 0.

    A motor of speed 0 is a brake: its strength is added to the joint's friction, and it stands as 0, 0 here.
    """
    joint_spring: np.ndarray
    """(j, 3) stiffness, damping, rest on the coordinate; a SPRING's is the anchors' distance, with rest 0 a vector."""
    gravity: np.ndarray
    """(2) m/s²."""


class Place(NamedTuple):
    """Where a named body of the scene is found: in the frame of which body, at which pose."""

    body: int
    pose: Pose


class ShapePair(NamedTuple):
    """Two shapes that can touch, by their place among the shapes of the groups, and their surface."""

    first: int
    second: int
    friction: float
    restitution: float
    surface: Point
    """Velocity in the plane [m/s] at which the second's surface runs over its body."""


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
    columns = [np.array(column, dtype=float) for column in zip(*bodies, strict=True)]
    mass, inertia, pose, velocity = columns
    arrays = Model(
        mass,
        inertia,
        np.isinf(mass),
        pose,
        velocity,
        np.array([places[name].body for name, _ in outlines], dtype=np.int64),
        np.cumsum([0, *map(len, vertices)]).astype(np.int64),
        np.array([vertex for corners in vertices for vertex in corners], dtype=float),
        np.array([outline.radius for _, outline in outlines], dtype=float),
        np.array([(pair.first, pair.second) for pair in pairs], dtype=np.int64).reshape(-1, 2),
        np.array([pair.friction for pair in pairs], dtype=float),
        np.array([pair.restitution for pair in pairs], dtype=float),
        np.array([pair.surface for pair in pairs], dtype=float).reshape(-1, 2),
        **_joints(scene, places, pose),
        gravity=np.array(scene.gravity, dtype=float),
    )
    return arrays, places, tuple(name for name, _ in outlines)


_WORLD_BODY: tuple[float, float, Pose, Pose] = (math.inf, math.inf, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _body(solids: Sequence[AnySolid]) -> tuple[float, float, Pose, Pose]:
    """Mass, inertia, pose and velocity of solids that move as one."""
    parts = [(solid, *solid.mass_properties) for solid in solids]
    mass = sum(part[1] for part in parts)
    centers = [turned(center, solid.pose) for solid, _, _, center in parts]
    x, y = (sum(part[1] * center[k] for part, center in zip(parts, centers, strict=True)) / mass for k in (0, 1))
    inertia = sum(
        own + m * math.dist(center, (x, y)) ** 2 for (_, m, own, _), center in zip(parts, centers, strict=True)
    )
    (px, py, angle), (vx, vy, turn) = solids[0].pose, solids[0].velocity
    return mass, inertia, (x, y, angle), (vx - turn * (y - py), vy + turn * (x - px), turn)


def _local(pose: Pose, frame: Pose) -> Pose:
    return *framed(pose[:2], frame), pose[2] - frame[2]


def _joints(scene: Scene, places: Mapping[str, Place], pose: np.ndarray) -> dict[str, np.ndarray]:
    kept = [
        joint
        for joint in scene.joints
        if joint.type in _KINDS and len({places[name].body for name in joint.bodies}) == 2
    ]
    rows = [_joint(joint, scene.solids, places, pose) for joint in kept]
    kinds = np.dtype(
        [
            ("kind", "i8"),
            ("bodies", "i8", 2),
            ("anchor", "f8", (2, 2)),
            ("axis", "f8", 2),
            ("angle", "f8"),
            ("limit", "f8", 2),
            ("friction", "f8"),
            ("motor", "f8", 2),
            ("spring", "f8", 3),
        ]
    )
    table = np.array(rows, dtype=kinds)
    return {f"joint_{name}": np.ascontiguousarray(table[name]) for name in kinds.fields or ()}


def _joint(
    joint: AnyJoint, solids: Mapping[str, AnySolid], places: Mapping[str, Place], pose: np.ndarray
) -> tuple[Any, ...]:
    bodies = tuple(places[name].body for name in joint.bodies)
    frames = [tuple(pose[body]) for body in bodies]
    on_a, on_b = joint.places(*(solids.get(name) for name in joint.bodies))
    if joint.holds:
        on_a = on_b
    motor, friction = joint.drive, joint.friction
    if motor[0] == 0.0:
        motor, friction = (0.0, 0.0), friction + motor[1]
    axis = framed(joint.unit_axis, (0.0, 0.0, frames[0][2])) if isinstance(joint, Slider) else (0.0, 0.0)
    return (
        _KINDS[joint.type],
        bodies,
        (framed(on_a, frames[0]), framed(on_b, frames[1])),
        axis,
        frames[1][2] - frames[0][2],
        joint.range,
        friction,
        motor,
        joint.spring(math.dist(on_a, on_b)),
    )


def mobilities(model: Model) -> Iterator[float]:
    """1/m that each joint's spring-damper sees [1/kg | 1/(kg m²)], each body taken as free."""
    for kind, bodies, anchors in zip(model.joint_kind, model.joint_bodies, model.joint_anchor, strict=True):
        mobility = 1.0 / model.inertia[bodies]
        if kind == SLIDER:  # whose bodies do not turn
            mobility = 1.0 / model.mass[bodies]
        elif kind != PIN:
            mobility = 1.0 / model.mass[bodies] + np.sum(anchors**2, axis=1) / model.inertia[bodies]
        yield float(np.sum(mobility))


def too_much(model: Model) -> str:
    """Sentence on what of a model is more than they take; "" if nothing is."""
    for what, many, most in (
        ("bodies", len(model.mass), MOST_BODIES),
        ("shapes", len(model.radius), MOST_SHAPES),
        ("corners", len(model.vertices), MOST_CORNERS),
        ("pairs of shapes that can touch", len(model.pairs), MOST_PAIRS),
        ("joints", len(model.joint_kind), MOST_JOINTS),
        ("bodies in one linkage", _linked(model), MOST_LINKED),
    ):
        if many > most:
            return f"the scene has {many} {what}; the compiled methods take at most {most}"
    return ""


def _linked(model: Model) -> int:
    """Bodies of the largest set that joints connect, the world left out."""
    sets = {b: {b} for b in range(len(model.mass)) if not model.fixed[b]}
    for a, b in model.joint_bodies.tolist():
        if a in sets and b in sets:
            sets[a] |= sets[b]
            sets |= dict.fromkeys(sets[a], sets[a])
    return max(map(len, sets.values()))
