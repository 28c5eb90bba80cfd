# SPDX-License-Identifier: Apache-2.0
"""Which method and which sub-step serve a scene, and why.

The step of a first-order method. Backward difference gives a mode of angular frequency w the damping ratio w h / 2 that
it does not have: after one radian its amplitude is short by that share. With h = 2 error / w that is the error allowed.
The mode is the tool on its coupling at `STIFFNESS`, or a spring of the scene that is faster.
"""

import math

import numpy as np

from haptic_sim.compile.model import PIN, Model

STIFFNESS = 2000.0
"""N/m; coupling that the choice reckons with. A stiffer one is as stable, but less exact."""
STEPS = (1e-3, 0.5e-3, 0.25e-3, 0.2e-3, 0.125e-3, 0.1e-3, 0.05e-3, 0.025e-3)
"""s; whole shares of a millisecond, so that an exchange at 1 kHz is a whole number of sub-steps."""


def choose_method(scene, needs) -> tuple[str, str]:
    """Name of the method and why. ValueError if the scene asks for one that cannot do it."""
    if scene.method == "closed_form" and needs.axes is None:
        raise ValueError("method is 'closed_form', which needs a round tool without joints among half_planes, without "
                         "friction or restitution, that are parallel or square; take another method")
    if scene.method:
        return scene.method, "the scene asks for it"
    if needs.axes is not None:
        return "closed_form", f"contact acts on {_count(len(needs.axes), 'axis', 'axes')}, each solvable by itself"
    if scene.joints:
        return "partitioned", "joints: coordinates that keep them exactly"
    if len(needs.moving) > 1:
        return "partitioned", "bodies push on each other: one direct solve for any mass ratio, impacts in their instant"
    return "partitioned", "one direct solve of coupling and contacts, none of which overlap"


def choose_sub_step(scene, model: Model, method: str) -> tuple[float, str]:
    """Sub-step [s] and why."""
    if scene.sub_step:
        return scene.sub_step, "the scene asks for it"
    frequency, what = max(_modes(model))
    longest = 2.0 * scene.error / frequency
    step = next((step for step in STEPS if step <= longest), STEPS[-1])
    return step, (f"error {scene.error:g} of the fastest mode, {what} at {frequency:.4g} rad/s, "
                  f"allows {longest * 1e3:.4g} ms" + (", which would be too slow" if longest < step else ""))


def _modes(model):
    """(angular frequency, what) of the coupling and of the scene's own springs."""
    yield math.sqrt(STIFFNESS / model.mass[0]), f"the tool on a coupling of {STIFFNESS:g} N/m"
    for kind, bodies, anchors, spring in zip(model.joint_kind, model.joint_bodies, model.joint_anchor,
                                             model.joint_spring, strict=True):
        if spring[0] > 0.0:
            yield math.sqrt(spring[0] * _mobility(model, kind, bodies, anchors)), "a spring of the scene"


def _mobility(model, kind, bodies, anchors):
    """1 / (inertia that the spring sees), each body taken as free."""
    inertia = model.inertia[bodies]
    if kind == PIN:
        return float(np.sum(1.0 / inertia))
    return float(np.sum(1.0 / model.mass[bodies] + np.sum(anchors**2, axis=1) / inertia))


def _count(number, one, many):
    return f"{number} {one if number == 1 else many}"
