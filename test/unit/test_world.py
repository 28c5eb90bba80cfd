# SPDX-License-Identifier: Apache-2.0
"""The impulse method against closed forms: backward difference, contacts, friction, restitution, gravity."""

import math

import numpy as np
import pymunk
import pytest
from scipy.integrate import solve_ivp

from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling, along, held
from haptic_sim.pymunk_world.space import SLOP, SLOP_SHARE
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import hand
from haptic_sim.scene.language import Scene, load

H = 0.25e-3
ONE = 50e-6  # a sub-step that is one step
M = 0.1
REST = (0.0, 0.0, 0.0)
BALL = [{"circle": {"radius": 0.01}}]
STIFF = Coupling(2000.0, 2.0, 2.0, 0.002)


def world(gains=STIFF, sub_step=H, mass=M, pose=REST, inertia=1e-4, friction=0.2, restitution=0.0, **more):
    """A round tool of 10 mm, and to the left of x = -10 mm a wall."""
    shapes = [{"box": {"size": [0.1, 1.0], "center": [-0.06, 0]}}]
    wall = {"name": "wall", "fixed": True, "material": "steel", "shapes": shapes}
    tool = {"mass": mass, "inertia": inertia, "pose": pose, "material": "steel", "shapes": BALL}
    materials = {"steel": {"friction": friction, "restitution": restitution}}
    scene = Scene.model_validate({"name": "test", "materials": materials, "tool": tool, **{"bodies": [wall], **more}})
    method = PymunkWorld(reduce_scene(scene), sub_step)
    method.couple(gains)
    return method


def hold(method, handle, steps, velocity=REST):
    for _ in range(steps):
        method.step(held(handle, velocity), 1)
    return method


def backward_difference(x0, stiffness, damping, mass, h, steps):
    """Closed form of m(v⁺−v) = −h(K x⁺ + B v⁺), x⁺ = x + h v⁺ from rest: powers of its two roots."""
    polynomial = mass + h * damping + h * h * stiffness, -(2.0 * mass + h * damping), mass
    first, second = np.roots(polynomial).astype(complex)
    # From rest x₋₁ = x₀, so a + b = x₀ and a/z₁ + b/z₂ = x₀.
    a = x0 * (1.0 - 1.0 / second) / (1.0 / first - 1.0 / second)
    n = np.arange(1, steps + 1)
    return (a * first**n + (x0 - a) * second**n).real


GAINS = [(2000.0, 2.0), (500.0, 0.0), (2000.0, 200.0), (1e6, 0.0), (0.1, 50.0)]


@pytest.mark.parametrize("sub_step", [50e-6, 25e-6, 10e-6])
@pytest.mark.parametrize(("stiffness", "damping"), GAINS)
def test_free_tool_follows_the_closed_form_of_backward_difference(stiffness, damping, sub_step):
    method = world(Coupling(stiffness, damping), sub_step, pose=(0.02, 0.5, 0.0))
    target = (0.03, 0.5, 0.0)
    path = [hold(method, target, 1).position[0] - target[0] for _ in range(400)]
    assert path == pytest.approx(backward_difference(-0.01, stiffness, damping, M, sub_step, 400), abs=1e-9 * 0.01)


@pytest.mark.parametrize(("stiffness", "damping"), [(2.0, 0.002), (2.0, 0.1), (50.0, 0.0)])
def test_rotation_follows_the_closed_form_of_backward_difference_too(stiffness, damping):
    method = world(Coupling(0.0, 0.0, stiffness, damping), ONE, pose=(0.5, 0.0, 0.1))
    path = [hold(method, (0.5, 0.0, 0.3), 1).position[2] - 0.3 for _ in range(400)]
    assert path == pytest.approx(backward_difference(-0.2, stiffness, damping, 1e-4, ONE, 400), abs=1e-9 * 0.2)


