# SPDX-License-Identifier: Apache-2.0
"""A world led along a hand's path, and what came of it: poses, time spent, overlap, energy created.

Overlap is measured with the shapes and poses, not taken from what the world says of itself. Energy created is the
largest fall of what has been dissipated, supplied − Δstored, from one booking to a later one.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATOR
from haptic_device.device import operator_hand
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.protocol import Coupling, Planar, StepResult
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene import geometry
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

EXCHANGE_NS = 1_000_000
GAINS = Coupling(2000.0, 2.0, 2.0, 0.002)
FAR = 1e3  # times the energy of the scene's start or of the hand's way; nothing comes to so much but what has blown up


class LedWorld(Protocol):
    """What of a `World` a hand needs that leads it."""

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """`n` steps from each row of the hand's path (m, 6: position, velocity) evenly to the next."""

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]. Whoever asks wants them after each `step`: it may book from now on."""


class Exchanged:
    """Makes a simulation usable in `rollout`: each row of the path is a handle sample, 1 ms apart.

    Args:
        simulation: the simulation.
        start: first row of the path, (6).
        gains: of the coupling.

    Examples:
        >>> from haptic_sim.exchange.simulation import Simulation
        >>> from haptic_sim.protocol import held
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.lockstep.rollout import Exchanged, rollout
        >>> from haptic_sim.scene.language import load
        >>> path = held((0.03, 0.0, 0.0)).repeat(50, axis=0)
        >>> world = Exchanged(Simulation(reduce_scene(load("wall"))), path[0])
        >>> rollout(world, path).finite
        True
    """

    def __init__(self, simulation: Simulation, start: Sequence[float], gains: Coupling = GAINS):
        self.simulation, self._gains, self._time = simulation, gains, -EXCHANGE_NS
        self.pose = simulation.method.pose
        self._exchange(np.asarray(start, float).tolist())

    def step(self, target: np.ndarray, n: int = 1) -> StepResult:
        """An exchange for each row of the path `target` (m, 6) but its first; `n` is the simulation's own."""
        before = self.simulation.ledger.supplied
        for row in target[1:].tolist():
            self._exchange(row)
        return StepResult(self.simulation.ledger.supplied - before)

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J] after the last exchange."""
        return self.simulation.ledger.balance[:2]

    def _exchange(self, row: list[float]) -> None:
        self._time += EXCHANGE_NS
        x, y, theta, vx, vy, turn = row
        self.simulation.exchange(HandleSample(self._time, (x, y, theta), (vx, vy, turn), *self._gains))


class Rollout(NamedTuple):
    """Result of `rollout`.

    Attributes:
        finite: whether the energy of bodies and coupling stayed within 1e3 times what the scene had at its start or the
            hand's way puts into the coupling's spring (1 J at least). A run ends where it does not.
        poses: {body: (n, 3)} poses [m, m, rad] at the start and at each sample.
        spent: processor time of each stride [s], (strides).
        overlap: deepest overlap at the samples [m].
        created: energy created [J]: the largest decrease of the dissipated energy.
        scale: largest energy that occurred [J]: kinetic, potential or in the coupling's spring.

    Examples:
        >>> from haptic_sim.method_registry import make
        >>> from haptic_sim.protocol import held
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.lockstep.rollout import rollout
        >>> from haptic_sim.scene.language import load
        >>> path = held((0.03, 0.0, 0.0)).repeat(50, axis=0)
        >>> found = rollout(make("impulse", reduce_scene(load("wall")), 0.001), path, bodies=["tool"])
        >>> found.poses["tool"].shape, found.spent.shape
        ((100, 3), (99,))
    """

    finite: bool
    poses: dict[str, np.ndarray]
    spent: np.ndarray
    overlap: float
    created: float
    scale: float


def rollout(
    world: LedWorld,
    path: np.ndarray,
    count: int = 1,
    stride: int = 1,
    look: int | None = None,
    bodies: Iterable[str] = (),
    overlap: Callable[[], float] | None = None,
    gains: Coupling | None = None,
) -> Rollout:
    """Simulates a world whose handle follows a path. Returns a Rollout.

    Args:
        world: the world.
        path: (n, 6), position [m, m, rad] and velocity of the handle in each row.
        count: sub-steps from a row to the next.
        stride: rows in one call of `World.step`.
        look: rows between two samples of poses and overlap, a multiple of stride.
        bodies: names whose poses are kept.
        overlap: function () → depth [m], called at each sample.
        gains: of the coupling, for the energy.

    Examples:
        >>> import numpy as np
        >>> from haptic_sim.method_registry import make
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.lockstep.rollout import GAINS, hand, overlap_watch, rollout, way
        >>> from haptic_sim.scene.language import load
        >>> scene = load("wall")
        >>> world = make("closed_form", reduce_scene(scene), 0.001)
        >>> world.couple(GAINS)
        >>> path = way(hand(scene), np.arange(0.0, 2.0, 0.001))
        >>> found = rollout(world, path, bodies=["tool"], overlap=overlap_watch(scene, world.pose), gains=GAINS)
        >>> found.finite, found.created, found.overlap
        (True, 0.0, 0.0)
    """
    seen, spent, deepest = {name: [world.pose(name)] for name in bodies}, [], 0.0
    books = Books(world, gains) if gains else None
    for row in range(0, len(path) - 1, stride):
        began = time.thread_time()
        made = world.step(path[row : row + stride + 1], count)
        spent.append(time.thread_time() - began)
        reached = min(row + stride, len(path) - 1)
        if books and not books.book(path[reached], made.supplied):
            break
        if reached % (look or stride) == 0:
            for name, poses in seen.items():
                poses.append(world.pose(name))
            deepest = max(deepest, overlap() if overlap else 0.0)
    booked = (books.finite, books.created, books.scale) if books else (True, 0.0, 0.0)
    found = {name: np.array(places) for name, places in seen.items()}
    return Rollout(booked[0], found, np.array(spent), deepest, *booked[1:])


class Books:
    """Energy created and the largest about [J], booked again and again."""

    def __init__(self, world: LedWorld, gains: Coupling):
        stored = world.energy()
        self._world, self._gains, self._start, self._from = world, gains, sum(stored), world.pose(TOOL)
        self._most = max(1.0, *map(abs, stored))  # J
        self._supplied = self._lost = 0.0
        self.finite, self.created, self.scale = True, 0.0, max(map(abs, stored))

    def book(self, handle: Sequence[float], supplied: float) -> bool:
        """Books what is there now, the handle at (x, y, theta, …), and `supplied` [J] since; whether it is finite."""
        self._supplied += supplied
        stored, stretched = self._world.energy(), stretch(self._gains, handle, self._world.pose(TOOL))
        self._most = max(self._most, stretch(self._gains, handle, self._from))
        risen = sum(stored) - self._start
        self.finite = bool(math.isfinite(risen) and max(risen - self._supplied, stretched) < FAR * self._most)
        if self.finite:
            dissipated = self._supplied - risen
            self.created, self._lost = max(self.created, self._lost - dissipated), max(self._lost, dissipated)
            self.scale = max(self.scale, *map(abs, stored), stretched)
        return self.finite


def stretch(gains: Coupling, handle: Sequence[float], tool: Planar) -> float:
    """Energy in the coupling's spring [J]; handle and tool at poses (x, y, theta)."""
    x, y, theta = np.subtract(handle[:3], tool)
    return 0.5 * (gains.stiffness * (x * x + y * y) + gains.rotational_stiffness * theta * theta)


