# SPDX-License-Identifier: Apache-2.0
"""Rebounds by the compiled methods, of free bodies and of what the coupling holds, against closed forms."""

import math

import numpy as np
import pytest
from examples import half

from haptic_sim.method.event_driven import EventDriven
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

G, H = 9.81, 1e-3
BOTH = [Partitioned, EventDriven]
GAINS = Coupling(2000.0, 2.0, 2.0, 0.002)


def turned(degrees, x, y):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [c * x - s * y, s * x + c * y]


def plane(kind, degrees, restitution, bodies, tool, gravity=G, h=H, friction=0.0):
    """Bodies over a floor through the origin, all of one material, in a plane turned by `degrees`."""

    def placed(body):
        x, y, *_ = body["pose"]
        velocity = turned(degrees, *body.get("velocity", [0.0, 0.0])[:2])
        pose = [*turned(degrees, x, y), math.radians(degrees)]
        return {**body, "material": "m", "pose": pose, "velocity": [*velocity, 0.0]}

    floor = {"name": "floor", "fixed": True, "material": "m"}
    floor["shapes"] = [{"half_plane": {"normal": turned(degrees, 0.0, 1.0)}}]
    scene = {"name": "t", "materials": {"m": {"restitution": restitution, "friction": friction}}}
    scene |= {"gravity": turned(degrees, 0.0, -gravity), "bodies": [floor, *map(placed, bodies)], "tool": placed(tool)}
    return kind(reduce_scene(Scene.model_validate(scene)), h)


def disc(radius, x, y, speed=0.0, **more):
    shapes = [{"circle": {"radius": radius}}]
    return {"mass": 1.0, "pose": [x, y, 0.0], "velocity": [0.0, speed], "shapes": shapes, **more}


def height(pose, degrees):
    return turned(-degrees, *pose[:2])[1]


@half("degrees, radius, tool", [0.0, 37.0, 90.0], [0.05, 0.005], ["far", "beside it"])
def test_a_ball_that_loses_nothing_comes_back_to_its_height_but_for_a_few_steps_of_its_fall(degrees, radius, tool):
    """To within rounding where it is free; a backward difference near the tool takes gravity's work of one step."""
    fall, aside = 0.5, radius + 0.01 + (0.001 if tool == "beside it" else 1.0)
    held_at = [*turned(degrees, aside, radius + 0.01), math.radians(degrees)]
    ball, grip = disc(radius, 0.0, radius + fall, name="ball"), disc(0.01, aside, radius + 0.01, mass=0.1)
    method = plane(Partitioned, degrees, 1.0, [ball], grip)
    method.couple(GAINS)
    v = math.sqrt(2.0 * G * fall)
    heights, energies = [], [sum(method.energy())]
    for _ in range(round(2.0 * v / G / H)):
        method.step(held(held_at), 1)
        heights.append(height(method.pose("ball"), degrees) - radius)
        energies.append(sum(method.energy()))
    struck = int(np.argmin(heights))
    assert 0.9 * v / G < struck * H < 1.1 * v / G
    assert max(heights[struck:]) == pytest.approx(fall, abs=4.0 * H * v if tool == "beside it" else 1e-6)
    assert max(energies) <= energies[0] + 1e-2


@pytest.mark.parametrize("degrees", [0.0, 37.0])
@pytest.mark.parametrize("mass", [0.1, 2.0])
def test_the_rebound_of_a_held_tool_grows_steadily_with_restitution_up_to_one(degrees, mass):
    """1 m/s against a wall, the handle with it and then inside: e up to what the coupling's push leaves, no jump."""
    speeds, steps = [], [0.5, 0.7, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999, 0.9995, 0.9999, 1.0]
    for e in steps:
        method = plane(Partitioned, degrees, e, [], disc(0.01, 0.0, 0.02, -1.0, mass=mass), 0.0, 250e-6)
        method.couple(Coupling(200.0, 1.0, 0.0, 0.0))
        start, supplied = sum(method.energy()), 0.0
        rates = [-1.0]
        for k in range(100):
            handle = [*turned(degrees, 0.0, max(0.02 - 250e-6 * k, 0.005)), math.radians(degrees)]
            supplied += method.step(held(handle), 1).supplied
            assert sum(method.energy()) - start <= supplied + 1e-9
            rates.append(turned(-degrees, *method.velocity[:2])[1])
        struck = int(np.argmax(np.diff(rates)))
        speeds.append(-rates[struck + 1] / rates[struck])
    assert speeds == pytest.approx(np.minimum(steps, speeds[-1]).tolist(), abs=1e-9)
    assert 0.995 < speeds[-1] < 1.0


