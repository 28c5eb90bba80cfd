# SPDX-License-Identifier: Apache-2.0
"""Degrees of freedom that pins and sliders leave."""

import math

import numpy as np

from haptic_sim.reduction.model import SLIDER, SPRING, Model


def freedoms(model: Model, pose) -> int:
    """Degrees of freedom of all bodies at `pose` (n, 3): three each, less the rank of what pins and sliders forbid."""
    rows = [row for j in range(len(model.joint_kind)) for row in _forbidden(model, pose, j)]
    rank = np.linalg.matrix_rank(np.array(rows), tol=1e-9) if rows else 0
    return 3 * (len(model.mass) - 1) - int(rank)


def _forbidden(model, pose, j):
    """Rows of the constraint Jacobian of joint j, over the velocities of all bodies but the world."""
    a, b = model.joint_bodies[j]
    if model.joint_kind[j] == SPRING:
        return
    directions = [(1.0, 0.0), (0.0, 1.0)]
    if model.joint_kind[j] == SLIDER:
        turn = pose[a][2]
        x, y = model.joint_axis[j]
        directions = [(-math.sin(turn) * x - math.cos(turn) * y, math.cos(turn) * x - math.sin(turn) * y)]
        yield _row(model, pose, ((a, (0.0, 0.0), -1.0), (b, (0.0, 0.0), 1.0)), (0.0, 0.0), 1.0)
    for direction in directions:
        ends = ((a, model.joint_anchor[j][0], -1.0), (b, model.joint_anchor[j][1], 1.0))
        yield _row(model, pose, ends, direction, 0.0)


def _row(model, pose, ends, direction, turning):
    row = np.zeros(3 * len(model.mass))
    for body, anchor, sign in ends:
        c, s = math.cos(pose[body][2]), math.sin(pose[body][2])
        arm = c * anchor[0] - s * anchor[1], s * anchor[0] + c * anchor[1]
        torque = arm[0] * direction[1] - arm[1] * direction[0] + turning
        row[3 * body : 3 * body + 3] += np.array([*direction, torque]) * sign
    return row[:-3]
