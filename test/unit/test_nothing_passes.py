# SPDX-License-Identifier: Apache-2.0
"""Nothing passes what it meets, at any speed, angle and phase, nor comes out elsewhere when the handle jumps."""

import math

import numpy as np
import pymunk
import pytest
from examples import few, searching
from hypothesis import example, given
from hypothesis import strategies as st
from worlds import TURNS, World, block_of, body, box, disc, fixed, spring, tool

from haptic_sim.protocol import STILL, Coupling

H, THIN, FAST = 0.25e-3, 0.5e-3, 60.0
PHASES = range(4)
TINY = disc(0.5e-3)
PLATE = fixed("plate", shapes=box(THIN, 0.1))


class Space(World):
    """A world by impulses, and what is added to its pymunk space, in the plane before it was turned."""

    def __init__(self, *bodies, turn=0.0, **more):
        super().__init__("impulse", bodies, H, turn, **more)
        self.space = self.method.space

    def add(self, solid, *shapes, **more):
        for shape in shapes:
            for name, value in more.items():
                setattr(shape, name, value)
        self.space.add(solid, *shapes)
        return solid

    def stands(self):
        solid = pymunk.Body(body_type=pymunk.Body.STATIC)
        solid.angle = self.turn
        return solid

    def box(self, **more):
        solid = self.stands()
        return self.add(solid, pymunk.Poly.create_box(solid, (THIN, 0.1)), **more)

    def segment(self, radius=0.5 * THIN, **more):
        solid = self.stands()
        return self.add(solid, pymunk.Segment(solid, (0.0, -0.05), (0.0, 0.05), radius), **more)

    def line(self):
        return self.segment(0.0)

    def ball(self, x, speed=FAST, y=0.0, **more):
        solid = pymunk.Body(0.01, 1e-8)
        solid.position = pymunk.Vec2d(x, y).rotated(self.turn)
        solid.velocity = pymunk.Vec2d(speed, 0.0).rotated(self.turn)
        return self.add(solid, pymunk.Circle(solid, 0.5e-3), **more)

    def came(self, solid):
        """How far along the plane's first direction."""
        return solid.position.rotated(-self.turn).x

    def farthest(self, count, place):
        return max(place(self.steps(1)) for _ in range(count))


def shot(x, speed=FAST, shapes=TINY, **more):
    return body(x, shapes=shapes, mass=0.01, velocity=[speed, 0.0, 0.0], **more)


def of_body(world):
    return world.pose()[0]


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("plate", [None, Space.box, Space.segment, Space.line])
@pytest.mark.parametrize(("speed", "shapes"), [(5.0, TINY), (60.0, box(0.002, 0.001, angle=0.4)), (5000.0, TINY)])
def test_a_body_does_not_pass_a_thin_plate_of_the_scene_or_one_that_was_added(turn, plate, speed, shapes):
    for phase in PHASES:
        start = -0.02 - phase / len(PHASES) * speed * 50e-6
        world = Space(*([] if plate else [PLATE]), shot(start, speed, shapes), turn=turn)
        if plate:
            plate(world)
        before = world.energy
        assert -0.01 < world.farthest(max(20, round(0.03 / speed / H)), of_body) < 0.0, phase
        assert world.energy <= before * (1.0 + 1e-9)


@pytest.mark.parametrize("plate", [None, Space.box, Space.segment])
@pytest.mark.parametrize("speed", [5.0, 500.0])
def test_a_tool_that_its_handle_pulls_does_not_pass_a_thin_plate(plate, speed):
    thrown = tool(-0.02, mass=0.01, shapes=TINY, velocity=[speed, 0.0, 0.0])
    world = Space(*([] if plate else [PLATE]), turn=TURNS[1], tool=thrown, gains=Coupling(5000.0, 5.0, 1.0, 0.01))
    if plate:
        plate(world)
    world.handle = 0.05, 0.0, 0.0
    assert world.farthest(200, lambda world: world.pose("tool")[0]) < -0.5e-3 - 0.5 * THIN + 1e-5


def test_a_bar_that_spins_fast_does_not_cut_through_a_thin_plate():
    bar = body(-0.06, 0.0, 1.57, shapes=box(0.16, 0.004), mass=0.01, velocity=[0.0, 0.0, -900.0])
    world = Space(PLATE | {"shapes": box(0.001, 1.0)}, bar)
    for _ in range(200):
        x, _, angle = world.steps(1).pose()
        assert x < 0.0 and x + 0.08 * abs(math.cos(angle)) < 2e-3


