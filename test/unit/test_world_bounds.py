# SPDX-License-Identifier: Apache-2.0
"""What moves and what rests on either side of a bound, energy and momentum that nothing makes, stacks and chains."""

import itertools
import math

import numpy as np
import pytest
from worlds import BALL, DOWN, TURNS, G, World, body, box, disc, fixed, floor, joint, spring, tool

from bench.reference.exact_four_bar import angles
from haptic_sim.protocol import STILL, Coupling

DIRECT = ["partitioned", "event_driven"]


def tilted(slope):
    return G * math.sin(slope), -G * math.cos(slope)


def on_a_slope(part):
    """A block, whose friction is less than the slope's tangent by this part."""
    more = dict(friction=math.tan(math.pi / 6) / part, gravity=tilted(math.pi / 6))
    return dict(bodies=[floor(), body(0.0, 0.05)], **more)


def narrow(part):
    """A block on a slope of too much friction to slide, whose width is less than what stands by this part."""
    width = 0.1 * math.tan(0.4) / part
    tall = body(0.0, 0.05, shapes=box(width, 0.1))
    return dict(bodies=[floor(), tall], friction=1.0, gravity=tilted(0.4))


def arm(part):
    """On a pin whose friction is less than the torque of its weight by this part."""
    pin = joint("pin", friction_torque=0.5 * G / part)
    return dict(bodies=[body(0.5, shapes=box(0.1, 0.1))], joints=[pin], gravity=DOWN)


def driven(part):
    """A load on a guide of 30°, up from its stop by a motor of this part of its weight there."""
    guide = joint("slider", limits=[0.0, 1.0], motor={"speed": 0.02, "max_force": 0.5 * part * G})
    return dict(bodies=[body()], joints=[guide], gravity=(-0.5 * G, -math.sqrt(0.75) * G))


def turned_round(part):
    guide = joint("slider", "body", "world", limits=[-1.0, 0.0], motor={"speed": -0.02, "max_force": 0.5 * part * G})
    return driven(part) | dict(joints=[guide])


def against_friction(part):
    """A wheel whose motor is stronger than the dry friction of its pin by this part."""
    pin = joint("pin", friction_torque=0.5, motor={"speed": 3.0, "max_torque": 0.5 * part})
    return dict(bodies=[body()], joints=[pin])


BOUNDS = {
    on_a_slope: {"partitioned": 1e-3, "event_driven": 1e-3, "impulse": 1e-2},
    narrow: {"partitioned": 1e-2},
    arm: {"partitioned": 1e-3, "event_driven": 1e-3, "impulse": 1e-2},
    driven: {"partitioned": 1e-3, "impulse": 1e-2, "penalty_implicit": 1e-2},
    turned_round: {"partitioned": 1e-3, "impulse": 1e-2},
    against_friction: {"partitioned": 1e-3, "event_driven": 1e-3, "impulse": 1e-2},
}


@pytest.mark.parametrize(
    ("scene", "method", "off"),
    [pytest.param(scene, *one, id=f"{scene.__name__}-{one[0]}") for scene, of in BOUNDS.items() for one in of.items()],
)
def test_a_body_moves_just_beyond_its_bound_and_rests_just_within(scene, method, off):
    for turn, part in itertools.product(TURNS, (1.0 - off, 1.0 + off)):
        world = World(method, turn=turn, h=0.5e-3, **scene(part))
        before = world.state()
        moved = np.abs(world.run(0.5).state() - before)[:3].max()
        assert (moved > 5e-4) == (part > 1.0), (turn, part, moved)


def test_a_stack_of_twenty_carries_its_weight_and_does_not_move():
    boxes = [body(0.0, 0.05 + 0.1 * i, name=f"b{i}") for i in range(20)]
    world = World("partitioned", [floor(), *boxes], friction=0.5, gravity=DOWN).run(0.2)
    carried = {}
    for contact in world.method.contacts():
        pair = contact.body_a, contact.body_b
        carried[pair] = carried.get(pair, 0.0) + abs(contact.force_on_a[1])
    assert sorted(carried.values()) == pytest.approx([G * (i + 1) for i in range(20)], rel=1e-7)
    assert all(world.state(f"b{i}")[3:].tolist() == [0.0, 0.0, 0.0] for i in range(20))
    assert world.method.refusals == 0