@pytest.mark.parametrize("velocity", [(0.3, -0.2, 5.0), (0.0, 0.0, 0.0)])
def test_force_on_the_tool_is_what_moved_it(velocity):
    method = world(STIFF, H, pose=(0.5, 0.0, 0.1))
    for k in range(1, 200):
        before = method.velocity
        method.step(held((0.5 + velocity[0] * k * H, 0.01 + velocity[1] * k * H, velocity[2] * k * H), velocity), 1)
        gained = np.multiply((M, M, 1e-4), np.subtract(method.velocity, before)) / H
        assert method.force_on_tool == pytest.approx(gained, rel=1e-9, abs=1e-9)


def test_force_on_the_tool_is_the_law_of_the_coupling_at_the_end_of_a_step():
    method = hold(world(STIFF, ONE, pose=(0.5, 0.0, 0.0)), (0.52, 0.01, 0.3), 3, (0.1, -0.2, 4.0))
    (x, y, angle), (vx, vy, w) = method.position, method.velocity
    expected = 2000 * (0.52 - x) + 2 * (0.1 - vx), 2000 * (0.01 - y) + 2 * (-0.2 - vy)
    assert method.force_on_tool == pytest.approx((*expected, 2 * (0.3 - angle) + 0.002 * (4.0 - w)), rel=1e-11)


def test_without_gains_the_tool_is_a_free_body():
    method = world(Coupling(), gravity=[0.0, -9.81])
    hold(method, (5.0, 5.0, 5.0), 400)
    assert method.velocity == pytest.approx((0.0, -9.81 * 400 * H, 0.0), rel=1e-12)
    assert method.force_on_tool == REST


@pytest.mark.parametrize("gains", [Coupling(1e5, 100.0), Coupling(50.0, 1.0)])
def test_a_held_tool_sags_by_its_true_weight_over_the_stiffness(gains):
    method = world(gains, 1e-3, gravity=[0.0, -9.81])
    hold(method, REST, 5000)
    assert -method.position[1] == pytest.approx(M * 9.81 / gains.stiffness, rel=1e-9)
    assert method.force_on_tool[1] == pytest.approx(M * 9.81, rel=1e-9)


@pytest.mark.parametrize("stretch", [0.5e-3, 5e-3])
def test_pressed_on_a_wall_the_contact_force_is_stiffness_times_stretch(stretch):
    method = hold(world(pose=(0.001, 0.0, 0.0)), (-stretch, 0.0, 0.0), 4000)
    (contact,) = method.contacts()
    assert (contact.body_a, contact.body_b) == ("tool", "wall")
    assert contact.force_on_a[0] == pytest.approx(2000.0 * (stretch + method.position[0]), rel=1e-9)
    assert method.force_on_tool[0] == pytest.approx(-contact.force_on_a[0], rel=1e-9)
    assert contact.force_on_a[0] == pytest.approx(2000.0 * stretch, rel=2 * SLOP / stretch + 1e-9)
    assert contact.normal == pytest.approx((-1.0, 0.0))
    assert contact.point == pytest.approx((-0.01, 0.0), abs=1e-5)
    assert 0.0 < contact.depth <= 1.01 * min(SLOP, SLOP_SHARE * 0.01)


def test_while_sliding_and_bouncing_contacts_coupling_and_gravity_add_up_to_the_change_of_momentum():
    method = world(STIFF, ONE, pose=(0.001, 0.0, 0.0), gravity=[0.3, -9.81], restitution=0.5)
    touched = 0
    for k in range(4000):
        before = method.velocity
        method.step(held((-0.002 + 0.004 * math.sin(0.01 * k), 2e-5 * k, 0.0)), 1)
        forces = [contact.force_on_a for contact in method.contacts()]
        total = np.sum([method.force_on_tool[:2], (0.3 * M, -9.81 * M), *forces], axis=0)
        assert total * ONE == pytest.approx(M * np.subtract(method.velocity, before)[:2], abs=1e-12)
        touched += method.touching
    assert 100 < touched < 3750


