# SPDX-License-Identifier: Apache-2.0
"""One run of a case: how wrong, how much energy from nowhere, how deep, how fast.

Two passes. The judged one goes from hand sample to hand sample, energies booked, places compared with the reference
every 10 ms, overlaps measured with the shapes. The timed one takes the whole path in one call where the world can, so
that no one's glue is timed; the best of some repeats counts.
"""

import math
from typing import NamedTuple

from bench.methods.world import Impossible, make
from haptic_sim.lockstep.error_metrics import LOST, STABLE, UNSTABLE, Case, Reference, judge
from haptic_sim.lockstep.rollout import rollout

REPEATS, ENOUGH = 5, 0.25  # times, s


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


def run(case: Case, reference: Reference, method: str, step: int) -> Run:
    """A method or peer on a case at this step [µs]."""
    try:
        judged = judge(case, reference, _ready(case, method, step), case.period // (1000 * step))
        wall = clock(case, method, step)
    except Impossible as reason:
        return Run(case.name, case.kind, method, step, *[math.nan] * 5, f"cannot: {reason}")
    status = STABLE if judged.error < LOST else UNSTABLE
    return Run(case.name, case.kind, method, step, wall, *judged, status)


def clock(case: Case, method: str, step: int) -> float:
    """Time per simulated time, the best of some repeats.

    Of the one thread that does it: on an idle core that is wall time, on a busy one it leaves out what others do.
    """
    path, count, best, spent = case.path(), case.period // (1000 * step), math.inf, 0.0
    for repeat in range(REPEATS + 1):
        took = float(rollout(_ready(case, method, step), path, count, stride=len(path) - 1).spent[0])
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
