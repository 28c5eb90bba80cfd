# SPDX-License-Identifier: Apache-2.0
"""What of a scene does not fit together at the start, in sentences: names, materials, joints, gaps.

`solids` are the tool, which comes first, and the bodies.
"""

import math
from collections.abc import Iterable, Iterator, Sequence, Set

import numpy as np

from haptic_sim.scene.geometry import HALF_PLANE, framed, overlap, turned
from haptic_sim.scene.joints import WORLD, Joint, Spring, Weld
from haptic_sim.scene.shapes import TOOL, AnySolid, HalfPlane, Point

TOUCHING = 1e-9  # overlap [m] up to which two bodies count as touching: rounding of poses, far below any feature
TOGETHER = 1e-6  # m; anchors nearer than this count as met: a scene file rounds its poses
APART = 1e-6  # m/s; speed up to which the start may pull a joint apart: rounding of velocities
LARGEST = 1.0  # m; no hand leads a larger tool, and one of 1 mm or more is larger if it is written in mm
ALONG = HALF_PLANE / 2.0  # m; farthest from a half-plane's point, along it, that a body may start

Solids = Sequence[AnySolid]


def wrong_names(solids: Solids, materials: Iterable[str], measured: dict[str, str]) -> Iterator[str]:
    """Bodies without a name of their own; materials, and bodies `measured` by these keys, that are not there."""
    names = [solid.name for solid in solids]
    for k, name in enumerate(names[1:], 1):
        if name == WORLD or name in names[:k]:
            yield f"{_path(k)}.name is {name!r}, which is taken; give each body its own"
    for k, solid in enumerate(solids):
        if solid.material is not None and solid.material not in materials:
            yield f"{_path(k)}.material is {solid.material!r}; materials has {_listed(materials)}"
    for key, name in measured.items():
        if name not in names:
            yield f"measure.{key}.body is {name!r}; it must be one of {_listed(names)}"


def wrong_goals(goals: Iterable[str], measured: Iterable[str]) -> Iterator[str]:
    """Goals of a task that nothing measures."""
    for goal in goals:
        if goal not in measured:
            yield f"task.done.{goal} is the fraction of no measure; measure has {_listed(measured)}"


def wrong_joints(solids: Solids, joints: Iterable[Joint]) -> Iterator[str]:
    """Joints that are not between two bodies of which one can move, or that come apart."""
    there: dict[str, AnySolid | None] = {solid.name: solid for solid in solids} | {WORLD: None}
    for i, joint in enumerate(joints):
        path = f"joints[{i}]" + (f" ({joint.name!r})" if joint.name else "")
        strangers = [(end, name) for end, name in enumerate(joint.bodies) if name not in there]
        yield from (f"{path}.bodies[{end}] is {name!r}; it must be one of {_listed(there)}" for end, name in strangers)
        if not strangers:
            yield from _wrong_joint(path, joint, *(there[name] for name in joint.bodies))


def _wrong_joint(path: str, joint: Joint, a: AnySolid | None, b: AnySolid | None) -> Iterator[str]:
    if (a is None or a.fixed) and (b is None or b.fixed):
        yield f"{path} joins two bodies that cannot move, {_pair(joint)}; leave it out"
        return
    match joint:
        case _ if joint.locks and TOOL in joint.bodies:
            how = "welds" if isinstance(joint, Weld) else "with limits [0, 0] welds"
            yield f"{path} {how} {_pair(joint)}; give the tool those shapes instead"
        case Spring():
            if joint.rest != 0.0 and math.dist(*joint.places(a, b)) < TOGETHER:
                yield f"{path} has no length and so no direction; write rest: 0 or move an anchor"
        case _:
            yield from _apart(path, joint, a, b)


def _apart(path: str, joint: Joint, a: AnySolid | None, b: AnySolid | None) -> Iterator[str]:
    """Anchors that do not meet (a slider's on its axis), and velocities at the start that pull them apart."""
    on_a, on_b = joint.places(a, b)
    (vax, vay), (vbx, vby) = _speed(on_a, a), _speed(on_b, b)
    gap = joint.forbidden((on_b[0] - on_a[0], on_b[1] - on_a[1]))
    rate = (vbx - vax, vby - vay) if joint.locks else joint.forbidden((vbx - vax, vby - vay))
    if math.hypot(*gap) > TOGETHER:
        yield (
            f"{path} cannot be met: its anchors on {_pair(joint)} are {math.hypot(*gap) * 1e3:.4g} mm "
            f"apart at the start, by [{gap[0]:.6g}, {gap[1]:.6g}] m; move a body or an anchor"
        )
    turns = {0.0 if end is None else end.velocity[2] for end in (a, b)}
    if joint.keeps_angle and len(turns) > 1:
        yield f"{path} is twisted by the velocities of {_pair(joint)}; let both turn at the same rate"
    if math.hypot(*rate) > APART:
        yield (
            f"{path} is pulled apart at {math.hypot(*rate):.4g} m/s by the velocities of {_pair(joint)}; "
            "give them velocities that the joint allows"
        )


