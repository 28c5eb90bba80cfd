# SPDX-License-Identifier: Apache-2.0
"""Who can move: which bodies as one, which at all, how freely and how far, and so which shapes can ever touch.

A pin to the world keeps a body within its farthest vertex of the pin; along a chain of pins the distances add up; a
slider adds its way between its limits. Loops only make it less. A body without such a chain can be anywhere.
"""

import heapq
import math
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from itertools import combinations
from typing import NamedTuple

import numpy as np

from haptic_sim.reduction.assembly import ShapePair, shapes_of
from haptic_sim.reduction.connected import connected
from haptic_sim.reduction.model import PIN, SLIDER, Model
from haptic_sim.scene.geometry import Outline, Point, distance, turned
from haptic_sim.scene.joints import WORLD
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL, AnySolid

_STILL = (0.0, 0.0, 0.0)


class Disc(NamedTuple):
    """What can be reached: everything within `radius` of `center` [m]."""

    center: tuple[float, float]
    radius: float


ANYWHERE = Disc((0.0, 0.0), math.inf)


def groups_of(scene: Scene) -> list[list[str]]:
    """Names that make one body each: the tool, movable bodies in the scene's order, the world."""
    fixed = [(WORLD, body.name) for body in scene.bodies if body.fixed]
    groups = connected((*scene.solids, WORLD), fixed + [joint.bodies for joint in scene.joints if joint.locks])
    return sorted(groups, key=lambda group: WORLD in group)


def moving_bodies(scene: Scene, groups: Sequence[Sequence[str]]) -> set[str]:
    """Names that something can move: a force, a start velocity, or a touch or joint of one that moves.

    A belt moves only what is pressed upon it, and what presses is one of these.
    """
    movable = [solid for name, solid in scene.solids.items() if name not in groups[-1]]
    discs, apart = reaches(scene, groups[-1]), scene.kept_apart
    driven = {name for joint in scene.joints if joint.moves for name in joint.bodies} | {TOOL}
    pushed = {body.name for body in movable if any(scene.gravity) or any(body.velocity) or body.name in driven}
    links = [(group[0], name) for group in groups[:-1] for name in group]
    links += [joint.bodies for joint in scene.joints]
    links += [(a.name, b.name) for a, b in combinations(movable, 2) if can_touch(apart, a, b, discs)]
    hanging = connected((solid.name for solid in movable), links)
    return {name for group in hanging if not pushed.isdisjoint(group) for name in group}


class Touching(NamedTuple):
    """Shapes that can touch, the names of their bodies, and how many pairs of shapes of different bodies cannot."""

    pairs: list[ShapePair]
    names: tuple[tuple[str, str], ...]
    apart: int


def touching_pairs(scene: Scene, groups: Sequence[Sequence[str]]) -> Touching:
    """What can touch, the shapes taken in the order of the groups."""
    solids, shapes = scene.solids, shapes_of(scene, groups)
    discs, held = reaches(scene, groups[-1]), scene.kept_apart
    pairs, apart = [], 0
    names: dict[tuple[str, str], None] = {}
    for i, (group_a, name_a, _) in enumerate(shapes):
        for j, (group_b, name_b, _) in enumerate(shapes[i + 1 :], i + 1):
            if group_a == group_b:
                continue
            a, b = solids[name_a], solids[name_b]
            if can_touch(held, a, b, discs):
                pairs.append(_pair(scene, i, j, a, b))
                names[name_a, name_b] = None
            else:
                apart += 1
    return Touching(pairs, tuple(names), apart)


def _pair(scene: Scene, i: int, j: int, a: AnySolid, b: AnySolid) -> ShapePair:
    one, two = scene.material(a), scene.material(b)
    friction, restitution = math.sqrt(one.friction * two.friction), math.sqrt(one.restitution * two.restitution)
    return (i, j), friction, restitution, turned(b.surface_velocity, (0.0, 0.0, b.pose[2]))


