# SPDX-License-Identifier: Apache-2.0
"""One run of a case: how wrong, how much energy from nowhere, how deep, how fast.

Two passes. The judged one goes from hand sample to hand sample, energies booked, places compared with the reference
every 10 ms, overlaps measured with the shapes. The timed one takes the whole path in one call where the world can, so
that no one's glue is timed; the best of some repeats counts.
"""

import math
import time
from typing import NamedTuple

import numpy as np

from reference.case import Case
from reference.reference import Reference, apart
from bench.methods.world import Impossible, make
from haptic_sim.method import Coupling
from haptic_sim.solid import TOOL
from haptic_sim.trial import overlap_watch

REPEATS, ENOUGH = 5, 0.25  # times, s
LOST = 1.0  # of the way that the bodies come: a larger error is no answer any more
FAR = 1e3  # m or rad; nothing goes there but what has blown up
STABLE, UNSTABLE = "stable", "unstable"


class Run(NamedTuple):
    """One line of the table. `error` is relative to the way the bodies come, `wall` is s per simulated s."""

    scene: str
    kind: str
    method: str
    step_us: int
    wall: float
    error: float
    created_j: float
    scale_j: float
    penetration_m: float
    status: str
    """stable, unstable, or why it could not be done."""

    @property
    def counts(self) -> bool:
        """Whether it takes part in comparisons."""
        return self.status == STABLE


class Judged(NamedTuple):
    """Error, energy created [J], largest energy about [J], deepest overlap [m]."""

    error: float
    created: float
    scale: float
    penetration: float


def run(case: Case, reference: Reference, method: str, step: int) -> Run:
    """A method or peer on a case at this step [µs]."""
    try:
        judged = judge(case, reference, _ready(case, method, step), case.period // (1000 * step))
        wall = clock(case, method, step)
    except Impossible as reason:
        return Run(case.name, case.kind, method, step, *[math.nan] * 5, f"cannot: {reason}")
    status = STABLE if judged.error < LOST else UNSTABLE
    return Run(case.name, case.kind, method, step, wall, *judged, status)


def judge(case: Case, reference: Reference, world, count: int) -> Judged:
    """The pass that is looked at; `count` steps from one sample of the hand to the next."""
    path, every, bodies = case.path(), case.look // case.period, case.bodies()
    seen, energies, deepest = {name: [world.pose(name)] for name in bodies}, [sum(world.energy())], 0.0
    scale, supplied, overlap = max(map(abs, world.energy())), [0.0], overlap_watch(case.scene, world.pose)
    for k in range(len(path) - 1):
        world.follow(path[k:k + 2], count)
        stored = world.energy()
        if not all(abs(number) < FAR for number in (*stored, *world.pose(TOOL))):
            return Judged(math.inf, math.inf, scale, math.inf)
        energies.append(sum(stored))
        supplied.append(world.supplied)
        scale = max(scale, *map(abs, stored), stretch(case.gains, path[k + 1], world.pose(TOOL)))
        if (k + 1) % every == 0:
            deepest = max(deepest, overlap())
            for name in bodies:
                seen[name].append(world.pose(name))
    return Judged(error_of(seen, reference, bodies), _created(np.array(supplied), np.array(energies)), scale, deepest)


def error_of(seen, reference: Reference, bodies: dict[str, float]) -> float:
    """Root mean square over time of the worst body's distance from its reference, over the longest way of any."""
    gaps = [apart(np.array(seen[name]), reference.poses[name], radius) for name, radius in bodies.items()]
    worst = np.max(gaps, axis=0)
    return float(np.sqrt(np.mean(worst**2))) / way(reference, bodies) if np.all(np.isfinite(worst)) else math.inf


def way(reference: Reference, bodies: dict[str, float]) -> float:
    """Longest way [m] that any body comes."""
    return max(float(apart(reference.poses[name], reference.poses[name][:1], radius).max())
               for name, radius in bodies.items())


def stretch(gains: Coupling, handle, tool) -> float:
    """Energy in the coupling's spring [J]; handle and tool at poses (x, y, theta)."""
    x, y, theta = np.subtract(handle[:3], tool)
    return 0.5 * (gains.stiffness * (x * x + y * y) + gains.rotational_stiffness * theta * theta)


def clock(case: Case, method: str, step: int) -> float:
    """Time per simulated time, the best of some repeats.

    Of the one thread that does it: on an idle core that is wall time, on a busy one it leaves out what others do.
    """
    path, count, best, spent = case.path(), case.period // (1000 * step), math.inf, 0.0
    for repeat in range(REPEATS + 1):
        world = _ready(case, method, step)
        began = time.thread_time()
        world.follow(path, count)
        took = time.thread_time() - began
        spent += took
        if repeat > 0 or took > ENOUGH:  # the first fills caches
            best = min(best, took)
        if spent > ENOUGH and best < math.inf:
            break
    return best / case.seconds


def _ready(case, method, step):
    world = make(method, case.scene, step * 1e-6)
    world.couple(case.gains)
    return world


def _created(supplied, stored):
    """Largest fall of what has been dissipated: energy [J] that came from nowhere."""
    dissipated = supplied - (stored - stored[0])
    return float(np.max(np.maximum.accumulate(dissipated) - dissipated))
