# SPDX-License-Identifier: Apache-2.0
"""The impulse method: nothing goes through anything, joints, start velocities, and rebounds that the port can pay."""

import math
import re
from pathlib import Path

import pytest
from scipy.special import ellipk

from haptic_sim.method import Coupling
from haptic_sim.method.registry import make
from haptic_sim.scene import Scene
from haptic_sim.world import World

H, G = 0.25e-3, 9.81
ONE = 50e-6  # a sub-step that is one step
STILL = (0.0, 0.0, 0.0)
BALL = [{"circle": {"radius": 0.01}}]
FAR = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": BALL}
PLATE = {"name": "plate", "fixed": True, "material": "m", "shapes": [{"box": {"size": [0.001, 1.0]}}]}


def world(bodies, h=H, friction=0.0, restitution=0.0, tool=FAR, **more):
    materials = {"m": {"friction": friction, "restitution": restitution}}
    return World(Scene.model_validate({"name": "t", "materials": materials, "tool": tool,
                                         "bodies": [{"material": "m", **body} for body in bodies], **more}), h)


def run(method, count, handle=STILL):
    for _ in range(count):
        method.step(handle, STILL)
    return method


@pytest.mark.parametrize("shape", [BALL, [{"box": {"size": [0.02, 0.004], "angle": 0.4}}]])
@pytest.mark.parametrize("speed", [5.0, 50.0, 5000.0])
def test_a_thin_plate_is_not_passed_at_any_speed_whatever_the_phase(speed, shape):
    for phase in range(10):
        shot = {"name": "shot", "mass": 0.01, "velocity": [speed, 0.0, 0.0], "shapes": shape,
                "pose": [-0.03 - 0.1 * phase * speed * H, 0.0, 0.0]}
        method = world([PLATE, shot])
        before = method.energy()[0]
        run(method, 60)
        assert method.pose("shot")[0] < 0.0, phase
        assert method.energy()[0] <= before * (1.0 + 1e-9), phase


@pytest.mark.parametrize("speed", [5.0, 500.0])
def test_the_tool_is_not_pulled_through_a_thin_plate_by_a_handle_that_jumps(speed):
    tool = {"mass": 0.01, "pose": [-0.02, 0.0, 0.0], "velocity": [speed, 0.0, 0.0], "shapes": BALL, "material": "m"}
    method = world([PLATE], tool=tool)
    method.couple(Coupling(5000.0, 5.0, 1.0, 0.01))
    deepest = max(run(method, 1, (0.05, 0.0, 0.0)).position[0] + 0.01 + 0.0005 for _ in range(200))
    assert deepest < 1e-5


def test_a_bar_that_spins_fast_does_not_cut_through_a_thin_plate():
    bar = {"name": "bar", "mass": 0.01, "pose": [-0.06, 0.0, 1.57], "velocity": [0.0, 0.0, -900.0],
           "shapes": [{"box": {"size": [0.16, 0.004]}}]}
    method = world([PLATE, bar])
    for _ in range(200):
        run(method, 1)
        x, y, angle = method.pose("bar")
        tips = [x + end * 0.08 * math.cos(angle) for end in (-1.0, 1.0)]
        assert x < 0.0 and max(tips) < 2e-3


def pendulum(h, angle):
    rod = {"name": "rod", "mass": 1.0, "inertia": 1.0 / 12.0, "shapes": [{"box": {"size": [1.0, 0.01]}}],
           "pose": [0.5 * math.cos(angle), 0.5 * math.sin(angle), angle]}
    return world([rod], h, gravity=[0.0, -G], joints=[{"type": "pin", "bodies": ["world", "rod"], "at": [0.0, 0.0]}])


