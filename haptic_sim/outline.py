# SPDX-License-Identifier: Apache-2.0
"""Planar outlines: convex polygons and discs, with area, mass centre and inertia at even density. SI units."""

import math
from typing import NamedTuple

Point = tuple[float, float]
HALF_PLANE = 20.0  # m, length of the piece of a half-plane that is modelled; half as deep
STRAIGHT = 1e-9  # turn [rad] below which three vertices lie on one line


class Outline(NamedTuple):
    """A convex polygon (vertices counter-clockwise [m]), or a disc: one vertex, its centre, and a `radius` [m]."""

    vertices: tuple[Point, ...]
    radius: float = 0.0


class Lamina(NamedTuple):
    """Area [m²], centroid [m], second moment of area about that centroid [m⁴]."""

    area: float
    centroid: Point
    second_moment: float


def convex(vertices) -> tuple[Point, ...]:
    """The same polygon, counter-clockwise; ValueError names what is wrong: too few, repeated, crossing or concave."""
    count = len(vertices)
    if count < 3:
        raise ValueError(f"a polygon needs at least 3 vertices, here are {count}")
    for i in range(count):
        if vertices[i] == vertices[(i + 1) % count]:
            raise ValueError(f"vertex {(i + 1) % count} repeats the one before it; remove it")
    turns = [_turn(vertices[i - 1], vertices[i], vertices[(i + 1) % count]) for i in range(count)]
    around = sum(turns)
    if abs(abs(around) - 2.0 * math.pi) > 1e-6 or max(map(abs, turns)) > math.pi - STRAIGHT:
        raise ValueError("the polygon crosses or folds onto itself; list its vertices in order around the outline")
    inward = [i for i, turn in enumerate(turns) if turn * around < 0.0 and abs(turn) > STRAIGHT]
    if inward:
        raise ValueError(f"the polygon is concave at vertex {inward[0]}; split it into convex shapes")
    return tuple(vertices) if around > 0.0 else tuple(reversed(vertices))


def rectangle(size: Point, center: Point, angle: float) -> tuple[Point, ...]:
    """Vertices of a rectangle of `size` (width, height) [m] about `center`, turned by `angle` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    corners = [(sx * size[0] / 2.0, sy * size[1] / 2.0) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return tuple((center[0] + c * x - s * y, center[1] + s * x + c * y) for x, y in corners)


def half_plane(point: Point, normal: Point) -> Outline:
    """A rectangle far larger than any device's workspace, one side centred on `point` with outward `normal`."""
    length = math.hypot(*normal)
    nx, ny = normal[0] / length, normal[1] / length
    depth, reach = HALF_PLANE / 2.0, HALF_PLANE / 2.0
    corners = ((-ny, nx, 0.0), (-ny, nx, depth), (ny, -nx, depth), (ny, -nx, 0.0))
    return Outline(
        tuple((point[0] + reach * tx - back * nx, point[1] + reach * ty - back * ny) for tx, ty, back in corners)
    )


def finest_feature(outline: Outline) -> float:
    """Shortest edge, or the radius of a disc [m]."""
    if outline.radius > 0.0:
        return outline.radius
    return min(math.dist(a, b) for a, b in _edges(outline.vertices))


def combined(outlines) -> Lamina:
    """Lamina of a compound of outlines; where they overlap, the overlap counts twice."""
    parts = [_lamina(outline) for outline in outlines]
    area = sum(part.area for part in parts)
    cx = sum(part.area * part.centroid[0] for part in parts) / area
    cy = sum(part.area * part.centroid[1] for part in parts) / area
    moment = sum(part.second_moment + part.area * math.dist(part.centroid, (cx, cy)) ** 2 for part in parts)
    return Lamina(area, (cx, cy), moment)


def _turn(before, at, after):
    ax, ay, bx, by = at[0] - before[0], at[1] - before[1], after[0] - at[0], after[1] - at[1]
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def _edges(vertices):
    return zip(vertices, vertices[1:] + vertices[:1], strict=True)


def _lamina(outline):
    if outline.radius > 0.0:
        area = math.pi * outline.radius**2
        return Lamina(area, outline.vertices[0], area * outline.radius**2 / 2.0)
    ox, oy = outline.vertices[0]  # about a vertex, so that small shapes far out keep their digits
    area = sx = sy = moment = 0.0
    for (ax, ay), (bx, by) in _edges(tuple((x - ox, y - oy) for x, y in outline.vertices)):
        cross = ax * by - ay * bx
        area += cross / 2.0
        sx += cross * (ax + bx) / 6.0
        sy += cross * (ay + by) / 6.0
        moment += cross * (ax * ax + ax * bx + bx * bx + ay * ay + ay * by + by * by) / 12.0
    cx, cy = sx / area, sy / area
    return Lamina(area, (ox + cx, oy + cy), moment - area * (cx * cx + cy * cy))
