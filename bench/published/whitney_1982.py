# SPDX-License-Identifier: Apache-2.0
"""How deep a peg can wedge in its hole: squeezed until both contacts are closed, let go, and then pushed down."""

from functools import cache

import numpy as np
from scipy.optimize import brentq

from haptic_sim.lockstep.rollout import rollout
from haptic_sim.protocol import Coupling
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

WIDTH, HOLE, LENGTH = 0.02, 0.02002, 0.1
"""Of the peg, of the hole, from the peg's tip to the grip [m]."""
GAINS = Coupling(2000.0, 20.0, 2.0, 0.02)
"""Of the hand's coupling to the grip."""
SQUEEZE, PUSH = 0.5, 1e-3
"""How far the hand turns the grip to close both contacts [rad], and draws it down afterwards [m]: 1 N m and 2 N."""
STEP, TICKS, STILL = 2.5e-4, 400, 1e-6
"""s; sub-steps of each of the three stages; travel of a peg that is held [m]."""
FRICTIONS = 0.3, 0.45, 0.6
SHARES = *np.arange(0.1, 0.9, 0.1), *np.arange(0.9, 1.105, 0.01), 1.2, 1.3
"""Insertions that are tried, over friction times width."""


def held() -> list[float]:
    """Insertion over friction times width up to which the peg is held at all that are tried, of each friction."""
    return [_last(_held(friction)) for friction in FRICTIONS]


def slides() -> list[float]:
    """Insertion over friction times width from which the peg is held at none that is tried, of each friction."""
    return [_last(_held(friction)[::-1], held=False) for friction in FRICTIONS]


def _last(tried, held=True):
    """Last insertion of those in a row from the first on that are all held, or all not; NaN if the first is not so."""
    last = np.nan
    for share, is_held in tried:
        if is_held is not held:
            break
        last = share
    return last


@cache
def _held(friction):
    return [(float(share), bool(_travel(share * friction * WIDTH, friction) < STILL)) for share in SHARES]


def _travel(depth, friction):
    """Way [m] that the grip goes down under the hand's push."""
    pose = x, y, angle = _tilted(depth)
    world = PymunkWorld(reduce_scene(_scene(pose, friction)), STEP)
    world.couple(GAINS)
    for aim in ((x, y, angle - SQUEEZE), pose):
        _rest(world, aim)
    before = world.pose("tool")[1]
    _rest(world, (x, y - PUSH, angle))
    return before - world.pose("tool")[1]


def _rest(world, aim):
    rollout(world, np.array([[*aim, 0.0, 0.0, 0.0]] * 2), TICKS)


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
    body = {"mass": 0.1, "inertia": 3e-4, "material": "steel", "pose": list(pose), "shapes": [{"vertices": peg}]}
    return Scene.model_validate(
        {
            "name": "wedging",
            "materials": {"steel": {"friction": friction}},
            "bodies": [
                {"name": name, "fixed": True, "material": "steel", "shapes": [{"vertices": vertices}]}
                for name, vertices in sides.items()
            ],
            "tool": body,
        }
    )
