# SPDX-License-Identifier: Apache-2.0
"""The impulse method: nothing goes through anything, joints, start velocities, and rebounds that the port can pay."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from examples import half
from scipy.special import ellipk

from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling, held
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

H, G = 0.25e-3, 9.81
ONE = 50e-6  # a sub-step that is one step
STILL = (0.0, 0.0, 0.0)
BALL, SMALL = ([{"circle": {"radius": radius}}] for radius in (0.01, 2.5e-4))
FAR = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": BALL}


def world(bodies, h=H, friction=0.0, restitution=0.0, tool=FAR, **more):
    scene = {"name": "t", "materials": {"m": {"friction": friction, "restitution": restitution}}, "tool": tool, **more}
    scene["bodies"] = [{"material": "m", **body} for body in bodies]
    return PymunkWorld(reduce_scene(Scene.model_validate(scene)), h)


def body(name, x=0.0, y=0.0, angle=0.0, shapes=BALL, mass=1.0, **more):
    return {"name": name, "mass": mass, "pose": [x, y, angle], "shapes": shapes, **more}


def tool_at(x, speed=0.0, mass=0.1, shapes=BALL):
    """A tool of the bodies' material that moves along x."""
    return {"mass": mass, "pose": [x, 0.0, 0.0], "velocity": [speed, 0.0, 0.0], "shapes": shapes, "material": "m"}


def fixed(name, x=0.0, y=0.0, shapes=BALL, **more):
    return {"name": name, "fixed": True, "pose": [x, y, 0.0], "shapes": shapes, **more}


def box(width, height, **more):
    return [{"box": {"size": [width, height], **more}}]


def pin(a, b, x=0.0, y=0.0, **more):
    return {"type": "pin", "bodies": [a, b], "at": [x, y], **more}


PLATE = fixed("plate", shapes=box(0.001, 1.0))


def run(method, count, handle=STILL):
    for _ in range(count):
        method.step(held(handle), 1)
    return method


@pytest.mark.parametrize("shape", [BALL, box(0.02, 0.004, angle=0.4)])
@pytest.mark.parametrize("speed", [5.0, 50.0, 5000.0])
def test_a_thin_plate_is_not_passed_at_any_speed_whatever_the_phase(speed, shape):
    for phase in range(10):
        start = -0.03 - 0.1 * phase * speed * H
        method = world([PLATE, body("shot", start, shapes=shape, mass=0.01, velocity=[speed, 0.0, 0.0])])
        before = method.energy()[0]
        run(method, 60)
        assert method.pose("shot")[0] < 0.0, phase
        assert method.energy()[0] <= before * (1.0 + 1e-9), phase


@pytest.mark.parametrize("speed", [5.0, 500.0])
def test_the_tool_is_not_pulled_through_a_thin_plate_by_a_handle_that_jumps(speed):
    method = world([PLATE], tool=tool_at(-0.02, speed, 0.01))
    method.couple(Coupling(5000.0, 5.0, 1.0, 0.01))
    deepest = max(run(method, 1, (0.05, 0.0, 0.0)).position[0] + 0.01 + 0.0005 for _ in range(200))
    assert deepest < 1e-5


def test_a_bar_that_spins_fast_does_not_cut_through_a_thin_plate():
    bar = body("bar", -0.06, 0.0, 1.57, box(0.16, 0.004), 0.01, velocity=[0.0, 0.0, -900.0])
    method = world([PLATE, bar])
    for _ in range(200):
        run(method, 1)
        x, y, angle = method.pose("bar")
        tips = [x + end * 0.08 * math.cos(angle) for end in (-1.0, 1.0)]
        assert x < 0.0 and max(tips) < 2e-3


def pendulum(h, angle):
    rod = body("rod", 0.5 * math.cos(angle), 0.5 * math.sin(angle), angle, box(1.0, 0.01), inertia=1.0 / 12.0)
    return world([rod], h, gravity=[0.0, -G], joints=[pin("world", "rod")])