@pytest.mark.parametrize(("pull", "slides"), [(0.99, False), (1.01, True)])
def test_a_pressed_block_slides_just_beyond_the_friction_cone_and_stays_just_within(pull, slides):
    block = {"mass": M, "inertia": 1.0, "material": "steel", "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    method = PymunkWorld(
        reduce_scene(world().scene.model_copy(update={"tool": type(world().scene.tool).model_validate(block)})), H
    )
    method.couple(Coupling(2000.0, 2.0, 100.0, 10.0))
    hold(method, (-2e-3, 0.0, 0.0), 2000)
    normal = -method.force_on_tool[0]
    hold(method, (-2e-3, pull * 0.2 * normal / 2000.0, 0.0), 4000)
    assert (abs(method.position[1]) > 1e-6) == slides


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_a_free_tool_rebounds_with_the_coefficient_of_restitution(restitution):
    method = world(Coupling(1e-9), pose=(0.05, 0.0, 0.0), restitution=restitution)
    hold(method, (0.0, 0.0, 0.0), 1)
    method.couple(Coupling(0.0, 1e4))
    hold(method, REST, 1, (-0.5, 0.0, 0.0))
    approach = method.velocity[0]
    method.couple(Coupling())
    hold(method, REST, 1000)
    assert approach < -0.4
    assert method.velocity[0] == pytest.approx(-restitution * approach, abs=1e-12)


def test_gains_count_from_the_sub_step_after_they_change():
    soft, changed = Coupling(300.0, 1.0, 0.5, 0.001), world(pose=(0.5, 0.0, 0.1))
    fresh = world(soft, pose=(0.5, 0.0, 0.1))
    changed.couple(soft)
    assert hold(changed, (0.51, 0.0, 0.0), 5).position == hold(fresh, (0.51, 0.0, 0.0), 5).position


@pytest.mark.parametrize("gains", [Coupling(-1.0), Coupling(damping=math.nan), Coupling(rotational_damping=math.inf)])
def test_gains_that_are_negative_or_not_finite_are_refused_by_name(gains):
    name = next(name for name, gain in gains._asdict().items() if gain != 0.0)
    with pytest.raises(ValueError, match=f"coupling {name} is .*finite and at least 0"):
        world().couple(gains)


@pytest.mark.parametrize(("mass", "stiffness"), [(1e-3, 2e5), (1e-3, 1e8), (10.0, 1e8)])
def test_a_coupling_far_stiffer_than_the_sub_step_likes_stays_bounded_on_a_wall(mass, stiffness):
    method = world(Coupling(stiffness, 0.0, 10.0, 0.0), mass=mass, pose=(0.005, 0.0, 0.0))
    farthest = max(abs(hold(method, (-0.001, 0.0, 0.0), 1).position[0]) for _ in range(2000))
    assert farthest <= 0.005
    assert method.velocity[0] == pytest.approx(0.0, abs=1e-9)


def test_reset_brings_back_the_start_and_the_same_bits():
    method = world(pose=(0.001, 0.0, 0.0))
    handle = (-0.002, 0.003, 0.1)
    first = [hold(method, handle, 1).position for _ in range(200)]
    method.reset()
    assert (method.position, method.velocity) == ((0.001, 0.0, 0.0), REST)
    assert [hold(method, handle, 1).position for _ in range(200)] == first


