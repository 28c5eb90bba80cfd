# SPDX-License-Identifier: Apache-2.0
"""Motors, dry friction and spring-dampers of joints, as the compiled methods solve them, against closed forms."""

import math

import numpy as np
import pytest

from haptic_sim.method.event_driven import EventDriven
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

BOTH = [Partitioned, EventDriven]
ANGLES = [0.0, 37.0]
SIZES = [1.0, 0.01]
"""Inertia [kg m²] or mass [kg] that moves, and with it the scale of torques."""
FAR_TOOL = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
SPEED = 3.0


def world(kind, h, bodies, joints, tool=FAR_TOOL, **more):
    scene = {"name": "t", "bodies": bodies, "joints": joints, "tool": tool, **more}
    return kind(reduce_scene(Scene.model_validate(scene)), h)


def run(method, count, handle=(0.0, 0.0, 0.0)):
    method.step(held(handle), count)
    return method


def turned(degrees, x, y):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [c * x - s * y, s * x + c * y]


def body(name, mass, shape, x=0.0, degrees=0.0, **more):
    """At (x, 0) in a plane turned by so many degrees."""
    pose = [*turned(degrees, x, 0.0), math.radians(degrees)]
    return {"name": name, "mass": mass, "pose": pose, "shapes": [shape], **more}


def driven(kind, joint, degrees, size, motor, friction, turning=0.0, **more):
    """A wheel on a pin or a sled on a guide, with motor (speed, strength) and dry friction, both times its inertia."""
    wheel, (speed, strength) = body("body", size, {"box": {"size": [0.1, 0.1]}}, degrees=degrees, inertia=size), motor
    law = {"type": joint, "bodies": ["world", "body"], "at": [0.0, 0.0]}
    if joint == "pin":
        wheel["velocity"] = [0.0, 0.0, turning]
        law |= {"friction_torque": friction * size, "motor": {"speed": speed, "max_torque": strength * size}}
    else:
        wheel["velocity"] = [*turned(degrees, turning, 0.0), 0.0]
        law |= {"friction_force": friction * size, "motor": {"speed": speed, "max_force": strength * size}}
        law["axis"] = turned(degrees, 1.0, 0.0)
    return world(kind, 1e-3, [wheel], [law], **more)


def coordinate(method, degrees, joint):
    """(coordinate, rate) of the driven body's joint."""
    pose, rates = method.bodies()[1]
    if joint == "pin":
        return pose[2] - math.radians(degrees), rates[2]
    ux, uy = turned(degrees, 1.0, 0.0)
    return pose[0] * ux + pose[1] * uy, rates[0] * ux + rates[1] * uy


def cases(*joints):
    return pytest.mark.parametrize(
        ("kind", "joint", "degrees", "size"),
        [(kind, joint, *turn) for kind in BOTH for joint in joints for turn in zip(ANGLES, SIZES, strict=True)],
    )


CASES = cases("pin", "slider")


@CASES
def test_a_motor_weaker_than_the_friction_of_its_joint_does_not_move_it(kind, joint, degrees, size):
    method = run(driven(kind, joint, degrees, size, (SPEED, 0.1), 0.5), 200)
    assert coordinate(method, degrees, joint) == pytest.approx((0.0, 0.0), abs=1e-15)


@CASES
@pytest.mark.parametrize(
    ("motor", "friction", "turning", "stations"),
    [
        # I dω/dt = 15 − 7.5 until ω = 3, after .4 s
        ((3.0, 15.0), 7.5, 0.0, [(200, 0.15, 1.5), (600, 1.2, 3.0)]),
        ((-3.0, 15.0), 7.5, 0.0, [(200, -0.15, -1.5), (600, -1.2, -3.0)]),
        # I dω/dt = −(15 + 7.5) from 6 to 3, in 2/15 s; then the motor holds its speed
        ((3.0, 15.0), 7.5, 6.0, [(100, None, 3.75), (300, None, 3.0)]),
        # I dω/dt = −(10 + 5) from 3; at rest after .2 s
        ((0.0, 10.0), 5.0, 3.0, [(100, 0.225, 1.5), (300, 0.3, 0.0)]),
    ],
)
def test_a_motor_less_friction_brings_a_body_to_its_speed_and_both_together_brake_what_is_faster(
    kind, joint, degrees, size, motor, friction, turning, stations
):
    method, done = driven(kind, joint, degrees, size, motor, friction, turning), 0
    for ticks, way, rate in stations:
        run(method, ticks - done)
        done, found = ticks, coordinate(method, degrees, joint)
        assert found[1] == pytest.approx(rate, rel=1e-12, abs=1e-12)
        assert way is None or found[0] == pytest.approx(way, rel=1e-9)


