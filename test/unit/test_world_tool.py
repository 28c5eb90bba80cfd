# SPDX-License-Identifier: Apache-2.0
"""The tool between its coupling and the world: backward difference, forces, rebounds that the port can pay."""

import itertools
import math

import numpy as np
import pymunk
import pytest
from examples import half
from worlds import DOWN, TURNS, World, box, disc, fixed, floor, joint, tool

from haptic_sim.lockstep.rollout import hand
from haptic_sim.method_registry import METHODS, make
from haptic_sim.protocol import STILL, Coupling
from haptic_sim.pymunk_world.space import SLOP
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

H, ONE, M = 0.25e-3, 50e-6, 0.1  # ONE: a sub-step that is one step of the impulse method
GAINS = Coupling(2000.0, 2.0, 2.0, 0.002)
WALL = fixed("wall", shapes=[{"half_plane": {"normal": [1.0, 0.0]}}])
PLATE = fixed("plate", shapes=box(0.001, 1.0))
RIGID = ["impulse", "partitioned", "event_driven", "closed_form"]


def backward_difference(x0, stiffness, damping, mass, h, steps):
    """Closed form of m(v⁺−v) = −h(K x⁺ + B v⁺), x⁺ = x + h v⁺ from rest: powers of its two roots."""
    polynomial = mass + h * damping + h * h * stiffness, -(2.0 * mass + h * damping), mass
    first, second = np.roots(polynomial).astype(complex)
    # From rest x₋₁ = x₀, so a + b = x₀ and a/z₁ + b/z₂ = x₀.
    a = x0 * (1.0 - 1.0 / second) / (1.0 / first - 1.0 / second)
    n = np.arange(1, steps + 1)
    return (a * first**n + (x0 - a) * second**n).real


@pytest.mark.parametrize("method", ["impulse", "partitioned", "penalty_implicit"])
@pytest.mark.parametrize(("stiffness", "damping", "h"), [(2000.0, 2.0, ONE), (2000.0, 200.0, 25e-6), (1e6, 0.0, ONE)])
def test_a_free_tool_follows_the_closed_form_of_backward_difference(method, stiffness, damping, h):
    gains = Coupling(stiffness, damping, 1e-3 * stiffness, 1e-3 * damping)
    world = World(method, [], h, tool=tool(0.02, 0.5, 0.1, inertia=1e-4), gains=gains)
    path = np.array([world.steps(1, (0.03, 0.5, 0.3)).pose("tool") for _ in range(400)])
    assert path[:, 0] - 0.03 == pytest.approx(backward_difference(-0.01, stiffness, damping, M, h, 400), abs=1e-11)
    assert path[:, 2] - 0.3 == pytest.approx(backward_difference(-0.2, stiffness, damping, M, h, 400), abs=2e-10)


@pytest.mark.parametrize("method", ["impulse", "partitioned", "penalty_implicit", "closed_form"])
def test_the_force_on_the_tool_is_the_law_of_the_newest_gains_at_the_end_of_a_step_and_what_moved_it(method):
    world = World(method, [], ONE, tool=tool(0.5, inertia=1e-4), gains=Coupling(300.0, 1.0, 0.5, 0.001))
    world.steps(2, (0.5, 0.01, 0.1))
    world.method.couple(GAINS)
    for _ in range(3):
        before = world.state("tool")[3:]
        world.steps(1, (0.52, 0.01, 0.3), (0.1, -0.2, 4.0))
        x, y, angle, vx, vy, turning = world.state("tool")
        expected = 2000 * (0.52 - x) + 2 * (0.1 - vx), 2000 * (0.01 - y) + 2 * (-0.2 - vy)
        expected = np.array((*expected, 2 * (0.3 - angle) + 0.002 * (4.0 - turning)))
        assert world.method.force_on_tool == pytest.approx(expected, rel=1e-11)
        assert np.array((M, M, 1e-4)) * (world.state("tool")[3:] - before) / ONE == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("method", RIGID)
