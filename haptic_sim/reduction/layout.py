# SPDX-License-Identifier: Apache-2.0
"""What of a model follows from its bodies, shapes and joints: edge normals, discs around shapes, linkages."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from haptic_sim.reduction.connected import connected
from haptic_sim.reduction.model import Model, mobilities
from haptic_sim.reduction.seams import cover_edges


def lay_out(model: Model) -> None:
    """Fills in the arrays of a model that follow from the others."""
    model.extent[:] = 1e-3
    for s, (first, end) in enumerate(pairwise(model.shape_start)):
        found = _shape(model.vertices[first:end], model.radius[s])
        model.normals[first:end], model.middle[s], model.reach[s], model.thickness[s] = found
        b = model.shape_body[s]
        model.extent[b] = max(model.extent[b], math.hypot(*model.middle[s]) + model.reach[s])
    model.disc[:] = np.repeat(model.radius, np.diff(model.shape_start))
    model.pair_bodies[:] = model.shape_body[model.pairs]
    cover_edges(model)
    _link(model)


def _shape(corners: np.ndarray, radius: float) -> tuple[Any, np.ndarray, float, float]:
    """Normals of the edges, centre and radius of the disc that holds a shape, and its least width."""
    if radius > 0.0:
        return 0.0, corners[0], radius, 2.0 * radius
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / np.hypot(edges[:, 0], edges[:, 1])[:, None]
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    width = min(np.ptp(corners @ normal) for normal in normals)
    return normals, middle, np.hypot(*(corners - middle).T).max(), width


def _link(model: Model) -> None:
    """Bodies and joints in the order of the linkages, and the rate of each."""
    world = len(model.mass) - 1
    groups = connected(range(world), model.joint_bodies.tolist())
    model.record["linkages"] = len(groups)
    model.linkage[world] = model.place_in[world] = -1
    for i, group in enumerate(groups):
        model.linkage[group], model.place_in[group] = i, range(len(group))
    of_joints = model.linkage[model.joint_bodies].max(axis=1)
    model.order[:], model.joint_order[:] = (np.argsort(of, kind="stable") for of in (model.linkage[:world], of_joints))
    moved = np.array(list(mobilities(model)))
    for start, of in ((model.body_start, model.linkage[:world]), (model.joint_start, of_joints)):
        start[1 : len(groups) + 1] = np.cumsum(np.bincount(of, minlength=len(groups)))
    for i in range(len(groups)):
        model.rate[i] = _rate(model, moved, model.joint_order[slice(*model.joint_start[i : i + 2])])


def _rate(model: Model, mobility: np.ndarray, joints: np.ndarray) -> float:
    """max(Σ c/m, √(Σ k/m)) over the spring-dampers of these joints, 1/m what each of them moves."""
    stiffness, damping = (mobility[joints] @ model.joint_spring[joints, k] for k in (0, 1))
    return max(damping, math.sqrt(stiffness))
