# SPDX-License-Identifier: Apache-2.0
"""Methods that claim discrete-time passivity, against handles that look for energy."""

import numpy as np
import pytest
from examples import tries
from scipy.optimize import minimize

from haptic_sim.method.partitioned import Partitioned
from haptic_sim.method.penalty_explicit import PenaltyExplicit
from haptic_sim.method_registry import METHODS, make
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.joints import RotaryMotor
from haptic_sim.scene.language import Scene, load

H, STEPS = 1e-3, 3
STILL = (0.0, 0.0, 0.0)
GAINS = [Coupling(2000.0, 2.0, 2.0, 0.002), Coupling(2e5, 0.0, 50.0, 0.0)]


def crowded(restitution=0.4):
    """A square tool between a floor, a wall and a loose block with friction and rebound."""
    floor = {"name": "floor", "fixed": True, "material": "m", "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    wall = {
        "name": "wall",
        "fixed": True,
        "material": "m",
        "pose": [-0.15, 0.5, 0.0],
        "shapes": [{"box": {"size": [0.1, 1.0]}}],
    }
    block = {
        "name": "block",
        "mass": 0.2,
        "material": "m",
        "pose": [0.1, 0.02, 0.0],
        "shapes": [{"box": {"size": [0.06, 0.04]}}],
    }
    tool = {"mass": 0.1, "material": "m", "pose": [0.0, 0.05, 0.0], "shapes": [{"box": {"size": [0.04, 0.03]}}]}
    return Scene.model_validate(
        {
            "name": "crowded",
            "materials": {"m": {"friction": 0.3, "restitution": restitution}},
            "bodies": [floor, wall, block],
            "tool": tool,
        }
    )


def cornered():
    """A round tool in a frictionless corner."""
    walls = [
        {"name": name, "fixed": True, "shapes": [{"half_plane": {"normal": normal, "point": [-0.02, -0.02]}}]}
        for name, normal in (("floor", [0.0, 1.0]), ("wall", [1.0, 0.0]))
    ]
    return Scene.model_validate(
        {"name": "cornered", "bodies": walls, "tool": {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}}
    )


def made(name, gains):
    elastic = name.startswith("penalty")
    method = make(name, reduce_scene(cornered() if name == "closed_form" else crowded(0.0 if elastic else 0.4)), H)
    method.couple(gains)
    return method


def least_loss(method, places):
    """Least that an exchange was given beyond what the world gained [J], while the handle jumps from place to place."""
    method.reset()
    stored, least = sum(method.energy()), np.inf
    for x, y, angle in places:
        handle = 0.1 * x, 0.1 * y, 2.0 * angle
        supplied = method.step(held(handle), STEPS).supplied
        before, stored = stored, sum(method.energy())
        least = min(least, supplied - (stored - before))
    return least


def worst_found(method):
    """An adversary that improves random motions of the handle by Powell's method."""

    def loss(flat):
        return least_loss(method, np.tanh(flat).reshape(-1, 3))

    def found(seed):
        first = np.random.default_rng(seed).normal(size=30)
        return minimize(loss, first, method="Powell", options={"maxfev": tries(75)}).fun

    return min(map(found, range(2)))


@pytest.mark.parametrize("gains", GAINS)
@pytest.mark.parametrize("name", ["partitioned", "closed_form"])
def test_a_passive_method_gives_no_more_than_it_was_given_to_a_handle_that_looks_for_it(name, gains):
    method = made(name, gains)
    assert method.passive
    force = 0.3 * gains.stiffness + 1.0  # the farthest jump
    assert worst_found(method) >= -1e-9 - 4e-12 * force


def test_implicit_contacts_stiffer_than_the_coupling_are_passive_and_softer_ones_let_it_through_and_gain():
    stiff, soft = made("penalty_implicit", GAINS[0]), made("penalty_implicit", GAINS[1])
    assert worst_found(stiff) >= -1e-9
    assert worst_found(soft) < -1.0


def test_the_adversary_finds_energy_in_contacts_that_are_stepped_explicitly():
    stiffness = 0.5 * 0.1 / H**2  # an eighth of the limit of stability
    method = PenaltyExplicit(reduce_scene(crowded(0.0)), H, stiffness, 0.0)
    method.couple(GAINS[0])
    assert worst_found(method) < -1e-6


def test_every_method_says_whether_it_is_passive():
    assert {name: made(name, GAINS[0]).passive for name in METHODS} == {
        "impulse": False,
        "penalty_explicit": False,
        "penalty_implicit": False,
        "partitioned": True,
        "event_driven": False,
        "closed_form": True,
    }


@pytest.mark.parametrize("gains", GAINS)
@pytest.mark.parametrize("speed", [0.5, -20.0])
def test_a_crowd_on_a_belt_gains_no_more_than_the_port_supplies_and_the_belt_works(speed, gains):
    """A belt works the force that drags the crowd times its own speed; the handle jumps at random."""
    scene = crowded()
    belt, *others = scene.bodies
    belt = belt.model_copy(update={"surface_velocity": (speed, 0.0)})
    method = Partitioned(reduce_scene(scene.model_copy(update={"bodies": (belt, *others)})), H)
    method.couple(gains)
    rng, largest, worst, works = np.random.default_rng(3), 0.0, np.inf, 0.0
    for _ in range(300):
        handle = rng.uniform(-0.1, 0.1), rng.uniform(-0.05, 0.05), rng.uniform(-1.0, 1.0)
        for _ in range(int(rng.integers(1, 8))):
            stored = sum(method.energy())
            given = method.step(held(handle), 1).supplied
            work = sum(H * speed * one.force_on_a[0] for one in method.contacts() if one.body_b == "floor")
            gained = sum(method.energy()) - stored
            largest = max(largest, abs(given + work), abs(gained), 1.0)
            worst, works = min(worst, given + work - gained), works + abs(work)
    assert works > 0.01
    assert worst >= -1e-9 * largest


def driven_four_bar(torque, speed, h):
    """The four-bar linkage on a coupling without damping, its crank turned by a motor unless the torque is 0."""
    scene = load("four_bar")
    crank, *others = scene.joints
    motor = RotaryMotor(speed=speed, max_torque=torque) if torque else None
    method = Partitioned(
        reduce_scene(scene.model_copy(update={"joints": (crank.model_copy(update={"motor": motor}), *others)})), h
    )
    method.couple(Coupling(2000.0, 0.0, 0.0, 0.0))
    return method


@pytest.mark.parametrize("h", [0.25e-3, 2e-3])
@pytest.mark.parametrize(("torque", "speed"), [(0.0, 0.0), (1e-12, 1e4), (0.02, 1e4), (0.02, -1e4), (1.0, 1e4)])
def test_a_linkage_gains_no_more_than_the_port_supplies_and_its_motor_works(torque, speed, h):
    """A motor that never reaches its speed works torque times angle; the handle jumps at random."""
    rng, method, largest, worst = np.random.default_rng(1), driven_four_bar(torque, speed, h), 0.0, np.inf
    for _ in range(300):
        handle = rng.uniform(-0.08, 0.0), rng.uniform(-0.04, 0.04), 0.0
        stored, angle = sum(method.energy()), method.pose("crank")[2]
        given = method.step(held(handle), int(rng.integers(1, 8))).supplied
        given += np.sign(speed) * torque * (method.pose("crank")[2] - angle)
        gained = sum(method.energy()) - stored
        largest, worst = max(largest, abs(given), abs(gained)), min(worst, given - gained)
    assert worst >= -1e-12 * largest
