# SPDX-License-Identifier: Apache-2.0
"""What of a model follows from its bodies, shapes and joints: edge normals, discs around shapes, linkages."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from haptic_sim.reduction.connected import connected
from haptic_sim.reduction.model import SLIDER, SPRING, Model
from haptic_sim.reduction.seams import cover_edges
from haptic_sim.scene.geometry import normals, width


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
    model.joint_mobility[:] = [_mobility(model, j) for j in range(len(model.joint_kind))]
    cover_edges(model)
    _link(model)


def _shape(corners: np.ndarray, radius: float) -> tuple[Any, np.ndarray, float, float]:
    """Normals of the edges, centre and radius of the disc that holds a shape, and its least width."""
    if radius > 0.0:
        return 0.0, corners[0], radius, 2.0 * radius
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    return normals(corners), middle, np.hypot(*(corners - middle).T).max(), width(corners)


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
    for start, of in ((model.body_start, model.linkage[:world]), (model.joint_start, of_joints)):
        start[1 : len(groups) + 1] = np.cumsum(np.bincount(of, minlength=len(groups)))
    for i in range(len(groups)):
        joints = model.joint_order[slice(*model.joint_start[i : i + 2])]
        stiffness, damping = (model.joint_mobility[joints] @ model.joint_spring[joints, k] for k in (0, 1))
        model.rate[i] = max(damping, math.sqrt(stiffness))


def _mobility(model: Model, j: int) -> float:
    bodies = model.joint_bodies[j]
    mobility = 1.0 / model.inertia[bodies]
    if model.joint_kind[j] == SLIDER:  # whose bodies do not turn
        mobility = 1.0 / model.mass[bodies]
    elif model.joint_kind[j] == SPRING:
        mobility = 1.0 / model.mass[bodies] + np.sum(model.joint_anchor[j] ** 2, axis=1) / model.inertia[bodies]
    return float(np.sum(mobility))
