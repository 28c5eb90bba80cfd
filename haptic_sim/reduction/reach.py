# SPDX-License-Identifier: Apache-2.0
"""How far the bodies of a scene can ever get, as discs that hold them for sure, and so which of them can ever touch.

A pin to the world keeps a body within its farthest vertex of the pin; along a chain of pins the distances add up; a
slider adds its way between its limits. Loops only make it less. A body without such a chain can be anywhere.
"""

import heapq
import math
from typing import NamedTuple

from haptic_sim import scene_validation
from haptic_sim.geometry import Outline, distance, turned

_STILL = (0.0, 0.0, 0.0)


class Disc(NamedTuple):
    """What can be reached: everything within `radius` of `center` [m]."""

    center: tuple[float, float]
    radius: float


ANYWHERE = Disc((0.0, 0.0), math.inf)


def reaches(scene, immovable: set[str]) -> dict[str, Disc]:
    """Disc that holds all shapes of each movable body and of the tool for all time."""
    movable = {solid.name: solid for _, solid in scene_validation.solids(scene) if solid.name not in immovable}
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


def can_touch(apart: set[frozenset[str]], a, b, discs: dict[str, Disc]) -> bool:
    """Whether two bodies can ever touch: not `apart` (scene_validation), a layer in common, and within reach."""
    if not a.layers & b.layers or frozenset((a.name, b.name)) in apart:
        return False
    disc_a, disc_b = discs.get(a.name), discs.get(b.name)
    if disc_a is None or disc_b is None:
        moving, fixed = (disc_b, a) if disc_a is None else (disc_a, b)
        return moving is not None and _touches(moving, fixed)
    return math.dist(disc_a.center, disc_b.center) <= disc_a.radius + disc_b.radius


def _touches(disc, fixed):
    if math.isinf(disc.radius):
        return True
    around = Outline((disc.center,), disc.radius)
    return any(distance(around, _STILL, outline, fixed.pose) <= 0.0 for outline in fixed.outlines)


def _held_points(scene, movable):
    """(body, point on it at the start, disc it stays in), nearest first along the joints (Dijkstra)."""
    solids = {solid.name: solid for _, solid in scene_validation.solids(scene)}
    holding = [joint for joint in scene.joints if joint.type != "spring"]
    queue = [
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
        disc = Disc(center or place, far + _travel(joint))
        yield other, place, disc
        for k, after in enumerate(holding):
            if k != i and other in after.bodies and math.isfinite(disc.radius):
                onward = after.places(*(solids.get(name) for name in after.bodies))[1]
                heapq.heappush(queue, (disc.radius + math.dist(place, onward), len(done), k, other, disc.center))


def _travel(joint):
    if joint.type != "slider":
        return 0.0
    return max(map(abs, joint.limits)) if joint.limits else math.inf
