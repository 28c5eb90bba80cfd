# SPDX-License-Identifier: Apache-2.0
"""Whether the method that a scene is given keeps the scene's bounds: it and the others that could have been chosen.

Error against the reference of a case (closed form, or a stored solution), else against a converged solution that is
made here, whose doubt is what twice its step changes: where a scene is chaotic, that is more than any error.
"""

import math
import statistics
import time

from haptic_sim.bench import case as cases
from haptic_sim.bench import hard
from haptic_sim.bench import reference as references
from haptic_sim.bench.measure import LOST, STABLE, UNSTABLE, error_of, judge, way
from haptic_sim.bench.world import Impossible, make
from haptic_sim.compile import compile_scene
from haptic_sim.compile.measured import Measured
from haptic_sim.scene import load
from haptic_sim.simulation import HandleSample, Simulation

CANDIDATES = ("closed_form", "impulse", "partitioned")
FINE = {"partitioned": (4000, 2000), "impulse": (10000, 5000)}
"""ns; the steps of a solution that is made here, by the first that can."""
SECONDS, LOOK = 1.0, 2_000_000  # s at most, of a scene without a case of its own; ns between the looks


def verify(name: str) -> list[Measured]:
    """What the candidates do on a scene, a name or a file, each at the step it would get. SceneError for no scene."""
    known = references.reference(name) if name in cases.NAMES else None
    case = cases.case(name) if known else _case(name)
    known = known or _converged(case)
    compiled = compile_scene(case.scene)
    methods = CANDIDATES if compiled.needs.axes is not None else CANDIDATES[1:]
    return [_measured(case, known, method) for method in dict.fromkeys((*methods, compiled.method))]


def within(row: Measured, error: float) -> bool:
    """Whether a row keeps the bounds of a scene that allows this error, as far as its reference can tell."""
    return (row.status == STABLE and row.error <= error + row.doubt
            and row.created <= hard.CREATED and row.overlap_m <= hard.OVERLAP)


def _case(name):
    """The case of a hard scene, or of one of the user's."""
    if name in hard.NAMES:
        return hard.case(name, LOOK)
    scene = load(name)
    seconds = min(scene.motion.get("duration", SECONDS), SECONDS)
    return cases.Case(scene.name, "", seconds, scene, cases.Coupling(*cases.GAINS), True, LOOK)


def _converged(case):
    """A reference made here, and how far twice its step is from it, root mean square [m]."""
    for method, steps in FINE.items():
        try:
            coarse, fine = (references.solution(case, method, step) for step in steps)
        except Impossible:
            continue
        known = references.Reference(fine, method, math.nan)
        return known._replace(doubt=error_of(coarse, known, case.bodies()) * way(known, case.bodies()))
    raise ValueError(f"no method can model scene {case.name!r} alone")


def _measured(case, known, method):
    step = compile_scene(case.scene, method).sub_step
    doubt = known.doubt / way(known, case.bodies())
    try:
        world = make(method, case.scene, step)
    except Impossible as reason:
        return Measured(case.scene.name, method, 1e6 * step, math.nan, doubt, math.nan, math.nan, math.nan,
                        f"cannot: {reason}")
    world.couple(case.gains)
    found = judge(case, known, world, round(case.period * 1e-9 / step))
    created = found.created / max(found.scale, hard.LEAST)
    return Measured(case.scene.name, method, 1e6 * step, found.error, doubt, created, found.penetration,
                    _exchange(case, method, step), STABLE if found.error < LOST else UNSTABLE)


def _exchange(case, method, step):
    """Median processor time of an exchange of 1 ms [us], sub-steps and answer."""
    simulation, spent = Simulation(case.scene, step, method=method), []
    for k, row in enumerate(case._replace(moving=True).path().tolist()):
        sample = HandleSample(k * cases.EXCHANGE, tuple(row[:3]), tuple(row[3:]), *case.gains)
        began = time.thread_time_ns()
        simulation.exchange(sample)
        spent.append((time.thread_time_ns() - began) * 1e-3)
    return statistics.median(spent)
