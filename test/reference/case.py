# SPDX-License-Identifier: Apache-2.0
"""What is measured: a scene, how its hand goes, how long, and how far its bodies have to come.

A hand that moves is known once a millisecond and goes straight in between, for every method alike, so that the answer
does not depend on who asks how often. One at rest lets a method step as far as it likes.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_sim.compile import compile_scene
from haptic_sim.method import Coupling
from haptic_sim.scene import Scene, load
from haptic_sim.solid import TOOL
from haptic_sim.trial import GAINS, hand, jump, turned_scene

LOOK, LONG_LOOK = 10_000_000, 50_000_000
"""ns between the looks at the bodies' places; the longer one where steps beyond 10 ms make sense."""
EXCHANGE = 1_000_000
"""ns between two samples of a hand that moves."""
STEPS = (50000, 25000, 10000, 5000, 2500, 1000, 500, 250, 100, 50, 25)
"""µs."""
AHEAD = 1e-3 / math.pi  # s
JOINTED, SINGLE, RICH, FREE = "jointed", "single contact", "contact-rich", "no contact"
DOWN = (0.0, -9.81)


class Case(NamedTuple):
    """A scene to be measured; `kind` is the class that it is compared in, `seconds` the simulated time."""

    name: str
    kind: str
    seconds: float
    scene: Scene
    gains: Coupling
    moving: bool
    """Whether the hand moves."""
    look: int
    """ns between the looks."""
    jumps: float | None = None
    """s; when the hand goes from its motion's start to its target at once, and at rest otherwise."""

    @property
    def period(self) -> int:
        """ns from one sample of the hand to the next."""
        return EXCHANGE if self.moving else self.look

    @property
    def steps(self) -> tuple[int, ...]:
        """Steps to be tried [µs]."""
        return tuple(step for step in STEPS if 1000 * step <= self.period)

    def path(self) -> np.ndarray:
        """Positions and velocities (n + 1, 6) of the handle at its samples."""
        lead = hand(self.scene) if self.jumps is None else jump(self.scene, 0.0, self.jumps)
        places = np.array([lead(k * self.period * 1e-9) for k in range(round(self.seconds * 1e9) // self.period + 1)])
        smooth = self.moving and self.jumps is None
        rates = np.gradient(places, self.period * 1e-9, axis=0) if smooth else np.zeros_like(places)
        return np.hstack([places, rates])

    def bodies(self) -> dict[str, float]:
        """Bodies that are looked at → radius of gyration [m], by which a turn counts as a way.

        All that can move, but not a tool that hangs idle beside them.
        """
        solids = {body.name: body for body in self.scene.bodies} | {TOOL: self.scene.tool}
        moving = compile_scene(self.scene).needs.moving
        idle = not self.moving and not any(TOOL in joint.bodies for joint in self.scene.joints)
        return {name: math.sqrt(solids[name].mass_properties[1] / solids[name].mass_properties[0])
                for name in moving if not (idle and name == TOOL)}


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
    update = {"name": name, "motion": {**scene.motion, **changes.get("motion", {})},
              "gravity": changes.get("gravity", scene.gravity)}
    if "throw" in changes:
        update["bodies"] = tuple(body.model_copy(update={"velocity": changes["throw"]}) for body in scene.bodies)
        update["tool"] = scene.tool.model_copy(update={"velocity": changes["throw"]})
    # Bodies on their way have left a little earlier, so that no impact falls on the end of a step.
    scene = turned_scene(scene.model_copy(update=update), 0.0, 0.0 if "throw" in changes else AHEAD)
    moving = scene.motion["name"] != "hold"
    return Case(name, kind, seconds, scene, Coupling(*changes.get("gains", GAINS)), moving, changes.get("look", LOOK))
