# SPDX-License-Identifier: Apache-2.0
"""What slides or rolls over the seam of two shapes of one body does not feel it; corners that are there are felt."""

import math

import numpy as np
import pytest
from examples import half
from worlds import DOWN, TURNS, G, World, block_of, body, disc, tool

from haptic_sim.protocol import Coupling

BOTH = ["partitioned", "event_driven"]
SEAM = 0.1
"""Place of the seam along the floor [m]."""
LEFT = block_of(-0.4, SEAM, -0.1, 0.0)


def slope(rise, thickness=0.1):
    """A floor that goes on from the seam by a metre and rises by `rise`."""
    return {"vertices": [[SEAM, -thickness], [SEAM + 1.0, -thickness], [SEAM + 1.0, rise], [SEAM, 0.0]]}


TILES = [block_of(SEAM + 0.02 * k, SEAM + 0.02 * (k + 1), -0.1, 0.0) for k in range(30)]
FLOORS = {
    "two boxes": [LEFT, block_of(SEAM, 1.1, -0.1, 0.0)],
    "a thin and a thick box": [block_of(-0.4, SEAM, -0.01, 0.0), block_of(SEAM, 1.1, -0.3, 0.0)],
    "a thick and a thin box": [block_of(-0.4, SEAM, -0.3, 0.0), block_of(SEAM, 1.1, -0.01, 0.0)],
    "overlapping boxes": [block_of(-0.4, 0.2, -0.1, 0.0), block_of(SEAM, 1.1, -0.2, 0.0)],
    "tiles": [LEFT, *TILES],
    "a half plane and a box": [{"half_plane": {"normal": [0.0, 1.0]}}, block_of(SEAM, 1.1, -0.1, 0.0)],
}
OVER = half("floor, method, turn", list(FLOORS), BOTH, TURNS)
EVERYWHERE = half("method, turn", BOTH, TURNS)


def block(x=0.0, speed=0.5, mass=2.0, width=0.04, height=0.02):
    shapes = [block_of(-0.5 * width, 0.5 * width, -0.5 * height, 0.5 * height)]
    return body(x, 0.5 * height, shapes=shapes, mass=mass, velocity=[speed, 0.0, 0.0])


def made(method, turn, shapes, *bodies, **more):
    ground = {"name": "floor", "fixed": True, "shapes": shapes}
    return World(method, [ground, *bodies], **{"turn": turn, "gravity": DOWN} | more)


@OVER
def test_a_block_keeps_its_speed_over_a_seam_without_friction(floor, method, turn):
    world = made(method, turn, FLOORS[floor], block())
    for k in range(1, 501):
        expected = 0.5e-3 * k, 0.01, 0.0, 0.5, 0.0, 0.0
        assert world.steps(1).state() == pytest.approx(expected, abs=1e-7)


@OVER
def test_a_block_slows_down_by_mu_g_over_a_seam_and_stops_where_it_would(floor, method, turn):
    world = made(method, turn, FLOORS[floor], block(speed=1.0), friction=0.3)
    assert world.run(0.17).state()[3:] == pytest.approx((1.0 - 0.3 * G * 0.17, 0.0, 0.0), abs=1e-6)
    assert world.run(0.3).state()[:3] == pytest.approx((1.0 / (0.6 * G), 0.01, 0.0), abs=2e-6)


@OVER
def test_a_disc_rolls_over_a_seam_at_its_speed(floor, method, turn):
    """Spun up by friction first: a disc that slid at v rolls at 2/3 v."""
    rolls = body(0.0, 0.02, shapes=disc(0.02), velocity=[0.3, 0.0, 0.0])
    x, y, _, vx, vy, turning = made(method, turn, FLOORS[floor], rolls, friction=0.5).run(1.0).state()
    assert x > 0.15
    assert (vx, vy, y, turning) == pytest.approx((0.2, 0.0, 0.02, -10.0), abs=1e-6)


@pytest.mark.parametrize("method", BOTH)
def test_blocks_of_round_numbers_pass_seams_at_round_places(method):
    """Numbers of one or two digits, as one writes them: then corner and seam meet at the end of a sub-step."""
    for draw in range(20):
        rng = np.random.default_rng(draw)
        width, height = rng.integers(1, 10, 2) * 0.01
        edges = [-1.0, *np.cumsum([0.05, *rng.integers(1, 6, 8) * 0.02]).tolist(), 3.0]
        speed, mass = rng.integers(1, 11) * 0.1, float(rng.choice([0.02, 0.1, 1.0, 5.0]))
        pairs = zip(edges[:-1], edges[1:], strict=True)
        shapes = [block_of(a, b, -0.05 * rng.integers(1, 4), 0.0) for a, b in pairs]
        turn, h = math.radians(rng.choice([0.0, 10.0, 37.0, 90.0])), float(rng.choice([1e-3, 5e-4, 2e-4]))
        world = made(method, turn, shapes, block(0.0, speed, mass, width, height), h=h)
        expected = 0.4 * speed, 0.5 * height, 0.0, speed, 0.0, 0.0
        assert world.run(0.4).state() == pytest.approx(expected, abs=1e-7), draw


def pushed_along(turn, held, shapes, start, end, height, *bodies, friction=0.0):
    """(y, angle) of tool and bodies, and the force along, while the handle leads over from its rest."""
    more = dict(tool=held, gains=Coupling(2000.0, 20.0, 2.0, 0.02), friction=friction)
    world, seen, count = made("partitioned", turn, shapes, *bodies, **more), [], round(abs(end - start) / 0.2e-3)
    for k in range(count):
        world.steps(1, (start + (end - start) * k / count, height, 0.0))
        seen.append([*world.pose("tool")[1:], *(value for _ in bodies for value in world.pose()[1:]), world.force()[0]])
    return np.array(seen[400:]), world


