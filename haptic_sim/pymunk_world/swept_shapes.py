# SPDX-License-Identifier: Apache-2.0
"""What a sweep asks of pymunk's shapes that somebody has added to a scene's space: discs, widths, who meets whom."""

import functools
import math
from collections.abc import Iterator, Mapping, Sequence, Set

import numpy as np
import pymunk

from haptic_sim.scene.geometry import Point, Pose, edges

LEAST = 1e-4
"""m; width with which a thinner shape counts: a segment may have none."""

Disc = tuple[Point, float]
"""Place and radius [m]."""


def discs(shape: pymunk.Shape, centre: Point) -> list[Disc]:
    """Corners and middle of a shape as the discs that fit in, seen from this point of its body's frame."""
    corners, radius = [(x - centre[0], y - centre[1]) for x, y in _corners(shape)], shape.radius
    found = [(corner, radius) for corner in corners]
    if len(corners) > 1:
        middle = tuple(np.mean(corners, axis=0).tolist())
        found.append((middle, radius + (fits(corners, middle) if len(corners) > 2 else 0.0)))
    return found


def passed(shapes: Sequence[pymunk.Shape], here: Pose, there: Pose, extent: float) -> pymunk.BB:
    """Box about all places of a body's shapes between two poses; no point is farther than `extent` from its centre."""
    around = functools.reduce(pymunk.BB.merge, (shape.cache_bb() for shape in shapes))
    dx, dy, turn = there[0] - here[0], there[1] - here[1], extent * abs(there[2] - here[2])
    left, bottom = around.left + min(0.0, dx) - turn, around.bottom + min(0.0, dy) - turn
    return pymunk.BB(left, bottom, around.right + max(0.0, dx) + turn, around.top + max(0.0, dy) + turn)


def places(shape: pymunk.Shape, around: pymunk.BB) -> Iterator[Disc]:
    """Corners of a shape, or its middle, as discs in the plane, of those that touch a box."""
    for corner in map(shape.body.local_to_world, _corners(shape)):  # type: ignore[union-attr]  # those of a space have one
        if around.intersects(pymunk.BB.newForCircle(corner, shape.radius)):
            yield corner, shape.radius


def fits(corners: Sequence[Point], middle: Point) -> float:
    """Radius of the disc about `middle` that fits into a convex polygon [m]."""
    return min(_off(a, b, middle) for a, b in edges(corners))


def width(shape: pymunk.Shape) -> float:
    """Least width of a shape [m], its radius counted, and LEAST at least."""
    corners, across = _corners(shape), 0.0
    if len(corners) > 2:
        across = min(max(_off(a, b, corner) for corner in corners) for a, b in edges(corners))
    return max(LEAST, across + 2.0 * shape.radius)


def narrowest(widths: Mapping[pymunk.Shape, float]) -> dict[pymunk.ShapeFilter, float]:
    """The least of these widths [m] for each filter there is: of many shapes few differ in it."""
    found: dict[pymunk.ShapeFilter, float] = {}
    for shape, one in widths.items():
        found[shape.filter] = min(one, found.get(shape.filter, math.inf))
    return found


def least_met(body: pymunk.Body, narrow: Mapping[pymunk.ShapeFilter, float]) -> float:
    """The least of these widths [m] that a body's filters let it meet; inf if they let it meet none."""
    own = {shape.filter for shape in body.shapes}
    return min((one for given, one in narrow.items() if _accepted(own, given)), default=math.inf)


def can_meet(body: pymunk.Body, own: list[pymunk.Shape], other: pymunk.Shape, joints: Set[pymunk.Constraint]) -> bool:
    """Whether one of these shapes of a body collides with a shape, as the two are now; joints: all of the space.

    A body itself remembers joints that were taken out too.
    """
    if other.sensor or other.body is body:
        return False
    if any(not joint.collide_bodies and other.body in (joint.a, joint.b) for joint in body.constraints & joints):
        return False
    return _accepted({shape.filter for shape in own if not shape.sensor}, other.filter)


def _accepted(own: Set[pymunk.ShapeFilter], given: pymunk.ShapeFilter) -> bool:
    return any(not one.rejects_collision(given) for one in own)


def _corners(shape: pymunk.Shape) -> Sequence[Point]:
    if isinstance(shape, pymunk.Circle):
        return [shape.offset]
    return [shape.a, shape.b] if isinstance(shape, pymunk.Segment) else shape.get_vertices()


def _off(a: Point, b: Point, point: Point) -> float:
    """Distance of a point from the line through a and b."""
    (ax, ay), (bx, by) = a, b
    return abs((bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax)) / math.hypot(bx - ax, by - ay)
