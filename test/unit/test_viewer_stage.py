# SPDX-License-Identifier: Apache-2.0
"""Scenes changed by a page: what the nodes are asked for, and when, by a desk that has no nodes."""

import asyncio
import types

import pytest

from haptic_device.description import load_device
from haptic_sim.scene import load
from haptic_sim.viewer import desk as desk_module
from haptic_sim.viewer import stage
from haptic_sim.viewer.desk import EDGE, Desk
from haptic_sim.viewer.stage import SIMULATION, Stage

RESET, LOAD = f"{SIMULATION}/reset_scene", f"{SIMULATION}/load_scene"


class Table:
    """A desk whose hand is where it should be after `looks` looks; `done` is what was asked for, in order."""

    def __init__(self, looks=0, refusal=""):
        self.done, self.looks, self.refusal = [], looks, refusal
        self.driving, self.held_off, self.services = True, False, self
        self.feed = types.SimpleNamespace(axes=3, scene=load("peg_in_hole"))
        self.values = {SIMULATION: {"scene": "peg_in_hole", "method": "auto"}}

    @property
    def arrived(self):
        self.looks -= 1
        if self.looks < 0:
            self.done.append("arrived")
        return self.looks < 0

    def aim(self, place):
        self.done.append(("aim", tuple(place.values())))

    async def order(self, service):
        self.done.append(service)

    async def set(self, node, change):
        self.done.append(change)

    async def trigger(self, service, *again):
        self.done.append(service)
        if service == LOAD and self.refusal:
            raise ValueError(self.refusal)
        return "said"

    async def poll(self):
        self.done.append("poll")


@pytest.fixture(autouse=True)
def no_time_passes(monkeypatch):
    own = asyncio.sleep
    monkeypatch.setattr(stage.asyncio, "sleep", lambda seconds: own(0.0))


def pose(name):
    return ("aim", load(name).tool.pose)


def test_a_scene_is_loaded_with_the_motor_off_once_the_device_says_that_the_hand_is_there():
    table = Table(looks=30)
    assert asyncio.run(Stage(table).load({"name": "wrench_on_nut"})) == "said"
    wanted = ["disable", pose("wrench_on_nut"), "arrived", {"scene": "wrench_on_nut"}, LOAD, "enable", "poll"]
    assert table.done == wanted and table.looks == -1


def test_after_a_refusal_hand_and_tool_are_both_at_the_start_of_what_there_was():
    table = Table(refusal="no closed form")
    with pytest.raises(ValueError, match="no closed form"):
        asyncio.run(Stage(table).take_method({"name": "closed_form"}))
    there = [pose("peg_in_hole"), "arrived"]
    asked = [{"method": "closed_form"}, LOAD, {"method": "auto"}]
    assert table.done == ["disable", *there, *asked, *there, RESET, "enable"]


def test_a_motor_that_a_page_has_switched_off_stays_off():
    table = Table()
    table.driving = False
    asyncio.run(Stage(table).start_again({}))
    assert table.done == [pose("peg_in_hole"), "arrived", RESET, "poll"]


@pytest.fixture
def desk(monkeypatch):
    """One whose nodes never answer; the world is the device's workspace."""
    monkeypatch.setattr(desk_module, "Services", lambda node: types.SimpleNamespace(prepare=lambda *words: None))
    feed = types.SimpleNamespace(truth=None, axes=3, to_world=list)
    return Desk(types.SimpleNamespace(create_publisher=lambda *words: None), feed, (1.0, 1.0))


def test_a_page_leads_no_hand_to_the_edge_of_the_workspace_but_draws_all_of_it(desk):
    desk.device = load_device("desktop")
    assert desk.workspace == tuple(axis.workspace for axis in desk.device.axes)
    for (low, high), axis in zip(desk.limits.workspace, desk.device.axes, strict=True):
        width = axis.workspace[1] - axis.workspace[0]
        assert low == pytest.approx(axis.workspace[0] + EDGE * width)
        assert high == pytest.approx(axis.workspace[1] - EDGE * width)
    desk.device = None
    assert desk.workspace is None


def test_a_hand_has_arrived_when_the_device_says_so_and_not_when_it_was_told(desk):
    truth, desk.hand.goal = types.SimpleNamespace(target=[0.0, 0.0, 0.0]), (0.01, 0.0, 0.0)
    desk.feed.truth = truth
    assert not desk.arrived
    truth.target = [0.01, 0.0, 0.0]
    assert desk.arrived
    desk.feed.truth = None
    assert not desk.arrived
