# SPDX-License-Identifier: Apache-2.0
"""The partitioned method against closed forms: linkages, impacts, friction, and what it gives at the tool's port."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from haptic_sim.method.event_driven import EventDriven
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

G = 9.81
DOWN = [0.0, -G]
STILL = (0.0, 0.0, 0.0)
BOTH = [Partitioned, EventDriven]
SLIM = [{"vertices": [[-0.5, 0.0], [0.0, -0.001], [0.5, 0.0], [0.0, 0.001]]}]  # a rod of 1 m, pointed
FAR_TOOL = {"mass": 0.1, "pose": [50.0, 50.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}


def world(h, bodies, friction=0.0, restitution=0.0, kind=Partitioned, belt=0.0, **more):
    """Bodies over a floor at y = 0, all of one material, whose top runs at `belt` [m/s]; the tool is far off unless
    given."""
    floor = {"name": "floor", "fixed": True, "pose": [0.0, 0.0, math.pi], "surface_velocity": [-belt, 0.0]}
    floor["shapes"] = [{"box": {"size": [40, 2], "center": [0, 1]}}]
    scene = {"name": "t", "materials": {"m": {"friction": friction, "restitution": restitution}}, "tool": FAR_TOOL}
    scene["bodies"] = [{"material": "m", **body} for body in (floor, *bodies)]
    return kind(reduce_scene(Scene.model_validate(scene | more)), h)


def run(method, count, handle=STILL):
    method.step(held(handle), count)
    return method


def speed(method, body):
    """Velocity of the named body's mass centre, and its turn rate."""
    moving = [solid.name for solid in method.scene.bodies if not solid.fixed]
    return np.array(method.bodies()[1 + moving.index(body)][1])  # the tool is the first


def block(**more):
    return {"name": "block", "mass": 1.0, "pose": [0.0, 0.05, 0.0], "shapes": [{"box": {"size": [0.2, 0.1]}}], **more}


def ball(**more):
    return {"name": "ball", "mass": 1.0, "pose": [0.0, 0.1, 0.0], "shapes": [{"circle": {"radius": 0.1}}], **more}


def rod(pose, shapes=SLIM, **more):
    """Of 1 m and 1 kg."""
    return {"name": "rod", "mass": 1.0, "inertia": 1.0 / 12.0, "pose": pose, "shapes": shapes, **more}


def pendulum(h, angle=0.0):
    """A rod of 1 m on a pin, `angle` from horizontal."""
    pose = [0.5 * math.cos(angle), 20.0 + 0.5 * math.sin(angle), angle]
    hung = rod(pose, [{"box": {"size": [1.0, 0.01]}}])
    return world(h, [hung], gravity=DOWN, joints=[{"type": "pin", "bodies": ["world", "rod"], "at": [0.0, 20.0]}])


def period(amplitude):
    """T = 4 √(I/(m g L/2)) K(sin² θ/2): closed form of the rod's swing."""
    return 4.0 * math.sqrt((1.0 / 3.0) / (G * 0.5)) * ellipk(math.sin(amplitude / 2.0) ** 2)


@pytest.mark.parametrize("amplitude", [5.0, 90.0, 150.0])
def test_after_a_whole_period_the_pendulum_is_back_to_a_billionth(amplitude):
    """At the turning point the angle is flat; the turn rate tells the time, with dω/dt = −3/2 g cos θ."""
    start = math.radians(amplitude - 90.0)
    whole = period(math.radians(amplitude))
    method = run(pendulum(whole / 20000.0, start), 20000)
    late = speed(method, "rod")[2] / (-1.5 * G * math.cos(start))
    assert abs(late) / whole <= 1e-9
    assert method.pose("rod")[2] == pytest.approx(start, abs=1e-9)


def test_joints_are_met_to_rounding():
    method = run(pendulum(1e-2, 0.3), 1000)
    x, y, angle = method.pose("rod")
    assert math.hypot(x - 0.5 * math.cos(angle), y - 20.0 - 0.5 * math.sin(angle)) < 1e-14


