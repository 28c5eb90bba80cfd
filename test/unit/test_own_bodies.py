# SPDX-License-Identifier: Apache-2.0
"""Bodies of one's own in the pymunk world: as the page says, again after each reset, and refused elsewhere."""

import re
from pathlib import Path

import pymunk
import pytest
from handle_samples import MS

from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.protocol import STILL, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load


def run(method, count):
    for _ in range(count):
        method.step(held(STILL), 1)


def test_what_the_page_shows_to_add_moves_with_the_world_is_held_and_calls_back():
    """A ball that falls on the block, and is held by a string of 50 mm when it is thrown up."""
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "own_bodies.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], names)
    world, ball = names["world"], names["ball"]
    run(world, 2000)
    assert ball.position.y == pytest.approx(0.045, abs=1e-5) and names["struck"]
    world.space.gravity, world.body("block").velocity = (0.0, 0.0), (0.0, 0.0)
    ball.velocity = 0.0, 2.0
    run(world, 400)
    assert ball.position.y > 0.06
    assert ball.position.get_distance(world.body("block").position) <= 0.05 + 1e-3
    names["simulation"].reset()
    assert ball not in world.space.bodies


def flap(world):
    """A ball that hangs in the world, once for each space."""
    world.mine = pymunk.Body(0.01, 1e-8)
    world.mine.position = 0.05, 0.0
    world.space.add(world.mine, pymunk.Circle(world.mine, 0.5e-3))


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
