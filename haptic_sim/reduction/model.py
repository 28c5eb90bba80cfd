# SPDX-License-Identifier: Apache-2.0
"""The numbers of a scene: plain arrays, SI, for methods that calculate.

Body 0 is the tool; the last body is the world, to which everything fixed belongs. Bodies welded together are one body.
A body's frame has its origin in the mass centre, and the axes of the (first) body it was made of.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_sim.geometry import framed, turned
from haptic_sim.joint import WORLD
from haptic_sim.scene import Scene
from haptic_sim.solid import TOOL

PIN, SLIDER, SPRING = range(3)
_KINDS = {"pin": PIN, "slider": SLIDER, "spring": SPRING}
_UNLIMITED = (-math.inf, math.inf)

Planar = tuple[float, float, float]


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
    """(j, 2) speed wished [rad/s | m/s] and largest torque or force [N m | N]; without a motor 0, 0."""
    joint_spring: np.ndarray
    """(j, 3) stiffness, damping, rest on the coordinate; a SPRING's is the anchors' distance, with rest 0 a vector."""
    gravity: np.ndarray
    """(2) m/s²."""


class Place(NamedTuple):
    """Where a named body of the scene is found: in the frame of which body, at which pose."""

    body: int
    pose: Planar


def build(scene: Scene, groups: list[list[str]], pairs) -> tuple[Model, dict[str, Place], tuple[str, ...]]:
    """Arrays of a scene, the places of its bodies, and the body name of each shape.

    `groups` are the names that make one body each: the tool's first, the world's last. `pairs` are shapes (indices, in
    the order of the groups) with the materials' friction and restitution, and the velocity of the second's surface.
    """
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    bodies = [_body([solids[name] for name in group]) for group in groups[:-1]] + [_WORLD_BODY]
    places = {
        name: Place(i, _local(solids[name].pose, bodies[i][2])) if name != WORLD else Place(i, (0.0, 0.0, 0.0))
        for i, group in enumerate(groups)
        for name in group
    }
    outlines = [
        (name, outline) for group in groups for name in group if name != WORLD for outline in solids[name].outlines
    ]
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
        np.array([pair[:2] for pair in pairs], dtype=np.int64).reshape(-1, 2),
        np.array([pair[2] for pair in pairs], dtype=float),
        np.array([pair[3] for pair in pairs], dtype=float),
        np.array([pair[4] for pair in pairs], dtype=float).reshape(-1, 2),
        *_joints(scene, solids, places, pose),
        np.array(scene.gravity, dtype=float),
    )
    return arrays, places, tuple(name for name, _ in outlines)


_WORLD_BODY = (math.inf, math.inf, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _body(solids):
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


def _local(pose, frame):
    return *framed(pose[:2], frame), pose[2] - frame[2]


def _joints(scene, solids, places, pose):
    kept = [
        joint
        for joint in scene.joints
        if joint.type != "weld" and len({places[name].body for name in joint.bodies}) == 2
    ]
    rows = [_joint(joint, solids, places, pose) for joint in kept]
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
    return [np.ascontiguousarray(table[name]) for name in kinds.names]


def _joint(joint, solids, places, pose):
    bodies = tuple(places[name].body for name in joint.bodies)
    frames = [tuple(pose[body]) for body in bodies]
    on_a, on_b = joint.places(*(solids.get(name) for name in joint.bodies))
    spring = (joint.stiffness, joint.damping, joint.rest or 0.0)
    axis = (0.0, 0.0)
    if joint.type == "spring":
        spring = (joint.stiffness, joint.damping, math.dist(on_a, on_b) if joint.rest is None else joint.rest)
    else:
        on_a = on_b
    if joint.type == "slider":
        length = math.hypot(*joint.axis)
        axis = framed((joint.axis[0] / length, joint.axis[1] / length), (0.0, 0.0, frames[0][2]))
    return (
        _KINDS[joint.type],
        bodies,
        (framed(on_a, frames[0]), framed(on_b, frames[1])),
        axis,
        frames[1][2] - frames[0][2],
        joint.limits or _UNLIMITED,
        joint.friction,
        joint.drive,
        spring,
    )