def test_a_pendulum_at_90_degrees_keeps_its_period_to_a_thousandth():
    whole = 4.0 * math.sqrt((1.0 / 3.0) / (G * 0.5)) * ellipk(0.5)
    method, count = pendulum(1e-4, 0.0), 0
    falling = True
    while falling or method._bodies[1].angular_velocity < 0.0:
        falling = method._bodies[1].angular_velocity <= 0.0 and count < round(0.3 * whole / 1e-4)
        run(method, 1)
        count += 1
    assert 2.0 * count * 1e-4 == pytest.approx(whole, rel=1e-3)


def test_a_start_velocity_is_there_in_the_first_sub_step_and_kept_without_forces():
    shot = {"name": "shot", "mass": 1.0, "pose": [1.0, 2.0, 0.5], "velocity": [0.3, -0.2, 4.0], "shapes": BALL}
    method = run(world([shot], tool=FAR | {"velocity": [1.0, 0.0, 2.0]}), 40)
    t = 40 * H
    assert method.pose("shot") == pytest.approx((1.0 + 0.3 * t, 2.0 - 0.2 * t, 0.5 + 4.0 * t), rel=1e-12)
    assert method.position == pytest.approx((50.0 + t, 50.0, 2.0 * t), rel=1e-12)


def test_a_slider_goes_along_its_axis_only_and_stops_at_its_limit():
    sled = {"name": "sled", "mass": 1.0, "velocity": [0.8, 0.6, 0.0], "shapes": BALL}
    joint = {"type": "slider", "bodies": ["world", "sled"], "at": [0.0, 0.0], "axis": [0.8, 0.6],
             "limits": [-1.0, 0.05]}
    method = run(world([sled], joints=[joint], gravity=[3.0, -4.0]), 100)
    x, y, angle = method.pose("sled")
    assert (0.8 * y - 0.6 * x, angle) == pytest.approx((0.0, 0.0), abs=1e-6)
    x, y, _ = run(method, 400).pose("sled")
    assert 0.8 * x + 0.6 * y == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize(("torque", "turns"), [(0.99, True), (1.01, False)])
def test_friction_on_a_pin_holds_just_up_to_its_torque(torque, turns):
    arm = {"name": "arm", "mass": 1.0, "pose": [0.5, 0.0, 0.0], "shapes": [{"box": {"size": [0.1, 0.1]}}]}
    joint = {"type": "pin", "bodies": ["world", "arm"], "at": [0.0, 0.0], "friction_torque": torque * 0.5 * G}
    method = run(world([arm], joints=[joint], gravity=[0.0, -G]), 400)
    assert (abs(method.pose("arm")[2]) > 1e-4) == turns


def test_a_motor_turns_at_its_speed():
    arm = {"name": "arm", "mass": 1.0, "pose": [0.5, 0.0, 0.0], "shapes": [{"box": {"size": [0.1, 0.1]}}]}
    joint = {"type": "pin", "bodies": ["world", "arm"], "at": [0.0, 0.0], "motor": {"speed": 2.0, "max_torque": 100.0}}
    method = run(world([arm], joints=[joint]), 800)
    assert method._bodies[1].angular_velocity == pytest.approx(2.0, rel=1e-6)


def test_a_spring_swings_at_its_frequency_and_its_energy_is_booked():
    ball = {"name": "ball", "mass": 1.0, "pose": [0.35, 0.0, 0.0], "shapes": BALL}
    spring = {"type": "spring", "bodies": ["world", "ball"], "anchors": [[0.0, 0.0], [0.0, 0.0]], "stiffness": 400.0,
              "rest": 0.3}
    method = world([ball], 1e-4, joints=[spring])
    start = sum(method.energy())
    assert start == pytest.approx(0.5 * 400.0 * 0.05**2)
    run(method, round(math.pi / 20.0 / 1e-4))
    assert method.pose("ball")[0] == pytest.approx(0.25, abs=1e-4)
    assert sum(method.energy()) == pytest.approx(start, rel=1e-2)


