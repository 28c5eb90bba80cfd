# SPDX-License-Identifier: Apache-2.0
"""Simulation methods by name: a line here is all that a new one needs. Only the one that is used is imported.

A method is a class behind `haptic_sim.protocol.World`, made of a reduced scene and a sub-step [s]; it raises ValueError
for a scene that it cannot model. The parameter `method`, the scene language, the measurements and the page read this.
"""

import importlib
from typing import Any, NamedTuple


class Entry(NamedTuple):
    """What is known about a method before it is imported.

    Attributes:
        where: its class, as `module:name`.
        kernels: entries of haptic_display/run/kernels.py that it needs.
        offered: whether scenes may ask for it.

    Examples:
        >>> from haptic_sim.method_registry import METHODS
        >>> METHODS["impulse"].where
        'haptic_sim.pymunk_world.world:PymunkWorld'
    """

    where: str
    kernels: tuple[str, ...] = ()
    offered: bool = True


METHODS = {
    "impulse": Entry("haptic_sim.pymunk_world.world:PymunkWorld"),
    "penalty_explicit": Entry("haptic_sim.method.penalty_explicit:PenaltyExplicit", ("methods", "methods of penalty")),
    "penalty_implicit": Entry("haptic_sim.method.penalty_implicit:PenaltyImplicit", ("methods", "methods of penalty")),
    "partitioned": Entry("haptic_sim.method.partitioned:Partitioned", ("methods",)),
    "event_driven": Entry("haptic_sim.method.event_driven:EventDriven", ("methods",), offered=False),
    "closed_form": Entry("haptic_sim.method.closed_form:ClosedForm"),
}
AUTO = "auto"
"""In place of a method's name: as the scene asks, or as fits it."""


def offered() -> tuple[str, ...]:
    """Names of the methods that a scene or a parameter may ask for.

    Examples:
        >>> from haptic_sim.method_registry import offered
        >>> offered()
        ('impulse', 'penalty_explicit', 'penalty_implicit', 'partitioned', 'closed_form')
    """
    return tuple(name for name, entry in METHODS.items() if entry.offered)


def make(name: str, scene: Any, sub_step: float) -> Any:
    """Makes a `World` from a scene with the method of this name.

    Raises ValueError if there is no such method, or if it cannot model the scene.

    Args:
        name: of the method, in METHODS.
        scene: a ReducedScene.
        sub_step: [s].

    Examples:
        >>> from haptic_sim.method_registry import make
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> make("partitioned", reduce_scene(load("pendulum")), 0.0005).passive
        True
        >>> make("euler", reduce_scene(load("pendulum")), 0.0005)
        Traceback (most recent call last):
            ...
        ValueError: method is 'euler'; it must be one of impulse, penalty_explicit, ...
    """
    if name not in METHODS:
        raise ValueError(f"method is {name!r}; it must be one of {', '.join(METHODS)}")
    module, kind = METHODS[name].where.split(":")
    return getattr(importlib.import_module(module), kind)(scene, sub_step)