def test_a_dynamic_body_slides_to_rest_after_v_squared_over_two_mu_g():
    floor, block = ({"material": "steel", "shapes": [{"box": {"size": size}}]} for size in ([4, 0.1], [0.2, 0.1]))
    floor |= {"name": "floor", "fixed": True, "pose": [0.0, -0.05, 0.0]}
    block |= {"name": "block", "mass": 1.0, "pose": [0.5, 0.05, 0.0]}
    tool = {"mass": 1e3, "inertia": 1e3, "pose": [0.39, 0.05, 0.0], "shapes": [{"circle": {"radius": 0.009}}]}
    scene = {"name": "push", "gravity": [0.0, -9.81], "materials": {"steel": {"friction": 0.4}}, "tool": tool}
    method = PymunkWorld(reduce_scene(Scene.model_validate(scene | {"bodies": [floor, block]})), ONE)
    method.couple(Coupling(1e9, 1e6, 1e6, 1e6))
    for k in range(1, 10001):  # pushes to 1 m/s, then stops dead
        method.step(held((0.39 + 0.5e-4 * k * k * ONE, 0.05, 0.0), (k / 10000.0, 0.0, 0.0)), 1)
    left_at, speed = method.pose("block")[0], 1.0
    hold(method, method.position, 10000)
    travelled = method.pose("block")[0] - left_at
    assert travelled == pytest.approx(speed**2 / (2 * 0.4 * 9.81), rel=5e-3)
    assert method.energy() == pytest.approx((0.0, 9.81 * (1.0 + 1e3) * 0.05), rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("name", ["slider", "four_bar"])
def test_joints_that_push_the_tool_are_no_contact(name):
    scene = load(name)
    method, lead = PymunkWorld(reduce_scene(scene), H), hand(scene)
    method.couple(STIFF)
    assert sum(hold(method, lead(k * 1e-3), 4).touching for k in range(1000)) == len(method.contacts()) == 0


def test_a_tool_on_a_guide_touches_where_it_meets_a_wall_and_only_there():
    guide = {"type": "slider", "bodies": ["world", "tool"], "at": [0.0, 0.0], "axis": [1.0, 0.0]}
    method = world(pose=(0.001, 0.0, 0.0), joints=[guide])
    assert not hold(method, (0.005, 0.002, 0.0), 400).touching and method.contacts() == []
    assert hold(method, (-0.005, 0.002, 0.0), 400).touching
    assert method.contacts()[0].force_on_a[0] == pytest.approx(2000.0 * 0.005, rel=2e-3)


def test_a_sub_step_of_several_steps_is_as_many_sub_steps_of_one():
    """The handle goes on a straight line through either; Σ f·Δx is the energy supplied."""
    coarse = world(STIFF, H, pose=(0.02, 0.0, 0.1), gravity=[0.0, -9.81])
    fine, steps = world(STIFF, H / coarse.inner, pose=(0.02, 0.0, 0.1), gravity=[0.0, -9.81]), 400 * coarse.inner
    start, end = (0.02, 0.0, 0.1), (-0.03, 0.003, 0.2)
    velocity = tuple((b - a) / (400 * H) for a, b in zip(start, end, strict=True))
    before, work = fine.position, 0.0
    made = coarse.step(along((start, velocity), (end, velocity)), 400)
    for k in range(1, steps + 1):
        fine.step(held([a + k / steps * (b - a) for a, b in zip(start, end, strict=True)], velocity), 1)
        work += float(np.dot(fine.force_on_tool, np.subtract(fine.position, before)))
        before = fine.position
    assert coarse.inner > fine.inner == 1
    assert (coarse.touching, made.touched) == (True, True)
    assert coarse.position == pytest.approx(fine.position, abs=1e-12)
    assert coarse.velocity == pytest.approx(fine.velocity, abs=1e-9)
    assert made.supplied == pytest.approx(work, rel=1e-9)


def put_wall(method, x):
    """A wall, as if it had come from behind, up to this place."""
    corners = [(x - 0.11, -1.0), (x - 0.01, -1.0), (x - 0.01, 1.0), (x - 0.11, 1.0)]
    method.space.add(pymunk.Poly(method.space.static_body, corners))


@pytest.mark.parametrize("depth", [2e-6, 2e-4])
def test_push_out_gives_no_more_at_the_port_than_was_lost_there(depth):
    """A tool that begins in a wall, held against it: nothing was lost yet, so that nothing may push it out."""
    method = world(Coupling(2000.0), ONE, pose=(0.0, 0.0, 0.0), friction=0.0)
    put_wall(method, depth)
    supplied = method.step(held((-0.005, 0.0, 0.0)), 400).supplied
    stored = sum(method.energy())
    assert supplied - stored >= -1e-12
    assert -SLOP <= method.position[0] < 1e-5


def test_push_out_that_the_coupling_does_not_oppose_takes_an_overlap_back_down_to_the_slop():
    method = world(Coupling(), ONE, pose=(0.0, 0.0, 0.0), friction=0.0)
    put_wall(method, 1e-4)
    made = method.step(held(REST), 2000)
    assert method.position[0] == pytest.approx(1e-4 - SLOP, abs=1e-8)
    assert made.supplied == made.correction == 0.0  # nothing pulls: it moves without energy


def test_what_rests_falls_asleep_and_is_awake_as_soon_as_the_tool_touches_it():
    scene = load("push_block")
    method = PymunkWorld(reduce_scene(scene), H)
    method.couple(STIFF)
    block = method.body("block")
    hold(method, scene.tool.pose, 1600)
    assert block.is_sleeping and method.bodies()[1][0] == pytest.approx((0.0, 0.02, 0.0), abs=1e-5)
    for k in range(1200):
        x, y, angle = scene.tool.pose
        method.step(held((x + 2e-5 * k, y, angle), (0.08, 0.0, 0.0)), 1)
    assert not block.is_sleeping
    assert method.pose("block")[0] - method.position[0] == pytest.approx(0.04, abs=1e-5)


@pytest.mark.parametrize(("thick", "part"), [(2e-4, 2e-3), (2e-3, 2e-3)])
def test_a_thin_ladder_slides_down_as_its_equation_says(thick, part):
    """Ends on a smooth floor and wall: θ'' = −(3 g/2 L) cos θ of the line between them, until it leaves the wall."""
    length, start, g, time = 0.3, 1.1, 9.81, 0.12
    x, y = 0.5 * length * math.cos(start), 0.5 * length * math.sin(start)
    planes = [
        {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]},
        {"name": "wall", "fixed": True, "shapes": [{"half_plane": {"normal": [1.0, 0.0]}}]},
    ]
    ends = [[-0.5 * length, 0.0], [0.0, -0.5 * thick], [0.5 * length, 0.0], [0.0, 0.5 * thick]]
    rod = {"name": "rod", "mass": 0.1, "inertia": 0.1 * length**2 / 12.0, "pose": [x, y, math.pi - start]}
    bodies = [*planes, rod | {"shapes": [{"vertices": ends}]}]
    tool = {"mass": 0.1, "pose": [9.0, 9.0, 0.0], "shapes": BALL}
    scene = {"name": "ladder", "gravity": [0.0, -g], "bodies": bodies, "tool": tool}
    method = hold(PymunkWorld(reduce_scene(Scene.model_validate(scene)), H), REST, round(time / H))
    exact = solve_ivp(lambda _, s: (s[1], -1.5 * g / length * math.cos(s[0])), (0.0, time), (start, 0.0), rtol=1e-10)
    fallen = start - exact.y[0, -1]
    assert math.sin(exact.y[0, -1]) > 2.0 / 3.0 * math.sin(start)  # still at the wall
    assert math.pi - method.pose("rod")[2] == pytest.approx(exact.y[0, -1], abs=part * fallen)


def test_a_crowd_of_any_size_is_taken_where_the_direct_methods_have_a_limit():
    places = [[0.03 * (k % 10), 0.03 * (k // 10) + 0.5, 0.0] for k in range(60)]
    discs = [{"name": f"d{k}", "mass": 0.01, "pose": place, "shapes": BALL} for k, place in enumerate(places)]
    method = hold(world(bodies=discs), REST, 4)
    assert len(method.bodies()) == 61 and method.inner == 1
    with pytest.raises(ValueError, match="bod"):
        make("partitioned", reduce_scene(method.scene), H)
