# SPDX-License-Identifier: Apache-2.0
"""Discs pinned to all their neighbours, the uppermost to the world: a grid that cannot move, pulled at a corner."""

import math

import numpy as np
import pytest

from haptic_sim.lockstep.rollout import GAINS, hand, rollout, way
from haptic_sim.method_registry import make
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import framed, turned
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

PITCH = 0.01  # m
STONE = {"material": "stone"}


def grid(side, seconds):
    """The scene, by rows from above."""
    places = [(PITCH * j, -PITCH * (i + 0.5)) for i in range(side) for j in range(side)]
    shape, names = {"circle": {"radius": 0.004}}, [f"disc_{k}" for k in range(side * side)]
    discs = [
        {"name": name, "mass": 0.002, **STONE, "pose": [*place, 0.0], "layers": [], "shapes": [shape]}
        for name, place in zip(names, places, strict=True)
    ]
    corner = [PITCH * (side - 1), -PITCH * side, 0.0]
    pins = [(names[k - 1], names[k], (x - PITCH / 2, y)) for k, (x, y) in enumerate(places) if k % side]
    above = ["world"] * side + names
    pins += [(above[k], names[k], (x, y + PITCH / 2)) for k, (x, y) in enumerate(places)]
    target = [corner[0] + 0.003, corner[1] + 0.001, 0.0]
    return Scene.model_validate(
        {
            "name": "grid",
            "gravity": [0.0, -9.81],
            "materials": {"stone": {"friction": 0.5}},
            "bodies": discs,
            "joints": [
                {"type": "pin", "bodies": [a, b], "at": list(at)} for a, b, at in (*pins, (names[-1], TOOL, corner[:2]))
            ],
            "tool": {"mass": 0.1, **STONE, "pose": corner, "shapes": [{"circle": {"radius": 0.006}}]},
            "motion": {"name": "press_wall", "start": corner, "target": target, "duration": seconds},
        }
    )


def widest_gap(scene, pose):
    """Way [m] by which the two sides of the worst pin are apart."""
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    sides = [
        [turned(framed(pin.at, solids[name].pose), pose(name)) if name in solids else pin.at for name in pin.bodies]
        for pin in scene.joints
    ]
    return max(math.dist(*ends) for ends in sides)


@pytest.mark.parametrize("side", [3, 5])
def test_many_pins_stay_closed_in_pymunk_s_world_and_create_no_energy(side):
    """As fast as a few joints take their errors back, 17 pins in a grid gain six times the energy that is about."""
    scene, seconds = grid(side, 0.4), 0.4
    world, path = make("impulse", reduce_scene(scene), 0.25e-3), way(hand(scene), np.arange(0.0, seconds, 1e-3))
    world.couple(GAINS)
    found = rollout(world, path, 4, 10, 50, overlap=lambda: widest_gap(scene, world.pose), gains=GAINS)
    assert found.finite and found.overlap < 50e-6
    assert found.created < 0.01 * max(found.scale, 1e-3)