def held_knob(motor, friction, degrees):
    pin = {"type": "pin", "bodies": ["world", "tool"], "at": [0.0, 1.0], "friction_torque": friction}
    pin["motor"] = {"speed": motor[0], "max_torque": motor[1]}
    tool = FAR_TOOL | {"inertia": 1e-4, "pose": [0.0, 1.0, math.radians(degrees)]}
    method = world(Partitioned, 1e-3, [], [pin], tool)
    method.couple(Coupling(2000.0, 2.0, 2.0, 0.1))
    return method


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_a_motor_turns_a_held_tool_ahead_by_its_torque_less_friction_and_gives_way_by_their_sum(degrees, speed):
    """From the handle it goes (.3 − .1)/2 rad ahead; the handle that goes back draws it from (.3 + .1)/2 ahead."""
    method, start, sign = held_knob((speed, 0.3), 0.1, degrees), math.radians(degrees), math.copysign(1.0, speed)
    run(method, 2000, (0.0, 1.0, start))
    assert method.position[2] - start == pytest.approx(sign * 0.1, rel=1e-6)
    for back in np.linspace(0.0, 0.5, 500):
        run(method, 1, (0.0, 1.0, start - sign * back))
    run(method, 1000, (0.0, 1.0, start - sign * 0.5))
    assert method.position[2] - start == pytest.approx(sign * (0.2 - 0.5), abs=1e-6)


@pytest.mark.parametrize("strength", [1.0, 1e3])
@pytest.mark.parametrize("speed", [1e-6, -1e-6, 1e-3, 1.0])
def test_a_held_tool_has_its_motors_speed_however_strong_motor_and_friction_are(speed, strength):
    """To what the rows give way of themselves (REGULARIZATION), 25 nrad/s at 500 N m."""
    method = held_knob((speed, strength), 0.5 * strength, 0.0)
    assert run(method, 50, (0.0, 1.0, 0.0)).velocity[2] == pytest.approx(speed, rel=0.03)


@pytest.mark.parametrize("degrees", ANGLES)
def test_two_joints_with_motor_and_friction_in_a_row_each_keep_their_own_law(degrees):
    """The first motor is stronger than its friction, the second weaker: both arms turn as one."""
    bar = {"box": {"size": [0.2, 0.02]}}
    arms = [body(name, 1.0, bar, x, degrees, inertia=0.1) for name, x in (("a", 0.1), ("b", 0.3))]
    pins = [
        {"type": "pin", "bodies": bodies, "at": turned(degrees, x, 0.0), "friction_torque": friction, "motor": motor}
        for bodies, x, friction, motor in (
            (["world", "a"], 0.0, 0.5, {"speed": 2.0, "max_torque": 5.0}),
            (["a", "b"], 0.2, 9.0, {"speed": 9.0, "max_torque": 0.1}),
        )
    ]
    method = run(world(Partitioned, 1e-3, arms, pins), 1000)
    first, second = (pose[2] for pose, _ in method.bodies()[1:])
    assert first - second == pytest.approx(0.0, abs=1e-9) and method.bodies()[1][1][2] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("kind", BOTH)
def test_no_energy_comes_from_nowhere_where_motor_and_friction_work(kind):
    """What the motor has given is at least the kinetic energy: 15 N m over the angle, of which friction takes half."""
    method = driven(kind, "pin", 0.0, 1.0, (SPEED, 15.0), 7.5)
    for _ in range(50):
        run(method, 10)
        angle = coordinate(method, 0.0, "pin")[0]
        assert method.energy()[0] <= 7.5 * angle * (1.0 + 1e-9) + 1e-12


H = 1e-3
FAST = pytest.mark.parametrize("fast", [0.5, 2.5, 6.0, 100.0, 1e4])
"""Rate of a joint's spring-damper times the sub-step; an explicit formula is stable up to some 6."""
KINDS = cases("pin", "slider", "spring")


def sprung(kind, joint, degrees, size, stiffness, damping, stretch=0.0, push=0.0):
    """A body whose mass or inertia is `size` on a spring-damper, `stretch` off its rest, pushed by `push` · size.

    The push is gravity along the coordinate; the pin's body is a ring 1 m about its pin, whose mass centre it draws.
    """
    stiffness, damping, along = stiffness * size, damping * size, turned(degrees, 1.0, 0.0)
    hung = {"name": "body", "mass": size, "inertia": size, "shapes": [{"circle": {"radius": 0.1}}]}
    law = {"bodies": ["world", "body"], "type": joint, "stiffness": stiffness, "damping": damping}
    gravity = [push * along[0], push * along[1]]
    if joint == "pin":
        pose = [*turned(degrees, 0.0, -1.0), math.radians(degrees)]
        hung |= {"inertia": 0.5 * size, "mass": 0.5 * size, "pose": pose}
        law |= {"at": [0.0, 0.0], "rest": -stretch}
        gravity = [2.0 * push * along[0], 2.0 * push * along[1]]
    elif joint == "slider":
        law |= {"at": [0.0, 0.0], "axis": along, "rest": -stretch}
    else:
        hung["pose"] = [*turned(degrees, stretch, 0.0), 0.0]
        law |= {"anchors": [[0.0, 0.0], [0.0, 0.0]], "rest": 0.0}
    return world(kind, H, [hung], [law], gravity=gravity), hung.get("pose", [0.0, 0.0, 0.0])


