# SPDX-License-Identifier: Apache-2.0
"""What is compared is the same problem for every peer; worlds of many bodies are what they say; tables tell truly."""

import math

import numpy as np
import pytest

from bench.methods import growth, loads, world
from bench.methods.measure import run
from bench.methods.world import make
from bench.reference.case import case
from bench.reference.reference import reference
from haptic_sim.error_metrics import STABLE
from haptic_sim.protocol import Coupling
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import GAINS, overlap_watch
from haptic_sim.scene.shapes import TOOL

PACKAGES = {"box2d": "Box2D", "mujoco_rk4": "mujoco", "mujoco_implicit": "mujoco"}  # of the peers that are optional


def made(engine="impulse", world="heap", bodies=100, step=growth.STEP, median=100.0, p99=200.0, overlap=5.0, status=""):
    return growth.Run(world, bodies, engine, step, median, p99, overlap, 1e-4, math.nan, status)


@pytest.mark.parametrize("count", [10, 30])
@pytest.mark.parametrize(
    ("world", "pieces"),
    [
        ("row", int),
        ("heap", int),
        ("chain", int),
        ("pyramid", {10: 10, 30: 28}.get),
        ("joint_grid", {10: 9, 30: 25}.get),
    ],
)
def test_a_world_has_as_many_bodies_as_it_says_and_none_overlaps_at_the_start(world, pieces, count):
    """A pyramid has 1 + 2 + ... boxes, a grid a square number of discs: the most that are no more than asked for."""
    of = getattr(loads, world)(count, 0.2)
    movable = [body.name for body in of.scene.bodies if not body.fixed]
    assert len(movable) == pieces(count)
    assert set(reduce_scene(of.scene).needs.moving) == {TOOL, *movable}
    poses = {body.name: body.pose for body in of.scene.bodies} | {TOOL: of.scene.tool.pose}
    assert overlap_watch(of.scene, poses.get)() <= 1e-9
    assert of.path().shape == (201, 6)
    assert of.path()[0, :3] == pytest.approx(of.scene.tool.pose)


@pytest.mark.parametrize("engine", ["impulse", "partitioned"])
@pytest.mark.parametrize("world", ["row", "pyramid"])
def test_what_nobody_touches_stays_where_it_is(engine, world):
    found = growth.run(world, 10, engine, growth.STEP, 0.1)
    assert (found.bodies, found.status) == (10, "")
    assert found.error_um < 5.0
    assert found.overlap_um < 5.0
    assert found.created < 1e-3


def test_a_block_that_is_pushed_aside_is_an_error_of_its_way(monkeypatch):
    above, beside, pushed = (0.0, 0.04, 0.0), (-0.02, 0.006, 0.0), (0.0, 0.006, 0.0)
    way = np.vstack([np.linspace(above, beside, 201), np.linspace(beside, pushed, 400)])

    class Pushing(loads.Load):
        def path(self):
            return np.hstack([way, np.gradient(way, 1e-3, axis=0)])

    row = Pushing(*loads.row(3, 0.6))
    world = make("partitioned", row.scene, growth.STEP * 1e-6)
    world.couple(Coupling(*GAINS))
    world.step(row.path(), 1000 // growth.STEP)
    came = [math.dist(world.pose(body.name)[:2], body.pose[:2]) for body in row.scene.bodies if not body.fixed]
    monkeypatch.setattr(loads, "row", lambda count, seconds: row)
    assert growth.run("row", 3, "partitioned", growth.STEP, 0.6).error_um == pytest.approx(1e6 * max(came))
    assert max(came) > 1e-3


def test_a_pin_that_is_open_is_an_error_of_its_gap():
    """The second link of four is turned about its middle: two pins open by half its length times the sine's chord."""
    chain = loads.chain(4, 0.1)
    poses = {body.name: body.pose for body in chain.scene.bodies} | {TOOL: chain.scene.tool.pose}
    assert loads.pins_open(chain.scene, poses.get) == pytest.approx(0.0, abs=1e-15)
    x, y, angle = poses["piece_1"]
    poses["piece_1"] = (x, y, angle + 0.1)
    assert loads.pins_open(chain.scene, poses.get) == pytest.approx(loads.LINK * math.sin(0.05))


@pytest.mark.parametrize(("world", "count"), [("chain", 30), ("joint_grid", 10), ("joint_grid", 30)])
def test_many_pins_stay_closed_in_pymunk_s_world_and_create_no_energy(world, count):
    """As fast as a few joints take their errors back, 17 pins in a grid gain six times the energy that is about."""
    found = growth.run(world, count, "impulse", growth.STEP, 0.4)
    assert found.error_um < 50.0
    assert found.created < 0.01


def test_a_run_that_takes_too_long_is_ended_and_says_so():
    found = growth.run("row", 10, "partitioned", growth.STEP, 0.1, limit=0.0)
    assert found.status == "over"
    assert math.isnan(found.overlap_um)
    cells = growth.markdown([found, made(), made()._replace(created=math.inf)]).splitlines()[2:5]
    assert [row.count("over ") for row in cells] == [2, 0, 0]
    assert ["not finite" in row for row in cells] == [False, False, True]
    assert growth.run("row", 10, "partitioned", growth.STEP, 0.1).status == ""


@pytest.mark.parametrize("peer", world.PEERS)
@pytest.mark.parametrize("name", ["free_space", "pendulum", "four_bar", "slider", "wall"])
def test_every_peer_comes_to_the_closed_form(peer, name):
    """So that what is compared is the same problem: signs, anchors, masses, coupling, hand."""
    pytest.importorskip(PACKAGES.get(peer, "pymunk"))
    found = run(case(name), reference(name), peer, 250)
    assert found.status == STABLE
    assert found.error < 2e-3
