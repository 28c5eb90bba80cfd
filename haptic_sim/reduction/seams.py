# SPDX-License-Identifier: Apache-2.0
"""Which edges of a body's shapes are hidden at a seam: there two shapes of one body make one surface.

An edge is covered from one of its ends on if that corner lies on a neighbour's boundary, the edge goes on from it
inside the neighbour or along its boundary, and the corner's other edge, the surface, does not go inside. So of two
boxes side by side, flush or overlapping, the sides that meet are covered and the tops are not; of a box on a wider one
only its bottom is. What reaches the side where it is covered is deeper below the surface than the cover goes.

A neighbour takes over what its shape lets go only if it can touch all that the shape can touch.
"""

import math
from collections.abc import Iterator

import numpy as np

from haptic_sim.reduction.model import Model

MISFIT = 1e-6
"""m; by which shapes that are one surface may be apart or overlap."""
NEAR = 1e-4
"""m from the corner where an edge is looked at; of a short edge its quarter."""

Faces = tuple[np.ndarray, np.ndarray]
"""Corners of a polygon, and the normals of the edges that start there."""


def cover_edges(model: Model) -> None:
    """Writes of each corner how deep below the surface an edge is covered from it on, into `covered` and `straight`."""
    covered, normals = model.covered, model.normals
    for s, neighbours in _neighbours(model):
        first, end = model.shape_start[s], model.shape_start[s + 1]
        for v in range(first, end):
            after, before = v + 1 if v + 1 < end else first, v - 1 if v > first else end - 1
            corner, ahead, back = model.vertices[[v, after, before]]
            for n in neighbours:
                faces = _faces(model, n)
                for side, (to, along, surface) in enumerate(((ahead, back, before), (back, ahead, v))):
                    depth = _cover(faces, corner, to, along, normals[surface])
                    covered[v, side] = max(covered[v, side], depth)
                    if abs(_outside(faces, corner - _near(corner, along))) <= MISFIT:
                        model.straight[v] = max(model.straight[v], depth)


def _neighbours(model: Model) -> Iterator[tuple[int, list[int]]]:
    """Polygons, and the polygons of the same body beside them that can touch all that each of them can touch."""
    low, high = _bounds(model)
    met: dict[int, set[int]] = {}
    for a, b in model.pairs.tolist():
        met.setdefault(a, set()).add(b)
        met.setdefault(b, set()).add(a)
    for s, met_by_s in met.items():
        if model.radius[s] > 0.0:
            continue
        beside = (low <= high[s] + MISFIT).all(axis=1) & (high >= low[s] - MISFIT).all(axis=1)
        same = np.flatnonzero(beside & (model.shape_body == model.shape_body[s])).tolist()
        if near := [n for n in same if n != s and model.radius[n] == 0.0 and met_by_s <= met.get(n, set())]:
            yield s, near


def _bounds(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest coordinates of each shape in its body's frame [m]."""
    starts, radius = model.shape_start[:-1], model.radius[:, None]
    low, high = np.minimum.reduceat(model.vertices, starts), np.maximum.reduceat(model.vertices, starts)
    return low - radius, high + radius


def _cover(faces: Faces, corner: np.ndarray, to: np.ndarray, along: np.ndarray, normal: np.ndarray) -> float:
    """How deep below the surface, of this normal and `along`, the edge from a corner `to` another is covered [m]."""
    if abs(_outside(faces, corner)) > MISFIT or _outside(faces, corner + _near(corner, along)) < -MISFIT:
        return 0.0
    if _outside(faces, corner + _near(corner, to)) > MISFIT:
        return 0.0
    points, normals = faces
    rates = normals @ (to - corner)
    ways = (MISFIT - np.sum((corner - points) * normals, axis=1))[rates > 0.0] / rates[rates > 0.0]
    return float(min(1.0, ways.min(initial=1.0)) * ((corner - to) @ normal))


def _near(corner: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The first bit of the way from a corner to another."""
    length = math.dist(corner, other)
    return (other - corner) * (min(NEAR, 0.25 * length) / length)


def _faces(model: Model, s: int) -> Faces:
    first, end = model.shape_start[s], model.shape_start[s + 1]
    return model.vertices[first:end], model.normals[first:end]


def _outside(faces: Faces, point: np.ndarray) -> float:
    """How far a point is outside a polygon [m]; below zero inside."""
    points, normals = faces
    return float(np.max(np.sum((point - points) * normals, axis=1)))