@pytest.mark.parametrize("stretch", [0.5e-3, 5e-3])
def test_pressed_on_a_wall_the_contact_force_is_stiffness_times_stretch(method, stretch):
    world = World(method, [WALL], H, tool=tool(0.011), gains=Coupling(2000.0, 20.0, 2.0, 0.02))
    world.run(1.0, (0.01 - stretch, 0.0, 0.0))
    (contact,) = world.method.contacts()
    place = world.pose("tool")[0]
    assert (contact.body_a, contact.body_b) == ("tool", "wall")
    assert contact.force_on_a == pytest.approx((2000.0 * (stretch + place - 0.01), 0.0), rel=1e-9, abs=1e-9)
    assert world.force()[0] == pytest.approx(-contact.force_on_a[0], rel=1e-9)
    assert place == pytest.approx(0.01, abs=1.01 * SLOP)
    assert contact.normal == pytest.approx((-1.0, 0.0))
    assert contact.point == pytest.approx((0.0, 0.0), abs=SLOP)
    assert 0.0 <= contact.depth <= 1.01 * SLOP


@pytest.mark.parametrize("method", ["impulse", "partitioned"])
def test_a_pressed_tool_slides_just_beyond_the_friction_cone_and_stays_just_within(method):
    for turn, part in itertools.product(TURNS, (0.99, 1.01)):
        block = tool(0.01, inertia=1.0, shapes=box(0.02, 0.02))
        world = World(method, [WALL], H, turn, 0.2, tool=block, gains=Coupling(2000.0, 20.0, 100.0, 10.0))
        normal = -world.run(0.3, (0.008, 0.0, 0.0)).force()[0]
        before = world.pose("tool")[1]
        world.run(0.3, (0.008, before + part * 0.2 * normal / 2000.0, 0.0))
        assert (abs(world.pose("tool")[1] - before) > 1e-6) == (part > 1.0)


@pytest.mark.parametrize("method", ["impulse", "partitioned"])
def test_a_tool_at_the_stop_of_its_guide_is_held_by_the_couplings_force_which_is_no_contact(method):
    guide = joint("slider", "world", "tool", limits=[-0.1, 0.02])
    world = World(method, [], H, tool=tool(), joints=[guide], gains=Coupling(2000.0, 20.0, 2.0, 0.02))
    assert world.run(0.2, (0.03, 0.0, 0.0)).force()[0] == pytest.approx(2000.0 * 0.01, rel=1e-3)
    assert not world.method.touching and world.method.contacts() == []


def test_a_tool_on_a_guide_touches_where_it_meets_a_wall_and_only_there():
    guide = joint("slider", "world", "tool")
    world = World("impulse", [WALL], H, tool=tool(0.011), joints=[guide], gains=GAINS)
    assert not world.run(0.1, (0.015, 0.002, 0.0)).method.touching and world.method.contacts() == []
    assert world.run(0.2, (0.005, 0.002, 0.0)).method.touching
    assert world.method.contacts()[0].force_on_a[0] == pytest.approx(2000.0 * 0.005, rel=2e-3)


def test_what_a_tool_touches_within_an_exchange_is_told_with_its_force():
    world = World("impulse", [WALL], H, restitution=0.9, tool=tool(0.03, velocity=[-1.0, 0.0, 0.0]))
    went = [world.lead([(world.handle, STILL)] * 2, 4) for _ in range(40)]
    touched = [travel for travel in went if travel.touched]
    assert world.state("tool")[3] > 0.5
    assert 1 <= len(touched) <= 2 and max(travel.force for travel in touched) > 0.0


