# SPDX-License-Identifier: Apache-2.0
"""Bodies of one's own in the pymunk world: nothing goes through them, nor they through the scene, at any angle."""

import math

import pymunk
import pytest
from handle_samples import MS

from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.protocol import Coupling, held
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene, load

H, THIN, FAST = 0.25e-3, 0.5e-3, 60.0
ANGLES = [0.0, math.radians(37.0)]
PHASES = range(4)
SMALL = {"shapes": [{"circle": {"radius": 0.5e-3}}]}
FAR = {"mass": 0.1, "pose": [5.0, 5.0, 0.0], **SMALL}


def scene(*bodies, tool=FAR, **more):
    return Scene.model_validate({"name": "t", "tool": tool, "bodies": list(bodies), **more})


def world(*bodies, **more):
    return PymunkWorld(reduce_scene(scene(*bodies, **more), "impulse"), H)


def run(method, count):
    for _ in range(count):
        method.step(held((0.0, 0.0, 0.0)), 1)
    return method


def along(angle, way):
    return way * math.cos(angle), way * math.sin(angle)


def shot(angle, start, speed=FAST, **more):
    """What flies along this direction through the origin."""
    return {"mass": 0.01, "pose": [*along(angle, start), 0.0], "velocity": [*along(angle, speed), 0.0], **SMALL} | more


def box(space, angle, **more):
    """A thin plate through the origin, square to this direction."""
    body = pymunk.Body(body_type=pymunk.Body.STATIC)
    body.angle = angle
    return added(space, pymunk.Poly.create_box(body, (THIN, 0.1)), **more)


def segment(space, angle, radius=0.5 * THIN, **more):
    body = pymunk.Body(body_type=pymunk.Body.STATIC)
    body.angle = angle
    return added(space, pymunk.Segment(body, (0.0, -0.05), (0.0, 0.05), radius), **more)


def line(space, angle, **more):
    return segment(space, angle, 0.0, **more)


def ball(space, angle, start, speed=FAST, **more):
    body = pymunk.Body(0.01, 1e-8)
    body.position, body.velocity = along(angle, start), along(angle, speed)
    return added(space, pymunk.Circle(body, 0.5e-3), **more)


def added(space, shape, **more):
    for name, value in more.items():
        setattr(shape, name, value)
    space.add(shape.body, shape)
    return shape.body


def came(place, angle):
    """How far along its direction."""
    return place[0] * math.cos(angle) + place[1] * math.sin(angle)


def farthest(method, angle, place, count=20):
    """How far a place comes along its direction."""
    return max(came(place(run(method, 1)), angle) for _ in range(count))


def starts():
    return [-0.02 - phase / len(PHASES) * FAST * 50e-6 for phase in PHASES]


@pytest.mark.parametrize("plate", [box, segment, line])
@pytest.mark.parametrize("angle", ANGLES)
def test_the_tool_does_not_pass_a_thin_plate_that_was_added(angle, plate):
    for start in starts():
        method = world(tool=shot(angle, start))
        plate(method.space, angle)
        assert -0.01 < farthest(method, angle, lambda method: method.position) < 0.0, start


@pytest.mark.parametrize("plate", [box, segment])
@pytest.mark.parametrize("angle", ANGLES)
def test_a_tool_that_its_handle_pulls_does_not_pass_a_thin_plate_that_was_added(angle, plate):
    method = world(tool=shot(angle, -0.02))
    method.couple(Coupling(5000.0, 5.0))
    plate(method.space, angle)
    for _ in range(200):
        method.step(held((*along(angle, 0.05), 0.0)), 1)
        assert came(method.position, angle) < 0.0


@pytest.mark.parametrize("plate", [box, segment, line])
@pytest.mark.parametrize("shapes", [SMALL["shapes"], [{"box": {"size": [0.002, 0.001], "angle": 0.4}}]])
@pytest.mark.parametrize("angle", ANGLES)
def test_a_body_of_the_scene_does_not_pass_a_thin_plate_that_was_added(angle, shapes, plate):
    for start in starts():
        method = world(shot(angle, start, name="shot", shapes=shapes))
        plate(method.space, angle)
        assert -0.01 < farthest(method, angle, lambda method: method.pose("shot")) < 0.0, start


@pytest.mark.parametrize("angle", ANGLES)
def test_a_ball_that_was_added_does_not_pass_a_thin_plate_of_the_scene(angle):
    plate = {"name": "plate", "fixed": True, "pose": [0.0, 0.0, angle], "shapes": [{"box": {"size": [THIN, 0.1]}}]}
    for start in starts():
        method = world(plate)
        shot = ball(method.space, angle, start)
        assert -0.01 < farthest(method, angle, lambda _, shot=shot: shot.position) < 0.0, start


