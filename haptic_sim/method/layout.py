# SPDX-License-Identifier: Apache-2.0
"""What the compiled methods add to a model once: edge normals, discs around shapes, bodies sorted into linkages."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from haptic_sim.method.seams import covered_edges
from haptic_sim.reduction.model import Model, mobilities


class Layout(NamedTuple):
    """Constant arrays beside a `Model`; a linkage is a set of bodies that joints, springs too, connect."""

    normals: np.ndarray
    """(v, 2) outward unit normal of the edge that starts at each vertex, body's frame."""
    covered: np.ndarray
    """(v, 2) how deep below the surface the edge that starts at a vertex, and that which ends there, is covered [m]."""
    straight: np.ndarray
    """(v) the larger of both, if there the surface goes straight on [m]; see `seams`."""
    disc: np.ndarray
    """(v) radius of the disc about a vertex [m], 0 for a polygon's corner."""
    middle: np.ndarray
    """(s, 2) centre of a disc that holds the shape, body's frame [m]."""
    reach: np.ndarray
    """(s) radius of that disc [m]."""
    thickness: np.ndarray
    """(s) least width of the shape [m]."""
    pair_bodies: np.ndarray
    """(p, 2) bodies of each pair of shapes."""
    linkage: np.ndarray
    """(n) linkage of each body; -1 for the world."""
    place_in: np.ndarray
    """(n) place of a body within its linkage; -1 for the world."""
    body_start: np.ndarray
    """(l + 1) linkage i has order[body_start[i]:body_start[i + 1]]."""
    order: np.ndarray
    """(n - 1) bodies in the order of their linkages."""
    joint_start: np.ndarray
    """(l + 1) and joint_order[joint_start[i]:joint_start[i + 1]]."""
    joint_order: np.ndarray
    """Joints in the order of their linkages."""
    extent: np.ndarray
    """(n) farthest point of the body from its mass centre [m]."""
    rate: np.ndarray
    """(l) rate [1/s] at which a linkage's own spring-dampers act at most, each body taken as free."""


def lay_out(model: Model) -> Layout:
    """The layout of a model."""
    shapes = [_shape(model, s) for s in range(len(model.radius))]
    normals = [normal for shape in shapes for normal in shape[0]]
    order, body_start, joint_order, joint_start, linkage, place_in = _linkages(model)
    extent = np.full(len(model.mass), 1e-3)
    for s, (_, middle, reach, _) in enumerate(shapes):
        b = model.shape_body[s]
        extent[b] = max(extent[b], math.hypot(*middle) + reach)
    return Layout(
        np.array(normals, dtype=float).reshape(-1, 2),
        *covered_edges(model, np.array(normals, dtype=float).reshape(-1, 2)),
        np.repeat(model.radius, np.diff(model.shape_start)),
        np.array([shape[1] for shape in shapes]).reshape(-1, 2),
        np.array([shape[2] for shape in shapes]),
        np.array([shape[3] for shape in shapes]),
        model.shape_body[model.pairs].reshape(-1, 2),
        linkage,
        place_in,
        body_start,
        order,
        joint_start,
        joint_order,
        extent,
        np.array([_rate(model, joint_order[first:end]) for first, end in pairwise(joint_start)]),
    )


def _shape(model, s):
    corners = model.vertices[model.shape_start[s] : model.shape_start[s + 1]]
    if model.radius[s] > 0.0:
        return [(0.0, 0.0)], corners[0], model.radius[s], 2.0 * model.radius[s]
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / np.hypot(edges[:, 0], edges[:, 1])[:, None]
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    width = min(np.ptp(corners @ normal) for normal in normals)
    return list(normals), middle, np.hypot(*(corners - middle).T).max(), width


def _rate(model, joints):
    """max(Σ c/m, √(Σ k/m)) over the spring-dampers of these joints, 1/m what each of them moves."""
    moved = np.array(list(mobilities(model)))[joints]
    stiffness, damping = moved @ model.joint_spring[joints, 0], moved @ model.joint_spring[joints, 1]
    return max(damping, math.sqrt(stiffness))


def _linkages(model):
    count = len(model.mass) - 1
    root = list(range(count))

    def find(b):
        while root[b] != b:
            b = root[b]
        return b

    held = range(len(model.joint_kind))
    for j in held:
        a, b = model.joint_bodies[j]
        if not (model.fixed[a] or model.fixed[b]):
            root[find(max(a, b))] = find(min(a, b))
    heads = sorted({find(b) for b in range(count)})
    groups = [[b for b in range(count) if find(b) == head] for head in heads]
    of = {b: i for i, group in enumerate(groups) for b in group}
    held_by = [[j for j in held if i in (of.get(b) for b in model.joint_bodies[j])] for i in range(len(groups))]
    linkage = np.array([of[b] for b in range(count)] + [-1], dtype=np.int64)
    place = np.array([groups[of[b]].index(b) for b in range(count)] + [-1], dtype=np.int64)
    return (*_rows(groups), *_rows(held_by), linkage, place)


def _rows(groups):
    flat = np.array([item for group in groups for item in group], dtype=np.int64)
    return flat, np.cumsum([0, *map(len, groups)]).astype(np.int64)