@pytest.mark.parametrize("name", ["slider", "four_bar"])
def test_joints_that_push_the_tool_are_no_contact(name):
    scene = load(name)
    method, lead = make("impulse", reduce_scene(scene), 1e-3), hand(scene)
    method.couple(GAINS)
    for k in range(500):
        place = lead(2e-3 * k)
        method.step(np.array([[*place, 0.0, 0.0, 0.0]] * 2), 2)
        assert not method.touching and method.contacts() == []


def test_while_sliding_and_bouncing_contacts_coupling_and_gravity_add_up_to_the_change_of_momentum():
    more = dict(tool=tool(0.011), gravity=[0.3, -9.81], friction=0.2, restitution=0.5, gains=GAINS)
    world, touched = World("impulse", [WALL], ONE, **more), 0
    for k in range(4000):
        before = world.state("tool")[3:5]
        world.steps(1, (0.008 + 0.004 * math.sin(0.01 * k), 2e-5 * k, 0.0))
        forces = [contact.force_on_a for contact in world.method.contacts()]
        total = np.sum([world.force(), (0.3 * M, -9.81 * M), *forces], axis=0)
        assert total * ONE == pytest.approx(M * (world.state("tool")[3:5] - before), abs=1e-12)
        touched += world.method.touching
    assert 100 < touched < 3750


def test_a_sub_step_of_several_steps_is_as_many_sub_steps_of_one():
    """The handle goes on a straight line through either; Σ f·Δx is the energy supplied."""
    start, end = np.array((0.03, 0.0, 0.1)), np.array((-0.02, 0.003, 0.2))
    more = dict(tool=tool(*start), gravity=DOWN, friction=0.2, gains=GAINS)
    coarse = World("impulse", [WALL], H, **more)
    inner = coarse.method.inner
    fine, steps = World("impulse", [WALL], H / inner, **more), 400 * inner
    velocity = (end - start) / (400 * H)
    before, work = fine.pose("tool"), 0.0
    made = coarse.lead([(start, velocity), (end, velocity)], 400)
    for k in range(1, steps + 1):
        fine.steps(1, tuple(start + k / steps * (end - start)), velocity)
        work += fine.method.force_on_tool @ (fine.pose("tool") - before)
        before = fine.pose("tool")
    assert inner > fine.method.inner == 1
    assert (coarse.method.touching, made.touched) == (True, True)
    assert coarse.state("tool")[:3] == pytest.approx(fine.state("tool")[:3], abs=1e-12)
    assert coarse.state("tool")[3:] == pytest.approx(fine.state("tool")[3:], abs=1e-9)
    assert made.supplied == pytest.approx(work, rel=1e-9)


def put_wall(world, x):
    """A wall, as if it had come from behind, up to this place."""
    space = world.method.space
    space.add(pymunk.Poly(space.static_body, [(x - 0.11, -1.0), (x - 0.01, -1.0), (x - 0.01, 1.0), (x - 0.11, 1.0)]))


@pytest.mark.parametrize("depth", [2e-6, 2e-4])
def test_push_out_gives_no_more_at_the_port_than_was_lost_there(depth):
    """A tool that begins in a wall, held against it: nothing was lost yet, so that nothing may push it out."""
    world = World("impulse", [PLATE | {"pose": [-1.0, 0.0, 0.0]}], ONE, tool=tool(), gains=Coupling(2000.0))
    put_wall(world, depth)
    world.handle = (-0.005, 0.0, 0.0)
    supplied = world.lead([(world.handle, STILL)] * 2, 400).supplied
    assert supplied - world.energy >= -1e-12
    assert -SLOP <= world.pose("tool")[0] < 1e-5


def test_push_out_that_the_coupling_does_not_oppose_takes_an_overlap_back_down_to_the_slop():
    world = World("impulse", [PLATE | {"pose": [-1.0, 0.0, 0.0]}], ONE, tool=tool())
    put_wall(world, 1e-4)
    made = world.lead([(world.handle, STILL)] * 2, 2000)
    assert world.pose("tool")[0] == pytest.approx(1e-4 - SLOP, abs=1e-8)
    assert made.supplied == made.correction == 0.0  # nothing pulls: it moves without energy