@half("floor, turn", list(FLOORS), TURNS)
def test_a_block_that_the_tool_pushes_over_a_seam_does_not_lift_or_turn(floor, turn):
    held = tool(-0.0301, 0.01, material="smooth")
    seen, world = pushed_along(turn, held, FLOORS[floor], -0.03, 0.2, 0.01, block(0.0, 0.0, 0.2), friction=0.3)
    assert np.ptp(seen[:, 2:4], axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert seen[:, 4] == pytest.approx(np.full(len(seen), 0.3 * 0.2 * G), rel=1e-3)
    assert world.pose()[0] == pytest.approx(0.23, abs=0.005)


@half("floor, shape, turn", list(FLOORS), [disc(0.01), [block_of(-0.01, 0.01, -0.01, 0.01)]], TURNS)
def test_a_tool_pressed_to_the_floor_feels_no_seam(floor, shape, turn):
    """10 N or less into it, which is 5 mm of the coupling: nothing along the floor, and it neither lifts nor turns."""
    seen, _ = pushed_along(turn, tool(-0.03, 0.01, shapes=shape), FLOORS[floor], -0.03, 0.2, 0.005)
    assert np.abs(seen[:, 2]).max() < 1e-3
    assert seen[:, 0] == pytest.approx(np.full(len(seen), 0.01), abs=1e-8)
    assert np.abs(seen[:, 1]).max() < 1e-6


@pytest.mark.parametrize(("turn", "start", "end"), [(TURNS[0], -0.15, 0.08), (TURNS[1], 0.08, -0.15)])
def test_a_tool_of_two_boxes_slides_over_the_corner_of_a_table_without_friction(turn, start, end):
    """Its own seam passes the corner, both ways; nothing pushes it along."""
    held = tool(start, 0.01, shapes=[block_of(-0.1, 0.0, -0.01, 0.01), block_of(0.0, 0.1, -0.01, 0.01)])
    seen, _ = pushed_along(turn, held, [block_of(-0.4, 0.0, -0.1, 0.0)], start, end, 0.0099)
    assert np.abs(seen[:, 2]).max() < 0.05 and np.abs(seen[:, 1]).max() < 0.1


@EVERYWHERE
def test_a_disc_rolls_over_a_ridge_on_its_corner(method, turn):
    """Convex by 20°: it goes on with what it has and what it falls, without a blow: no energy is lost or gained."""
    rolls = body(0.06, 0.02, shapes=disc(0.02), velocity=[0.15, 0.0, 0.0], material="smooth")
    world = made(method, turn, [LEFT, slope(-math.tan(math.radians(20.0)), 0.5)], rolls)
    for _ in range(500):
        x, y, _, vx, vy, _ = world.steps(1).state()
        assert 0.5 * (vx * vx + vy * vy) + G * (y - 0.02) == pytest.approx(0.5 * 0.15**2, abs=1e-5)
    assert x > SEAM + 0.02 and vx > 0.15


@EVERYWHERE
def test_a_block_slides_off_a_level_floor_onto_a_slope_without_a_blow(method, turn):
    """Convex: with a slope of 3° it tips over the bend and loses no more than the turn of its way."""
    world = made(method, turn, [LEFT, slope(-math.tan(math.radians(3.0)))], block())
    start, slowest = world.energy, math.inf
    for _ in range(400):
        x, _, angle, vx, *_ = world.steps(1).state()
        slowest = min(slowest, vx)
        assert world.energy <= start * (1.0 + 1e-9) + 1e-9
    assert slowest > 0.498 and x > SEAM + 0.05
    assert angle == pytest.approx(-math.radians(3.0), abs=1e-3)


@EVERYWHERE
def test_a_block_strikes_a_slope_that_rises_by_its_angle_alone(method, turn):
    """Concave, 3° = atan s/c: the front corner goes up the slope and the rear one stays on the floor. With a, b half
    the block's sides: w = s v/(2 a c − b s), v = v₀/(1 + s² (I/m + a²)/(2 a c − b s)²); after that gravity acts."""
    s, c, a, b = math.sin(math.radians(3.0)), math.cos(math.radians(3.0)), 0.02, 0.01
    arm = 2.0 * a * c - b * s
    speed = 0.5 / (1.0 + s * s * ((a * a + b * b) / 3.0 + a * a) / arm**2)
    world = made(method, turn, [LEFT, slope(math.tan(math.radians(3.0)))], block())
    states = [world.steps(1).state() for _ in range(161)]
    assert states[-1][3] == pytest.approx(speed, rel=6e-3)
    assert max(one[5] for one in states) <= s * speed / arm * 1.001


@EVERYWHERE
def test_a_step_up_or_a_wall_stops_the_block_and_a_step_down_lets_it_pass(method, turn):
    down, up, wall = (
        block_of(SEAM, 1.1, -0.1, -0.003),
        block_of(SEAM, 1.1, -0.1, 0.012),
        block_of(SEAM, 0.2, 0.0, 0.1),
    )
    x, _, _, vx, *_ = made(method, turn, [LEFT, up], block()).run(0.17).state()
    assert x <= 0.08 + 1e-9 and vx < 0.1
    x, _, _, vx, *_ = made(method, turn, [LEFT, down], block()).run(0.17).state()
    assert (x, vx) == pytest.approx((0.085, 0.5), abs=1e-6)
    stopped = made(method, turn, [block_of(-0.4, 1.1, -0.1, 0.0), wall], block()).run(0.2).state()
    assert stopped == pytest.approx((0.08, 0.01, 0.0, 0.0, 0.0, 0.0), abs=1e-6)
