# SPDX-License-Identifier: Apache-2.0
"""What slides or rolls over the seam of two shapes of one body does not feel it; corners that are there are felt."""

import math

import numpy as np
import pytest
from examples import half

from haptic_sim.method.event_driven import EventDriven
from haptic_sim.method.layout import lay_out
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

G, H = 9.81, 1e-3
BOTH = [Partitioned, EventDriven]
PLACES = [0.0, 37.0], [1.0, 0.25]  # angle of the plane [degrees], size of the scene
EVERYWHERE, PLACED = half("kind, degrees, size", BOTH, *PLACES), half("degrees, size", *PLACES)
SEAM = 0.1
"""Place of the seam along the floor, times the size [m]."""


def turned(degrees, x, y):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [c * x - s * y, s * x + c * y]


def box(left, right, bottom, top):
    return {"vertices": [[left, bottom], [right, bottom], [right, top], [left, top]]}


def slope(run, rise, thickness=0.1):
    """A floor that goes on from the seam by `run` and rises by `rise`."""
    return {"vertices": [[SEAM, -thickness], [SEAM + run, -thickness], [SEAM + run, rise], [SEAM, 0.0]]}


FLOORS = {
    "two boxes": [box(-0.4, SEAM, -0.1, 0.0), box(SEAM, 1.1, -0.1, 0.0)],
    "a thin and a thick box": [box(-0.4, SEAM, -0.01, 0.0), box(SEAM, 1.1, -0.3, 0.0)],
    "a thick and a thin box": [box(-0.4, SEAM, -0.3, 0.0), box(SEAM, 1.1, -0.01, 0.0)],
    "overlapping boxes": [box(-0.4, 0.2, -0.1, 0.0), box(SEAM, 1.1, -0.2, 0.0)],
    "tiles": [box(-0.4, SEAM, -0.1, 0.0), *(box(SEAM + 0.02 * k, SEAM + 0.02 * (k + 1), -0.1, 0.0) for k in range(30))],
    "a half plane and a box": [{"half_plane": {"normal": [0.0, 1.0]}}, box(SEAM, 1.1, -0.1, 0.0)],
}


def scaled(shape, size):
    if "vertices" in shape:
        return {"vertices": [[size * x, size * y] for x, y in shape["vertices"]]}
    if "circle" in shape:
        circle = shape["circle"]
        centre = {"center": [size * x for x in circle["center"]]} if "center" in circle else {}
        return {"circle": {"radius": size * circle["radius"], **centre}}
    return shape


def scene_of(degrees, size, floor, bodies, tool, friction):
    """All of one material, lengths times `size`, the plane turned by `degrees`."""

    def placed(body):
        (x, y, angle), (vx, vy) = body.get("pose", (0.0, 0.0, 0.0)), body.get("velocity", (0.0, 0.0))
        return {
            "material": "m",
            **body,
            "pose": [*turned(degrees, size * x, size * y), math.radians(degrees) + angle],
            **({} if body.get("fixed") else {"velocity": [*turned(degrees, vx, vy), 0.0]}),
            "shapes": [scaled(shape, size) for shape in body["shapes"]],
        }

    ground = placed({"name": "floor", "fixed": True, "shapes": floor})
    scene = {"name": "t", "materials": {"m": {"friction": friction}, "smooth": {}}, "gravity": turned(degrees, 0.0, -G)}
    return scene | {"bodies": [ground, *map(placed, bodies)], "tool": placed(tool)}


