# SPDX-License-Identifier: Apache-2.0
"""Errors fall with the step at the order that each method claims: small problems with a known answer, one for each
thing a method integrates.

Order 1 is that of backward difference, which the coupling's passivity asks for, and of what Euler and Cromer do.
Between events, without a coupling, `partitioned` is of order 8 in free flight and of order 4 in contact, and
`event_driven` so with one.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.methods.world import make
from bench.reference.case import Case, case
from bench.reference.exact_axis import Axis, axis_motion
from bench.reference.reference import apart, reference
from haptic_sim.method.penalty_explicit import PenaltyExplicit
from haptic_sim.method.penalty_implicit import PenaltyImplicit
from haptic_sim.protocol import STILL, Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import rollout
from haptic_sim.scene.language import Scene, load

FINE, COARSE = (0.5e-3, 0.25e-3, 0.125e-3, 0.0625e-3), (50e-3, 25e-3, 12.5e-3)
LED = 10e-3, 5e-3, 2.5e-3
SHORT = 50e-6, 25e-6, 12.5e-6  # for `impulse`, which takes longer ones in several
CONTACT = 1e4, 5.0
"""Stiffness [N/m] and damping [N s/m] of the elastic contact."""


class Problem(NamedTuple):
    """What is integrated; method → the order expected; steps [s]."""

    what: str
    orders: dict[str, float]
    steps: tuple[float, ...]


PROBLEMS = {
    "coupling": Problem(
        "a tool led by its coupling",
        {"impulse": 1, "penalty_explicit": 1, "penalty_implicit": 1, "partitioned": 1, "closed_form": 1},
        FINE,
    ),
    "rigid_contact": Problem("a rigid wall, met and left", {"partitioned": 1, "closed_form": 1}, FINE),
    "elastic_contact": Problem(
        "a tool pressed on an elastic wall", {"penalty_explicit": 1, "penalty_implicit": 1}, FINE
    ),
    "linkage": Problem("a four-bar linkage let go", {"impulse": 1, "penalty_explicit": 1, "penalty_implicit": 1}, FINE),
    "linkage_flight": Problem("a four-bar linkage let go", {"partitioned": 8, "event_driven": 8}, COARSE),
    "sliding_rod": Problem("a rod whose end slides on a floor", {"partitioned": 4, "event_driven": 4}, COARSE),
    "spring": Problem("a tool drawn to a handle at rest", {"event_driven": 8}, LED),
}


def errors(problem: str, method: str) -> list[float]:
    """Largest distance of the moving bodies from the answer at the end of the problem [m], a step each."""
    solve = {"elastic_contact": _elastic, "sliding_rod": _sliding, "spring": _drawn}.get(problem)
    steps = steps_of(problem, method)
    if solve:
        return [solve(method, step) for step in steps]
    name = {"coupling": "free_space", "rigid_contact": "wall"}.get(problem, "four_bar_free")
    return [_of_case(case(name), method, step) for step in steps]


def steps_of(problem: str, method: str) -> tuple[float, ...]:
    """Steps [s] in which a method takes a problem."""
    return SHORT if method == "impulse" else PROBLEMS[problem].steps


def order(steps, found) -> float:
    """Slope of the straight line through log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(found), 1)[0])


def _of_case(of: Case, method, step):
    """Root mean square over the looks of the first half second."""
    world = make(method, of.scene, step)
    world.couple(of.gains)
    bodies, exact = of.bodies(), reference(of.name).poses
    path = of.path()[: round(0.5e9) // of.period + 1]
    poses = rollout(world, path, round(of.period * 1e-9 / step), of.look // of.period, bodies=bodies).poses
    gaps = [apart(poses[name], exact[name][: len(poses[name])], radius) for name, radius in bodies.items()]
    return float(np.sqrt(np.mean(np.max(gaps, axis=0)[1:] ** 2)))


def _elastic(method, step):
    """Mass on coupling and contact: one oscillator, pressed from the touch on by a handle 1 mm behind."""
    scene, gains, time, press = load("wall"), Coupling(2000.0, 2.0, 0.0, 0.0), 0.02, 1e-3
    radius = scene.tool.shapes[0].radius
    scene = scene.model_copy(update={"tool": scene.tool.model_copy(update={"pose": (radius, 0.0, 0.0)})})
    world = {"penalty_explicit": PenaltyExplicit, "penalty_implicit": PenaltyImplicit}[method](
        reduce_scene(scene), step, *CONTACT
    )
    world.couple(gains)
    world.step(held((radius - press, 0.0, 0.0)), round(time / step))
    whole = gains.stiffness + CONTACT[0]
    axis = Axis(scene.tool.mass, whole, gains.damping + CONTACT[1])
    rest = np.full(2, -press * gains.stiffness / whole)
    return abs(world.position[0] - radius - axis_motion(axis, rest, np.zeros(2), time, 0.0)[1])


def _drawn(method, step):
    """A tool 10 mm beside a handle that does not move."""
    scene, gains, time, beside = load("free_space"), Coupling(2000.0, 2.0, 0.0, 0.0), 0.1, 0.01
    scene = scene.model_copy(update={"tool": scene.tool.model_copy(update={"pose": (beside, 0.0, 0.0)})})
    world = make(method, scene, step)
    world.couple(gains)
    world.step(held(STILL), round(time / step))
    exact = axis_motion(Axis(scene.tool.mass, *gains[:2]), np.zeros(2), np.zeros(2), time, beside)[1]
    return abs(world.pose("tool")[0] - exact)


def _sliding(method, step):
    """A rod of 1 m whose end slides on a level floor without friction, 0.2 s from rest at 60°."""
    half, angle, time, g = 0.5, math.pi / 3.0, 0.2, 9.81
    rod = {
        "name": "rod",
        "mass": 1.0,
        "inertia": 1.0 / 12.0,
        "pose": [0.0, half * math.sin(angle), angle],
        "shapes": [{"vertices": [[-half, 0.0], [0.0, -0.001], [half, 0.0], [0.0, 0.001]]}],
    }
    floor = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    world = make(
        method, Scene.model_validate({"name": "rod", "gravity": [0.0, -g], "bodies": [floor, rod], "tool": tool}), step
    )
    world.step(held(STILL), round(time / step))

    def rate(_, state):
        turn, speed = state
        s, c = math.sin(turn), math.cos(turn)
        return speed, half * c * (half * s * speed * speed - g) / (1.0 / 12.0 + half * half * c * c)

    exact = solve_ivp(rate, (0.0, time), (angle, 0.0), "DOP853", rtol=1e-13, atol=1e-14).y[0, -1]
    return half * abs(world.pose("rod")[2] - exact)


CLAIMED = [(problem, method) for problem, of in PROBLEMS.items() for method in of.orders]


@pytest.mark.parametrize(("problem", "method"), CLAIMED)
def test_errors_fall_with_the_step_at_the_order_of_the_method(problem, method):
    """First order from both sides; a high one may be exceeded while errors of lower order are out of sight."""
    claimed, found = PROBLEMS[problem].orders[method], errors(problem, method)
    slope = order(steps_of(problem, method), found)
    assert slope > 0.85 * claimed
    assert slope < (1.2 if claimed == 1 else 1.3 * claimed)
