# SPDX-License-Identifier: Apache-2.0
"""Whether the method that a scene is given keeps the scene's bounds: it and the others that could have been chosen.

Error against a reference that is given, else against a converged solution that is made here, whose doubt is what twice
its step changes: where a scene is chaotic, that is more than any error.
"""

import math

import numpy as np

from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.error_metrics import (
    LOST,
    STABLE,
    UNSTABLE,
    Case,
    Reference,
    error_of,
    judge,
    longest_way,
    solution,
)
from haptic_sim.lockstep.rollout import GAINS, Exchanged, rollout
from haptic_sim.method_registry import make
from haptic_sim.reduction import ReducedScene, reduce_scene
from haptic_sim.reduction.measured import Measured
from haptic_sim.scene.language import Scene, load

OVERLAP, CREATED, LEAST = 1e-4, 0.01, 1e-3
"""m; share of the largest energy about; J that count as that where all is nearly at rest."""
CANDIDATES = ("closed_form", "impulse", "partitioned")
FINE = {"partitioned": (4000, 2000), "impulse": (10000, 5000)}
"""ns; the steps of a solution that is made here, by the first that can."""
SECONDS, LOOK = 1.0, 2_000_000  # s at most; ns between the looks

NOT_TOLD = "of drives too"  # what motors and belts give is not told from what is created
KEPT, BEYOND, OTHER = "kept", "**beyond**", ""  # bounds of the method that is chosen; another one has none
HEADS = "scene", "method", "step", "error", "reference to", "energy created", "overlap", "exchange", "bounds"


def case_of(name: str) -> Case:
    """A scene, a name or a file, as its own motion leads it. SceneError for no scene."""
    scene = load(name)
    return Case(scene.name, "", min(scene.motion.get("duration", SECONDS), SECONDS), scene, GAINS, True, LOOK)


def verify(case: Case, known: Reference | None = None) -> list[Measured]:
    """What the candidates do in a case, each at the step it would get, against what is known of it."""
    known, reduced = known or converged(case), reduce_scene(case.scene)
    methods = CANDIDATES if reduced.needs.axes is not None else CANDIDATES[1:]
    return [_measured(case, known, method) for method in dict.fromkeys((*methods, reduced.method))]


def within(row: Measured, error: float) -> bool:
    """Whether a row keeps the bounds of a scene that allows this error, as far as its reference can tell."""
    close = row.error <= error + row.doubt and row.overlap_m <= OVERLAP
    return row.status == STABLE and close and not row.created > CREATED


def converged(case: Case) -> Reference:
    """A reference made here, and how far twice its step is from it, root mean square [m]."""
    for method, steps in FINE.items():
        try:
            coarse, fine = (solution(case, method, step) for step in steps)
        except ValueError:
            continue
        known = Reference(fine, method, math.nan)
        return known._replace(doubt=error_of(coarse, known, case.bodies()) * longest_way(known, case.bodies()))
    raise ValueError(f"no method can model scene {case.name!r} alone")


def _measured(case: Case, known: Reference, method: str) -> Measured:
    reduced = reduce_scene(case.scene, method)
    step = reduced.sub_step
    doubt = known.doubt / longest_way(known, case.bodies())
    run = case.scene.name, method, 1e6 * step
    try:
        world = make(method, reduced, step)
    except ValueError as reason:
        return Measured(*run, math.nan, doubt, math.nan, math.nan, math.nan, f"cannot: {reason}")
    world.couple(case.gains)
    found = judge(case, known, world, round(case.period * 1e-9 / step))
    created = math.nan if case.scene.driven else found.created / max(found.scale, LEAST)
    status = STABLE if found.error < LOST else UNSTABLE
    return Measured(*run, found.error, doubt, created, found.penetration, exchange_time(case, reduced), status)


def exchange_time(case: Case, reduced: ReducedScene) -> float:
    """Median processor time of an exchange of 1 ms [us], sub-steps and answer."""
    path = case._replace(moving=True).path()
    world = Exchanged(Simulation(reduced), path[0], case.gains)
    return 1e6 * float(np.median(rollout(world, path).spent))


def assessment_of(scene: Scene, row: Measured) -> str:
    """Of the method that is chosen, whether it keeps the scene's bounds."""
    if row.method != reduce_scene(scene).method:
        return OTHER
    return KEPT if within(row, scene.error) else BEYOND


def markdown(rows: list[Measured], assessments: list[str]) -> str:
    """A row a method; the last column says of the one that is chosen whether it keeps the scene's bounds."""
    cells = [HEADS, ["---"] * len(HEADS)]
    for row, said in zip(rows, assessments, strict=True):
        figures = (
            [row.status] + [""] * 4
            if math.isnan(row.error)
            else [
                f"{row.error:.1e}",
                f"{row.doubt:.0e}",
                NOT_TOLD if math.isnan(row.created) else f"{row.created:.0e}",
                f"{row.overlap_m * 1e6:.2g} um",
                f"{row.exchange_us:.0f} us",
            ]
        )
        cells.append([row.scene, row.method, f"{row.step_us * 1e-3:g} ms", *figures, said])
    return "\n".join(f"| {' | '.join(cell)} |" for cell in cells)