def hand(scene: Scene, angle: float = 0.0) -> Callable[[float], Planar]:
    """The suggested motion of a scene: a function of time [s] that returns the position (x, y, theta) [m, m, rad].

    Args:
        scene: the scene.
        angle: turns the plane, counter-clockwise [rad].

    Examples:
        >>> from haptic_sim.lockstep.rollout import hand
        >>> from haptic_sim.scene.language import load
        >>> hand(load("wall"))(0.0)
        (0.03, 0.0, 0.0)
    """
    values = defaults(OPERATOR)
    values |= {"motion.start": scene.tool.pose, "motion.target": scene.tool.pose}
    motion = operator_hand.script(values | {f"motion.{key}": value for key, value in scene.motion.items()})
    place = np.empty(3)

    def at(time: float) -> Planar:
        operator_hand.target_at(motion[0], time, place)
        return (*turned(place[:2].tolist(), (0.0, 0.0, angle)), float(place[2]) + angle)

    return at


def way(lead: Callable[[float], Planar], times: np.ndarray) -> np.ndarray:
    """Path (n, 6) of a hand: its positions at these times, and velocities by differences.

    Args:
        lead: time [s] → (x, y, theta).
        times: evenly spaced [s], (n).

    Examples:
        >>> import numpy as np
        >>> from haptic_sim.lockstep.rollout import way
        >>> print(way(lambda time: (0.1 * time, 0.0, 0.0), np.array([0.0, 0.5, 1.0]))[:, [0, 3]])  # x, rate of x
        [[0.   0.1 ]
         [0.05 0.1 ]
         [0.1  0.1 ]]
    """
    places = np.array([lead(time) for time in times.tolist()])
    return np.hstack([places, np.gradient(places, times[1] - times[0], axis=0)])


def overlap_watch(scene: Scene, pose: Callable[[str], Any]) -> Callable[[], float]:
    """Makes a function () → deepest overlap [m] of all bodies of a scene that can touch.

    The function computes the overlap from shapes and poses. It does not use the contacts of the world.

    Args:
        scene: the scene.
        pose: body → (x, y, theta), such as the `pose` of a world.

    Examples:
        >>> from haptic_sim.lockstep.rollout import overlap_watch
        >>> from haptic_sim.scene.language import load
        >>> deep = {"tool": (0.009, 0.0, 0.0), "wall": (0.0, 0.0, 0.0)}  # a tool of radius 10 mm, a wall at x = 0
        >>> round(overlap_watch(load("wall"), deep.get)(), 9)  # [m]
        0.001
    """
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    outlines = {name: solid.outlines for name, solid in solids.items()}
    rank = {name: k for k, name in enumerate(solids)}
    touching = reduce_scene(scene).needs.touching
    first, second = np.array([(rank[a], rank[b]) for a, b in touching], dtype=int).reshape(-1, 2).T
    sizes = np.array(
        [
            max(math.hypot(*vertex) + outline.radius for outline in parts for vertex in outline.vertices)
            for parts in outlines.values()
        ]
    )
    reach = sizes[first] + sizes[second]

    def look() -> float:
        poses = {name: pose(name) for name in solids}
        places = np.array([place[:2] for place in poses.values()])
        near = np.flatnonzero(np.hypot(*(places[first] - places[second]).T) < reach)
        return max(
            (geometry.overlap(outlines[a], poses[a], outlines[b], poses[b]) for a, b in (touching[k] for k in near)),
            default=0.0,
        )

    return look