def moved(method, joint, degrees, start):
    """(way, rate) along the coordinate since the start."""
    (x, y, angle), (vx, vy, turning) = method.bodies()[1]
    if joint == "pin":
        return angle - start[2], turning
    ux, uy = turned(degrees, 1.0, 0.0)
    return (x - start[0]) * ux + (y - start[1]) * uy, vx * ux + vy * uy


@KINDS
@FAST
def test_in_grease_a_body_has_its_terminal_speed_and_lags_by_it_over_the_rate(kind, joint, degrees, size, fast):
    """v → g/r and x → v (t − 1/r) with r = c/m; a pin's gravity turns with the arm by less than rounding here."""
    rate, time = fast / H, 100
    method, start = sprung(kind, joint, degrees, size, 0.0, rate, push=1e-6)
    run(method, time)
    t, v = time * H, 1e-6 / rate
    expected = v * (t - (1.0 - math.exp(-rate * t)) / rate), v * (1.0 - math.exp(-rate * t))
    assert moved(method, joint, degrees, start) == pytest.approx(expected, rel=1e-6)


@KINDS
@pytest.mark.parametrize("fast", [0.5, 2.5, 4.0])
def test_a_damped_oscillator_swings_by_its_closed_form_up_to_some_radians_a_step(kind, joint, degrees, size, fast):
    """x = x₀ e^(−d t) (cos w t + d/w sin w t), d a tenth of the angular frequency."""
    frequency, x, d = fast / H, 1e-3, 0.1 * fast / H
    w = math.sqrt(frequency**2 - d**2)
    method, start = sprung(kind, joint, degrees, size, frequency**2, 2.0 * d, x)
    for k in range(1, 20):
        run(method, 1)
        t = k * H
        expected = x * math.exp(-d * t) * (math.cos(w * t) + d / w * math.sin(w * t)) - x
        assert moved(method, joint, degrees, start)[0] == pytest.approx(expected, abs=2e-5 * x)


@KINDS
@FAST
@pytest.mark.parametrize("damping", [0.0, 0.2, 3.0])
def test_no_spring_damper_creates_energy_and_a_damped_one_comes_to_rest(kind, joint, degrees, size, fast, damping):
    frequency = fast / H
    if damping * frequency * H > 6.0:
        frequency = fast / (damping * H)
    method, start = sprung(kind, joint, degrees, size, frequency**2, damping * frequency, 1e-3)
    energies = [sum(method.energy())]
    for _ in range(50):
        energies.append(sum(run(method, 1).energy()))
    assert np.diff(energies).max() <= 1e-6 * energies[0]
    if damping == 0.2 or damping == 3.0 and fast > 2.0:
        assert moved(method, joint, degrees, start)[0] == pytest.approx(-1e-3, rel=0.01 if fast > 1.0 else 0.2)


@pytest.mark.parametrize(("degrees", "size"), zip(ANGLES, SIZES, strict=True))
@pytest.mark.parametrize("damping", [1e2, 1e4, 1e6])
def test_what_strikes_a_plunger_in_grease_drives_it_by_its_momentum_over_the_damping(degrees, size, damping):
    """c x = m v: all that the ball has goes into the grease, in whatever way; c h/m of the light plunger 10 to 1e5."""
    plunger = body("plunger", 0.01 * size, {"box": {"size": [0.02, 0.02]}}, degrees=degrees)
    velocity = [*turned(degrees, 0.5, 0.0), 0.0]
    ball = body("ball", size, {"circle": {"radius": 0.01}}, -0.0217, degrees, velocity=velocity)
    guide = {"type": "slider", "bodies": ["world", "plunger"], "at": [0.0, 0.0], "axis": turned(degrees, 1.0, 0.0)}
    guide["damping"] = damping * size
    method = run(world(Partitioned, H, [plunger, ball], [guide]), 500)
    way = math.hypot(*method.pose("plunger")[:2])
    assert way == pytest.approx(0.5 / damping, rel=2e-3)
    assert math.hypot(*method.bodies()[2][1][:2]) < 1e-3


HANDLE = {"box": {"size": [0.03, 0.002], "center": [0.015, 0.0]}}
KNOB = {
    "bodies": [{"name": "knob", "mass": 0.02, "shapes": [{"circle": {"radius": 0.01}}, HANDLE]}],
    "joints": [{"type": "pin", "bodies": ["world", "knob"], "at": [0.0, 0.0], "damping": 0.5}],
    "tool": {"mass": 0.05, "pose": [0.026, 0.0165, 0.0], "shapes": [{"circle": {"radius": 0.005}}]},
    "gravity": [0.0, -9.81],
}


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize("held_tool", [False, True])
def test_a_small_knob_in_grease_never_has_more_energy_than_it_was_given(kind, held_tool):
    method, supplied = world(kind, 0.1e-3, **KNOB), 0.0
    if held_tool:
        method.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
    start = sum(method.energy())
    for k in range(400):
        supplied += method.step(held((0.026, 0.0165 - 2e-5 * k, 0.0)), 1).supplied
        assert sum(method.energy()) - start <= supplied + 1e-9
