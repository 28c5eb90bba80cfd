# SPDX-License-Identifier: Apache-2.0
"""Joints of the default method against closed forms: guides, springs, dampers, drives, stops, at any angle and size."""

import math

import numpy as np
import pytest
from examples import half

from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.language import Scene

H = 0.25e-3
TURNS = [0.0, math.radians(37.0)]
SIZES = [1.0, 0.1]
STILL = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}


def at(turn, x, y):
    """A vector of the scene's own frame in the plane, which is turned by `turn`."""
    return list(turned((x, y), (0.0, 0.0, turn)))


def block(name, turn, place=(0.0, 0.0), velocity=(0.0, 0.0, 0.0), size=(0.04, 0.02), mass=0.5, **more):
    pose, speed = [*at(turn, *place), turn], [*at(turn, *velocity[:2]), velocity[2]]
    shapes = [{"box": {"size": list(size)}}]
    return {"name": name, "mass": mass, "pose": pose, "velocity": speed, "layers": [], "shapes": shapes, **more}


def made(bodies, joints, gravity=(0.0, 0.0), h=H, method="impulse", **more):
    scene = {"name": "t", "gravity": list(gravity), "bodies": bodies, "joints": joints, "tool": STILL, **more}
    reduced = reduce_scene(Scene.model_validate(scene), method)
    return make(method, reduced, h)


def run(world, seconds):
    world.step(held(world.position), round(seconds / world.sub_step))
    return world


def guide(turn, a="world", b="sled", at_=(0.0, 0.0), axis=(1.0, 0.0), **more):
    return {"type": "slider", "bodies": [a, b], "at": at(turn, *at_), "axis": at(turn, *axis), **more}


def seen(world, body, turn):
    """Where a body is in the scene's own frame."""
    x, y, angle = world.pose(body)
    return *turned((x, y), (0.0, 0.0, -turn)), angle - turn


@half("turn, size, ends", TURNS, SIZES, [("world", "sled"), ("sled", "world")])
def test_a_sled_pushed_beside_its_mass_centre_stays_on_a_guide_at_its_corner_and_keeps_its_energy(turn, size, ends):
    """A force of 1 N on .5 kg for .2 s, by gravity across and along: s = a t²/2; nothing across, no turn."""
    sled = block("sled", turn, (0.03 * size, 0.02 * size), size=(0.06 * size, 0.04 * size))
    world = made([sled], [guide(turn, *ends)], gravity=at(turn, 2.0, -5.0))
    before = sum(world.energy())
    x, y, angle = seen(run(world, 0.2), "sled", turn)
    assert x == pytest.approx(0.03 * size + 0.5 * 2.0 * 0.2**2, rel=1e-3)
    assert (y, angle) == pytest.approx((0.02 * size, 0.0), abs=1e-9)
    assert sum(world.energy()) == pytest.approx(before, abs=1e-3 * 0.5 * 2.0 * 0.04)


PIN = {"type": "pin", "at": (0.05, 0.03)}
SLIDER = {"type": "slider", "at": (0.05, 0.03), "axis": (1.0, 0.4)}
SPRING = {"type": "spring", "anchors": [(0.02, 0.03), (-0.03, 0.01)], "stiffness": 50.0, "damping": 0.5}
FREE = {
    "pin": PIN,
    "pin with spring": PIN | {"stiffness": 0.1, "damping": 0.01, "rest": 0.5},
    "pin with stops": PIN | {"limits": [-0.2, 0.3]},
    "pin with drives": PIN | {"motor": {"speed": 1.0, "max_torque": 0.03}, "friction_torque": 0.02},
    "slider": SLIDER,
    "slider with spring": SLIDER | {"stiffness": 50.0, "damping": 0.5, "rest": 0.02},
    "slider with stops": SLIDER | {"limits": [-0.02, 0.03]},
    "slider with drives": SLIDER | {"motor": {"speed": 0.05, "max_force": 2.0}, "friction_force": 0.3},
    "spring": SPRING,
    "spring without length": SPRING | {"rest": 0.0},
}