def _speed(place: Point, solid: AnySolid | None) -> Point:
    if solid is None:
        return 0.0, 0.0
    (x, y, _), (vx, vy, turn) = solid.pose, solid.velocity
    return vx - turn * (place[1] - y), vy + turn * (place[0] - x)


def overlaps(solids: Solids, apart: Set[frozenset[str]]) -> Iterator[str]:
    """Bodies that overlap, unless both are fixed, have no layer in common, or are kept `apart`."""
    for i, k in _near(solids):
        a, b = solids[i], solids[k]
        if frozenset((a.name, b.name)) in apart or a.fixed and b.fixed or not a.layers & b.layers:
            continue
        depth = overlap(a.outlines, a.pose, b.outlines, b.pose)
        if depth > TOUCHING:
            yield (
                f"{_path(k)} ({b.name!r}) overlaps {_path(i)} ({a.name!r}) by {depth * 1e3:.4g} mm at the start; "
                "move one of them away by at least that"
            )


def hand_inside(solids: Solids, apart: Set[frozenset[str]], start: Sequence[float]) -> Iterator[str]:
    """Bodies of a right scene that the tool is in where the hand starts: the driver would wait for a small force."""
    led = solids[0].model_copy(update={"pose": tuple(start)}), *solids[1:]
    for sentence in overlaps(led, apart) if len(start) == len(led[0].pose) else ():
        yield f"motion.start is {list(start)}, which leads the tool into a body: {sentence}"


def too_large(tool: AnySolid, scale: float) -> Iterator[str]:
    """Why the tool is none for a hand; scale: world metres per device metre."""
    low, high = _around(tool)
    if (across := max(high[0] - low[0], high[1] - low[1])) > LARGEST * scale:
        yield f"tool is {across:.4g} m across; the limit is {LARGEST * scale:g} m: write lengths in m, not in mm"


def beyond_half_planes(solids: Solids) -> Iterator[str]:
    """Bodies that start beside the piece of a half-plane that is modelled."""
    for i, wall in enumerate(solids):
        for shape in (shape for shape in wall.shapes if isinstance(shape, HalfPlane)):
            (px, py), (nx, ny) = shape.point, shape.normal
            for k, solid in enumerate(solids):
                x, y = framed(solid.pose[:2], wall.pose)
                along = abs((y - py) * nx - (x - px) * ny) / math.hypot(nx, ny)
                if along > ALONG and not solid.fixed and solid.layers & wall.layers:
                    yield (
                        f"{_path(k)} ({solid.name!r}) starts {along:.4g} m along the half_plane of {_path(i)} "
                        f"({wall.name!r}) from its point, {ALONG:g} m of it are modelled; move the point nearer"
                    )


def _near(solids: Solids) -> list[tuple[int, int]]:
    """Pairs (i, k), i < k, whose upright bounding boxes meet: a hundredth of all in a heap of hundreds."""
    low, high = np.array([_around(solid) for solid in solids]).swapaxes(0, 1)
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return [(i, k) for i, k in np.argwhere(np.triu(meet, 1)).tolist()]


def _around(solid: AnySolid) -> tuple[Point, Point]:
    """Lowest and highest x, y of a body at the start."""
    corners = [(*turned(at, solid.pose), outline.radius) for outline in solid.outlines for at in outline.vertices]
    (low_x, low_y), (high_x, high_y) = (
        [extreme(corner[k] + sign * corner[2] for corner in corners) for k in (0, 1)]
        for extreme, sign in ((min, -1.0), (max, 1.0))
    )
    return (low_x, low_y), (high_x, high_y)


def _path(k: int) -> str:
    return f"bodies[{k - 1}]" if k else TOOL


def _pair(joint: Joint) -> str:
    return f"{joint.bodies[0]!r} and {joint.bodies[1]!r}"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