def reaches(scene: Scene, immovable: Collection[str]) -> dict[str, Disc]:
    """Disc that holds all shapes of each movable body and of the tool for all time."""
    movable = {name: solid for name, solid in scene.solids.items() if name not in immovable}
    found = dict.fromkeys(movable, ANYWHERE)
    for name, place, disc in _held_points(scene, movable):
        size = max(
            math.dist(place, corner) + outline.radius
            for outline in movable[name].outlines
            for corner in (turned(vertex, movable[name].pose) for vertex in outline.vertices)
        )
        if disc.radius + size < found[name].radius:
            found[name] = Disc(disc.center, disc.radius + size)
    return found


def can_touch(apart: Set[frozenset[str]], a: AnySolid, b: AnySolid, discs: Mapping[str, Disc]) -> bool:
    """Whether two bodies can ever touch: not kept `apart` by a joint, a layer in common, and within reach."""
    if not a.layers & b.layers or frozenset((a.name, b.name)) in apart:
        return False
    disc_a, disc_b = discs.get(a.name), discs.get(b.name)
    if disc_a is None or disc_b is None:
        moving, fixed = (disc_b, a) if disc_a is None else (disc_a, b)
        return moving is not None and _touches(moving, fixed)
    return math.dist(disc_a.center, disc_b.center) <= disc_a.radius + disc_b.radius


def _touches(disc: Disc, fixed: AnySolid) -> bool:
    if math.isinf(disc.radius):
        return True
    around = Outline((disc.center,), disc.radius)
    return any(distance(around, _STILL, outline, fixed.pose) <= 0.0 for outline in fixed.outlines)


def _held_points(scene: Scene, movable: Mapping[str, AnySolid]) -> Iterator[tuple[str, Point, Disc]]:
    """(body, point on it at the start, disc it stays in), nearest first along the joints (Dijkstra)."""
    solids, holding = scene.solids, [joint for joint in scene.joints if joint.holds]
    queue: list[tuple[float, float, int, str, Point | None]] = [
        (0.0, 0.0, i, joint.bodies[end], None)
        for i, joint in enumerate(holding)
        for end in (0, 1)
        if joint.bodies[end] not in movable
    ]
    done = set()
    while queue:
        far, _, i, origin, center = heapq.heappop(queue)
        joint = holding[i]
        other = joint.bodies[1 - joint.bodies.index(origin)]
        if (i, origin) in done or other not in movable:
            continue
        done.add((i, origin))
        place = joint.places(*(solids.get(name) for name in joint.bodies))[1]
        disc = Disc(center or place, far + joint.reach)
        yield other, place, disc
        for k, after in enumerate(holding):
            if k != i and other in after.bodies and math.isfinite(disc.radius):
                onward = after.places(*(solids.get(name) for name in after.bodies))[1]
                heapq.heappush(queue, (disc.radius + math.dist(place, onward), len(done), k, other, disc.center))


def degrees_of_freedom(model: Model) -> int:
    """Degrees of freedom of all bodies at the start: three each, less the rank of what pins and sliders forbid."""
    rows = []
    for j, ends in enumerate(model.joint_bodies):
        for row in forbidden_rows(model, j):
            whole = np.zeros((len(model.mass), 3))
            whole[ends] = row
            rows.append(whole[:-1].ravel())
    rank = np.linalg.matrix_rank(np.array(rows), tol=1e-9) if rows else 0
    return 3 * (len(model.mass) - 1) - int(rank)


def forbidden_rows(model: Model, j: int) -> Iterator[np.ndarray]:
    """(2, 3) of each velocity that joint j forbids at the start: over those of its bodies a and b, in the plane."""
    a, b = model.joint_bodies[j]
    directions = [(1.0, 0.0), (0.0, 1.0)] if model.joint_kind[j] == PIN else []
    if model.joint_kind[j] == SLIDER:
        turn = model.pose[a][2]
        x, y = model.joint_axis[j]
        directions = [(-math.sin(turn) * x - math.cos(turn) * y, math.cos(turn) * x - math.sin(turn) * y)]
        yield np.array([(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)])
    (ax, ay), (bx, by) = (
        turned(model.joint_anchor[j][end], (0.0, 0.0, model.pose[k][2])) for end, k in ((0, a), (1, b))
    )
    for nx, ny in directions:
        yield np.array([(-nx, -ny, ay * nx - ax * ny), (nx, ny, bx * ny - by * nx)])