@pytest.mark.parametrize("degrees", [0.0, 37.0])
@pytest.mark.parametrize("push", [0.05, 0.5, 5.0])
def test_a_pressed_tool_rebounds_by_the_largest_restitution_that_the_push_lets_be_passive(degrees, push):
    """e' = √(1 + k²) − k of e = 1, k = |f| h/(m v), but for what the push changes within the step, 2 h² K/m of v."""
    m, v, h = 0.1, 0.5, 1e-3
    stiffness = 200.0
    method = plane(Partitioned, degrees, 1.0, [], disc(0.01, 0.0, 0.01 + 1e-6, -v, mass=m), 0.0, h)
    method.couple(Coupling(stiffness, 0.0, 0.0, 0.0))
    method.step(held([*turned(degrees, 0.0, 0.01 - push / stiffness), math.radians(degrees)]), 1)
    k = push * h / (m * v)
    rebound = turned(-degrees, *method.velocity[:2])[1] / v
    assert rebound == pytest.approx(math.sqrt(1.0 + k * k) - k, abs=2.0 * h * h * stiffness / m)


@pytest.mark.parametrize("e", [0.3, 0.9, 1.0])
@pytest.mark.parametrize("kind", BOTH)
def test_an_elastic_tool_pressed_to_a_wall_comes_to_rest_there(kind, e):
    method = plane(kind, 0.0, e, [], disc(0.01, 0.0, 0.02, mass=0.1), 0.0)
    method.couple(Coupling(200.0, 5.0, 0.0, 0.0))
    for _ in range(3000):
        method.step(held((0.0, 0.0, 0.0)), 1)
    assert method.position[1] == pytest.approx(0.01, abs=1e-4) and abs(method.velocity[1]) < 2e-2


@pytest.mark.parametrize("degrees", [0.0, 37.0])
@pytest.mark.parametrize("friction", [0.0, 0.5, 2.0])
def test_no_impact_of_a_rough_rod_gains_energy_and_less_restitution_never_means_none(degrees, friction):
    """Where the whole restitution would gain with friction, a part of it stays: the end struck parts."""
    theta = math.radians(40.0)
    for e in (0.5, 0.9, 1.0):
        rod = {"name": "rod", "mass": 1.0, "inertia": 1.0 / 12.0, "pose": [0.0, 1.0, 0.0], "velocity": [-2.0, -1.0]}
        c, s = math.cos(theta), math.sin(theta)
        slim = [[-0.5, 0.0], [0.0, -0.001], [0.5, 0.0], [0.0, 0.001]]
        rod["shapes"] = [{"vertices": [[c * x - s * y, s * x + c * y] for x, y in slim]}]
        rod["pose"] = [0.0, 0.5 * s + 1e-4, 0.0]
        method = plane(Partitioned, degrees, e, [rod], disc(0.01, 50.0, 50.0), 0.0, friction=friction)
        before = sum(method.energy())
        method.step(held((0.0, 0.0, 0.0)), 2)
        (_, _, angle), (vx, vy, turning) = method.bodies()[1]
        arm = turned(math.degrees(angle) + 40.0, -0.5, 0.0)
        vx, vy = vx - turning * arm[1], vy + turning * arm[0]
        assert turned(-degrees, vx, vy)[1] > 0.05
        assert sum(method.energy()) <= before * (1.0 + 1e-9)
