# SPDX-License-Identifier: Apache-2.0
"""How wrong a world is: a scene led by its hand, beside where the bodies really go.

A hand that moves is known once a millisecond and goes straight in between, for every method alike, so that the answer
does not depend on who asks how often. One at rest lets a method step as far as it likes.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from haptic_sim.lockstep.rollout import EXCHANGE_NS, LedWorld, hand, overlap_watch, rollout, way
from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling, Planar
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

LOST = 1.0  # of the way that the bodies come: a larger error is no answer any more
STABLE, UNSTABLE = "stable", "unstable"


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
    lead: Callable[[float], Planar] | None = None
    """time [s] → (x, y, theta) of a hand at rest wherever it is, instead of the scene's motion."""

    @property
    def period(self) -> int:
        """ns from one sample of the hand to the next."""
        return EXCHANGE_NS if self.moving else self.look

    def path(self) -> np.ndarray:
        """Positions and velocities (n + 1, 6) of the handle at its samples."""
        times = np.arange(round(self.seconds * 1e9) // self.period + 1) * self.period * 1e-9
        path = way(self.lead or hand(self.scene), times)
        if self.lead or not self.moving:
            path[:, 3:] = 0.0
        return path

    def bodies(self) -> dict[str, float]:
        """Bodies that are looked at → radius of gyration [m], by which a turn counts as a way.

        All that can move, but not a tool that hangs idle beside them.
        """
        solids = {body.name: body for body in self.scene.bodies} | {TOOL: self.scene.tool}
        moving = reduce_scene(self.scene).needs.moving
        idle = not self.moving and not any(TOOL in joint.bodies for joint in self.scene.joints)
        return {
            name: math.sqrt(solids[name].mass_properties[1] / solids[name].mass_properties[0])
            for name in moving
            if not (idle and name == TOOL)
        }


class Reference(NamedTuple):
    """Body → poses (n, 3) at the looks; what it comes from; how far it may be off [m]."""

    poses: dict[str, np.ndarray]
    source: str
    doubt: float


class Judged(NamedTuple):
    """Error, energy created [J], largest energy about [J], deepest overlap [m]."""

    error: float
    created: float
    scale: float
    penetration: float


def judge(case: Case, reference: Reference, world: LedWorld, count: int) -> Judged:
    """A world on the whole path; `count` steps from one sample of the hand to the next."""
    bodies = case.bodies()
    found = rollout(
        world,
        case.path(),
        count,
        look=case.look // case.period,
        bodies=bodies,
        overlap=overlap_watch(case.scene, world.pose),
        gains=case.gains,
    )
    if not found.finite:
        return Judged(math.inf, math.inf, found.scale, math.inf)
    return Judged(error_of(found.poses, reference, bodies), found.created, found.scale, found.overlap)


def solution(of: Case, method: str, step: int) -> dict[str, np.ndarray]:
    """Body → poses (n, 3) at the looks, by a method at this step [ns]. ValueError if the method cannot model it."""
    world = make(method, reduce_scene(of.scene), step * 1e-9)
    world.couple(of.gains)
    return rollout(world, of.path(), of.period // step, of.look // of.period, bodies=of.bodies()).poses


def error_of(seen: dict[str, np.ndarray], reference: Reference, bodies: dict[str, float]) -> float:
    """Root mean square over time of the worst body's distance from its reference, over the longest way of any."""
    worst = np.max([apart(seen[name], reference.poses[name], radius) for name, radius in bodies.items()], axis=0)
    whole = float(np.sqrt(np.mean(worst**2))) if np.all(np.isfinite(worst)) else math.inf
    return whole / longest_way(reference, bodies)


def longest_way(reference: Reference, bodies: dict[str, float]) -> float:
    """Longest way [m] that any body comes."""
    poses = reference.poses
    return max(float(apart(poses[name], poses[name][:1], radius).max()) for name, radius in bodies.items())


def apart(poses: np.ndarray, others: np.ndarray, radius: float) -> np.ndarray:
    """Distances [m] of poses, a turn counted at this radius."""
    gap = (poses - others) * (1.0, 1.0, radius)
    return np.sqrt(np.sum(gap * gap, axis=1))