@pytest.mark.parametrize("kind", FREE)
def test_two_free_bodies_joined_beside_their_mass_centres_keep_their_momentum(kind, turn=TURNS[1]):
    joint = {**FREE[kind], "bodies": ["one", "two"]}
    joint |= {key: at(turn, *joint[key]) for key in ("at", "axis") if key in joint}
    spin, apart = 1.0, 0.0 if joint["type"] == "slider" else -1.0
    hinge = np.array((0.05, 0.03))

    def velocity(place, rate):
        if joint["type"] == "slider":  # both turn about one point, and slide
            return *(spin * np.array((-place[1], place[0])) + (0.05 if place[0] else 0.0) * np.array((1.0, 0.4))), spin
        arm = np.array(place) - hinge
        return 0.1 - rate * arm[1], 0.05 + rate * arm[0], rate

    bodies = [
        block("one", turn, (0.0, 0.0), velocity((0.0, 0.0), spin), (0.06, 0.04), 0.3),
        block("two", turn, (0.1, 0.05), velocity((0.1, 0.05), spin + apart), (0.08, 0.02), 0.7),
    ]
    world = made(bodies, [joint])
    model = reduce_scene(world.scene).model

    def momentum():
        states = [np.array((*pose, *rates)) for pose, rates in world.bodies()[1:]]
        linear = sum(m * s[3:5] for m, s in zip(model.mass[1:3], states, strict=True))
        angular = sum(
            m * (s[0] * s[4] - s[1] * s[3]) + i * s[5]
            for m, i, s in zip(model.mass[1:3], model.inertia[1:3], states, strict=True)
        )
        speed = sum(m * np.hypot(*s[3:5]) for m, s in zip(model.mass[1:3], states, strict=True))
        turning = sum(i * abs(s[5]) for i, s in zip(model.inertia[1:3], states, strict=True))
        return np.array((*linear, angular)), np.array((speed, speed, 0.2 * speed + turning))  # 0.2 m from end to end

    before, scale = momentum()
    after, _ = momentum() if run(world, 1.0) else None
    assert np.all(np.abs(after - before) < 1e-9 * scale)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("kind", ["pin", "slider"])
def test_a_joint_whose_limits_are_both_0_holds_like_a_weld(kind, turn):
    joint = guide(turn, limits=[0.0, 0.0])
    if kind == "pin":
        joint = {"type": "pin", "bodies": ["world", "sled"], "at": at(turn, 0.05, 0.0), "limits": [0.0, 0.0]}
    world = made([block("sled", turn)], [joint], gravity=[1.0, -G])
    assert seen(run(world, 0.1), "sled", turn) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


G = 9.81


@half("turn, rest, off", TURNS, [0.02, -0.02], [0.0, 0.015])
def test_a_sliders_spring_pushes_to_its_rest_on_either_side(turn, rest, off):
    """x = rest (1 − cos ω t), ω² = K/m: 1 kg on 400 N/m."""
    sled = block("sled", turn, (0.0, off), mass=1.0)
    world = made([sled], [guide(turn, stiffness=400.0, rest=rest)])
    before = sum(world.energy())
    assert before == pytest.approx(0.5 * 400.0 * rest**2, rel=1e-9)
    run(world, 0.1)
    assert seen(world, "sled", turn)[0] == pytest.approx(rest * (1.0 - math.cos(20.0 * 0.1)), rel=2e-3)
    assert sum(world.energy()) == pytest.approx(before, rel=2e-3)


@pytest.mark.parametrize("turn", TURNS)
def test_a_spring_without_length_damps_across_its_stretch_as_along_it(turn):
    """ẍ + 2 ζω ẋ + ω² x = 0 in both directions: thrown across from a stretch."""
    k, c, m, time = 100.0, 2.0, 1.0, 0.1
    ball = block("ball", turn, (0.02, 0.0), (0.0, 0.4, 0.0), mass=m)
    spring = {"type": "spring", "bodies": ["world", "ball"], "anchors": [[0, 0], [0, 0]], "rest": 0.0}
    world = run(made([ball], [spring | {"stiffness": k, "damping": c}]), time)
    decay, swing = 0.5 * c / m, math.sqrt(k / m - (0.5 * c / m) ** 2)
    fade = math.exp(-decay * time)
    x = 0.02 * fade * (math.cos(swing * time) + decay / swing * math.sin(swing * time))
    y = 0.4 * fade * math.sin(swing * time) / swing
    assert seen(world, "ball", turn)[:2] == pytest.approx((x, y), rel=2e-3)


