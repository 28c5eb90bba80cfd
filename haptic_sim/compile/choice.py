# SPDX-License-Identifier: Apache-2.0
"""Which method and which sub-step serve a scene, and why.

The step of a first-order method. Backward difference gives a mode of angular frequency w the damping ratio w h / 2 that
it does not have: after one radian its amplitude is short by that share. With h = 2 error / w that is the error allowed.
The mode is the tool on its coupling at `STIFFNESS`, or a spring of the scene that is faster. Inside a sub-step
`impulse` takes steps of at most `SHORT`, so its sub-step is how often a port that stays passive acts; `partitioned`
takes the sub-step whole, and so one as short.
"""

import math

import numpy as np

from haptic_sim.compile.beyond import beyond
from haptic_sim.compile.limits import too_much
from haptic_sim.compile.model import PIN, Model

STIFFNESS = 2000.0
"""N/m; coupling that the choice reckons with. A stiffer one is as stable, but less exact."""
STEPS = (1e-3, 0.5e-3, 0.25e-3, 0.2e-3, 0.125e-3, 0.1e-3, 0.05e-3, 0.025e-3)
"""s; whole shares of a millisecond, so that an exchange at 1 kHz is a whole number of sub-steps."""
SHORT = 0.05e-3
"""s; longest step of `partitioned`, that of Chipmunk inside `impulse`: both err by what the step is long."""
SOLVED = 6e-6
"""s of step for each body: a direct solve costs some 2 us a body, and is to take a third of its step."""


def choose_method(scene, needs, model: Model, names) -> tuple[str, str]:
    """Name of the method and why; `names` of the model's bodies. ValueError if the scene asks for one that cannot."""
    if scene.method == "closed_form" and needs.axes is None:
        raise ValueError("method is 'closed_form', which needs a round tool without joints among half_planes, without "
                         "friction or restitution, that are parallel or square; take another method")
    if scene.method:
        return scene.method, "the scene asks for it"
    if needs.axes is not None:
        return "closed_form", f"contact acts on {_count(len(needs.axes), 'axis', 'axes')}, each solvable by itself"
    asked = beyond(scene, model, names)
    if not asked:
        return "impulse", "nothing in the scene asks for more than impulses by short steps"
    refusal = too_much(model)
    return ("impulse", f"{asked}; but {refusal}") if refusal else ("partitioned", asked)


def choose_sub_step(scene, model: Model, method: str) -> tuple[float, str]:
    """Sub-step [s] and why."""
    if scene.sub_step:
        return scene.sub_step, "the scene asks for it"
    frequency, what = max(_modes(model))
    longest = 2.0 * scene.error / frequency
    why = f"error {scene.error:g} of the fastest mode, {what} at {frequency:.4g} rad/s, allows {longest * 1e3:.4g} ms"
    bodies = len(model.mass) - 1
    if method == "partitioned" and longest > (own := max(SHORT, SOLVED * bodies)):
        longest = own
        why += f", {method} takes {own * 1e3:g} ms: " + (
            "steps as short as those inside impulse" if own == SHORT else
            f"what the direct solve of {bodies} bodies can keep up with")
    step = next((step for step in STEPS if step <= longest), STEPS[-1])
    return step, why + (", which would be too slow" if longest < step else "")


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