D, A, B, C = 4.0, 1.5, 3.5, 3.0  # four-bar: ground, crank, coupler, rocker


def angles(crank):
    """Angles of coupler and rocker, open branch."""
    x, y = D - A * math.cos(crank), -A * math.sin(crank)
    f = math.hypot(x, y)
    coupler = math.atan2(y, x) + math.acos((B * B + f * f - C * C) / (2.0 * B * f))
    return coupler, math.atan2(
        A * math.sin(crank) + B * math.sin(coupler), A * math.cos(crank) + B * math.cos(coupler) - D
    )


def four_bar(h, turn_rate):
    """Bars of 1 kg in a plane without gravity, the crank at 60° kept by a motor at its speed."""
    crank = math.pi / 3.0
    coupler, rocker = angles(crank)
    ends = {
        "crank": ((0.0, 0.0), A, crank),
        "coupler": ((A * math.cos(crank), A * math.sin(crank)), B, coupler),
        "rocker": ((D, 0.0), C, rocker),
    }
    tip = D + C * math.cos(rocker), C * math.sin(rocker)
    bars = [
        {
            "name": name,
            "mass": 1.0,
            "shapes": [{"box": {"size": [length, 0.01]}}],
            "layers": [k + 1],
            "pose": [x + 0.5 * length * math.cos(angle), y + 0.5 * length * math.sin(angle), angle],
        }
        for k, (name, ((x, y), length, angle)) in enumerate(ends.items())
    ]
    motor = {"speed": turn_rate, "max_torque": 1e6}
    joints = [
        {"type": "pin", "bodies": ["world", "crank"], "at": [0.0, 0.0], "motor": motor},
        {"type": "pin", "bodies": ["crank", "coupler"], "at": list(ends["coupler"][0])},
        {"type": "pin", "bodies": ["coupler", "rocker"], "at": list(tip)},
        {"type": "pin", "bodies": ["world", "rocker"], "at": [D, 0.0]},
    ]
    return Partitioned(
        reduce_scene(Scene.model_validate({"name": "four", "bodies": bars, "joints": joints, "tool": FAR_TOOL})), h
    )


def test_a_four_bar_keeps_its_angles_over_ten_turns():
    method = run(four_bar(1e-3, 2.0 * math.pi), 10000)
    crank, coupler, rocker = (method.pose(name)[2] for name in ("crank", "coupler", "rocker"))
    assert crank > math.pi / 3.0 + 19.9 * math.pi
    assert (coupler, rocker) == pytest.approx(angles(crank), abs=1e-12)


@pytest.mark.parametrize("ratio", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_collinear_impact_keeps_momentum_and_newtons_law_to_a_billionth(ratio, restitution):
    pair = [
        ball(name="a", mass=ratio, pose=[0.0, 5.0, 0.0], velocity=[1.0, 0.0, 0.0]),
        ball(name="b", pose=[0.30017, 5.0, 0.0]),
    ]
    method = run(world(1e-3, pair, restitution=restitution), 200)
    expected = (ratio - restitution) / (ratio + 1.0), ratio * (1.0 + restitution) / (ratio + 1.0)
    assert (speed(method, "a")[0], speed(method, "b")[0]) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("kind", [*BOTH, PymunkWorld])
@pytest.mark.parametrize(("gap", "speeds"), [(-1e-10, (-1 / 3, 2 / 3, 2 / 3)), (1e-9, (0.0, 0.0, 1.0))])
def test_touching_discs_are_struck_at_once_and_those_a_nanometre_apart_one_by_one(kind, gap, speeds):
    row = [ball(name=name, pose=[x, 5.0, 0.0]) for name, x in (("a", 0.0), ("b", 0.21), ("c", 0.41 + gap))]
    row[0]["velocity"] = [1.0, 0.0, 0.0]
    method = run(world(1e-3, row, restitution=1.0, kind=kind), 100)
    assert tuple(speed(method, name)[0] for name in "abc") == pytest.approx(speeds, abs=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.4])