def test_a_pendulum_at_90_degrees_keeps_its_period_to_a_thousandth():
    whole = 4.0 * math.sqrt((1.0 / 3.0) / (G * 0.5)) * ellipk(0.5)
    method, count = pendulum(1e-4, 0.0), 0
    falling = True
    while falling or method.bodies()[1][1][2] < 0.0:
        falling = method.bodies()[1][1][2] <= 0.0 and count < round(0.3 * whole / 1e-4)
        run(method, 1)
        count += 1
    assert 2.0 * count * 1e-4 == pytest.approx(whole, rel=1e-3)


def test_a_start_velocity_is_there_in_the_first_sub_step_and_kept_without_forces():
    shot = body("shot", 1.0, 2.0, 0.5, velocity=[0.3, -0.2, 4.0])
    method = run(world([shot], tool=FAR | {"velocity": [1.0, 0.0, 2.0]}), 40)
    t = 40 * H
    assert method.pose("shot") == pytest.approx((1.0 + 0.3 * t, 2.0 - 0.2 * t, 0.5 + 4.0 * t), rel=1e-12)
    assert method.position == pytest.approx((50.0 + t, 50.0, 2.0 * t), rel=1e-12)


@pytest.mark.parametrize(("torque", "turns"), [(0.99, True), (1.01, False)])
def test_friction_on_a_pin_holds_just_up_to_its_torque(torque, turns):
    joint = pin("world", "arm", friction_torque=torque * 0.5 * G)
    method = run(world([body("arm", 0.5, shapes=box(0.1, 0.1))], joints=[joint], gravity=[0.0, -G]), 400)
    assert (abs(method.pose("arm")[2]) > 1e-4) == turns


SPRING = {"type": "spring", "bodies": ["world", "ball"], "anchors": [[0.0, 0.0], [0.0, 0.0]]}


def test_a_spring_swings_at_its_frequency_and_its_energy_is_booked():
    method = world([body("ball", 0.35)], 1e-4, joints=[SPRING | {"stiffness": 400.0, "rest": 0.3}])
    start = sum(method.energy())
    assert start == pytest.approx(0.5 * 400.0 * 0.05**2)
    run(method, round(math.pi / 20.0 / 1e-4))
    assert method.pose("ball")[0] == pytest.approx(0.25, abs=1e-4)
    assert sum(method.energy()) == pytest.approx(start, rel=1e-2)


def test_welded_bodies_move_as_one_and_bodies_on_other_layers_pass_through():
    one = body("one", -0.2, velocity=[1.0, 0.0, 0.0])
    two = one | {"name": "two", "pose": [-0.2, 0.3, 0.0]}
    ghost = one | {"name": "ghost", "pose": [-0.2, -0.3, 0.0], "layers": [5]}
    weld = {"type": "weld", "bodies": ["one", "two"], "at": [-0.2, 0.1]}
    method = run(world([PLATE | {"shapes": box(0.001, 0.1)}, one, two, ghost], joints=[weld]), 1200)
    (ax, ay, _), (bx, by, _) = method.pose("one"), method.pose("two")
    assert math.hypot(ax - bx, ay - by) == pytest.approx(0.3, rel=1e-9)
    assert method.pose("ghost")[0] == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize("part", [10.0, 1.02, 0.98, 0.5, 0.1])
@pytest.mark.parametrize("e", [0.5, 0.9, 0.99, 0.999, 1.0])
def test_the_tool_rebounds_with_its_restitution_and_with_less_below_the_speed_that_keeps_the_port_passive(e, part):
    """v₀ (1 − e²) = 2 (|f| T/m) e: the push f of the coupling over a sub-step T; below, e is what keeps it."""
    mass, stiffness, stretch = 0.1, 2000.0, 0.01
    effective = mass + ONE * ONE * stiffness
    change = stiffness * stretch * ONE / effective  # the handle is this far behind the wall
    speed = part * (2.0 * change * e / (1.0 - e * e) if e < 1.0 else change)
    tool = tool_at(-0.0105 + 5e-10, speed, mass)  # a hair into the plate, at this speed
    method = world([PLATE], ONE, restitution=e, tool=tool)
    method.couple(Coupling(stiffness))
    method.step(held((-0.0105 + stretch, 0.0, 0.0)), 1)
    kept = -method.velocity[0] / speed
    change -= stiffness * ONE * ONE * speed / effective  # by the end of the step
    passive = math.hypot(1.0, change / speed) - change / speed
    assert kept == pytest.approx(min(e, passive), rel=1e-4)
    assert speed * (1.0 - kept**2) >= 2.0 * change * kept * (1.0 - 1e-4)