@pytest.mark.parametrize("wire", [disc(1e-4), box(2e-4, 2e-4, angle=0.5), None])
@given(speed=st.floats(2.0, 5e3), along=st.floats(-0.045, 0.045), turn=st.floats(-3.0, 3.0), spin=st.floats(-9.0, 9.0))
@example(speed=15.0, along=0.0123, turn=0.0, spin=0.0)
@few(30)
def test_the_edge_of_a_bar_that_flies_sideways_does_not_pass_a_thin_wire(wire, speed, along, turn, spin):
    """A bar of 100 by 0.5 mm that the wire hardly turns, a wire 0.2 mm thick, of the scene or added."""
    bar = body(-0.02, along, shapes=box(0.0005, 0.1), mass=0.01, inertia=100.0, velocity=[speed, 0.0, spin])
    world = Space(*([fixed("wire", shapes=wire)] if wire else []), bar, turn=turn)
    if not wire:
        stands = world.stands()
        world.add(stands, pymunk.Circle(stands, 1e-4))
    for _ in range(max(20, round(0.03 / speed / H))):
        x, y, angle = world.steps(1).pose()
        if abs(y * math.cos(angle) - x * math.sin(angle)) > 0.05:  # slid off the wire
            break
        assert x * math.cos(angle) + y * math.sin(angle) < 0.0