@half("turn, share, kind", TURNS, [0.5, 2.5, 6.0, 100.0, 1e4], ["slider", "spring", "pin"])
def test_what_sinks_in_grease_has_its_weight_over_the_damping_for_speed(kind, share, turn):
    """C h/m from .5 to 1e4 of a step of 50 µs; v = m g/C, of a pin ω = m g l/C."""
    m = 0.01
    plunger = block("plunger", turn, (0.05, 0.0), size=(0.02, 0.02), mass=m)
    joint = {"bodies": ["world", "plunger"]}
    if kind == "slider":
        c, lever = share * m / 50e-6, 1.0
        joint |= {"type": "slider", "at": at(turn, 0.0, 0.0), "axis": at(turn, 0.0, 1.0)}
    elif kind == "spring":
        c, lever = share * m / 50e-6, 1.0
        joint |= {"type": "spring", "anchors": [at(turn, 0.05, 100.0), [0.0, 0.0]]}
    else:
        inertia = m * 0.02**2 / 6.0
        c, lever = share * inertia / 50e-6, 0.05
        joint |= {"type": "pin", "at": at(turn, 0.0, 0.0)}
    world = made([plunger], [joint | {"damping": c}], gravity=at(turn, 0.0, -G))
    speed = m * G * lever / c
    settle = (m + (inertia / 0.05**2 if kind == "pin" else 0.0)) * (0.05**2 if kind == "pin" else 1.0) / c
    x, y, w = run(world, 12.0 * settle + 0.01).bodies()[1][1]
    if kind == "pin":
        angle = seen(world, "plunger", turn)[2]
        assert -w == pytest.approx(speed * math.cos(angle), rel=2e-3)
    else:
        assert -turned((x, y), (0.0, 0.0, -turn))[1] == pytest.approx(speed, rel=1e-4)