def test_what_rests_falls_asleep_and_is_awake_as_soon_as_the_tool_touches_it():
    scene = load("push_block")
    method = make("impulse", reduce_scene(scene), H)
    method.couple(GAINS)
    block, (x, y, angle) = method.body("block"), scene.tool.pose
    method.step(np.array([[x, y, angle, 0.0, 0.0, 0.0]] * 2), 1600)
    assert block.is_sleeping and method.bodies()[1][0] == pytest.approx((0.0, 0.02, 0.0), abs=1e-5)
    for k in range(1200):
        method.step(np.array([[x + 2e-5 * k, y, angle, 0.08, 0.0, 0.0]] * 2), 1)
    assert not block.is_sleeping
    assert method.pose("block")[0] - method.position[0] == pytest.approx(0.04, abs=1e-5)


@pytest.mark.parametrize(("e", "part"), [(0.5, 10.0), (0.5, 0.5), (0.9, 1.02), (0.9, 0.98), (0.999, 0.1), (1.0, 1.02)])
def test_the_tool_rebounds_with_its_restitution_and_with_less_below_the_speed_that_keeps_the_port_passive(e, part):
    """v₀ (1 − e²) = 2 (|f| T/m) e: the push f of the coupling over a sub-step T; below, e is what keeps it."""
    stiffness, stretch = 2000.0, 0.01
    effective = M + ONE * ONE * stiffness
    change = stiffness * stretch * ONE / effective  # the handle is this far behind the wall
    speed = part * (2.0 * change * e / (1.0 - e * e) if e < 1.0 else change)
    moving = tool(-0.0105 + 5e-10, velocity=[speed, 0.0, 0.0])  # a hair into the plate, at this speed
    world = World("impulse", [PLATE], ONE, restitution=e, tool=moving, gains=Coupling(stiffness))
    world.steps(1, (-0.0105 + stretch, 0.0, 0.0))
    kept = -world.state("tool")[3] / speed
    change -= stiffness * ONE * ONE * speed / effective  # by the end of the step
    passive = math.hypot(1.0, change / speed) - change / speed
    assert kept == pytest.approx(min(e, passive), rel=1e-4)
    assert speed * (1.0 - kept**2) >= 2.0 * change * kept * (1.0 - 1e-4)


@pytest.mark.parametrize("push", [0.05, 0.5, 5.0])
def test_a_pressed_tool_rebounds_by_the_largest_restitution_that_the_push_lets_be_passive(push):
    """e' = √(1 + k²) − k of e = 1, k = |f| h/(m v), but for what the push changes within the step, 2 h² K/m of v."""
    v, h, stiffness = 0.5, 1e-3, 200.0
    moving = tool(0.01 + 1e-6, velocity=[-v, 0.0, 0.0])
    world = World("partitioned", [WALL], h, TURNS[1], restitution=1.0, tool=moving, gains=Coupling(stiffness))
    world.steps(1, (0.01 - push / stiffness, 0.0, 0.0))
    k = push * h / (M * v)
    within = 2.0 * h * h * stiffness / M
    assert world.state("tool")[3] / v == pytest.approx(math.sqrt(1.0 + k * k) - k, abs=within)


