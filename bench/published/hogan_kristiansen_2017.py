# SPDX-License-Identifier: Apache-2.0
"""Painlevé's rod: the friction from which a sliding rod stops at once, without a collision."""

import math

import numpy as np

from bench.reference.bisection import bisected
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

ANGLES = tuple(math.radians(degrees) for degrees in (55.0, 60.0, 65.0, 70.0)) + (math.atan(2.0),)
"""Of the rod over the floor; the last one needs the least friction."""
HALF, THICK = 0.5, 1e-4
"""Half the rod's length and thickness in the shipped scene [m]."""
STEP, STEPS, JUMP, HALVINGS = 1e-6, 20, 0.3, 10
"""s; sub-steps; change of speed that no finite force makes in that time [m/s, rad/s]; of the bracket."""


def friction() -> list[float]:
    """Least coefficient of friction, over the angles, at which the sliding rod's speed jumps."""
    least = (bisected(lambda mu, angle=angle: _change(mu, angle) > JUMP, 1.0, 2.0, HALVINGS) for angle in ANGLES)
    return [min(least)]


def _change(friction, angle):
    """Largest change of a velocity of the rod that slides with its lower end ahead."""
    scene, height = load("painleve_rod"), HALF * math.sin(angle) + THICK * math.cos(angle)
    materials = {name: one.model_copy(update={"friction": friction}) for name, one in scene.materials.items()}
    placed = {"pose": (0.0, height, angle)}
    bodies = tuple(one.model_copy(update=placed) if one.name == "rod" else one for one in scene.bodies)
    method = Partitioned(reduce_scene(scene.model_copy(update={"materials": materials, "bodies": bodies})), STEP)
    before = np.array(method.bodies()[1][1])  # the tool is the first
    method.step(held(method.position), STEPS)
    return float(np.abs(np.array(method.bodies()[1][1]) - before).max())