SLIM = [{"vertices": [[-0.5, 0.0], [0.0, -0.001], [0.5, 0.0], [0.0, 0.001]]}]


def rod(degrees, velocity, over=0.0):
    angle = math.radians(degrees)
    return body(0.0, 0.5 * math.sin(angle) + over, angle, shapes=SLIM, inertia=1.0 / 12.0, velocity=[*velocity, 0.0])


HANDLE = {"box": {"size": [0.03, 0.002], "center": [0.015, 0.0]}}
KNOB = dict(
    bodies=[body(name="knob", shapes=[*BALL, HANDLE], mass=0.02)],
    joints=[joint("pin", "world", "knob", damping=0.5)],
    tool=tool(0.026, 0.0165, shapes=disc(0.005), mass=0.05),
    gravity=DOWN,
    h=0.1e-3,
)
GAINS = Coupling(2000.0, 2.0, 2.0, 0.002)
THROWN = dict(bodies=[floor(), rod(40.0, [-2.0, -1.0], 1e-4)], friction=0.5)
GAINING = {
    "painlevé 45°": (dict(bodies=[floor(), rod(45.0, [-1.0, 0.0])], friction=1.0, gravity=DOWN), ["partitioned"]),
    "painlevé 63°": (dict(bodies=[floor(), rod(63.43, [-1.0, 0.0])], friction=1.5, gravity=DOWN), ["partitioned"]),
    "painlevé 75°": (dict(bodies=[floor(), rod(75.0, [-1.0, 0.0])], friction=2.0, gravity=DOWN), ["partitioned"]),
    "rough rod": (THROWN | dict(friction=2.0, restitution=0.9), ["partitioned"]),
    "rough elastic rod": (THROWN | dict(restitution=1.0), ["partitioned"]),
    "small knob in grease": (KNOB, DIRECT),
    "small knob in grease and held tool": (KNOB | dict(gains=GAINS), DIRECT),
}


@pytest.mark.parametrize(
    ("scene", "method"),
    [pytest.param(of, method, id=f"{name} {method}") for name, (of, methods) in GAINING.items() for method in methods],
)
def test_no_step_gains_more_energy_than_its_coupling_supplied(scene, method):
    world = World(method, **scene)
    for k in range(200):
        (x, y, angle), before = world.handle, world.energy
        supplied = world.lead([(world.handle, STILL), ((x, y - 2e-5, angle), STILL)]).supplied
        assert world.energy - before - supplied <= 1e-9, k


@pytest.mark.parametrize("method", DIRECT)
@pytest.mark.parametrize(
    ("kind", "swing", "rate"),
    [
        ("pin", 2.5, 0.0),
        ("pin", 5e4, 1e4),
        ("slider", 100.0, 0.0),
        ("slider", 2.0, 6.0),
        ("spring", 1e4, 0.0),
        ("spring", 2.5, 0.5),
    ],
)
def test_no_spring_damper_creates_energy_and_a_damped_one_comes_to_rest(method, kind, swing, rate):
    """`swing` radians and `rate` time constants a step of 1 ms; an explicit formula is stable up to some 6."""
    stretch, each = 1e-3, dict(stiffness=(1e3 * swing) ** 2, damping=1e3 * rate)
    law = spring(rest=0.0, **each) if kind == "spring" else joint(kind, rest=-stretch, **each)
    start = stretch if kind == "spring" else 0.0
    world = World(method, [body(start, shapes=disc(0.1), inertia=1.0, layers=[])], joints=[law])
    energies = [world.energy, *(world.steps(1).energy for _ in range(100))]
    assert np.diff(energies).max() <= 1e-6 * energies[0]
    assert rate == 0.0 or world.state()[2 if kind == "pin" else 0] - start == pytest.approx(-stretch, rel=0.01)


