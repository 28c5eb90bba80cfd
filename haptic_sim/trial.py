# SPDX-License-Identifier: Apache-2.0
"""A scene put to the test: its motion led by an exact hand, turned and shifted as asked, and judged from outside.

Overlap is measured with the shapes and poses, not taken from what the method says of itself. Energy created is the
largest amount by which the ledger's `dissipated` ever falls from one exchange to the next, or in all.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_device.law import operator
from haptic_device.parameters import OPERATOR
from haptic_sim import clearance
from haptic_sim.compile import compile_scene
from haptic_sim.joint import WORLD
from haptic_sim.scene import Scene
from haptic_sim.shape import turned
from haptic_sim.simulation import HandleSample, Simulation
from haptic_sim.solid import TOOL

EXCHANGE_NS = 1_000_000
GAINS = (2000.0, 2.0, 2.0, 0.002)
_STILL = (0.0, 0.0, 0.0)


class Outcome(NamedTuple):
    """What came of it: deepest overlap [m], energy created [J], whether all stayed finite.

    `scale` [J] is the largest energy about: kinetic, potential or in the coupling's spring.
    """

    finite: bool
    overlap: float
    created: float
    scale: float
    simulation: Simulation


def hand(scene: Scene, angle: float = 0.0):
    """time [s] → where the suggested motion leads the handle (x, y, theta), the plane turned by `angle` [rad]."""
    values = {parameter.name: parameter.default for parameter in OPERATOR}
    values |= {"motion.start": scene.tool.pose, "motion.target": scene.tool.pose}
    motion = operator.script(values | {f"motion.{key}": value for key, value in scene.motion.items()})
    place = np.empty(3)

    def at(time):
        operator.target_at(motion[0], time, place)
        return (*turned(place[:2].tolist(), (0.0, 0.0, angle)), float(place[2]) + angle)

    return at


def turned_scene(scene: Scene, angle: float, ahead: float = 0.0) -> Scene:
    """The same scene with the plane turned by `angle` [rad], and bodies already `ahead` [s] on their way."""
    whole = 0.0, 0.0, angle

    def moved(solid):
        (x, y, theta), (vx, vy, rate) = solid.pose, solid.velocity
        pose = *turned((x + ahead * vx, y + ahead * vy), whole), theta + angle + ahead * rate
        return solid.model_copy(update={"pose": pose, "velocity": (*turned((vx, vy), whole), rate)})

    def held(joint):
        update = {key: turned(getattr(joint, key), whole) for key in ("at", "axis") if getattr(joint, key)}
        if joint.anchors:
            update["anchors"] = tuple(turned(anchor, whole) if name == WORLD else anchor
                                      for anchor, name in zip(joint.anchors, joint.bodies, strict=True))
        return joint.model_copy(update=update)

    return scene.model_copy(update={
        "bodies": tuple(map(moved, scene.bodies)), "tool": moved(scene.tool), "joints": tuple(map(held, scene.joints)),
        "gravity": turned(scene.gravity, whole),
    })


def jump(scene: Scene, angle: float, when: float):
    """time [s] → a handle that is at the motion's start until `when`, and from then on at its target."""
    ends = [(*turned(scene.motion[key][:2], (0.0, 0.0, angle)), scene.motion[key][2] + angle)
            for key in ("start", "target")]
    return lambda time: ends[time >= when]


def attempt(scene: Scene, seconds: float, method: str | None = None, sub_step: float | None = None, gains=GAINS,
            angle: float = 0.0, phase: float = 0.0, look_every: int = 1, way=None) -> Outcome:
    """Run the scene for `seconds`, overlaps looked at after every so many exchanges; `phase` in sub-steps 0…1.

    `way` leads the handle instead of the scene's motion: time [s] → (x, y, theta) in the turned plane.
    """
    lead = way or hand(scene, angle)
    step = sub_step or compile_scene(scene, method).sub_step
    world = Simulation(turned_scene(scene, angle, phase * step), step, method=method)
    watch = overlap_watch(world.scene, world.method.pose)
    overlap = lost = created = scale = 0.0
    for k in range(round(seconds * 1e9) // EXCHANGE_NS + 1):
        here, before = lead(k * 1e-3 + phase * step), lead((k - 1) * 1e-3 + phase * step)
        velocity = tuple((a - b) * 1e3 for a, b in zip(here, before, strict=True)) if way is None else _STILL
        answer = world.exchange(HandleSample(k * EXCHANGE_NS, here, velocity, *gains))
        balance = world.ledger.balance
        if not all(map(math.isfinite, (*answer.position, *answer.velocity, *answer.force_on_tool, *balance))):
            return Outcome(False, math.inf, math.inf, scale, world)
        created = max(created, lost - balance.dissipated)
        lost = max(lost, balance.dissipated)
        scale = max(scale, balance.kinetic, abs(balance.potential), _stretch_energy(answer.position, here, gains))
        if k % look_every == 0:
            overlap = max(overlap, watch())
    return Outcome(True, overlap, created, scale, world)


def _stretch_energy(tool, handle, gains):
    x, y, theta = (a - b for a, b in zip(tool, handle, strict=True))
    return 0.5 * (gains[0] * (x * x + y * y) + gains[2] * theta * theta)


def overlap_watch(scene: Scene, pose):
    """() → deepest overlap [m] of all bodies that can touch, where `pose` (body → pose) says that they are."""
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    outlines = {name: solid.outlines for name, solid in solids.items()}
    rank = {name: k for k, name in enumerate(solids)}
    touching = compile_scene(scene).needs.touching
    first, second = np.array([(rank[a], rank[b]) for a, b in touching], dtype=int).reshape(-1, 2).T
    sizes = np.array([max(math.hypot(*vertex) + outline.radius for outline in parts for vertex in outline.vertices)
                      for parts in outlines.values()])
    reach = sizes[first] + sizes[second]

    def look():
        poses = {name: pose(name) for name in solids}
        places = np.array([place[:2] for place in poses.values()])
        near = np.flatnonzero(np.hypot(*(places[first] - places[second]).T) < reach)
        return max((clearance.overlap(outlines[a], poses[a], outlines[b], poses[b])
                    for a, b in (touching[k] for k in near)), default=0.0)

    return look