FAR_TOOL = {"mass": 0.1, "pose": [-5.0, 0.8, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}


def made(kind, degrees, size, floor, bodies, tool=FAR_TOOL, friction=0.0, h=H):
    return kind(reduce_scene(Scene.model_validate(scene_of(degrees, size, floor, bodies, tool, friction))), h)


def block(x=0.0, speed=0.5, mass=2.0, width=0.04, height=0.02):
    shapes = [box(-0.5 * width, 0.5 * width, -0.5 * height, 0.5 * height)]
    return {"name": "block", "mass": mass, "pose": [x, 0.5 * height, 0.0], "velocity": [speed, 0.0], "shapes": shapes}


def state(method, degrees, body=1):
    """(x, y, angle; velocities) of a moving body in the plane before it was turned."""
    (x, y, angle), (vx, vy, turning) = method.bodies()[body]
    return (*turned(-degrees, x, y), angle - math.radians(degrees), *turned(-degrees, vx, vy), turning)


@EVERYWHERE
@pytest.mark.parametrize("floor", FLOORS)
def test_a_block_keeps_its_speed_over_a_seam_without_friction(kind, degrees, size, floor):
    method = made(kind, degrees, size, FLOORS[floor], [block(speed=0.5 * size)])
    for _ in range(500):
        method.step(held((0.0, 0.0, 0.0)), 1)
        x, y, angle, vx, vy, turning = state(method, degrees)
        assert (vx, vy, turning) == pytest.approx((0.5 * size, 0.0, 0.0), abs=1e-7)
        assert (y, angle) == pytest.approx((0.01 * size, 0.0), abs=1e-7)
    assert x == pytest.approx(0.25 * size, rel=1e-6)


@EVERYWHERE
@pytest.mark.parametrize("floor", FLOORS)
def test_a_block_slows_down_by_mu_g_over_a_seam_and_stops_where_it_would(kind, degrees, size, floor):
    speed = math.sqrt(size)
    method = made(kind, degrees, size, FLOORS[floor], [block(speed=speed)], friction=0.3)
    end = speed / (0.3 * G)
    method.step(held((0.0, 0.0, 0.0)), round(0.5 * end / H))
    x, y, angle, vx, vy, turning = state(method, degrees)
    assert (vx, vy, turning) == pytest.approx((speed - 0.3 * G * H * round(0.5 * end / H), 0.0, 0.0), abs=1e-6)
    method.step(held((0.0, 0.0, 0.0)), round(end / H))
    assert state(method, degrees)[:3] == pytest.approx((speed**2 / (0.6 * G), 0.01 * size, 0.0), abs=2e-6)


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize("draw", range(20))
def test_blocks_of_round_numbers_pass_seams_at_round_places(kind, draw):
    """Numbers of one or two digits, as one writes them: then corner and seam meet at the end of a sub-step."""
    rng = np.random.default_rng(draw)
    width, height = rng.integers(1, 10, 2) * 0.01
    seams = np.cumsum([0.05, *rng.integers(1, 6, 8) * 0.02])
    speed, mass = rng.integers(1, 11) * 0.1, float(rng.choice([0.02, 0.1, 1.0, 5.0]))
    edges = [-1.0, *seams.tolist(), 3.0]
    floor = [box(a, b, -0.05 * rng.integers(1, 4), 0.0) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    degrees = float(rng.choice([0.0, 10.0, 37.0, 90.0]))
    h = float(rng.choice([1e-3, 5e-4, 2e-4]))
    method = made(kind, degrees, 1.0, floor, [block(0.0, speed, mass, width, height)], h=h)
    method.step(held((0.0, 0.0, 0.0)), round(0.4 / h))
    x, y, angle, vx, vy, turning = state(method, degrees)
    assert (x, y, angle) == pytest.approx((0.4 * speed, 0.5 * height, 0.0), abs=1e-7)
    assert (vx, vy, turning) == pytest.approx((speed, 0.0, 0.0), abs=1e-7)


def pushed_along(degrees, size, tool, bodies, floor, start, end, friction=0.0, height=0.01, h=H):
    """The least and largest of (y, angle) of tool and bodies, and of the force along, while the handle leads over."""
    method = made(Partitioned, degrees, size, floor, bodies, tool, friction, h)
    method.couple(Coupling(2000.0, 20.0, 2.0, 0.02))
    seen, count = [], round(abs(end - start) / 0.2 / h)
    for k in range(count):
        way = start + (end - start) * k / count
        method.step(held((*turned(degrees, size * way, size * height), math.radians(degrees))), 1)
        force = turned(-degrees, *method.force_on_tool[:2])
        seen.append(
            [value for body in range(len(bodies) + 1) for value in state(method, degrees, body)[1:3]] + [force[0]]
        )
    return np.array(seen[round(0.4 / h) :]), method


@PLACED
@pytest.mark.parametrize("floor", FLOORS)
def test_a_block_that_the_tool_pushes_over_a_seam_does_not_lift_or_turn(degrees, size, floor):
    tool = {"mass": 0.1, "pose": [-0.0301, 0.01, 0.0], "material": "smooth", "shapes": [{"circle": {"radius": 0.01}}]}
    seen, method = pushed_along(degrees, size, tool, [block(0.0, 0.0, 0.2)], FLOORS[floor], -0.03, 0.2, 0.3)
    assert np.ptp(seen[:, 2:4], axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert seen[:, 4] == pytest.approx(np.full(len(seen), 0.3 * 0.2 * G), rel=1e-3)
    assert state(method, degrees)[0] == pytest.approx(0.23 * size, abs=0.005)


@PLACED
@pytest.mark.parametrize("ends", [(-0.15, 0.15), (0.15, -0.15)])
def test_a_tool_of_two_boxes_slides_over_the_corner_of_a_table_without_friction(degrees, size, ends):
    """Its own seam passes the corner, both ways; nothing pushes it along."""
    table = [box(-0.4, 0.0, -0.1, 0.0)]
    start, end = np.clip(ends, -0.15, 0.08)
    shapes = [box(-0.1, 0.0, -0.01, 0.01), box(0.0, 0.1, -0.01, 0.01)]
    tool = {"mass": 0.1, "pose": [float(start), 0.01, 0.0], "shapes": shapes}
    seen, method = pushed_along(degrees, size, tool, [], table, start, end, height=0.0099)
    assert np.abs(seen[:, 2]).max() < 0.05 and np.abs(seen[:, 1]).max() < 0.1


@PLACED
@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("shape", [{"circle": {"radius": 0.01}}, box(-0.01, 0.01, -0.01, 0.01)])
def test_a_tool_pressed_to_the_floor_feels_no_seam(degrees, size, floor, shape):
    """10 N or less into it, which is 5 mm of the coupling: nothing along the floor, and it neither lifts nor turns."""
    tool = {"mass": 0.1, "pose": [-0.03, 0.01, 0.0], "shapes": [shape]}
    seen, _ = pushed_along(degrees, size, tool, [], FLOORS[floor], -0.03, 0.2, height=0.005)
    assert np.abs(seen[:, 2]).max() < 1e-3
    assert seen[:, 0] == pytest.approx(np.full(len(seen), 0.01 * size), abs=1e-8)
    assert np.abs(seen[:, 1]).max() < 1e-6


@EVERYWHERE
def test_a_disc_rolls_over_a_ridge_on_its_corner(kind, degrees, size):
    """Convex by 20°: it goes on with what it has and what it falls, without a blow: no energy is lost or gained."""
    floor = [box(-0.4, SEAM, -0.1, 0.0), slope(1.0, -math.tan(math.radians(20.0)), 0.5)]
    disc = {"name": "disc", "mass": 1.0, "pose": [0.06, 0.02, 0.0], "velocity": [0.15 * size, 0.0]}
    disc |= {"material": "smooth", "shapes": [{"circle": {"radius": 0.02}}]}
    method = made(kind, degrees, size, floor, [disc])
    start = 0.5 * (0.15 * size) ** 2
    for _ in range(500):
        method.step(held((0.0, 0.0, 0.0)), 1)
        x, y, _, vx, vy, _ = state(method, degrees)
        assert 0.5 * (vx * vx + vy * vy) + G * (y - 0.02 * size) == pytest.approx(start, abs=1e-5 * size)
    assert x > SEAM * size + 0.02 * size and vx > 0.15 * size


@EVERYWHERE
@pytest.mark.parametrize("floor", FLOORS)
def test_a_disc_rolls_over_a_seam_at_its_speed(kind, degrees, size, floor):
    """Spun up by friction first: a disc that slid at v rolls at 2/3 v."""
    disc = {
        "name": "disc",
        "mass": 1.0,
        "pose": [0.0, 0.02, 0.0],
        "velocity": [0.3 * size, 0.0],
        "shapes": [{"circle": {"radius": 0.02}}],
    }
    method = made(kind, degrees, size, FLOORS[floor], [disc], friction=0.5)
    method.step(held((0.0, 0.0, 0.0)), 1000)
    x, y, angle, vx, vy, turning = state(method, degrees)
    assert x > 0.15 * size
    assert (vx, vy, y) == pytest.approx((0.2 * size, 0.0, 0.02 * size), abs=1e-6)
    assert turning == pytest.approx(-10.0, abs=1e-4)


@EVERYWHERE
def test_a_block_slides_off_a_level_floor_onto_a_slope_without_a_blow(kind, degrees, size):
    """Convex: with a slope of 3° it tips over the bend and loses no more than the turn of its way."""
    floor = [box(-0.4, SEAM, -0.1, 0.0), slope(1.0, -math.tan(math.radians(3.0)))]
    method = made(kind, degrees, size, floor, [block(speed=0.5 * size)])
    start, slowest = sum(method.energy()), math.inf
    for _ in range(400):
        method.step(held((0.0, 0.0, 0.0)), 1)
        x, y, angle, vx, vy, turning = state(method, degrees)
        slowest = min(slowest, vx)
        assert sum(method.energy()) <= start * (1.0 + 1e-9) + 1e-9
    assert slowest > 0.498 * size and x > SEAM * size + 0.05 * size
    assert angle == pytest.approx(-math.radians(3.0), abs=1e-3)


@EVERYWHERE
def test_a_block_strikes_a_slope_that_rises_by_its_angle_alone(kind, degrees, size):
    """Concave, 3° = atan s/c: the front corner goes up the slope and the rear one stays on the floor. With a, b half
    the block's sides: w = s v/(2 a c − b s), v = v₀/(1 + s² (I/m + a²)/(2 a c − b s)²); after that gravity acts."""
    s, c, a, b = math.sin(math.radians(3.0)), math.cos(math.radians(3.0)), 0.02, 0.01
    arm = 2.0 * a * c - b * s
    speed = 0.5 / (1.0 + s * s * ((a * a + b * b) / 3.0 + a * a) / arm**2)
    floor = [box(-0.4, SEAM, -0.1, 0.0), slope(1.0, math.tan(math.radians(3.0)))]
    method = made(kind, degrees, size, floor, [block(speed=0.5 * size)])
    states = []
    for _ in range(161):
        method.step(held((0.0, 0.0, 0.0)), 1)
        states.append(state(method, degrees))
    assert states[-1][3] == pytest.approx(speed * size, rel=6e-3)
    assert max(one[5] for one in states) <= s * speed / arm * 1.001


@EVERYWHERE
@pytest.mark.parametrize("higher", [True, False])
def test_a_step_up_stops_the_block_and_a_step_down_lets_it_pass(kind, degrees, size, higher):
    rise = 0.012 if higher else -0.003
    floor = [box(-0.4, SEAM, -0.1, 0.0), box(SEAM, 1.1, -0.1, rise)]
    method = made(kind, degrees, size, floor, [block(speed=0.5 * size)])
    method.step(held((0.0, 0.0, 0.0)), 170)
    x, _, _, vx, *_ = state(method, degrees)
    if higher:
        assert x <= 0.08 * size + 1e-9 and vx < 0.1 * size
    else:
        assert x == pytest.approx(0.085 * size, abs=1e-6) and vx == pytest.approx(0.5 * size, abs=1e-6)


@EVERYWHERE
def test_a_wall_that_stands_on_the_floor_stops_the_block(kind, degrees, size):
    floor = [box(-0.4, 1.1, -0.1, 0.0), box(SEAM, 0.2, 0.0, 0.1)]
    method = made(kind, degrees, size, floor, [block(speed=0.5 * size)])
    method.step(held((0.0, 0.0, 0.0)), 200)
    x, y, angle, vx, vy, turning = state(method, degrees)
    assert (x, y, angle) == pytest.approx((0.08 * size, 0.01 * size, 0.0), abs=1e-6)
    assert (vx, vy, turning) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def covered(floor):
    """Corners of the floor's shapes from which an edge is hidden, and how deep."""
    model = reduce_scene(Scene.model_validate(scene_of(0.0, 1.0, floor, [block()], FAR_TOOL, 0.0))).model
    world = np.repeat(model.shape_body, np.diff(model.shape_start)) == len(model.mass) - 1
    depths = lay_out(model).covered
    return sorted(
        (*corner.round(3).tolist(), depth.max().round(3))
        for corner, depth in zip(model.vertices[world], depths[world], strict=True)
        if depth.any()
    )


def test_only_sides_that_meet_are_hidden_as_deep_as_they_meet():
    assert covered([box(-0.4, SEAM, -0.1, 0.0)]) == []
    assert covered([box(-0.4, SEAM, -0.1, 0.0), box(0.2, 1.1, -0.1, 0.0)]) == []
    flush = [(SEAM, -0.1, 0.1), (SEAM, 0.0, 0.1)]
    assert covered([box(-0.4, SEAM, -0.1, 0.0), box(SEAM, 1.1, -0.1, 0.0)]) == sorted(2 * flush)
    assert covered([box(-0.4, SEAM, -0.1, 0.0), box(SEAM, 1.1, -0.3, 0.0)]) == [
        (SEAM, -0.1, 0.1),
        (SEAM, 0.0, 0.1),
        (SEAM, 0.0, 0.1),
    ]
    assert covered([box(-0.4, 0.2, -0.1, 0.0), box(SEAM, 1.1, -0.2, 0.0)]) == [(SEAM, 0.0, 0.1), (0.2, 0.0, 0.1)]
    assert covered([box(-0.4, 1.1, -0.1, 0.0), box(SEAM, 0.2, 0.0, 0.1)]) == [(SEAM, 0.0, 0.1), (0.2, 0.0, 0.1)]