@pytest.mark.parametrize("degrees", [10.0, 30.0, 60.0])
def test_a_falling_rod_gets_the_impulse_of_its_end(degrees, restitution):
    """P = (1+e) m v/(1 + 3 cos² θ): frictionless, one end hits (THEORY of planar impact, rod of length 1)."""
    theta = math.radians(degrees)
    falls = rod([0.0, 0.5 * math.sin(theta) + 0.05017, theta], velocity=[0.0, -1.0, 0.0])
    method = run(world(1e-3, [falls], restitution=restitution), 52)
    impulse = (1.0 + restitution) / (1.0 + 3.0 * math.cos(theta) ** 2)
    assert 1.0 + speed(method, "rod")[1] == pytest.approx(impulse, rel=1e-9)
    assert speed(method, "rod")[2] == pytest.approx(-impulse * 0.5 * math.cos(theta) * 12.0, rel=1e-9)


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_a_bouncing_ball_is_at_rest_after_zenos_time_and_not_before(restitution):
    end = math.sqrt(2.0 / G) * (1.0 + restitution) / (1.0 - restitution)
    h = end / 1000.0
    method = run(world(h, [ball(pose=[0.0, 1.1, 0.0])], restitution=restitution, gravity=DOWN), 999)
    assert method.energy()[0] > 0.0 or method.pose("ball")[1] > 0.1
    run(method, 2)
    assert speed(method, "ball") == pytest.approx(STILL, abs=1e-9)
    assert method.pose("ball")[1] == pytest.approx(0.1, abs=1e-9)


def tilted(degrees):
    theta = math.radians(degrees)
    return [G * math.sin(theta), -G * math.cos(theta)]


@pytest.mark.parametrize(("part", "slides"), [(1.001, False), (0.999, True)])
def test_a_block_slides_just_below_the_angle_of_friction_and_stays_just_above(part, slides):
    method = run(world(1e-3, [block()], part * math.tan(math.pi / 6), gravity=tilted(30.0)), 500)
    assert (method.pose("block")[0] > 1e-6) == slides


def test_a_sliding_block_accelerates_by_g_sin_less_mu_g_cos():
    method = run(world(1e-4, [block()], 0.3, gravity=tilted(30.0)), 1000)
    assert speed(method, "block")[0] / 0.1 == pytest.approx(G * (0.5 - 0.3 * math.sqrt(0.75)), rel=1e-9)


def test_a_disc_rolls_at_two_thirds():
    method = run(world(1e-3, [ball()], 0.5, gravity=tilted(20.0)), 1000)
    assert speed(method, "ball")[0] == pytest.approx(2.0 / 3.0 * G * math.sin(math.radians(20.0)), rel=1e-9)


def test_a_block_slides_to_rest_after_v_squared_over_two_mu_g_and_stays():
    method = run(world(1e-3, [block(velocity=[2.0, 0.0, 0.0])], 0.4, gravity=DOWN), 1500)
    assert method.pose("block")[0] == pytest.approx(4.0 / (2.0 * 0.4 * G), rel=1e-9)
    assert speed(method, "block") == pytest.approx(STILL, abs=1e-9)


@pytest.mark.parametrize(("kind", "close"), [(Partitioned, 1e-9), (EventDriven, 1e-9), (PymunkWorld, 1e-3)])
@pytest.mark.parametrize("belt", [0.5, -0.5])
def test_a_block_on_a_belt_has_its_speed_after_v_over_mu_g_and_keeps_it(kind, close, belt):
    method, drag = world(1e-3, [block()], 0.4, kind=kind, belt=belt, gravity=DOWN), 0.4 * G
    assert abs(run(method, 100).pose("block")[0]) == pytest.approx(0.5 * drag * 0.1**2, rel=close)
    assert run(method, 400).pose("block")[0] == pytest.approx(belt * (0.5 - 0.5 * abs(belt) / drag), rel=close)
    assert speed(method, "block") == pytest.approx((belt, 0.0, 0.0), abs=1e-9)


