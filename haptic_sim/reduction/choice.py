# SPDX-License-Identifier: Apache-2.0
"""Which method and which sub-step serve a scene, and why.

Inside a sub-step `impulse` takes steps of at most `SHORT`, so its sub-step is but how often a port that stays passive
acts; `partitioned` takes its sub-step whole, and so one as short.
"""

from haptic_sim.reduction.beyond import SHORT, beyond
from haptic_sim.reduction.limits import too_much
from haptic_sim.reduction.model import Model
from haptic_sim.reduction.modes import longest_step

STEPS = (1e-3, 0.5e-3, 0.25e-3, 0.2e-3, 0.125e-3, 0.1e-3, 0.05e-3, 0.025e-3)
"""s; whole shares of a millisecond, so that an exchange at 1 kHz is a whole number of sub-steps."""
ACTS = 0.2e-3
"""s; `impulse` has no shorter sub-step unless the error asks for less than the steps inside: ports cost as much."""
SOLVED = 6e-6
"""s of step for each body: a direct solve costs some 2 us a body, and is to take a third of its step."""


def choose_method(scene, needs, model: Model, names) -> tuple[str, str]:
    """Name of the method and why; `names` of the model's bodies. ValueError if the scene asks for one that cannot."""
    if scene.method == "closed_form" and needs.axes is None:
        raise ValueError(
            "method is 'closed_form', which needs a round tool without joints among half_planes, without "
            "friction or restitution, that are parallel or square; take another method"
        )
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
    longest, why = longest_step(model, scene.error)
    bodies = len(model.mass) - 1
    if method == "impulse" and SHORT <= longest < ACTS:
        longest = ACTS
        why += f", which {method} keeps by its steps inside {ACTS * 1e3:g} ms"
    if method == "partitioned" and longest > (own := max(SHORT, SOLVED * bodies)):
        longest = own
        why += f", {method} takes {own * 1e3:g} ms: " + (
            "steps as short as those inside impulse"
            if own == SHORT
            else f"what the direct solve of {bodies} bodies can keep up with"
        )
    step = next((step for step in STEPS if step <= longest), STEPS[-1])
    return step, why + (", which would be too slow" if longest < step else "")


def _count(number, one, many):
    return f"{number} {one if number == 1 else many}"