def test_what_a_motor_has_given_is_at_least_the_kinetic_energy():
    """15 N m over the angle, of which friction takes half."""
    pin = joint("pin", friction_torque=7.5, motor={"speed": 3.0, "max_torque": 15.0})
    world = World("partitioned", [body(inertia=1.0, layers=[])], joints=[pin])
    for _ in range(50):
        angle = world.steps(10).state()[2]
        assert world.energy <= 7.5 * angle * (1.0 + 1e-9) + 1e-12


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("friction", [0.0, 0.5, 2.0])
def test_where_friction_would_make_a_rebound_gain_energy_a_part_of_it_stays(turn, friction):
    for e in (0.5, 0.9, 1.0):
        world = World("partitioned", turn=turn, restitution=e, **THROWN | dict(friction=friction))
        before = world.energy
        _, _, angle, _, vy, turning = world.steps(2).state()
        assert vy - 0.5 * turning * math.cos(angle) > 0.05  # of the end that struck
        assert world.energy <= before * (1.0 + 1e-9)


def links(count, length, ratio=1.0):
    """Thin links in a row, let go level, the last so many times as heavy as the others."""
    bodies, pins = [], []
    for k in range(count):
        mass = 0.02 * (ratio if k == count - 1 else 1.0)
        bodies.append(body(length * (k + 0.5), name=f"l{k}", shapes=box(length, 0.2 * length), mass=mass, layers=[1]))
        pins.append(joint("pin", f"l{k - 1}" if k else "world", f"l{k}", (length * k, 0.0)))
    return dict(bodies=bodies, joints=pins, gravity=DOWN)


def test_a_chain_of_thin_links_keeps_its_pins_closed_and_creates_no_energy():
    count, length = 9, 0.02
    world = World("impulse", h=1e-3, **links(count, length))
    least = start = world.energy
    created = opened = fastest = 0.0
    for _ in range(600):
        kinetic, potential = world.steps(1).method.energy()
        fastest, least = max(fastest, kinetic), min(least, kinetic + potential)
        created = max(created, kinetic + potential - least)
        end = (0.0, 0.0)
        for k in range(count):
            x, y, angle, *_ = world.state(f"l{k}")
            way = 0.5 * length * math.cos(angle), 0.5 * length * math.sin(angle)
            opened = max(opened, math.dist(end, (x - way[0], y - way[1])))
            end = x + way[0], y + way[1]
    assert opened < 1e-4
    assert created < 0.01 * fastest and world.energy < start


@pytest.mark.parametrize(("ratio", "stop"), [(1.0, True), (50.0, False)])
def test_a_double_pendulum_keeps_its_energy_and_is_where_the_direct_method_says(ratio, stop):
    """Whatever else has a stop: by impulses a drawer far away has one."""
    ends, scene = [], links(2, 0.03, ratio)
    if stop:
        scene["bodies"].append(body(2.0, name="drawer"))
        scene["joints"].append(joint("slider", "world", "drawer", limits=[-0.1, 0.1]))
    for method in ("impulse", "partitioned"):
        world = World(method, turn=TURNS[1], h=0.25e-3, **scene)
        before = world.energy
        world.run(0.1)
        assert world.energy == pytest.approx(before, abs=2e-3 * 0.02 * (1.0 + ratio) * G * 0.06)
        ends.append([world.state(name)[2] for name in ("l0", "l1")])
    assert ends[0] == pytest.approx(ends[1], abs=5e-3)


HINGE = (0.05, 0.03)
FREE = {
    "pin": {},
    "pin with spring": {"stiffness": 0.1, "damping": 0.01, "rest": 0.5},
    "pin with stops": {"limits": [-0.2, 0.3]},
    "pin with drives": {"motor": {"speed": 1.0, "max_torque": 0.03}, "friction_torque": 0.02},
    "slider with spring": {"stiffness": 50.0, "damping": 0.5, "rest": 0.02},
    "slider with stops": {"limits": [-0.02, 0.03]},
    "slider with drives": {"motor": {"speed": 0.05, "max_force": 2.0}, "friction_force": 0.3},
    "spring": {"stiffness": 50.0, "damping": 0.5},
    "spring without length": {"stiffness": 50.0, "damping": 0.5, "rest": 0.0},
}


