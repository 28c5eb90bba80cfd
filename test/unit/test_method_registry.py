# SPDX-License-Identifier: Apache-2.0
"""A simulation method is one file and one line of registration; everything else follows the registry."""

from pathlib import Path
from typing import get_args

import pytest

from bench.methods import world as measured_worlds
from haptic_device.config.parameters import EXCHANGE_METHODS
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.method_registry import AUTO, METHODS, Entry, make, offered
from haptic_sim.protocol import World
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import SceneError, parse

DOCS = Path(__file__).parents[2] / "docs"
SCENE = {"name": "toy", "method": "toy", "tool": {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}}
GAINS = (2000.0, 2.0, 2.0, 0.002)


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(METHODS, "toy", Entry("toy_method:Toy"))


@pytest.mark.parametrize("exchange", EXCHANGE_METHODS)
def test_a_method_in_one_file_answers_exchanges_behind_every_port_once_a_line_names_it(registered, exchange):
    simulation = Simulation(reduce_scene(parse(SCENE, "here")), port=port_of(exchange))
    assert simulation.method_name == "toy"
    for k in range(5):
        handle = HandleSample(k * 1_000_000, (1e-4 * k, 0.0, 0.0), (0.1, 0.0, 0.0), *GAINS, energy=1e-3 * k)
        tool = simulation.exchange(handle)
    assert simulation.counters.exchanges == 5 and simulation.counters.sub_steps > 0
    if exchange == "direct":
        assert tool.position == (4e-4, 0.0, 0.0)


def test_the_measurements_can_take_it_too(registered):
    scene = parse(SCENE, "here")
    assert measured_worlds.make("toy", scene, 1e-3).pose("tool") == scene.tool.pose


def test_without_the_line_a_scene_that_asks_for_it_is_refused_with_the_names_that_there_are():
    with pytest.raises(SceneError, match=f"method is 'toy'.*{', '.join(offered())}"):
        parse(SCENE, "here")
    with pytest.raises(ValueError, match=f"method is 'toy'; it must be one of {', '.join(METHODS)}"):
        make("toy", reduce_scene(parse({**SCENE, "method": None}, "here")), 1e-3)


def test_parameters_measurements_and_pages_name_what_is_registered():
    from haptic_sim.node.parameters import Simulation as Parameters

    assert get_args(Parameters.model_fields["method"].annotation) == (AUTO, *offered())
    assert tuple(METHODS) == measured_worlds.OURS
    page = (DOCS / "theory/methods.md").read_text(encoding="utf-8")
    assert [name for name in METHODS if f"`{name}`" not in page] == []


@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_all_that_the_protocol_says(name):
    scene = reduce_scene(parse({**SCENE, "method": None}, "here"))
    world = make(name, scene, 1e-3)
    wanted = {*World.__annotations__, *(word for word in vars(World) if not word.startswith("_"))}
    assert [word for word in sorted(wanted) if not hasattr(world, word)] == []