@pytest.mark.parametrize("angle", ANGLES)
def test_a_ball_and_a_stick_that_were_added_do_not_pass_a_plate_that_was_added(angle):
    for start in starts():
        method = world()
        box(method.space, angle)
        stick = pymunk.Body(0.01, 1e-8)
        stick.center_of_gravity = 0.003, 0.0  # its frame's origin is another place
        stick.position, stick.angle, stick.velocity = along(angle, start), angle, along(angle, FAST)
        added(method.space, pymunk.Segment(stick, (0.0, 0.0), (0.006, 0.0), 2e-4))
        other = ball(method.space, angle, start - 0.01)
        for body in (stick, other):
            body.position += along(angle + 0.5 * math.pi, 0.02 if body is other else 0.0)
        run(method, 20)
        assert came(stick.local_to_world((0.006, 0.0)), angle) < 0.0, start
        assert came(other.position, angle) < 0.0, start


@pytest.mark.parametrize("angle", ANGLES)
def test_what_is_added_or_thrown_after_the_world_has_been_stepped_is_met_from_then_on(angle):
    for start in starts():
        method = run(world(shot(angle, start - 0.2, name="shot")), 5)
        resting = ball(method.space, angle, start, 0.0)
        run(method, 5)
        box(method.space, angle)
        resting.position, resting.velocity = along(angle, -1e-3 + 0.03 * start), along(angle, FAST)
        run(method, 40)
        assert came(resting.position, angle) < 0.0, start
        assert came(method.pose("shot"), angle) < 0.0, start


APART = {"filter": pymunk.ShapeFilter(group=7)}


@pytest.mark.parametrize("plate", [APART, {"sensor": True}])
@pytest.mark.parametrize("angle", ANGLES)
def test_what_a_filter_rejects_and_a_sensor_are_passed_without_loss_of_time(angle, plate):
    method = world()
    shot = ball(method.space, angle, -0.02, **APART)
    box(method.space, angle, **plate)
    run(method, 20)
    assert came(shot.position, angle) == pytest.approx(-0.02 + 20 * H * FAST, abs=1e-9)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_plate_that_the_layers_of_the_scene_reject_is_passed_without_loss_of_time(angle):
    method = world(shot(angle, -0.02, name="shot", layers=[1]), tool=FAR | {"layers": [0]})
    first, second = (pymunk.ShapeFilter(categories=bit, mask=bit) for bit in (1, 2))
    box(method.space, angle, filter=first)
    assert came(run(method, 20).pose("shot"), angle) == pytest.approx(-0.02 + 20 * H * FAST, abs=1e-9)
    method = world(shot(angle, -0.02, name="shot", layers=[1]), tool=FAR | {"layers": [0]})
    box(method.space, angle, filter=second)
    assert came(run(method, 20).pose("shot"), angle) < 0.0


def test_two_that_a_joint_keeps_from_colliding_lose_no_time_to_each_other_and_it_is_not_torn_open_by_a_plate():
    method = world()
    one, two = (ball(method.space, 0.0, start) for start in (-0.02, -0.025))
    pin = pymunk.PinJoint(one, two)
    pin.collide_bodies = False
    method.space.add(pin)
    run(method, 1)
    assert two.position.x == pytest.approx(-0.025 + H * FAST, abs=1e-9)
    box(method.space, 0.0)
    for _ in range(20):
        run(method, 1)
        assert max(one.position.x, two.position.x) < 0.0
        assert one.position.get_distance(two.position) == pytest.approx(0.005, abs=2e-4)


def test_what_is_taken_out_is_passed_and_the_rest_still_met():
    method = world(shot(0.0, -0.08, name="shot"))
    gone, other = ball(method.space, 0.0, -0.3), ball(method.space, 0.0, -0.2)
    first = segment(method.space, 0.0)
    run(method, 2)
    method.space.remove(first, *first.shapes, gone, *gone.shapes)
    behind = box(method.space, 0.0)
    behind.position = 0.05, 0.0
    method.space.reindex_shapes_for_body(behind)
    run(method, 40)
    assert 0.0 < method.pose("shot")[0] < 0.05 and other.position.x < 0.05


def test_what_a_callback_takes_out_when_a_fast_tool_strikes_it_is_gone_and_the_rest_goes_on():
    method = world(tool=shot(0.0, -0.02))
    hit = ball(method.space, 0.0, 0.0, 0.0, collision_type=1)
    left, behind = ball(method.space, 0.0, -0.4), box(method.space, 0.0)
    behind.position = 0.05, 0.0
    method.space.reindex_shapes_for_body(behind)
    method.space.on_collision(1, None, post_solve=lambda pair, space, _: space.remove(hit, *hit.shapes))
    run(method, 2)
    for _ in range(10):
        method.step(held((0.0, 0.0, 0.0)), 8)
        assert max(method.position[0], left.position.x) < 0.05
    assert hit not in method.space.bodies and method.position[0] > 0.04
    method.space.remove(left)  # its shape stays behind, as pymunk lets it
    run(method, 2)