@pytest.mark.parametrize("name", FREE)
def test_two_free_bodies_joined_beside_their_mass_centres_keep_their_momentum(name):
    """Each starts as the joint lets it; a slider's both turn about one point, and slide."""
    kind, places = name.split(" ")[0], ((0.0, 0.0), (0.1, 0.05))
    if kind == "spring":
        law = spring("one", "two", [(0.02, 0.03), (-0.03, 0.01)], **FREE[name])
    else:
        law = joint(kind, "one", "two", HINGE, **({"axis": [1.0, 0.4]} if kind == "slider" else {}) | FREE[name])

    def rates(k):
        (x, y), spin = places[k], 1.0 - k * (kind != "slider")
        if kind == "slider":
            return [-y + 0.05 * k, x + 0.02 * k, spin]
        return [0.1 - spin * (y - HINGE[1]), 0.05 + spin * (x - HINGE[0]), spin]

    one = body(*places[0], 0.0, "one", box(0.06, 0.04), 0.3, velocity=rates(0), layers=[])
    two = body(*places[1], 0.0, "two", box(0.08, 0.02), 0.7, velocity=rates(1), layers=[])
    world = World("impulse", [one, two], h=1e-3, turn=TURNS[1], joints=[law])

    def momentum():
        sums = np.zeros(3)
        for name, mass, inertia in ("one", 0.3, 0.3 * (0.06**2 + 0.04**2) / 12.0), ("two", 0.7, 0.7 * 0.0068 / 12.0):
            x, y, _, vx, vy, turning = world.state(name)
            sums += mass * vx, mass * vy, mass * (x * vy - y * vx) + inertia * turning
        return sums

    before = momentum()
    world.run(1.0)
    assert momentum() == pytest.approx(before, abs=1e-10)


@pytest.mark.parametrize("drive", [{"motor": {"speed": 0.3, "max_force": 1.0}}, {"friction_force": 0.1}])
def test_a_slider_between_two_that_turn_is_driven_and_braked_along_its_axis_alone(drive):
    """A load on a carrier that spins, without gravity, against the direct solver: no part of the force goes across."""
    carrier = body(name="carrier", mass=2.0, inertia=0.02, velocity=[0.0, 0.0, 2.0], layers=[])
    load = body(0.2, name="load", inertia=0.01, velocity=[0.0, 0.4, 2.0], layers=[])
    guide = joint("slider", "carrier", "load", (0.2, 0.0), **drive)
    worlds = [World(method, [carrier, load], 0.25e-3, joints=[guide]).run(0.1) for method in ("impulse", "partitioned")]
    for name in ("carrier", "load"):
        assert worlds[0].state(name)[:3] == pytest.approx(worlds[1].state(name)[:3], abs=2e-5)


def test_errors_on_a_belt_under_a_plate_that_turns_fall_with_the_fourth_power_of_the_step():
    """What sticks to a running corner turns against it, and the part of the belt's velocity along it changes."""
    corner = [{"vertices": [[-0.1, -0.2], [0.1, -0.2], [0.0, 0.0]]}]
    scene = [fixed("corner", shapes=corner, surface_velocity=[0.3, 0.2]), body(0.01, 0.05, shapes=box(1.0, 0.1))]
    ends = [World("partitioned", scene, 0.2 / n, friction=2.0, gravity=DOWN).steps(n).state() for n in (800, 20, 80)]
    exact, *errors = ends[0], *(math.dist(end[:3], ends[0][:3]) for end in ends[1:])
    assert abs(exact[2]) > 0.02 and errors[0] / errors[1] > 2.0**7


BARS = 4.0, 1.5, 3.5, 3.0  # ground, crank, coupler, rocker


def test_a_four_bar_driven_by_its_crank_keeps_its_angles_over_ten_turns():
    ground, *lengths = BARS
    start = math.pi / 3.0
    knee = lengths[0] * math.cos(start), lengths[0] * math.sin(start)
    coupler, rocker = angles(BARS, start)
    tip = ground + lengths[2] * math.cos(rocker), lengths[2] * math.sin(rocker)
    names, ends = ("crank", "coupler", "rocker"), ((0.0, 0.0), knee, (ground, 0.0))
    bars = [
        body(
            x + 0.5 * size * math.cos(angle), y + 0.5 * size * math.sin(angle), angle, name, box(size, 0.01), layers=[]
        )
        for name, angle, (x, y), size in zip(names, (start, coupler, rocker), ends, lengths, strict=True)
    ]
    pins = [
        joint("pin", "world", "crank", motor={"speed": 2.0 * math.pi, "max_torque": 1e6}),
        joint("pin", "crank", "coupler", knee),
        joint("pin", "coupler", "rocker", tip),
        joint("pin", "world", "rocker", ends[2]),
    ]
    world = World("partitioned", bars, joints=pins).run(10.0)
    crank, *others = (world.pose(name)[2] for name in names)
    assert crank > start + 19.9 * math.pi
    assert others == pytest.approx(angles(BARS, crank), abs=1e-12)