def test_errors_on_a_belt_under_a_plate_that_turns_fall_with_the_fourth_power_of_the_step():
    """What sticks to a running corner turns against it, and the part of the belt's velocity along it changes."""
    corner = {"name": "corner", "fixed": True, "surface_velocity": [0.3, 0.2], "pose": [0.0, 9.0, 0.0]}
    corner["shapes"] = [{"vertices": [[-0.1, -0.2], [0.1, -0.2], [0.0, 0.0]]}]
    plate = block(pose=[0.01, 9.05, 0.0], shapes=[{"box": {"size": [1.0, 0.1]}}])
    exact, *ends = (run(world(0.2 / n, [corner, plate], 2.0, gravity=DOWN), n).pose("block") for n in (800, 20, 80))
    errors = [math.dist(end, exact) for end in ends]
    assert abs(exact[2]) > 0.02 and errors[0] / errors[1] > 2.0**7


def test_a_ball_that_falls_on_a_belt_is_spun_by_it_and_by_no_more_than_its_friction():
    """μ m v (1 + e) while it slides; a disc that ends rolling has a third of the belt's speed."""
    falling = ball(pose=[0.0, 0.1 + 1e-4, 0.0], velocity=[0.0, -1.0, 0.0])
    for belt, given in ((3.0, 0.2 * 1.0 * 1.5), (0.3, 0.1)):
        method = run(world(1e-3, [falling], 0.2, 0.5, belt=belt), 2)
        assert speed(method, "ball") == pytest.approx((given, 0.5, given / 0.05), rel=1e-9)


def test_a_tool_on_a_belt_goes_with_it_until_its_coupling_pulls_as_hard_as_friction():
    tool = {"mass": 0.1, "inertia": 1e-4, "pose": [0.0, 0.01, 0.0], "material": "m"}
    method = world(1e-3, [], 0.3, belt=0.1, tool=tool | {"shapes": [{"box": {"size": [0.04, 0.02]}}]})
    method.couple(Coupling(2000.0, 20.0, 50.0, 0.5))
    handle = 0.0, 0.0, 0.0
    assert run(method, 10, handle).velocity[0] == pytest.approx(0.1, rel=1e-9)
    assert run(method, 2000, handle).position[:2] == pytest.approx((0.3 * 0.01, 0.01), rel=1e-6)


@pytest.mark.parametrize(("width", "tips"), [(0.039, True), (0.041, False)])
def test_a_block_tips_before_it_slides_if_it_is_narrower_than_mu_times_its_height(width, tips):
    """Gravity turns slowly enough past the friction angle: w/h against μ = .4, at a slope of just above it."""
    slope = 22.0 if not tips else 21.5
    tall = block(pose=[0.0, 0.05, 0.0], shapes=[{"box": {"size": [width, 0.1]}}])
    method = run(world(1e-3, [tall], 0.4, gravity=tilted(slope)), 200)
    assert (abs(method.pose("block")[2]) > 1e-3) == tips


def test_a_stack_of_twenty_carries_its_weight_and_does_not_move():
    boxes = [block(name=f"b{i}", pose=[0.0, 0.05 + 0.1 * i, 0.0]) for i in range(20)]
    method = run(world(1e-3, boxes, 0.5, gravity=DOWN), 200)
    carried = {}
    for contact in method.contacts():
        key = contact.body_a, contact.body_b
        carried[key] = carried.get(key, 0.0) + abs(contact.force_on_a[1])
    assert sorted(carried.values()) == pytest.approx([G * (i + 1) for i in range(20)], rel=1e-7)
    assert all(speed(method, f"b{i}").tolist() == [0.0, 0.0, 0.0] for i in range(20))
    assert method.refusals == 0