@pytest.mark.parametrize("mass", [0.1, 2.0])
def test_the_rebound_of_a_held_tool_grows_steadily_with_restitution_up_to_one(mass):
    """1 m/s against a wall, the handle with it and then inside: e up to what the coupling's push leaves, no jump."""
    speeds, steps = [], [0.5, 0.9, 0.98, 0.99, 0.995, 0.999, 0.9999, 1.0]
    for e in steps:
        moving = tool(0.02, mass=mass, velocity=[-1.0, 0.0, 0.0])
        world = World("partitioned", [WALL], H, TURNS[1], restitution=e, tool=moving, gains=Coupling(200.0, 1.0))
        start, supplied, rates = world.energy, 0.0, [-1.0]
        for k in range(100):
            world.handle = (max(0.02 - H * k, 0.005), 0.0, 0.0)
            supplied += world.lead([(world.handle, STILL)] * 2).supplied
            assert world.energy - start <= supplied + 1e-9
            rates.append(world.state("tool")[3])
        struck = int(np.argmax(np.diff(rates)))
        speeds.append(-rates[struck + 1] / rates[struck])
    assert speeds == pytest.approx(np.minimum(steps, speeds[-1]).tolist(), abs=1e-9)
    assert 0.995 < speeds[-1] < 1.0


@half("heavy, e, off", [(0.1, 2.0), (0.002, 20.0)], [0.5, 0.99, 1.0], [0.0, 0.006])  # tool's mass, coupling's damping
def test_a_tool_that_a_damped_coupling_drives_into_a_wall_gives_nothing_at_the_port(off, e, heavy):
    """The handle goes with the tool at 1 m/s, and on into the plate; off its middle the tool turns too."""
    mass, damping = heavy
    moving = tool(-0.02, mass=mass, shapes=disc(0.01, center=[0.0, off]), velocity=[1.0, 0.0, 0.0])
    gains = Coupling(2000.0, damping, 0.5, 0.001)
    world = World("impulse", [PLATE], H, restitution=e, tool=moving, gains=gains)
    start, supplied, x, rebounds = world.energy, 0.0, -0.02, 0.0
    for _ in range(200):
        supplied += world.lead([((x, 0.0, 0.0), (1.0, 0.0, 0.0)), ((x + H, 0.0, 0.0), (1.0, 0.0, 0.0))]).supplied
        x, rebounds = x + H, min(rebounds, world.state("tool")[3])
        assert world.energy - start - supplied < 1e-9
    assert rebounds < -0.2 or e < 0.9 or damping > 2.0


@pytest.mark.parametrize("method", ["partitioned", "event_driven"])
@pytest.mark.parametrize("e", [0.3, 1.0])
def test_an_elastic_tool_pressed_to_a_wall_comes_to_rest_there(method, e):
    world = World(method, [WALL], restitution=e, tool=tool(0.02), gains=Coupling(200.0, 5.0))
    x, _, _, vx, *_ = world.run(3.0, (0.0, 0.0, 0.0)).state("tool")
    assert x == pytest.approx(0.01, abs=1e-4) and abs(vx) < 2e-2