def test_welded_bodies_move_as_one_and_bodies_on_other_layers_pass_through():
    one = {"name": "one", "mass": 1.0, "pose": [-0.2, 0.0, 0.0], "velocity": [1.0, 0.0, 0.0], "shapes": BALL}
    two = one | {"name": "two", "pose": [-0.2, 0.3, 0.0]}
    ghost = one | {"name": "ghost", "pose": [-0.2, -0.3, 0.0], "layers": [5]}
    weld = {"type": "weld", "bodies": ["one", "two"], "at": [-0.2, 0.1]}
    method = run(world([PLATE | {"shapes": [{"box": {"size": [0.001, 0.1]}}]}, one, two, ghost], joints=[weld]), 1200)
    (ax, ay, _), (bx, by, _) = method.pose("one"), method.pose("two")
    assert math.hypot(ax - bx, ay - by) == pytest.approx(0.3, rel=1e-9)
    assert method.pose("ghost")[0] == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize(("part", "rebounds"), [(1.02, True), (0.98, False)])
def test_an_impact_rebounds_only_above_the_speed_that_keeps_the_port_passive(part, rebounds):
    """v₀ = 2 |f| T e/(m (1 − e²)): the push f of the coupling over a sub-step T."""
    e, mass, stiffness, stretch = 0.5, 0.1, 2000.0, 0.01
    effective = mass + ONE * ONE * stiffness
    push = stiffness * stretch  # the handle is this far behind the wall
    speed = part * 2.0 * push * ONE * e / (mass * (1.0 - e * e)) * mass / effective
    tool = {"mass": mass, "pose": [-0.0105 + 5e-10, 0.0, 0.0], "velocity": [speed, 0.0, 0.0], "shapes": BALL,
            "material": "m"}  # a hair into the plate, at this speed
    method = world([PLATE], ONE, restitution=e, tool=tool)
    method.couple(Coupling(stiffness))
    method.step((-0.0105 + stretch, 0.0, 0.0), STILL)
    assert (method.velocity[0] < -1e-3) == rebounds


@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_a_block_on_a_belt_has_its_speed_after_v_over_mu_g_and_keeps_it(speed):
    belt = {"name": "belt", "fixed": True, "pose": [0.0, 0.0, math.pi], "surface_velocity": [-speed, 0.0],
            "shapes": [{"box": {"size": [10.0, 2.0], "center": [0.0, 1.0]}}]}
    block = {"name": "block", "mass": 1.0, "pose": [0.0, 0.05, 0.0], "shapes": [{"box": {"size": [0.2, 0.1]}}]}
    method, drag = world([belt, block], friction=0.4, gravity=[0.0, -G]), 0.4 * G
    assert abs(run(method, 400).pose("block")[0]) == pytest.approx(0.5 * drag * 0.1**2, rel=1e-3)
    assert run(method, 1600).pose("block")[0] == pytest.approx(speed * (0.5 - 0.5 * abs(speed) / drag), rel=1e-3)
    assert method.bodies()[1][1][0] == pytest.approx(speed, rel=1e-9)


