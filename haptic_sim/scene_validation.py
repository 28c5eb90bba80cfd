# SPDX-License-Identifier: Apache-2.0
"""Whether the parts of a scene fit together at the start: names, materials, joints, gaps; ValueError if they do not."""

import math

import numpy as np

from haptic_sim.geometry import overlap, turned
from haptic_sim.joint import TOGETHER, WORLD
from haptic_sim.solid import TOOL

TOUCHING = 1e-9  # overlap [m] up to which two bodies count as touching: rounding of poses, far below any feature
APART = 1e-6  # m/s; speed up to which the start may pull a joint apart: rounding of velocities


def check(scene) -> None:
    """Everything of this file, in the order in which a mistake is best understood."""
    _check_names(scene)
    _check_joints(scene)
    _check_overlaps(scene)


def kept_apart(scene) -> set[frozenset[str]]:
    """Pairs of bodies that do not touch since a joint that is not a spring holds them together."""
    return {frozenset(joint.bodies) for joint in scene.joints if joint.type != "spring" and not joint.collide}


def solids(scene):
    """(path in the file, tool or body), the tool first."""
    return [("tool", scene.tool), *((f"bodies[{i}]", body) for i, body in enumerate(scene.bodies))]


def _check_names(scene):
    names = [body.name for body in scene.bodies]
    for i, name in enumerate(names):
        if name in (TOOL, WORLD) or name in names[:i]:
            raise ValueError(f"bodies[{i}].name is {name!r}, which is taken; give each body its own")
    for path, solid in solids(scene):
        if solid.material is not None and solid.material not in scene.materials:
            raise ValueError(f"{path}.material is {solid.material!r}; materials has {_listed(scene.materials)}")
    for key, measure in scene.measure.items():
        if measure.body not in (TOOL, *names):
            raise ValueError(f"measure.{key}.body is {measure.body!r}; it must be one of {_listed((TOOL, *names))}")


def _check_joints(scene):
    there = {solid.name: solid for _, solid in solids(scene)} | {WORLD: None}
    for i, joint in enumerate(scene.joints):
        path = f"joints[{i}]" + (f" ({joint.name!r})" if joint.name else "")
        for end, name in enumerate(joint.bodies):
            if name not in there:
                raise ValueError(f"{path}.bodies[{end}] is {name!r}; it must be one of {_listed(there)}")
        ends = [there[name] for name in joint.bodies]
        if all(end is None or getattr(end, "fixed", False) for end in ends):
            raise ValueError(f"{path} joins two bodies that cannot move, {_pair(joint)}; leave it out")
        if joint.type == "weld" and TOOL in joint.bodies:
            raise ValueError(f"{path} welds {_pair(joint)}; give the tool those shapes instead")
        if joint.type != "spring":
            _check_together(path, joint, ends)
        elif joint.rest != 0.0 and math.dist(*joint.places(*ends)) < TOGETHER:
            raise ValueError(f"{path} has no length and so no direction; write rest: 0 or move an anchor")


def _check_together(path, joint, ends):
    """The anchors meet (a slider's on its axis), and the velocities at the start do not pull them apart."""
    (ax, ay), (bx, by) = joint.places(*ends)
    gap = bx - ax, by - ay
    (vax, vay), (vbx, vby) = (_speed(place, end) for place, end in zip(joint.places(*ends), ends, strict=True))
    rate = vbx - vax, vby - vay
    if joint.type == "slider":
        length = math.hypot(*joint.axis)
        across = -joint.axis[1] / length, joint.axis[0] / length
        gap, rate = (tuple((v[0] * across[0] + v[1] * across[1]) * n for n in across) for v in (gap, rate))
    if math.hypot(*gap) > TOGETHER:
        raise ValueError(
            f"{path} cannot be met: its anchors on {_pair(joint)} are {math.hypot(*gap) * 1e3:.4g} mm "
            f"apart at the start, by [{gap[0]:.6g}, {gap[1]:.6g}] m; move a body or an anchor"
        )
    turns = {0.0 if end is None else end.velocity[2] for end in ends}
    if joint.type != "pin" and len(turns) > 1:
        raise ValueError(f"{path} is twisted by the velocities of {_pair(joint)}; let both turn at the same rate")
    if math.hypot(*rate) > APART:
        raise ValueError(
            f"{path} is pulled apart at {math.hypot(*rate):.4g} m/s by the velocities of {_pair(joint)}; "
            "give them velocities that the joint allows"
        )


def _speed(place, solid):
    if solid is None:
        return 0.0, 0.0
    (x, y, _), (vx, vy, turn) = solid.pose, solid.velocity
    return vx - turn * (place[1] - y), vy + turn * (place[0] - x)


def _check_overlaps(scene):
    everything, apart = solids(scene), kept_apart(scene)
    for i, k in _near([solid for _, solid in everything]):
        (path, a), (other, b) = everything[i], everything[k]
        held = frozenset((a.name, b.name)) in apart or getattr(a, "fixed", False) and b.fixed
        if held or not a.layers & b.layers:
            continue
        depth = overlap(a.outlines, a.pose, b.outlines, b.pose)
        if depth > TOUCHING:
            raise ValueError(
                f"{other} ({b.name!r}) overlaps {path} ({a.name!r}) by {depth * 1e3:.4g} mm at the start; "
                "move one of them away by at least that"
            )


def _near(bodies):
    """Pairs (i, k), i < k, whose upright bounding boxes meet: a hundredth of all in a heap of hundreds."""
    low, high = (np.array(corner) for corner in zip(*map(_around, bodies), strict=True))
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return np.argwhere(np.triu(meet, 1)).tolist()


def _around(solid):
    """Lowest and highest x, y of a body at the start."""
    corners = [
        (*turned(vertex, solid.pose), outline.radius) for outline in solid.outlines for vertex in outline.vertices
    ]
    return tuple(
        tuple(extreme(p[k] + sign * p[2] for p in corners) for k in (0, 1))
        for extreme, sign in ((min, -1.0), (max, 1.0))
    )


def _pair(joint):
    return f"{joint.bodies[0]!r} and {joint.bodies[1]!r}"


def _listed(names):
    return ", ".join(names) or "none"