@half("turn, strengths, kind", TURNS, [(0.1, 0.5), (1.0, 0.5), (0.5, 1.0), (2.0, 0.0)], ["pin", "slider"])
def test_a_motor_moves_its_joint_with_what_dry_friction_leaves_of_it(kind, strengths, turn):
    """v = (motor − friction) t/m until the motor's speed; nothing where friction is more."""
    motor, friction = strengths
    push, m = max(0.0, motor - friction), 0.2
    body = block("body", turn, mass=m, inertia=m)
    if kind == "pin":
        joint = {"type": "pin", "at": [0.0, 0.0], "friction_torque": friction}
        joint["motor"] = {"speed": 0.6, "max_torque": motor}
    else:
        joint = guide(turn, "world", "body", friction_force=friction, motor={"speed": 0.6, "max_force": motor})
    world = made([body], [joint | {"bodies": ["world", "body"]}])

    def rate():
        x, y, w = world.bodies()[1][1]
        return w if kind == "pin" else turned((x, y), (0.0, 0.0, -turn))[0]

    run(world, 0.05)
    assert rate() == pytest.approx(push * 0.05 / m, rel=2e-3, abs=1e-9)
    run(world, 0.3)
    assert rate() == pytest.approx(0.6 if push else 0.0, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("turn", TURNS)
def test_the_motor_of_a_sled_is_not_weakened_by_what_presses_the_sled_on_its_guide(turn):
    """10 N across the guide, 1 N of motor against .4 N of friction on .5 kg."""
    joint = guide(turn, motor={"speed": 1e3, "max_force": 1.0}, friction_force=0.4)
    world = run(made([block("sled", turn, (0.0, 0.01))], [joint], gravity=at(turn, 0.0, -20.0)), 0.2)
    assert seen(world, "sled", turn)[0] == pytest.approx(0.5 * (0.6 / 0.5) * 0.2**2, rel=2e-3)


def test_a_motor_of_speed_0_brakes_as_much_as_friction_of_its_strength():
    body = block("body", 0.0, velocity=(0.0, 0.0, 5.0), mass=0.2, inertia=0.2)
    joint = {"type": "pin", "bodies": ["world", "body"], "at": [0.0, 0.0], "friction_torque": 0.5}
    world = run(made([body], [joint | {"motor": {"speed": 0.0, "max_torque": 1.5}}]), 0.1)
    assert world.bodies()[1][1][2] == pytest.approx(5.0 - 2.0 / 0.2 * 0.1, rel=1e-3)


@half("turn, rate", TURNS, [1.0, 50.0, -30.0])
def test_a_bar_thrown_against_its_pins_stop_stays_there(rate, turn):
    bar = block("bar", turn, (0.1, 0.0), (0.0, 0.1 * rate, rate), (0.2, 0.02), 0.3)
    joint = {"type": "pin", "bodies": ["world", "bar"], "at": [0.0, 0.0], "limits": [-0.4, 0.5]}
    world = run(made([bar], [joint]), 1.0)
    assert world.pose("bar")[2] - turn == pytest.approx(0.5 if rate > 0.0 else -0.4, abs=1e-6)
    assert world.bodies()[1][1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@half("turn, speed, off", TURNS, [0.1, 2.0, -20.0], [0.0, 0.02])
def test_a_sled_thrown_against_its_stop_stays_there(speed, off, turn):
    sled = block("sled", turn, (0.0, off), (speed, 0.0, 0.0))
    world = run(made([sled], [guide(turn, limits=[-0.03, 0.05])]), 1.0)
    wall = 0.05 if speed > 0.0 else -0.03
    assert seen(world, "sled", turn) == pytest.approx((wall, off, 0.0), abs=1e-6)
    assert world.bodies()[1][1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_tool_on_a_guide_meets_its_stop_under_the_coupling_with_the_couplings_force():
    """K x of 2000 N/m and 10 mm is what holds the tool at its stop."""
    tool = {"mass": 0.1, "pose": [0.0, 0.01, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    scene = {"name": "t", "tool": tool, "joints": [guide(0.0, "world", "tool", limits=[-0.1, 0.02])]}
    world = make("impulse", reduce_scene(Scene.model_validate(scene)), H)
    world.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
    for _ in range(800):
        world.step(held((0.03, 0.01, 0.0)), 1)
    assert world.position == pytest.approx((0.02, 0.01, 0.0), abs=1e-6)
    assert world.force_on_tool[0] == pytest.approx(2000.0 * 0.01, rel=1e-3)


def two_links(ratio, turn=0.0, **joint):
    """Two links of 30 mm, the second so many times as heavy as the first of 20 g, let go level."""
    links = [
        block("l0", turn, (0.015, 0.0), size=(0.03, 0.006), mass=0.02),
        block("l1", turn, (0.045, 0.0), size=(0.03, 0.006), mass=0.02 * ratio),
    ]
    pins = [
        {"type": "pin", "bodies": [a, b], "at": at(turn, x, 0.0), **joint}
        for a, b, x in (("world", "l0", 0.0), ("l0", "l1", 0.03))
    ]
    return links, pins


@half("turn, ratio, stop", TURNS, [1.0, 50.0], [False, True])
def test_a_double_pendulum_keeps_its_energy_and_its_pins_whatever_else_has_a_stop(stop, ratio, turn):
    """The direct method, exact to rounding, is where it is after .1 s."""
    links, pins = two_links(ratio, turn)
    drawer = [block("drawer", turn, (2.0, 0.0))] if stop else []
    stops = [guide(turn, "world", "drawer", (2.0, 0.0), limits=[-0.01, 0.05])] if stop else []
    ends = []
    for method in ("impulse", "partitioned"):
        world = made([*links, *drawer], [*pins, *stops], gravity=at(turn, 0.0, -G), method=method)
        before = sum(world.energy())
        run(world, 0.1)
        assert sum(world.energy()) == pytest.approx(before, abs=2e-3 * 0.02 * (1.0 + ratio) * G * 0.06)
        ends.append([seen(world, name, turn)[2] for name in ("l0", "l1")])
    assert ends[0] == pytest.approx(ends[1], abs=5e-3)


@half("turn, ratio", TURNS, [1.0, 50.0])
def test_an_arm_that_hangs_on_the_stops_of_its_pins_comes_to_rest(ratio, turn):
    links, pins = two_links(ratio, turn, limits=[-0.1, 0.1])
    world = run(made(links, pins, gravity=at(turn, 0.0, -G)), 1.0)
    fastest = 0.0
    for _ in range(100):
        run(world, 1e-3)
        fastest = max(fastest, *(abs(rates[2]) for _, rates in world.bodies()[1:]))
    assert fastest < 1e-3
    angles = [seen(world, name, turn)[2] for name in ("l0", "l1")]
    assert angles == pytest.approx([-0.1, -0.2], abs=1e-4)


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_drawer_that_the_tool_pushes_passes_its_stop_by_no_more_than_a_step_of_its_way(speed):
    tool = {"mass": 0.1, "pose": [-0.0255, 0.0, 0.0], "shapes": [{"circle": {"radius": 0.005}}]}
    drawer = block("drawer", 0.0, mass=0.05) | {"layers": [0]}
    joints = [guide(0.0, "world", "drawer", limits=[-0.1, 0.02])]
    scene = {"name": "t", "tool": tool, "bodies": [drawer], "joints": joints}
    world = make("impulse", reduce_scene(Scene.model_validate(scene)), H)
    world.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
    farthest, x = 0.0, -0.0255
    for _ in range(round(0.05 / speed / H)):
        x = min(x + speed * H, 0.0)
        world.step(held((x, 0.0, 0.0)), 1)
        farthest = max(farthest, world.pose("drawer")[0])
    assert 0.02 - 1e-6 < farthest < 0.02 + 1.5 * speed * 51e-6
    assert world.pose("drawer")[0] == pytest.approx(0.02, abs=1.5 * speed * 51e-6)
