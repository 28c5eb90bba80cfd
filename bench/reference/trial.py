# SPDX-License-Identifier: Apache-2.0
"""A scene put to the test: its motion led by an exact hand, turned and shifted as asked, and judged from outside."""

import math
from typing import NamedTuple

import numpy as np

from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.rollout import GAINS, Exchanged, hand, overlap_watch, rollout
from haptic_sim.protocol import Coupling
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.joints import WORLD
from haptic_sim.scene.language import Scene


class Outcome(NamedTuple):
    """What came of it: deepest overlap [m], energy created and the largest about [J], whether all stayed finite."""

    finite: bool
    overlap: float
    created: float
    scale: float
    simulation: Simulation


def turned_scene(scene: Scene, angle: float, ahead: float = 0.0) -> Scene:
    """The same scene with the plane turned by `angle` [rad], and bodies already `ahead` [s] on their way."""
    whole = 0.0, 0.0, angle

    def moved(solid):
        (x, y, theta), (vx, vy, rate) = solid.pose, solid.velocity
        pose = *turned((x + ahead * vx, y + ahead * vy), whole), theta + angle + ahead * rate
        return solid.model_copy(update={"pose": pose, "velocity": (*turned((vx, vy), whole), rate)})

    def held(joint):
        update = {"at": turned(joint.at, whole)} if joint.at else {}
        if joint.type == "slider":
            update["axis"] = turned(joint.axis, whole)
        if joint.anchors:
            update["anchors"] = tuple(
                turned(anchor, whole) if name == WORLD else anchor
                for anchor, name in zip(joint.anchors, joint.bodies, strict=True)
            )
        return joint.model_copy(update=update)

    return scene.model_copy(
        update={
            "bodies": tuple(map(moved, scene.bodies)),
            "tool": moved(scene.tool),
            "joints": tuple(map(held, scene.joints)),
            "gravity": turned(scene.gravity, whole),
        }
    )


def jump(scene: Scene, angle: float, when: float):
    """time [s] → a handle that is at the motion's start until `when`, and from then on at its target."""
    ends = [
        (*turned(scene.motion[key][:2], (0.0, 0.0, angle)), scene.motion[key][2] + angle) for key in ("start", "target")
    ]
    return lambda time: ends[time >= when]


def attempt(
    scene: Scene,
    seconds: float,
    method: str | None = None,
    sub_step: float | None = None,
    gains=GAINS,
    angle: float = 0.0,
    phase: float = 0.0,
    look_every: int = 1,
    way=None,
) -> Outcome:
    """Run the scene for `seconds`, overlaps looked at after every so many exchanges; `phase` in sub-steps 0…1.

    `way` leads the handle instead of the scene's motion, at rest wherever it is: time [s] → (x, y, theta) in the turned
    plane.
    """
    lead, step = way or hand(scene, angle), sub_step or reduce_scene(scene, method).sub_step
    simulation = Simulation(reduce_scene(turned_scene(scene, angle, phase * step), method), step)
    places = np.array([lead(k * 1e-3 + phase * step) for k in range(-1, round(seconds * 1e3) + 1)])
    rates = np.zeros_like(places[1:]) if way else np.diff(places, axis=0) * 1e3
    path = np.hstack([places[1:], rates])
    gains = Coupling(*gains)
    world = Exchanged(simulation, path[0], gains)
    found = rollout(world, path, look=look_every, overlap=overlap_watch(simulation.scene, world.pose), gains=gains)
    if not found.finite:
        return Outcome(False, math.inf, math.inf, found.scale, simulation)
    return Outcome(True, found.overlap, found.created, found.scale, simulation)