def test_a_ball_beside_a_held_tool_comes_back_to_its_height_but_for_a_few_steps_of_its_fall():
    """A backward difference near the tool takes gravity's work of one step."""
    radius, fall = 0.05, 0.5
    ball = {"name": "body", "mass": 1.0, "pose": [0.0, radius + fall, 0.0], "shapes": disc(radius)}
    beside = tool(radius + 0.011, radius + 0.01)
    more = dict(restitution=1.0, gravity=DOWN, tool=beside, gains=GAINS)
    world = World("partitioned", [floor(), ball], turn=TURNS[1], **more)
    v, before = math.sqrt(2.0 * 9.81 * fall), world.energy
    heights = []
    for _ in range(round(2.0 * v / 9.81 / 1e-3)):
        heights.append(world.steps(1).pose()[1] - radius)
        assert world.energy <= before + 1e-2
    assert max(heights[len(heights) // 2 :]) == pytest.approx(fall, abs=4e-3 * v)


def held_knob(motor, friction, turn=0.0):
    pin = joint("pin", "world", "tool", (0.0, 1.0), friction_torque=friction)
    pin["motor"] = {"speed": motor[0], "max_torque": motor[1]}
    knob = tool(0.0, 1.0, inertia=1e-4)
    return World("partitioned", [], turn=turn, joints=[pin], tool=knob, gains=Coupling(2000.0, 2.0, 2.0, 0.1))


@pytest.mark.parametrize(("turn", "speed"), list(zip(TURNS, [5.0, -5.0], strict=True)))
def test_a_motor_turns_a_held_tool_ahead_by_its_torque_less_friction_and_gives_way_by_their_sum(turn, speed):
    """From the handle it goes (.3 − .1)/2 rad ahead; the handle that goes back draws it from (.3 + .1)/2 ahead."""
    world, sign = held_knob((speed, 0.3), 0.1, turn), math.copysign(1.0, speed)
    assert world.run(2.0).pose("tool")[2] == pytest.approx(sign * 0.1, rel=1e-6)
    for back in np.linspace(0.0, 0.5, 500):
        world.steps(1, (0.0, 1.0, -sign * back))
    assert world.run(1.0).pose("tool")[2] == pytest.approx(sign * (0.2 - 0.5), abs=1e-6)


@pytest.mark.parametrize(("speed", "strength"), [(1e-6, 1e3), (-1e-3, 1e3), (1.0, 1.0)])
def test_a_held_tool_has_its_motors_speed_however_strong_motor_and_friction_are(speed, strength):
    """To what the rows give way of themselves (REGULARIZATION), 25 nrad/s at 500 N m."""
    assert held_knob((speed, strength), 0.5 * strength).steps(50).state("tool")[5] == pytest.approx(speed, rel=0.03)


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_drawer_that_the_tool_pushes_passes_its_stop_by_no_more_than_a_step_of_its_way(speed):
    drawer = {"name": "body", "mass": 0.05, "pose": [0.0, 0.0, 0.0], "shapes": box(0.04, 0.02)}
    guide, farthest, x = joint("slider", limits=[-0.1, 0.02]), 0.0, -0.0255
    world = World("impulse", [drawer], H, tool=tool(x, shapes=disc(0.005)), joints=[guide], gains=GAINS)
    for _ in range(round(0.05 / speed / H)):
        x = min(x + speed * H, 0.0)
        farthest = max(farthest, world.steps(1, (x, 0.0, 0.0)).pose()[0])
    assert 0.02 - 1e-6 < farthest < 0.02 + 1.5 * speed * 51e-6
    assert world.pose()[0] == pytest.approx(0.02, abs=1.5 * speed * 51e-6)


@pytest.mark.parametrize("method", METHODS)
def test_no_sub_steps_move_nothing_a_reset_gives_the_same_bits_and_gains_below_0_are_refused(method):
    world = World(method, [WALL], H, tool=tool(0.011), gains=GAINS)

    def led():
        return [world.steps(5, (0.005, 0.02, 0.5)).state("tool").tolist() for _ in range(40)]

    first, before = led(), world.state("tool").tolist()
    assert world.lead([(world.handle, STILL)] * 2, 0)[:5] == (0.0, False, 0.0, 0.0, 0)
    assert world.state("tool").tolist() == before
    world.method.reset()
    assert world.pose("tool") == pytest.approx((0.011, 0.0, 0.0), abs=0.0)
    assert led() == first
    for gains in Coupling(-1.0), Coupling(1.0, math.nan), Coupling(rotational_damping=math.inf):
        with pytest.raises(ValueError, match="coupling .* is .*finite and at least 0"):
            world.method.couple(gains)


def test_a_crowd_is_taken_by_impulses_and_refused_by_direct_methods_with_their_limit():
    crowd = [{"name": f"d{k}", "mass": 0.01, "pose": [0.03 * k, 0.5, 0.0], "shapes": disc(0.01)} for k in range(45)]
    assert len(World("impulse", crowd, H, tool=tool()).steps(4).method.bodies()) == 46
    with pytest.raises(ValueError, match=r"47 bodies; the compiled methods take at most 40"):
        World("partitioned", crowd, H, tool=tool(), gravity=DOWN)
