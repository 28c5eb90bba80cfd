# SPDX-License-Identifier: Apache-2.0
"""What a step goes into [µs of the thread]: pieces of one of `partitioned`, and a whole one of `event_driven`.

Scenes of the speed_error bench halfway through, at 1 ms, each piece done again and again on the same state.
"""

import time
from typing import Annotated

import typer

from haptic_device.jit import kernel
from haptic_sim.method.constraints import add_joint_constraints
from haptic_sim.method.continuous_collision import add_collisions, start_collision_search
from haptic_sim.method.implicit_step import solve_constraints, unconstrained_velocity
from haptic_sim.method.stabilization import stabilize
from haptic_sim.method.sub_step import activate_within_reach, event_step, sub_step
from haptic_sim.method_registry import make
from haptic_sim.reduction import reduce_scene
from reference.case import NAMES, case

H, TIMES, REPEATS = 1e-3, 1000, 5


@kernel
def reach(models, layouts, works, times):
    """Which linkages the coupling can reach."""
    for _ in range(times):
        activate_within_reach(models[0], layouts[0], works[0], H)


@kernel
def free(models, layouts, works, times):
    """Velocities without contacts: reduced coordinates, coupling, springs."""
    for _ in range(times):
        unconstrained_velocity(models[0], layouts[0], works[0], H)


@kernel
def collide(models, layouts, works, times):
    """Which shapes meet on the way."""
    for _ in range(times):
        start_collision_search(models[0], layouts[0], works[0])
        add_collisions(models[0], layouts[0], works[0], 0)


@kernel
def contacts(models, layouts, works, times):
    """The contact problem, from its rows to the velocities."""
    model, layout, work = models[0], layouts[0], works[0]
    start_collision_search(model, layout, work)
    n = add_collisions(model, layout, work, add_joint_constraints(model, layout, work, 0, work.q, work.v, 1e9, H))
    for _ in range(times):
        solve_constraints(model, layout, work, n, H, 1.0)


@kernel
def joints_closed(models, layouts, works, times):
    """Joints closed again."""
    for _ in range(times):
        stabilize(models[0], layouts[0], works[0], 0)


@kernel
def held_step(models, layouts, works, times):
    """A whole step of `partitioned`."""
    for _ in range(times):
        sub_step(models[0], layouts[0], works[0], H)


@kernel
def flown_step(models, layouts, works, times):
    """A whole step of `event_driven`."""
    for _ in range(times):
        event_step(models[0], layouts[0], works[0], H)


PIECES = {
    "reach": reach,
    "free": free,
    "collide": collide,
    "contacts": contacts,
    "stabilize": joints_closed,
    "partitioned": held_step,
    "event_driven": flown_step,
}


def spent(of, name):
    """Least time of a piece [µs]."""
    method = make("event_driven" if name == "event_driven" else "partitioned", reduce_scene(of.scene), H)
    method.couple(of.gains)
    path = of.path()
    method.step(path[: len(path) // 2], max(1, round(of.period * 1e-9 / H)))
    best = float("inf")
    for _ in range(REPEATS):
        records = [record.copy() for record in method._records]
        reach(*records, 1)
        PIECES[name](*records, 1)
        began = time.thread_time()
        PIECES[name](*records, TIMES)
        best = min(best, (time.thread_time() - began) / TIMES)
    return 1e6 * best


def main(
    scenes: Annotated[list[str] | None, typer.Argument(help="Scenes with a reference; else all that move.")] = None,
) -> None:
    """What a step goes into [µs of the thread], one line a scene."""
    print(f"{'scene':14}" + "".join(f"{name:>13}" for name in PIECES))
    for name in scenes or [name for name in NAMES if case(name).moving]:
        print(f"{name:14}" + "".join(f"{spent(case(name), piece):13.2f}" for piece in PIECES), flush=True)