def test_a_slow_belt_does_not_fall_asleep():
    belt = fixed("belt", shapes=[{"half_plane": {"normal": [0.0, 1.0]}}], surface_velocity=[5e-5, 0.0])
    bodies = belt, body("block", 0.0, 0.05, shapes=box(0.2, 0.1))
    method = run(world(bodies, friction=0.4, gravity=[0.0, -G]), 4000)
    assert method.pose("block")[0] == pytest.approx(5e-5, rel=1e-3)


@pytest.mark.parametrize("turned_round", [False, True])
@pytest.mark.parametrize(("part", "rises"), [(1.01, True), (0.99, False)])
def test_a_sliders_motor_lifts_its_load_at_its_speed_if_its_force_is_more_than_the_weight(part, rises, turned_round):
    """On a guide of 30°, up from its stop: a = (part − 1) g sin 30° until the speed is reached."""
    load = body("load", 0.0, 5.0, math.pi / 6, box(0.1, 0.1))
    sign, bodies = (-1.0, ["load", "world"]) if turned_round else (1.0, ["world", "load"])
    guide = {
        "type": "slider",
        "bodies": bodies,
        "at": [0.0, 5.0],
        "axis": [math.sqrt(3.0), 1.0],
        "limits": [-1.0, 0.0] if turned_round else [0.0, 1.0],
        "motor": {"speed": sign * 0.02, "max_force": part * 0.5 * G},
    }
    method = run(world([load], joints=[guide], gravity=[0.0, -G]), 2000)
    x, y, _ = method.pose("load")
    start = 0.02 / (0.01 * 0.5 * G)
    assert math.hypot(x, y - 5.0) == pytest.approx(0.02 * (0.5 - 0.5 * start) if rises else 0.0, rel=1e-4, abs=1e-9)
    assert math.hypot(*method.bodies()[1][1][:2]) == pytest.approx(0.02 if rises else 0.0, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("drive", [{"motor": {"speed": 0.3, "max_force": 1.0}}, {"friction_force": 0.1}])
def test_a_slider_between_two_that_turn_is_driven_and_braked_along_its_axis_alone(drive):
    """A load on a carrier that spins, without gravity, against the direct solver: no part of the force goes across."""
    cube = {"layers": [1], "shapes": box(0.1, 0.1)}
    carrier = body("carrier", mass=2.0, inertia=0.02, velocity=[0.0, 0.0, 2.0], **cube)
    load = body("load", 0.2, inertia=0.01, velocity=[0.0, 0.4, 2.0], **cube)
    method = world(
        [carrier, load],
        joints=[{"type": "slider", "bodies": ["carrier", "load"], "at": [0.2, 0.0], "axis": [1.0, 0.0], **drive}],
    )
    exact = make("partitioned", reduce_scene(method.scene), H)
    for name in ("carrier", "load"):
        assert run(method, 400 if name == "carrier" else 0).pose(name) == pytest.approx(
            run(exact, 400 if name == "carrier" else 0).pose(name), abs=2e-5
        )


def test_what_the_page_shows_to_add_moves_with_the_world_is_held_and_calls_back():
    """A ball that falls on the block, and is held by a string of 50 mm when it is thrown up."""
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "own_bodies.md").read_text(encoding="utf-8")
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


LEVER = [fixed("base", shapes=box(0.06, 0.06)), body("lever", 0.05, 0.01, shapes=box(0.12, 0.01), mass=0.1)]


def test_a_lever_pinned_to_a_fixed_base_that_it_overlaps_stays_on_its_pin():
    method = world(LEVER, gravity=[0.0, -G], joints=[pin("base", "lever", 0.0, 0.01)])
    for _ in range(200):
        x, y, angle = run(method, 4).pose("lever")
        assert math.hypot(x - 0.05 * math.cos(angle), y - 0.05 * math.sin(angle) - 0.01) < 1e-5
    assert angle < -0.5