def test_a_pendulums_joint_is_met_to_rounding():
    hung = body(0.5 * math.cos(0.3), 0.5 * math.sin(0.3), 0.3, shapes=box(1.0, 0.01))
    world = World("partitioned", [hung], 1e-2, gravity=DOWN, joints=[joint("pin")])
    x, y, angle, *_ = world.steps(1000).state()
    assert math.hypot(x - 0.5 * math.cos(angle), y - 0.5 * math.sin(angle)) < 1e-14


LEVER = [fixed("base", shapes=box(0.06, 0.06)), body(0.05, 0.01, name="lever", shapes=box(0.12, 0.01), mass=0.1)]


def test_a_lever_on_a_base_that_it_overlaps_stays_on_its_pin_and_meets_another_body():
    """The lever's lower face is .005 + .01 m from the middle of the stop."""
    pin = joint("pin", "base", "lever", (0.0, 0.01))
    world = World("impulse", [*LEVER, fixed("stop", 0.09, -0.03, BALL)], 1e-3, gravity=DOWN, joints=[pin])
    for _ in range(300):
        x, y, angle, *_ = world.steps(1).state("lever")
        assert math.hypot(x - 0.05 * math.cos(angle), y - 0.05 * math.sin(angle) - 0.01) < 1e-5
    tilt = math.atan2(0.04, 0.09) - math.asin(0.015 / math.hypot(0.04, 0.09))
    assert angle == pytest.approx(-tilt, abs=2e-3)


def test_of_two_pinned_bodies_one_still_meets_what_is_welded_to_the_other():
    one, third = body(name="A", shapes=box(0.02, 0.02)), body(0.0, 0.08, name="C", shapes=box(0.1, 0.02))
    arm = body(0.05, name="B", shapes=box(0.1, 0.01), velocity=[0.0, 1.25, 25.0])
    joints = [joint("weld", "A", "C", (0.0, 0.05)), joint("pin", "A", "B"), joint("pin", "world", "A")]
    world, turned = World("impulse", [one, third, arm], 0.25e-3, joints=joints), 0.0
    for _ in range(400):
        turned = max(turned, world.steps(1).pose("B")[2] - world.pose("A")[2])
    assert 0.5 < turned < 0.5 * math.pi


def test_welded_bodies_move_as_one_and_bodies_pass_through_those_of_other_layers():
    """Layers 1 and 33 too, which are no bits of one number."""
    going = dict(shapes=BALL, velocity=[1.0, 0.0, 0.0])
    bodies = [
        body(-0.2, y, name=name, **going, **more)
        for name, y, more in (
            ("one", 0.0, {}),
            ("two", 0.3, {}),
            ("five", -0.3, dict(layers=[5])),
            ("held", -0.4, dict(layers=[33])),
        )
    ]
    plates = [fixed("plate", shapes=box(0.001, 0.7)), fixed("other", 0.0, -0.4, box(0.001, 0.05), layers=[33, 1])]
    world = World("impulse", [*plates, *bodies], 0.25e-3, joints=[joint("weld", "one", "two", (-0.2, 0.1))]).run(0.3)
    assert math.dist(world.pose("one")[:2], world.pose("two")[:2]) == pytest.approx(0.3, rel=1e-9)
    assert world.pose("one")[0] < 0.0 and world.pose("held")[0] < 0.0
    assert world.pose("five")[0] == pytest.approx(0.1, rel=1e-9)
    ghost = World("impulse", [plates[1] | {"layers": [1]}, bodies[3]], 0.25e-3).run(0.3)
    assert ghost.pose("held")[0] == pytest.approx(0.1, rel=1e-9)
