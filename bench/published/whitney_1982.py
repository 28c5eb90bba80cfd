# SPDX-License-Identifier: Apache-2.0
"""How deep a peg can wedge in its hole: the deepest insertion at which its own friction carries the hand's push."""

import numpy as np
from scipy.optimize import brentq

from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import rollout
from haptic_sim.scene.language import Scene

WIDTH, HOLE, LENGTH = 0.02, 0.0201, 0.1
"""Of the peg, of the hole, from the peg's tip to the grip [m]."""
PUSH, STIFFNESS = 5e-3, 2000.0
"""How far below its place the hand draws the grip [m], by this coupling [N/m]."""
STEP, TICKS, STILL = 1e-4, 3000, 1e-6
"""s; sub-steps; travel of a peg that is held [m]."""
FRICTIONS = 0.3, 0.45, 0.6
SHARES = np.arange(0.9, 1.1, 0.01)
"""Insertions that are tried, over friction times width."""


def wedging() -> list[float]:
    """Deepest insertion at which the peg is held, over friction times width, of each friction.

    Where rounding leaves a gap at one of the two contacts, the peg slides before it is held: such depths do not count.
    """
    return [_deepest(friction) for friction in FRICTIONS]


def _deepest(friction):
    return max((float(share) for share in SHARES if _held(share * friction * WIDTH, friction)), default=0.0)


def _held(depth, friction):
    return _travel(depth, friction) < STILL


def _travel(depth, friction):
    """Way [m] that the grip goes down under the hand's push."""
    x, y, angle = _tilted(depth)
    world = Partitioned(reduce_scene(_scene((x, y, angle), friction)), STEP)
    world.couple(Coupling(STIFFNESS, 20.0, 2.0, 0.02))
    rollout(world, np.array([[x, y - PUSH, angle, 0.0, 0.0, 0.0]] * 2), TICKS)
    return y - world.position[1]


def _tilted(depth):
    """Pose of the grip where the deeper corner of the tip touches the left wall and the peg's side the right mouth."""

    def gap(angle):
        c, s = np.cos(angle), np.sin(angle)
        return HOLE - WIDTH * c + (depth - WIDTH * s) * s / c

    angle = brentq(gap, -0.4, -1e-6)
    across, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    x, y = np.array([-0.5 * HOLE, -depth]) + 0.5 * WIDTH * across + LENGTH * along
    return x, y, angle


def _scene(pose, friction):
    half, outside, deep = 0.5 * HOLE, 0.06, -0.2
    sides = {
        "left": [[-outside, deep], [-half, deep], [-half, 0.0], [-outside, 0.0]],
        "right": [[outside, deep], [outside, 0.0], [half, 0.0], [half, deep]],
    }
    r = 0.5 * WIDTH
    peg = [[-r, -LENGTH], [r, -LENGTH], [r, -0.4 * LENGTH], [-r, -0.4 * LENGTH]]
    return Scene.model_validate(
        {
            "name": "wedging",
            "materials": {"steel": {"friction": friction}},
            "bodies": [
                {"name": name, "fixed": True, "material": "steel", "shapes": [{"vertices": vertices}]}
                for name, vertices in sides.items()
            ],
            "tool": {
                "mass": 0.1,
                "inertia": 3e-4,
                "material": "steel",
                "pose": list(pose),
                "shapes": [{"vertices": peg}],
            },
        }
    )