def test_a_lever_pinned_to_a_fixed_base_still_meets_another_fixed_body():
    stop, joint = fixed("stop", 0.09, -0.03), pin("base", "lever", 0.0, 0.01)
    method = run(world([*LEVER, stop], gravity=[0.0, -G], joints=[joint]), 1200)
    # The lever's lower face is .005 + .01 m from the middle of the stop.
    tilt = math.atan2(0.04, 0.09) - math.asin(0.015 / math.hypot(0.04, 0.09))
    assert method.pose("lever")[2] == pytest.approx(-tilt, abs=2e-3)


def test_of_two_pinned_bodies_one_still_meets_what_is_welded_to_the_other():
    one, third = body("A", shapes=box(0.02, 0.02), mass=0.1), body("C", 0.0, 0.08, shapes=box(0.1, 0.02), mass=0.1)
    arm = body("B", 0.05, shapes=box(0.1, 0.01), mass=0.1, velocity=[0.0, 1.25, 25.0])
    weld = {"type": "weld", "bodies": ["A", "C"], "at": [0.0, 0.05]}
    method = world([one, third, arm], joints=[weld, pin("A", "B"), pin("world", "A")])
    turned = max(run(method, 1).pose("B")[2] - method.pose("A")[2] for _ in range(400))
    assert 0.5 < turned < 0.5 * math.pi


@pytest.mark.parametrize("count", [8, 9])
def test_a_chain_of_thin_links_let_go_level_keeps_its_pins_closed_and_creates_no_energy(count):
    length = 0.02
    thin = {"shapes": box(length, 0.004), "mass": 0.002, "layers": [1]}
    links = [body(f"l{k}", length * (k + 0.5), **thin) for k in range(count)]
    pins = [pin(f"l{k - 1}" if k else "world", f"l{k}", length * k) for k in range(count)]
    method = world(links, gravity=[0.0, -G], joints=pins)
    least = start = sum(method.energy())
    created = opened = fastest = 0.0
    for _ in range(600):
        run(method, 4)
        kinetic, potential = method.energy()
        fastest, least = max(fastest, kinetic), min(least, kinetic + potential)
        created = max(created, kinetic + potential - least)
        end = (0.0, 0.0)
        for k in range(count):
            x, y, angle = method.pose(f"l{k}")
            way = 0.5 * length * math.cos(angle), 0.5 * length * math.sin(angle)
            opened = max(opened, math.dist(end, (x - way[0], y - way[1])))
            end = x + way[0], y + way[1]
    assert opened < 1e-4
    assert created < 0.01 * fastest and sum(method.energy()) < start


@pytest.mark.parametrize(("stiffness", "stretch", "time"), [(1.0, 4e-4, 1.5), (0.005, 0.05, 2.0)])
def test_what_a_weak_spring_will_move_does_not_fall_asleep(stiffness, stretch, time):
    """1 kg on a spring of k N/m: x = rest + stretch cos(√k t)."""
    method = world([body("ball", 0.1 + stretch)], joints=[SPRING | {"stiffness": stiffness, "rest": 0.1}])
    x = run(method, round(time / H)).pose("ball")[0]
    assert x - 0.1 == pytest.approx(stretch * math.cos(math.sqrt(stiffness) * time), abs=0.01 * stretch)


def test_what_a_small_gravity_will_move_does_not_fall_asleep():
    method = world([body("ball")], gravity=[0.0, -4e-4])
    assert run(method, round(2.0 / H)).pose("ball")[1] == pytest.approx(-0.5 * 4e-4 * 2.0**2, rel=1e-3)


def test_a_rod_that_balances_a_little_off_the_top_does_not_fall_asleep():
    """θ = θ₀ cosh(λ t), λ² = 3 g/(2 l), while θ is small."""
    method = run(pendulum(H, 0.5 * math.pi + 2e-5), round(1.5 / H))
    assert method.pose("rod")[2] - 0.5 * math.pi == pytest.approx(2e-5 * math.cosh(1.5 * math.sqrt(1.5 * G)), rel=1e-2)