@pytest.mark.parametrize("friction", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("degrees", [45.0, 63.43, 75.0])
def test_painleves_rod_comes_through_with_no_energy_gained(friction, degrees):
    theta = math.radians(degrees)
    thrown = rod([0.0, 0.5 * math.sin(theta), theta], velocity=[-1.0, 0.0, 0.0])
    method = world(1e-3, [thrown], friction, gravity=DOWN)
    energies = [sum(method.energy()), *(sum(run(method, 1).energy()) for _ in range(150))]
    assert np.isfinite(energies).all() and np.diff(energies).max() <= 1e-9


def test_an_unheld_tool_falls_and_a_held_one_hangs():
    for gains, y in ((Coupling(), -0.5 * G * 0.01), (Coupling(2000.0, 20.0, 1.0, 0.01), -0.1 * G / 2000.0)):
        tool = {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}], "pose": [0.0, 9.0, 0.0]}
        method = world(1e-3, [], gravity=DOWN, tool=tool)
        method.couple(gains)
        run(method, 100 if y < -0.01 else 3000, (0.0, 9.0, 0.0))
        assert method.position[1] - 9.0 == pytest.approx(y, rel=1e-6)


def test_bodies_beside_the_held_tool_fly_on_undisturbed():
    method = world(1e-3, [ball(pose=[0.0, 9.0, 0.0], velocity=[1.0, 0.0, 2.0])], gravity=DOWN)
    method.couple(Coupling(1000.0, 5.0, 1.0, 0.01))
    for _ in range(50):
        run(method, 10, (50.01, 50.0, 0.3))
    assert method.pose("ball") == pytest.approx((0.5, 9.0 - 0.5 * G * 0.25, 1.0), abs=1e-12)


def crowded(h, gains, gravity):
    """A tool between a floor, a loose block and a pendulum pinned to it."""
    hung = block(name="rod", mass=0.05, pose=[0.0, 0.35, math.pi / 2], shapes=[{"box": {"size": [0.1, 0.01]}}])
    tool = {"mass": 0.1, "material": "m", "pose": [0.0, 0.3, 0.0], "shapes": [{"box": {"size": [0.04, 0.03]}}]}
    bodies, pin = [block(pose=[0.15, 0.05, 0.0], mass=0.2), hung], {"type": "pin", "bodies": ["tool", "rod"]}
    method = world(h, bodies, 0.3, 0.4, gravity=gravity, tool=tool, joints=[pin | {"at": [0.0, 0.3]}])
    method.couple(gains)
    return method


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("gains", [Coupling(2000.0, 2.0, 2.0, 0.002), Coupling(2e5, 0.0, 50.0, 0.0)])
def test_the_tools_port_never_gives_more_than_it_was_given(seed, gains):
    """Handle motions that jump at random among few places, held for random times: the worst that a network makes."""
    rng = np.random.default_rng(seed)
    method = crowded(1e-3, gains, [0.0, 0.0])
    start, supplied, worst = sum(method.energy()), 0.0, 0.0
    for _ in range(150):
        handle = (rng.uniform(-0.1, 0.2), rng.uniform(-0.02, 0.3), rng.uniform(-2, 2))
        supplied += method.step(held(handle), int(rng.integers(1, 8))).supplied
        worst = min(worst, supplied - (sum(method.energy()) - start))
    assert worst >= -1e-9 * max(supplied, 1.0)


def test_reset_brings_back_the_start_and_the_same_bits():
    method = crowded(1e-3, Coupling(2000.0, 2.0, 2.0, 0.002), DOWN)
    first = [run(method, 5, (0.1, 0.02, 0.5)).position for _ in range(40)]
    method.reset()
    assert [run(method, 5, (0.1, 0.02, 0.5)).position for _ in range(40)] == first


def test_gains_that_are_negative_are_refused_by_name():
    with pytest.raises(ValueError, match="coupling damping is -1.0.*at least 0"):
        pendulum(1e-3).couple(Coupling(1.0, -1.0))


def test_a_scene_with_too_many_bodies_is_refused_with_the_number():
    balls = [ball(name=f"b{i}", pose=[0.3 * i, 1.0, 0.0]) for i in range(45)]
    with pytest.raises(ValueError, match="46|47.*bodies; the compiled methods take at most 40"):
        world(1e-3, balls, gravity=DOWN)