def test_a_slow_belt_does_not_fall_asleep():
    belt = {"name": "belt", "fixed": True, "surface_velocity": [5e-5, 0.0], "material": "m",
            "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    block = {"name": "block", "mass": 1.0, "pose": [0.0, 0.05, 0.0], "shapes": [{"box": {"size": [0.2, 0.1]}}]}
    method = run(world([belt, block], friction=0.4, gravity=[0.0, -G]), 4000)
    assert method.pose("block")[0] == pytest.approx(5e-5, rel=1e-3)


@pytest.mark.parametrize("turned_round", [False, True])
@pytest.mark.parametrize(("part", "rises"), [(1.01, True), (0.99, False)])
def test_a_sliders_motor_lifts_its_load_at_its_speed_if_its_force_is_more_than_the_weight(part, rises, turned_round):
    """On a guide of 30°, up from its stop: a = (part − 1) g sin 30° until the speed is reached."""
    load = {"name": "load", "mass": 1.0, "pose": [0.0, 5.0, math.pi / 6], "shapes": [{"box": {"size": [0.1, 0.1]}}]}
    sign, bodies = (-1.0, ["load", "world"]) if turned_round else (1.0, ["world", "load"])
    guide = {"type": "slider", "bodies": bodies, "at": [0.0, 5.0], "axis": [math.sqrt(3.0), 1.0],
             "limits": [-1.0, 0.0] if turned_round else [0.0, 1.0],
             "motor": {"speed": sign * 0.02, "max_force": part * 0.5 * G}}
    method = run(world([load], joints=[guide], gravity=[0.0, -G]), 4000)
    x, y, _ = method.pose("load")
    start = 0.02 / (0.01 * 0.5 * G)
    assert math.hypot(x, y - 5.0) == pytest.approx(0.02 * (1.0 - 0.5 * start) if rises else 0.0, rel=1e-4, abs=1e-9)
    assert math.hypot(*method.bodies()[1][1][:2]) == pytest.approx(0.02 if rises else 0.0, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("drive", [{"motor": {"speed": 0.3, "max_force": 1.0}}, {"friction_force": 0.1}])
def test_a_slider_between_two_that_turn_is_driven_and_braked_along_its_axis_alone(drive):
    """A load on a carrier that spins, without gravity, against the direct solver: no part of the force goes across."""
    box = {"layers": [1], "shapes": [{"box": {"size": [0.1, 0.1]}}]}
    carrier = {"name": "carrier", "mass": 2.0, "inertia": 0.02, "velocity": [0.0, 0.0, 2.0], **box}
    load = {"name": "load", "mass": 1.0, "pose": [0.2, 0.0, 0.0], "velocity": [0.0, 0.4, 2.0], "inertia": 0.01, **box}
    method = world([carrier, load], joints=[{"type": "slider", "bodies": ["carrier", "load"], "at": [0.2, 0.0],
                                             "axis": [1.0, 0.0], **drive}])
    exact = make("partitioned", method.scene, H)
    for name in ("carrier", "load"):
        assert run(method, 400 if name == "carrier" else 0).pose(name) == pytest.approx(
            run(exact, 400 if name == "carrier" else 0).pose(name), abs=2e-5)


@pytest.mark.parametrize(("gap", "speeds"), [(-1e-10, (-1 / 3, 2 / 3, 2 / 3)), (1e-9, (0.0, 0.0, 1.0))])
def test_touching_discs_are_struck_at_once_and_those_a_nanometre_apart_one_by_one(gap, speeds):
    row = [{"name": name, "mass": 1.0, "pose": [x, 5.0, 0.0], "shapes": [{"circle": {"radius": 0.1}}],
            "velocity": [1.0 if name == "a" else 0.0, 0.0, 0.0]}
           for name, x in (("a", 0.0), ("b", 0.21), ("c", 0.41 + gap))]
    method = run(world(row, restitution=1.0), 400)
    assert [velocity[0] for _, velocity in method.bodies()[1:]] == pytest.approx(speeds, abs=1e-9)


def test_what_the_page_shows_to_add_moves_with_the_world_is_held_and_calls_back():
    """A ball that falls on the block, and is held by a string of 50 mm when it is thrown up."""
    page = (Path(__file__).parent.parent / "docs" / "methods.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], names)
    world, ball = names["world"], names["ball"]
    run(world, 2000)
    assert ball.position.y == pytest.approx(0.045, abs=1e-5) and names["struck"]
    world.space.gravity, world.body("block").velocity = (0.0, 0.0), (0.0, 0.0)
    ball.velocity = 0.0, 2.0
    run(world, 400)
    assert ball.position.y > 0.06
    assert ball.position.get_distance(world.body("block").position) <= 0.05 + 1e-3
    names["simulation"].reset()
    assert ball not in world.space.bodies