def test_what_drifts_slowly_without_gravity_drifts_on():
    ball = body("ball", velocity=[9e-5, 0.0, 0.0])
    assert run(world([ball]), round(2.0 / H)).pose("ball")[0] == pytest.approx(2.0 * 9e-5, rel=1e-9)


def test_a_ball_that_the_tool_strikes_fast_does_not_go_through_a_thin_plate_behind_it():
    for phase in range(10):
        tool = tool_at(-0.004 - phase * 75e-6, 15.0)
        plate = fixed("plate", 0.016, shapes=box(0.0003, 1.0))
        ball = body("ball", 0.0103, shapes=SMALL, mass=0.0025)
        method = world([plate, ball], restitution=1.0, tool=tool)
        method.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
        way = [method.step(held(tool["pose"]), 4) and method.pose("ball")[0] for _ in range(3)]
        assert max(way) < 0.016, phase


@pytest.mark.parametrize("count", [4, 20])  # sub-steps: 1 and 5 ms
def test_what_a_spring_shoots_does_not_pass_a_thin_plate_however_seldom_samples_come(count):
    for phase in range(8):
        plate = fixed("plate", 0.05, shapes=box(0.0003, 1.0))
        ball = body("ball", 0.02 - phase * 1e-4, shapes=SMALL, mass=0.001)
        method, farthest = world([plate, ball], joints=[SPRING | {"stiffness": 390.0, "rest": 0.06}]), 0.0
        for _ in range(40 // count):
            method.step(held(STILL), count)
            farthest = max(farthest, method.pose("ball")[0])
        assert 0.045 < farthest < 0.05, phase


@pytest.mark.parametrize("speed", [10.0, 33.0])
def test_a_fast_body_loses_no_time_where_it_passes_fixed_bodies_of_other_layers(speed):
    ghosts = [fixed(f"g{k}", 0.02 * (k + 1) + 0.0003 * k, shapes=box(0.003, 0.2), layers=[5]) for k in range(20)]
    floor = fixed("floor", 0.0, -1.0, box(9.0, 0.1))
    shot = body("shot", shapes=box(0.004, 0.01), mass=0.1, velocity=[speed, 0.0, 0.0])
    count = int(0.5 / speed / H)
    assert run(world([floor, *ghosts, shot]), count).pose("shot")[0] == pytest.approx(speed * count * H, abs=1e-9)


@pytest.mark.parametrize(("layer", "passes"), [(33, True), (1, False)])
def test_layers_1_and_33_are_different_layers(layer, passes):
    shot = body("shot", -0.05, mass=0.1, velocity=[1.0, 0.0, 0.0], layers=[1])
    method = run(world([PLATE | {"layers": [layer]}, shot]), 400)
    assert (method.pose("shot")[0] > 0.0) == passes


def test_a_tool_on_a_guide_that_bounces_within_an_exchange_has_touched_in_it_with_a_force():
    guide = {"type": "slider", "bodies": ["world", "tool"], "at": [0.0, 0.0], "axis": [1.0, 0.0]}
    wall = fixed("wall", 0.03, shapes=box(0.02, 0.1))
    method = world([wall], restitution=0.9, tool=tool_at(0.0, 1.0), joints=[guide])
    went = [method.step(held(STILL), 4) for _ in range(20)]
    assert method.velocity[0] < -0.5
    touched = [travel for travel in went if travel.touched]
    assert 1 <= len(touched) <= 2 and max(travel.force for travel in touched) > 0.0


def test_travel_over_no_sub_steps_moves_nothing_and_says_that_nothing_happened():
    method = run(world([], gravity=[0.0, -G]), 10)
    before = method.position, method.velocity, method.energy()
    assert method.step(held(STILL), 0)[:-1] == (0.0, False, 0.0, 0.0, 0, 0.0, 0.0)
    assert (method.position, method.velocity, method.energy()) == before


@pytest.mark.parametrize("angle", [0.0, math.radians(37.0)])
@pytest.mark.parametrize("method", ["impulse", "partitioned"])
def test_a_ball_far_along_a_half_plane_lies_on_it(method, angle):
    """75 m from its point, and 10 m of way at 20 m/s."""
    c, s = math.cos(angle), math.sin(angle)
    start, shapes = (75.0 * c - 0.05 * s, 75.0 * s + 0.05 * c), [{"circle": {"radius": 0.05}}]
    ball = body("ball", *start, shapes=shapes, velocity=[20.0 * c, 20.0 * s, 0.0])
    tool = {"mass": 0.1, "pose": [-5.0 * s, 5.0 * c, 0.0], "shapes": BALL}
    scene = {"name": "t", "tool": tool, "gravity": [G * s, -G * c]}
    scene["bodies"] = [fixed("plane", shapes=[{"half_plane": {"normal": [-s, c]}}]), ball]
    world = make(method, reduce_scene(Scene.model_validate(scene)), H)
    run(world, round(0.5 / H), world.position)
    x, y, _ = world.pose("ball")
    assert (c * x + s * y, c * y - s * x) == pytest.approx((85.0, 0.05), abs=1e-5)


@pytest.mark.parametrize("turn", [0.0, math.radians(37.0)])
def test_a_disc_on_a_slope_of_a_hundred_thousandth_rolls_and_does_not_fall_asleep(turn):
    """x = g sin α t²/3 of a disc that rolls."""
    slope, time = 1e-5, 1.5
    plane = fixed("plane", shapes=[{"half_plane": {"normal": [-math.sin(turn), math.cos(turn)]}}])
    gravity = G * math.sin(turn + slope), -G * math.cos(turn + slope)
    disc = body("disc", -0.01 * math.sin(turn), 0.01 * math.cos(turn))
    method = world([plane, disc], friction=0.5, gravity=gravity, tool=FAR | {"layers": []})
    x, y, _ = run(method, round(time / H)).pose("disc")
    assert x * math.cos(turn) + y * math.sin(turn) == pytest.approx(G * math.sin(slope) * time**2 / 3.0, rel=2e-2)


@half("degrees, gravity", [0.0, 10.0, 37.0, 90.0], [(0.0, -G), (-G, 0.0)])
def test_a_ball_that_loses_nothing_rebounds_with_its_speed_whatever_gravity_does(degrees, gravity):
    angle = math.radians(degrees)
    c, s = math.cos(angle), math.sin(angle)
    plane = fixed("plane", shapes=[{"half_plane": {"normal": [-s, c]}}])
    ball = body("ball", -0.05 * s, 0.05 * c, velocity=[s, -c, 0.0])
    pull = [c * gravity[0] - s * gravity[1], s * gravity[0] + c * gravity[1]]
    method = world([plane, ball], restitution=1.0, gravity=pull, tool=FAR | {"layers": []})
    before = sum(method.energy())
    run(method, round(0.1 / H))
    x, y, _ = method.pose("ball")
    vx, vy, _ = method.bodies()[1][1]
    assert c * vy - s * vx > 0.0
    assert sum(method.energy()) == pytest.approx(before, rel=2e-3)
    assert c * y - s * x > 0.01


@half(
    "heavy, e, off", [(0.1, 2.0), (0.1, 20.0), (0.01, 20.0), (0.002, 20.0)], [0.5, 0.9, 0.99, 1.0], [0.0, 0.006]
)  # tool's mass, coupling's damping
def test_a_tool_that_a_damped_coupling_drives_into_a_wall_gives_nothing_at_the_port(off, e, heavy):
    """The handle goes with the tool at 1 m/s, and on into the plate; off its middle the tool turns too."""
    mass, damping = heavy
    shapes = [{"circle": {"radius": 0.01, "center": [0.0, off]}}]
    method = world([PLATE], restitution=e, tool=tool_at(-0.02, 1.0, mass, shapes))
    method.couple(Coupling(2000.0, damping, 0.5, 0.001))
    start, supplied, x = sum(method.energy()), 0.0, -0.02
    rebounds = 0.0
    for _ in range(200):
        rows = np.array([(x, 0.0, 0.0, 1.0, 0.0, 0.0), (x + H, 0.0, 0.0, 1.0, 0.0, 0.0)])
        supplied, x = supplied + method.step(rows, 1).supplied, x + H
        rebounds = min(rebounds, method.velocity[0])
        assert sum(method.energy()) - start - supplied < 1e-9
    assert rebounds < -0.2 or e < 0.9 or damping > 2.0
