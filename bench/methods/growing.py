# SPDX-License-Identifier: Apache-2.0
"""How the cost of an exchange grows with the number of bodies, ours and the peers', and what is right of the result.

Two runs of each: in the timed one nothing is looked at, in the other energies are booked, and overlaps and bodies that
should stay where they are looked at now and then. The one ends early once it has cost `LIMIT` of processor time, and
then there is no other; the other at half of it.
"""

import math
from typing import NamedTuple

import numpy as np

from bench.methods import loads
from bench.methods.world import Impossible, make
from haptic_sim.rollout import GAINS, overlap_watch, rollout

WORLDS = ("row", "heap", "chain", "gravel", "pyramid", "joint_grid")
COUNTS = (10, 30, 100, 300)
ENGINES = ("impulse", "partitioned", "pymunk", "box2d", "mujoco_implicit")
STEP, STEPS = 250, {"box2d": (250, 50)}  # µs; the finer one for Box2D overlaps as little as `impulse` does
LIMIT, SECONDS, SHORT = 5.0, 1.2, 0.3  # s; the latter two of simulated time
SETTLED = 2  # the first half is not counted: heaps fall, what rests falls asleep (Box2D after half a second)
BOOK_EVERY, LOOK_EVERY = 10, 50  # exchanges
_NOTHING = (math.nan,) * 3
LESS, WITHIN, TWICE = 1.3, 1e-3, 2.0  # the goals: row at rest to none, p99 of the stirred heap [s], heap to Box2D


class Run(NamedTuple):
    """One line of the table: an engine at a step with so many bodies that can move, the tool not counted."""

    world: str
    bodies: int
    engine: str
    step_us: int
    median_us: float
    """Processor time of an exchange of 1 ms, half of them within it; within the next all but a hundredth."""
    p99_us: float
    overlap_um: float
    created: float
    """Energy from nowhere, of the largest about."""
    error_um: float
    """Longest way of a body that should stay, or by which a pin is open; nan where neither is known."""
    status: str = ""
    """Empty; "over" if the timed run was ended at its limit, "partly" if the other alone; or why it cannot be done."""

    @property
    def cannot(self) -> bool:
        """Whether there is nothing to compare."""
        return self.status.startswith("cannot")


def jobs(worlds, counts, engines) -> list[tuple[str, int, str, int]]:
    """(world, bodies asked for, engine, step) of all runs; the row also without any block."""
    return [
        (world, count, engine, step)
        for world in worlds
        for count in (*([0] if world == "row" else []), *counts)
        for engine in engines
        for step in STEPS.get(engine, (STEP,))
    ]


def run(world: str, count: int, engine: str, step: int, seconds: float, limit: float = LIMIT) -> Run:
    """An engine at this step [µs] on a world of about `count` bodies."""
    load = getattr(loads, world)(count, seconds)
    key = (world, sum(not body.fixed for body in load.scene.bodies), engine, step)
    try:
        spent, whole = _timed(load, engine, step, limit)
        judged, seen = _judged(load, engine, step, 0.5 * limit) if whole else (_NOTHING, False)
    except Impossible as reason:
        return Run(*key, math.nan, math.nan, *_NOTHING, f"cannot: {reason}")
    counted = 1e6 * np.array(spent[len(spent) // SETTLED :])
    status = "over" if not whole else "" if seen else "partly"
    return Run(*key, float(np.median(counted)), float(np.percentile(counted, 99)), *judged, status)


def _ready(load, engine, step):
    world = make(engine, load.scene, step * 1e-6, many=True)
    world.couple(GAINS)
    return world


def _timed(load, engine, step, limit):
    """Processor time [s] of each exchange, and whether all were done."""
    path, count = load.path(), 1000 // step
    rollout(_ready(load, engine, step), path[:2], count)  # what is compiled or allocated once is so now
    spent = rollout(_ready(load, engine, step), path, count, limit=limit).spent
    return spent, float(np.sum(spent)) <= limit


def _judged(load, engine, step, limit):
    """Deepest overlap [µm], energy created over the largest about, error [µm]; and whether it came to the end."""
    path, world = load.path(), _ready(load, engine, step)
    look, wrong = overlap_watch(load.scene, world.pose), _error(load, world)
    errors = [wrong()]

    def watched():
        errors.append(wrong())
        return look()

    found = rollout(world, path, 1000 // step, BOOK_EVERY, LOOK_EVERY, overlap=watched, gains=GAINS, limit=limit)
    if not found.finite:
        return (math.inf, math.inf, math.inf), True
    judged = 1e6 * found.overlap, found.created / max(found.scale, 1e-3), 1e6 * np.max(errors)
    return judged, len(found.spent) * BOOK_EVERY >= len(path) - 1


def _error(load, world):
    """() → what is wrong [m] of the bodies that should stay, and of the pins; nan if there are neither."""
    start = {body.name: body.pose for body in load.scene.bodies}

    def wrong():
        ways = [math.dist(world.pose(name)[:2], start[name][:2]) for name in load.still]
        return max([loads.pins_open(load.scene, world.pose)] if load.scene.joints else ways, default=math.nan)

    return wrong


class Goal(NamedTuple):
    """A number that the growth is held to."""

    what: str
    value: float
    limit: float
    unit: str

    @property
    def reached(self) -> bool:
        """Whether it is no more than the limit."""
        return self.value <= self.limit


def goals(runs: list[Run]) -> list[Goal]:
    """Those of `impulse` that these runs can tell."""
    ours = {(item.world, item.bodies): item for item in runs if item.engine == "impulse" and not item.cannot}
    rest, none, heap = ours.get(("row", 300)), ours.get(("row", 0)), ours.get(("heap", 100))
    found = []
    if rest and none:
        found.append(Goal("300 resting blocks over none, median", rest.median_us / none.median_us, LESS, "×"))
    if heap:
        found.append(Goal("stirred heap of 100, p99", heap.p99_us, 1e6 * WITHIN, "µs"))
        rivals = [item for item in runs if (item.world, item.bodies, item.engine) == ("heap", 100, "box2d")]
        if rivals:
            rival = min(rivals, key=lambda item: abs(item.overlap_um - heap.overlap_um))
            found.append(
                Goal(
                    f"stirred heap of 100 over Box2D at {rival.step_us} µs, median (overlaps "
                    f"{heap.overlap_um:.2g} and {rival.overlap_um:.2g} µm)",
                    heap.median_us / rival.median_us,
                    TWICE,
                    "×",
                )
            )
    return found