def test_a_shape_that_was_added_to_a_body_of_the_scene_is_swept_with_it():
    for start in starts():
        method = world(shot(0.0, start - 0.02, name="shot"))
        box(method.space, 0.0)
        method.space.add(pymunk.Segment(method.body("shot"), (0.0, 0.0), (0.02, 0.0), 1e-4))
        assert run(method, 20).pose("shot")[0] < -0.02, start


def test_an_elastic_plate_that_was_added_throws_the_tool_back_as_one_of_the_scene_does():
    """Slowly, into the push of its coupling, where the port could not pay for the whole rebound."""
    tool = {"mass": 0.1, "pose": [-0.75e-3 + 5e-10, 0.0, 0.0], "velocity": [2e-3, 0.0, 0.0], "material": "m", **SMALL}
    plate = {"name": "plate", "fixed": True, "material": "m", "shapes": [{"box": {"size": [THIN, 0.1]}}]}
    given = {"tool": tool, "materials": {"m": {"restitution": 1.0}}}
    worlds = world(plate, **given), world(**given)
    box(worlds[1].space, 0.0, elasticity=1.0)
    for one in worlds:
        one.couple(Coupling(2000.0))
        one.step(held((0.01, 0.0, 0.0)), 1)
    assert worlds[0].velocity == pytest.approx(worlds[1].velocity, rel=1e-9)


def test_an_elastic_ball_that_was_added_rebounds_from_the_scene_also_where_the_tool_does_not():
    floor = {"name": "floor", "fixed": True, "material": "m", "shapes": [{"half_plane": {"normal": [-1.0, 0.0]}}]}
    method = world(floor, tool=FAR | {"pose": [-5.0, 0.0, 0.0]}, materials={"m": {"restitution": 0.64}})
    falls = ball(method.space, 0.0, -0.02, 1.0)
    next(iter(falls.shapes)).elasticity = 1.0
    run(method, 200)
    assert falls.velocity.x == pytest.approx(-0.8, rel=1e-3)


def test_two_elastic_shapes_that_were_added_rebound_when_they_meet_and_rest_on_each_other():
    method = world(
        shot(0.0, -1.0, 0.0, name="shot", material="m"), materials={"m": {"restitution": 1.0}}, gravity=[9.81, 0.0]
    )
    box(method.space, 0.0, elasticity=0.5)
    falls = ball(method.space, 0.0, -0.02, 0.0)
    next(iter(falls.shapes)).elasticity = 1.0
    run(method, 4000)
    assert abs(falls.velocity.x) < 1e-3 and falls.position.x < 0.0


def test_a_body_of_the_scene_that_is_thrown_between_two_exchanges_passes_nothing_either():
    for start in starts():
        method = world(shot(0.0, start, 0.0, name="shot"))
        box(method.space, 0.0)
        method.step(held((0.0, 0.0, 0.0)), 4)
        method.body("shot").velocity = (FAST, 0.0)
        method.step(held((0.0, 0.0, 0.0)), 20)
        assert method.pose("shot")[0] < 0.0, start


def flap(world):
    """A ball that hangs in the world, once for each space."""
    world.mine = ball(world.space, 0.0, 0.05, 0.0)


def test_what_was_added_comes_back_with_each_reset_and_with_it_the_same_bits():
    simulation = Simulation(reduce_scene(load("push_block"), "impulse"), added=flap)

    def led():
        tools = [
            simulation.exchange(HandleSample(k * MS, (1e-4 * k, 0.015, 0.0), (0.1, 0.0, 0.0), 2000.0, 2.0, 2.0, 0.002))
            for k in range(100)
        ]
        return tools, simulation.method.mine

    first, ball_before = led()
    simulation.reset()
    second, ball_after = led()
    assert first == second
    assert ball_after is not ball_before and ball_after in simulation.method.space.bodies
    assert ball_before not in simulation.method.space.bodies


@pytest.mark.parametrize(("name", "method"), [("wall", "closed_form"), ("push_block", "partitioned")])
def test_a_method_without_a_pymunk_world_takes_no_bodies_of_ones_own_and_says_what_to_do(name, method):
    with pytest.raises(ValueError) as refusal:
        Simulation(reduce_scene(load(name), method), added=flap)
    assert str(refusal.value) == (
        f"scene {name!r} gets the method {method}, which takes no bodies of your own: write method: impulse in the "
        "scene, or start the node with method:=impulse"
    )
    Simulation(reduce_scene(load(name), method))
