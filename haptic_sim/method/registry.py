# SPDX-License-Identifier: Apache-2.0
"""Methods by name; only the one that is used is imported."""

import importlib

from haptic_sim.method import Method
from haptic_sim.scene import Scene

METHODS = {
    "impulse": "haptic_sim.world:World",
    "penalty_explicit": "haptic_sim.method.penalty_explicit:PenaltyExplicit",
    "penalty_implicit": "haptic_sim.method.penalty_implicit:PenaltyImplicit",
    "partitioned": "haptic_sim.method.partitioned:Partitioned",
    "event_driven": "haptic_sim.method.event_driven:EventDriven",
    "closed_form": "haptic_sim.method.closed_form:ClosedForm",
}


def make(name: str, scene: Scene, sub_step: float) -> Method:
    """The method called `name` on a scene, stepped by `sub_step` [s]. ValueError if there is none, or not for it."""
    if name not in METHODS:
        raise ValueError(f"method is {name!r}; it must be one of {', '.join(METHODS)}")
    module, kind = METHODS[name].split(":")
    return getattr(importlib.import_module(module), kind)(scene, sub_step)
