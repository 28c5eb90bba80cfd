# SPDX-License-Identifier: Apache-2.0
"""Cases that have a reference: scenes as they are measured, each in the class that it is compared in."""

import math

from bench.reference.trial import turned_scene
from haptic_sim.lockstep.error_metrics import Case
from haptic_sim.lockstep.rollout import GAINS
from haptic_sim.protocol import Coupling
from haptic_sim.scene.language import load

LOOK, LONG_LOOK = 10_000_000, 50_000_000
"""ns between the looks at the bodies' places; the longer one where steps beyond 10 ms make sense."""
AHEAD = 1e-3 / math.pi  # s
JOINTED, SINGLE, RICH, FREE = "jointed", "single contact", "contact-rich", "no contact"
DOWN = (0.0, -9.81)
_AT_REST = {"motion": {"name": "hold"}}
_RELEASED = _AT_REST | {"gains": (0.0, 0.0, 0.0, 0.0), "look": LONG_LOOK}
_CASES = {
    "free_space": (FREE, 1.0, {"motion": {"duration": 1.0, "turns": 1.0}}),
    "pendulum": (JOINTED, 2.0, _AT_REST | {"look": LONG_LOOK}),
    "four_bar_free": (JOINTED, 2.0, _RELEASED | {"of": "four_bar", "gravity": DOWN}),
    "slider_free": (JOINTED, 0.5, _RELEASED | {"of": "slider", "throw": (0.3, 0.0, 0.0)}),
    "four_bar": (JOINTED, 1.0, {"motion": {"duration": 1.0, "turns": 1.0}}),
    "slider": (JOINTED, 1.0, {"motion": {"duration": 1.0}}),
    "wall": (SINGLE, 1.0, {"motion": {"duration": 1.0}}),
    "corner": (SINGLE, 1.0, {"motion": {"duration": 1.0}}),
    "incline": (SINGLE, 0.3, {"look": LONG_LOOK}),
    "zeno_ball": (SINGLE, 1.2, {"look": LONG_LOOK}),
    "collinear_1e3": (SINGLE, 0.2, {"look": LONG_LOOK}),
    "falling_rod": (SINGLE, 0.2, {"look": LONG_LOOK}),
    "push_block": (RICH, 1.0, {"motion": {"duration": 1.5}}),
    "stack": (RICH, 0.5, {"motion": {"duration": 0.8}}),
    "peg_in_hole": (RICH, 1.5, {"motion": {"duration": 2.0}}),
    "wrench_on_nut": (RICH, 0.8, {"motion": {"duration": 1.0}}),
    "hammer_nail": (RICH, 0.6, {"motion": {"duration": 2.0}}),
    "ratchet": (RICH, 1.0, {"motion": {"duration": 2.0}}),
}
NAMES = tuple(_CASES)


def case(name: str) -> Case:
    """The case called `name`. ValueError if there is none."""
    if name not in _CASES:
        raise ValueError(f"scene is {name!r}; those that have a reference are {', '.join(NAMES)}")
    kind, seconds, changes = _CASES[name]
    scene = load(changes.get("of", name))
    update = {
        "name": name,
        "motion": {**scene.motion, **changes.get("motion", {})},
        "gravity": changes.get("gravity", scene.gravity),
    }
    if "throw" in changes:
        update["bodies"] = tuple(body.model_copy(update={"velocity": changes["throw"]}) for body in scene.bodies)
        update["tool"] = scene.tool.model_copy(update={"velocity": changes["throw"]})
    # Bodies on their way have left a little earlier, so that no impact falls on the end of a step.
    scene = turned_scene(scene.model_copy(update=update), 0.0, 0.0 if "throw" in changes else AHEAD)
    moving = scene.motion["name"] != "hold"
    gains = Coupling(*changes.get("gains", GAINS))
    return Case(name, kind, seconds, scene, gains, moving, changes.get("look", LOOK))
