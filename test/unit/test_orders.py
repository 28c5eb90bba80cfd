# SPDX-License-Identifier: Apache-2.0
"""Errors fall with the step at the order that each method claims: small problems with a known answer, one for each
thing a method integrates.

Order 1 is that of backward difference, which the coupling's passivity asks for, and of what Euler and Cromer do.
Between events, without a coupling, `partitioned` and `event_driven` are of order 8 in free flight and of order 4 in
contact.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.methods.world import make
from bench.reference.case import case
from bench.reference.reference import apart, reference
from haptic_sim.lockstep.rollout import rollout
from haptic_sim.protocol import STILL, held
from haptic_sim.scene.language import Scene

FINE, COARSE = (0.5e-3, 0.25e-3, 0.125e-3, 0.0625e-3), (50e-3, 25e-3, 12.5e-3)
SHORT = 50e-6, 25e-6, 12.5e-6  # for `impulse`, which takes longer ones in several


class Problem(NamedTuple):
    """What is integrated: a case or "rod"; method → the order expected; steps [s]."""

    case: str
    orders: dict[str, float]
    steps: tuple[float, ...]


PROBLEMS = {
    "a tool led by its coupling": Problem(
        "free_space",
        {"impulse": 1, "penalty_explicit": 1, "penalty_implicit": 1, "partitioned": 1, "closed_form": 1},
        FINE,
    ),
    "a rigid wall, met and left": Problem("wall", {"partitioned": 1, "closed_form": 1}, FINE),
    "a four-bar linkage let go": Problem("four_bar_free", {"partitioned": 8, "event_driven": 8}, COARSE),
    "a rod whose end slides on a floor": Problem("rod", {"partitioned": 4, "event_driven": 4}, COARSE),
}


def error_of_case(of, method, step):
    """Root mean square distance of the moving bodies from the answer [m] over the looks of the first half second."""
    world = make(method, of.scene, step)
    world.couple(of.gains)
    bodies, exact = of.bodies(), reference(of.name).poses
    path = of.path()[: round(0.5e9) // of.period + 1]
    poses = rollout(world, path, round(of.period * 1e-9 / step), of.look // of.period, bodies=bodies).poses
    gaps = [apart(poses[name], exact[name][: len(poses[name])], radius) for name, radius in bodies.items()]
    return float(np.sqrt(np.mean(np.max(gaps, axis=0)[1:] ** 2)))


def error_of_rod(method, step):
    """A rod of 1 m whose end slides on a level floor without friction, 0.2 s from rest at 60°."""
    half, angle, time, g = 0.5, math.pi / 3.0, 0.2, 9.81
    rod = {"name": "rod", "mass": 1.0, "inertia": 1.0 / 12.0, "pose": [0.0, half * math.sin(angle), angle]}
    rod["shapes"] = [{"vertices": [[-half, 0.0], [0.0, -0.001], [half, 0.0], [0.0, 0.001]]}]
    floor = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    scene = {"name": "rod", "gravity": [0.0, -g], "bodies": [floor, rod], "tool": tool}
    world = make(method, Scene.model_validate(scene), step)
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
    name, orders, steps = PROBLEMS[problem]
    steps, claimed = SHORT if method == "impulse" else steps, orders[method]
    found = [error_of_rod(method, step) if name == "rod" else error_of_case(case(name), method, step) for step in steps]
    slope = float(np.polyfit(np.log(steps), np.log(found), 1)[0])
    assert 0.85 * claimed < slope < (1.2 if claimed == 1 else 1.3 * claimed)
