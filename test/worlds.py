# SPDX-License-Identifier: Apache-2.0
"""Worlds of a few bodies: written in a plane of their own, which is turned, and looked at in that plane again."""

import math

import numpy as np

from bench.reference.trial import turned_scene
from haptic_sim.method_registry import make
from haptic_sim.protocol import STILL, along
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import framed, turned
from haptic_sim.scene.language import Scene

G = 9.81
DOWN = (0.0, -G)
TURNS = [0.0, math.radians(37.0)]


def box(width, height, **more):
    return [{"box": {"size": [width, height], **more}}]


def block_of(left, right, bottom, top):
    return {"vertices": [[left, bottom], [right, bottom], [right, top], [left, top]]}


def disc(radius, **more):
    return [{"circle": {"radius": radius, **more}}]


BALL, SLAB = disc(0.01), box(0.2, 0.1)


def body(x=0.0, y=0.0, angle=0.0, name="body", shapes=SLAB, mass=1.0, **more):
    return {"name": name, "mass": mass, "pose": [x, y, angle], "shapes": shapes, **more}


def fixed(name, x=0.0, y=0.0, shapes=SLAB, **more):
    return {"name": name, "fixed": True, "pose": [x, y, 0.0], "shapes": shapes, **more}


def floor(**more):
    return fixed("floor", shapes=[{"half_plane": {"normal": [0.0, 1.0]}}], **more)


def tool(x=0.0, y=0.0, angle=0.0, shapes=BALL, mass=0.1, **more):
    return {"mass": mass, "pose": [x, y, angle], "shapes": shapes, **more}


def joint(kind, a="world", b="body", at=(0.0, 0.0), **more):
    return {
        "type": kind,
        "bodies": [a, b],
        "at": list(at),
        **({"axis": [1.0, 0.0]} if kind == "slider" else {}),
        **more,
    }


def spring(a="world", b="body", anchors=((0.0, 0.0), (0.0, 0.0)), **more):
    return {"type": "spring", "bodies": [a, b], "anchors": anchors, **more}


FAR = tool(50.0, 50.0, layers=[])
"""A tool that nothing touches."""


class World:
    """A scene stepped by `h` [s] with a method (its name or its class), in a plane that was turned [rad].

    All bodies are of one material unless they name another, and `gains` are the coupling's.
    """

    def __init__(self, method, bodies, h=1e-3, turn=0.0, friction=0.0, restitution=0.0, tool=FAR, gains=None, **more):
        materials = {"m": {"friction": friction, "restitution": restitution}, "smooth": {}}
        solids = [{"material": "m", **solid} for solid in (tool, *bodies)]
        scene = {"name": "t", "materials": materials, "tool": solids[0], "bodies": solids[1:], **more}
        self.turn, reduced = turn, reduce_scene(turned_scene(Scene.model_validate(scene), turn))
        self.method = make(method, reduced, h) if isinstance(method, str) else method(reduced, h)
        self.moving = reduced.needs.moving
        self.handle = tuple(solids[0]["pose"])
        if gains:
            self.method.couple(gains)

    def run(self, seconds, handle=None, velocity=STILL):
        """So many seconds with the handle held, from now on at this place."""
        return self.steps(round(seconds / self.method.sub_step), handle, velocity)

    def steps(self, count, handle=None, velocity=STILL):
        """So many sub-steps."""
        self.lead([(handle or self.handle, velocity)] * 2, count)
        return self

    def lead(self, rows, count=1):
        """What came of it that the handle went through these places, so many sub-steps from each to the next."""
        self.handle = tuple(rows[-1][0])
        back = 0.0, 0.0, self.turn
        return self.method.step(
            along(
                *(((*turned((x, y), back), t + self.turn), (*turned((u, v), back), w)) for (x, y, t), (u, v, w) in rows)
            ),
            count,
        )

    def pose(self, name="body"):
        """(x, y, angle) of a body's frame."""
        x, y, angle = self.method.pose(name)
        return np.array([*framed((x, y), (0.0, 0.0, self.turn)), angle - self.turn])

    def state(self, name="body"):
        """Pose, and velocities of the mass centre of what nothing is welded to."""
        rates = self.method.bodies()
        vx, vy, turning = rates[self.moving.index(name)][1] if name in self.moving else STILL
        return np.array([*self.pose(name), *framed((vx, vy), (0.0, 0.0, self.turn)), turning])

    def force(self):
        """Of the coupling on the tool."""
        return framed(self.method.force_on_tool[:2], (0.0, 0.0, self.turn))

    energy = property(lambda self: sum(self.method.energy()))
