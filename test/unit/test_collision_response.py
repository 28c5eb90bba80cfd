# SPDX-License-Identifier: Apache-2.0
"""The right constraint where several vertices and edges overlap at once: told by the motion, not the deepest overlap.

The handle jumps, so that the tool would lie deep inside what it meets (Colgate, Stanley & Brown 1995, Figs 1-3). What
is right is known: the face that the tool reached first holds it, and it never comes out elsewhere.
"""

import pytest
from examples import searching

from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import EXCHANGE_NS
from haptic_sim.scene.geometry import framed
from haptic_sim.scene.language import Scene
from reference.trial import turned_scene

STILL = (0.0, 0.0, 0.0)
GAINS = (5000.0, 10.0, 1e4, 1.0)  # hardly turns: what is held off centre would rightly roll around the corner
A_HANDS = (5000.0, 10.0, 20.0, 0.05)
METHODS = ["partitioned", "impulse"]
TURNS = [0.0, 0.9, 2.5] if searching() else [0.0, 2.5]
SQUARE = [{"box": {"size": [0.02, 0.02]}}]


def led(method, angle, obstacles, start, jumps, exchanges=150, gains=GAINS):
    """Places of the tool after each exchange, as in the plane before it was turned, for each place jumped to."""
    bodies = [{"name": f"b{i}", "fixed": True, "shapes": [shape]} for i, shape in enumerate(obstacles)]
    tool = {"mass": 0.1, "pose": [*start], "shapes": SQUARE}
    scene = turned_scene(Scene.model_validate({"name": "t", "bodies": bodies, "tool": tool, "method": method}), angle)
    world, path = Simulation(reduce_scene(scene), 0.25e-3), []
    back = 0.0, 0.0, -angle
    time = 0
    for handle in ((*start,), *jumps):
        x, y = framed(handle[:2], back)
        for _ in range(exchanges):
            sample = HandleSample(time, (x, y, handle[2] + angle), STILL, *gains)
            (px, py, theta) = world.exchange(sample).position
            path.append((*framed((px, py), (0.0, 0.0, angle)), theta - angle))
            time += EXCHANGE_NS
    return path


def box(x0, x1, y0, y1):
    return {"vertices": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]}


BLOCK = [box(0.0, 0.1, -0.1, 0.0)]


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sunk", [0.0005, 0.002, 0.009])
def test_a_tool_that_comes_from_the_side_stays_at_the_side_however_near_the_top_is(method, angle, sunk):
    """It overlaps the block's height by little and its width by much: least overlap says up, the motion says side."""
    y = 0.01 - sunk
    path = led(method, angle, BLOCK, (-0.015, y, 0.0), [(0.03, y, 0.0)])
    assert max(x for x, _, _ in path) < -0.0099
    assert path[-1][1] == pytest.approx(y, abs=1e-4)


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("over", [0.0005, 0.002, 0.009])
def test_a_tool_that_comes_from_above_stays_above_however_near_the_side_is(method, angle, over):
    x = -0.01 + over
    path = led(method, angle, BLOCK, (x, 0.015, 0.0), [(x, -0.04, 0.0)])
    assert min(y for _, y, _ in path) > 0.0099


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
def test_corner_in_corner_both_walls_hold(method, angle):
    walls = [box(-0.1, 0.0, -0.1, 0.3), box(0.0, 0.3, -0.1, 0.0)]
    path = led(
        method,
        angle,
        walls,
        (0.03, 0.03, 0.2),
        [(-0.03, -0.02, 0.2), (-0.05, 0.05, 0.0), (0.05, -0.05, 0.0)],
        gains=A_HANDS,
    )
    assert min(min(x, y) for x, y, _ in path) > 0.0099


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("turn", [0.0, 0.785])
def test_a_thin_fin_is_not_jumped_over_from_either_side(method, angle, turn):
    fin = [box(-0.0005, 0.0005, -0.05, 0.05)]
    right = led(method, angle, fin, (-0.03, 0.0, turn), [(0.03, 0.0, turn)])
    left = led(method, angle, fin, (0.03, 0.0, turn), [(-0.03, 0.0, turn)])
    assert max(x for x, _, _ in right) < -0.01 and min(x for x, _, _ in left) > 0.01


SLOT = [box(-0.1, -0.01005, -0.05, 0.0), box(0.01005, 0.1, -0.05, 0.0)]  # a slot 0.1 mm wider than the tool


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("beside", "enters"), [(0.0, True), (0.00004, True), (0.0003, False), (0.005, False)])
def test_a_slot_lets_in_what_fits_and_its_mouth_holds_what_does_not(method, angle, beside, enters):
    path = led(method, angle, SLOT, (beside, 0.012, 0.0), [(beside, -0.02, 0.0)])
    lowest = min(y for _, y, _ in path)
    assert lowest < -0.015 if enters else lowest > 0.0099


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
def test_corner_on_corner_is_not_passed(method, angle):
    diamond = [{"box": {"size": [0.03, 0.03], "angle": 0.7853981633974483}}]
    path = led(method, angle, diamond, (-0.045, 0.0, 0.7853981633974483), [(0.0, 0.0, 0.7853981633974483)])
    away = min(abs(x) + abs(y) for x, y, _ in path)  # both stand on their corners: they touch at a sum of halves
    assert away > (0.015 + 0.01) * 2.0**0.5 - 2e-3


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("method", METHODS)
def test_a_seam_between_two_flush_blocks_does_not_catch_what_slides_over_it(method, angle):
    floor = [box(-0.1, 0.0, -0.05, 0.0), box(0.0, 0.1, -0.05, 0.0)]
    path = led(method, angle, floor, (-0.05, 0.0101, 0.0), [(0.05, 0.008, 0.0)], exchanges=400)
    assert path[-1][0] == pytest.approx(0.05, abs=1e-3)
    assert all(0.0099 < y < 0.0102 for _, y, _ in path)


@pytest.mark.parametrize("method", METHODS)
def test_nothing_pops_out_of_a_pocket_when_the_hand_turns_and_pulls(method):
    """A pocket a little wider than the tool: turned hard against both sides, pulled out slowly, never thrown."""
    pocket = [box(-0.1, -0.0105, -0.03, 0.0), box(0.0105, 0.1, -0.03, 0.0), box(-0.1, 0.1, -0.05, -0.03)]
    path = led(
        method,
        0.0,
        pocket,
        (0.0, -0.015, 0.0),
        [(0.0, -0.015, 0.6), (0.02, -0.03, 0.6), (0.0, -0.015, -0.6)],
        gains=A_HANDS,
    )
    assert max(abs(x) for x, _, _ in path) < 0.001
    assert all(-0.0201 < y < -0.005 for _, y, _ in path)