@pytest.mark.parametrize("count", [4, 20])  # sub-steps: 1 and 5 ms
def test_what_the_tool_strikes_or_a_spring_shoots_does_not_pass_however_seldom_samples_come(count):
    behind = fixed("plate", 0.05, shapes=box(0.0003, 1.0))
    for phase in PHASES:
        ball = body(0.0443, shapes=disc(2.5e-4), mass=0.0025)
        striker = tool(0.03 - phase * 75e-6, velocity=[15.0, 0.0, 0.0])
        struck = Space(behind, ball, restitution=1.0, tool=striker, gains=Coupling(2000.0, 2.0, 2.0, 0.002))
        ball = body(0.02 - phase * 1e-4, shapes=disc(2.5e-4), mass=0.001)
        sprung = Space(behind, ball, joints=[spring(stiffness=390.0, rest=0.06)])
        for world in struck, sprung:
            way = [world.lead([(world.handle, STILL)] * 2, count) and world.pose()[0] for _ in range(40 // count)]
            assert max(way) < 0.05 and (world is struck or max(way) > 0.045), phase


@pytest.mark.parametrize("turn", TURNS)
def test_what_was_added_passes_neither_a_plate_of_the_scene_nor_one_that_was_added(turn):
    """A ball, a stick whose frame's origin is elsewhere, and balls that are thrown after the world has been stepped."""
    for phase in PHASES:
        start = -0.02 - phase / len(PHASES) * FAST * 50e-6
        for plates in ([PLATE], []):
            world = Space(*plates, turn=turn)
            if not plates:
                world.box()
            stick = pymunk.Body(0.01, 1e-8)
            stick.center_of_gravity = 0.003, 0.0
            stick.position, stick.angle = pymunk.Vec2d(start, 0.02).rotated(turn), turn
            stick.velocity = pymunk.Vec2d(FAST, 0.0).rotated(turn)
            world.add(stick, pymunk.Segment(stick, (0.0, 0.0), (0.006, 0.0), 2e-4))
            ball, resting = world.ball(start - 0.01), world.ball(start, 0.0, -0.03)
            world.steps(5)
            resting.position = pymunk.Vec2d(-1e-3 + 0.03 * start, -0.03).rotated(turn)
            resting.velocity = pymunk.Vec2d(FAST, 0.0).rotated(turn)
            world.steps(20)
            assert stick.local_to_world((0.006, 0.0)).rotated(-turn).x < 0.0, phase
            assert world.came(ball) < 0.0 and world.came(resting) < 0.0, phase


def test_what_is_added_or_thrown_between_two_exchanges_is_met_and_what_is_taken_out_is_passed():
    for phase in PHASES:
        start = -0.02 - phase / len(PHASES) * FAST * 50e-6
        late, grown = Space(shot(start - 0.2)), Space(shot(start - 0.02))
        thrown = Space(shot(start, 0.0), tool=tool(5.0, 5.0))
        late.steps(10).box()
        thrown.box()
        thrown.steps(4).method.body("body").velocity = (FAST, 0.0)
        grown.box()
        grown.space.add(pymunk.Segment(grown.method.body("body"), (0.0, 0.0), (0.02, 0.0), 1e-4))
        ends = [world.steps(40).pose()[0] for world in (late, thrown, grown)]
        assert max(*ends[:2], ends[2] + 0.02) < 0.0, phase
    world = Space(shot(-0.08))
    gone, other, first = world.ball(-0.3), world.ball(-0.2), world.segment()
    world.steps(2)
    world.space.remove(first, *first.shapes, gone, *gone.shapes)
    behind = world.box()
    behind.position = 0.05, 0.0
    world.space.reindex_shapes_for_body(behind)
    world.steps(40)
    assert 0.0 < world.pose()[0] < 0.05 and other.position.x < 0.05


@pytest.mark.parametrize("turn", TURNS)
def test_what_a_filter_rejects_a_sensor_and_other_layers_are_passed_without_loss_of_time(turn):
    apart = {"filter": pymunk.ShapeFilter(group=7)}
    for plate in apart, {"sensor": True}:
        world = Space(turn=turn)
        ball = world.ball(-0.02, **apart)
        world.box(**plate)
        assert world.came(ball) == pytest.approx(-0.02, abs=1e-9)
        world.steps(20)
        assert world.came(ball) == pytest.approx(-0.02 + 20 * H * FAST, abs=1e-9)
    for bit, passes in (1, True), (2, False):
        world = Space(shot(-0.02, layers=[1]), turn=turn, tool=tool(5.0, 5.0, layers=[0]))
        world.box(filter=pymunk.ShapeFilter(categories=bit, mask=bit))
        way = world.steps(20).pose()[0]
        assert way == pytest.approx(-0.02 + 20 * H * FAST, abs=1e-9) if passes else way < 0.0
    ghosts = [fixed(f"g{k}", 0.0203 * (k + 1), shapes=box(0.003, 0.2), layers=[5]) for k in range(20)]
    world = Space(*ghosts, fixed("floor", 0.0, -1.0, box(9.0, 0.1)), shot(0.0, 33.0), turn=turn)
    assert world.steps(60).pose()[0] == pytest.approx(33.0 * 60 * H, abs=1e-9)


def test_two_that_a_joint_keeps_from_colliding_lose_no_time_to_each_other_and_it_is_not_torn_open_by_a_plate():
    world = Space()
    one, two = world.ball(-0.02), world.ball(-0.025)
    pin = pymunk.PinJoint(one, two)
    pin.collide_bodies = False
    world.space.add(pin)
    world.steps(1)
    assert two.position.x == pytest.approx(-0.025 + H * FAST, abs=1e-9)
    world.box()
    for _ in range(20):
        world.steps(1)
        assert max(one.position.x, two.position.x) < 0.0
        assert one.position.get_distance(two.position) == pytest.approx(0.005, abs=2e-4)


def test_what_a_callback_takes_out_when_a_fast_tool_strikes_it_is_gone_and_the_rest_goes_on():
    world = Space(tool=tool(-0.02, shapes=TINY, mass=0.01, velocity=[FAST, 0.0, 0.0]))
    hit, left, behind = world.ball(0.0, 0.0, collision_type=1), world.ball(-0.4), world.box()
    behind.position = 0.05, 0.0
    world.space.reindex_shapes_for_body(behind)
    world.space.on_collision(1, None, post_solve=lambda pair, space, _: space.remove(hit, *hit.shapes))
    world.steps(2)
    for _ in range(10):
        assert max(world.steps(8).pose("tool")[0], left.position.x) < 0.05
    assert hit not in world.space.bodies and world.pose("tool")[0] > 0.04
    world.space.remove(left)  # its shape stays behind, as pymunk lets it
    world.steps(2)


def test_an_elastic_plate_that_was_added_throws_the_tool_back_as_one_of_the_scene_does():
    """Slowly, into the push of its coupling, where the port could not pay for the whole rebound."""
    slow = tool(-0.75e-3 + 5e-10, shapes=TINY, velocity=[2e-3, 0.0, 0.0])
    worlds = [Space(*of, restitution=1.0, tool=slow, gains=Coupling(2000.0)) for of in ([PLATE], [])]
    worlds[1].box(elasticity=1.0)
    ends = [world.steps(1, (0.01, 0.0, 0.0)).state("tool")[3:] for world in worlds]
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)


def test_elastic_balls_that_were_added_rebound_from_the_scene_and_come_to_rest_on_a_plate_that_was_added():
    wall = fixed("wall", shapes=[{"half_plane": {"normal": [-1.0, 0.0]}}])
    world = Space(wall, restitution=0.64)
    falls = world.ball(-0.02, 1.0, elasticity=1.0)
    world.steps(200)
    assert falls.velocity.x == pytest.approx(-0.8, rel=1e-3)
    world = Space(shot(-1.0, 0.0), restitution=1.0, gravity=[9.81, 0.0])
    world.box(elasticity=0.5)
    falls = world.ball(-0.02, 0.0, elasticity=1.0)
    world.steps(2400)
    assert abs(falls.velocity.x) < 1e-3 and falls.position.x < 0.0


METHODS = ["partitioned", "impulse"]
ANGLES = [0.0, 0.9, 2.5] if searching() else [0.0, 2.5]
FIRM = Coupling(5000.0, 10.0, 1e4, 1.0)  # hardly turns: what is held off centre would rightly roll around the corner
A_HANDS = Coupling(5000.0, 10.0, 20.0, 0.05)
BLOCK = [block_of(0.0, 0.1, -0.1, 0.0)]
WALLS = [block_of(-0.1, 0.0, -0.1, 0.3), block_of(0.0, 0.3, -0.1, 0.0)]
FIN = [block_of(-0.0005, 0.0005, -0.05, 0.05)]
SLOT = [block_of(-0.1, -0.01005, -0.05, 0.0), block_of(0.01005, 0.1, -0.05, 0.0)]  # 0.1 mm wider than the tool
DIAMOND = box(0.03, 0.03, angle=0.25 * math.pi)
FLUSH = [block_of(-0.1, 0.0, -0.05, 0.0), block_of(0.0, 0.1, -0.05, 0.0)]
POCKET = [block_of(-0.1, -0.0105, -0.03, 0.0), block_of(0.0105, 0.1, -0.03, 0.0), block_of(-0.1, 0.1, -0.05, -0.03)]
CORNERS = [(0.03, 0.03, 0.2), (-0.03, -0.02, 0.2), (-0.05, 0.05, 0.0), (0.05, -0.05, 0.0)]
STRAINED = [(0.0, -0.015, 0.0), (0.0, -0.015, 0.6), (0.02, -0.03, 0.6), (0.0, -0.015, -0.6)]
CENTRE = 0.25 * math.pi


def from_the_side(sunk):
    """It overlaps the block's height by little and its width by much: least overlap says up, the motion says side."""
    y = 0.01 - sunk
    return BLOCK, [(-0.015, y, 0.0), (0.03, y, 0.0)], lambda x, up: x.max() < -0.0099 and abs(up[-1] - y) < 1e-4


def from_above(over):
    x = -0.01 + over
    return BLOCK, [(x, 0.015, 0.0), (x, -0.04, 0.0)], lambda _, y: y.min() > 0.0099


def beside_a_slot(beside, enters):
    way = [(beside, 0.012, 0.0), (beside, -0.02, 0.0)]
    return SLOT, way, lambda _, y: y.min() < -0.015 if enters else y.min() > 0.0099


JUMPS = {
    "from the side, 0.5 mm below the top": from_the_side(0.0005),
    "from the side, 9 mm below the top": from_the_side(0.009),
    "from above, 0.5 mm beside the side": from_above(0.0005),
    "from above, 9 mm beside the side": from_above(0.009),
    "corner in corner": (WALLS, CORNERS, lambda x, y: min(x.min(), y.min()) > 0.0099),
    "over a fin": (FIN, [(-0.03, 0.0, 0.0), (0.03, 0.0, 0.0)], lambda x, _: x.max() < -0.01),
    "back over a fin": (FIN, [(0.03, 0.0, CENTRE), (-0.03, 0.0, CENTRE)], lambda x, _: x.min() > 0.01),
    "into a slot": beside_a_slot(0.00004, True),
    "beside a slot": beside_a_slot(0.0003, False),
    "corner on corner": (
        DIAMOND,
        [(-0.045, 0.0, CENTRE), (0.0, 0.0, CENTRE)],
        lambda x, y: (abs(x) + abs(y)).min() > 0.025 * math.sqrt(2.0) - 2e-3,
    ),
    "over a seam": (
        FLUSH,
        [(-0.05, 0.0101, 0.0), (0.05, 0.008, 0.0)],
        lambda x, y: abs(x[-1] - 0.05) < 1e-3 and 0.0099 < y.min() <= y.max() < 0.0102,
    ),
    "out of a pocket, turned hard": (
        POCKET,
        STRAINED,
        lambda x, y: abs(x).max() < 1e-3 and -0.0201 < y.min() <= y.max() < -5e-3,
    ),
}


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", JUMPS)
def test_the_face_that_a_tool_reached_first_holds_it_wherever_its_handle_jumps(name, method, angle):
    """So that it would lie deep inside what it meets (Colgate, Stanley & Brown 1995, Figs 1-3)."""
    shapes, way, right = JUMPS[name]
    obstacles = [fixed(f"b{i}", shapes=[shape]) for i, shape in enumerate(shapes)]
    gains, square = A_HANDS if len(way) > 2 else FIRM, tool(*way[0], shapes=box(0.02, 0.02))
    world, path = World(method, obstacles, H, angle, tool=square, gains=gains), []
    for handle in way:
        before = world.handle
        for k in range(400 if name == "over a seam" else 150):
            world.lead([(handle if k else before, STILL), (handle, STILL)], 4)
            path.append(world.pose("tool"))
    assert right(*np.array(path).T[:2])
