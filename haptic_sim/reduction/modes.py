# SPDX-License-Identifier: Apache-2.0
"""The step that a first-order method may take for the error allowed.

Backward difference gives a mode of angular frequency w the damping ratio w h / 2 that it does not have: after one
radian its amplitude is short by that share. With h = 2 error / w that is the error allowed. The mode is the tool on its
coupling at `STIFFNESS`, or a spring of the scene that is faster.
"""

import math

import numpy as np

from haptic_sim.reduction.model import PIN, Model

STIFFNESS = 2000.0
"""N/m; coupling that the choice reckons with. A stiffer one is as stable, but less exact."""


def longest_step(model: Model, error: float) -> tuple[float, str]:
    """Longest step [s] that keeps this error of the fastest mode, and that in words."""
    frequency, what = max(_modes(model))
    longest = 2.0 * error / frequency
    return longest, (
        f"error {error:g} of the fastest mode, {what} at {frequency:.4g} rad/s, allows {longest * 1e3:.4g} ms"
    )


def _modes(model):
    """(angular frequency, what) of the coupling and of the scene's own springs."""
    yield math.sqrt(STIFFNESS / model.mass[0]), f"the tool on a coupling of {STIFFNESS:g} N/m"
    for kind, bodies, anchors, spring in zip(
        model.joint_kind, model.joint_bodies, model.joint_anchor, model.joint_spring, strict=True
    ):
        if spring[0] > 0.0:
            yield math.sqrt(spring[0] * _mobility(model, kind, bodies, anchors)), "a spring of the scene"


def _mobility(model, kind, bodies, anchors):
    """1 / (inertia that the spring sees), each body taken as free."""
    inertia = model.inertia[bodies]
    if kind == PIN:
        return float(np.sum(1.0 / inertia))
    return float(np.sum(1.0 / model.mass[bodies] + np.sum(anchors**2, axis=1) / inertia))
