# SPDX-License-Identifier: Apache-2.0
"""Scenes changed by a page: what the nodes are asked for, and when, by commands that have no nodes."""

import asyncio
import contextlib
import types

import pytest

from haptic_display.page import messages, waiting
from haptic_display.page.commands import CommandHandler
from haptic_display.page.scene_controller import SceneController
from haptic_display.page.settings import DRIVER, SIMULATION
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load

SET = f"{SIMULATION}/set_parameters_atomically"
RESET, LOAD = f"{SIMULATION}/reset_scene", f"{SIMULATION}/load_scene"


class Commands:
    """Of a page whose hand is where it should be after `looks` looks; `done` is what was asked for, in order."""

    alone, check_wanted = CommandHandler.alone, CommandHandler.check_wanted

    def __init__(self, looks=0, refusal=""):
        self.doing = ""
        self.done, self.looks, self.refusal, self.yields = [], looks, refusal, 0
        self.driving, self.held_off, self.fault = True, False, ""
        self.state = types.SimpleNamespace(axes=3, scene=drawing_of(load("peg_in_hole")))
        self.values = {SIMULATION: {"scene": "peg_in_hole", "method": "auto"}}

    @property
    def arrived(self):
        self.looks -= 1
        if self.looks < 0:
            self.done.append("arrived")
        return self.looks < 0

    @property
    def yielded(self):
        self.yields -= 1
        return self.yields < 0

    def let_go(self):
        self.done.append("let go")

    def aim(self, place):
        self.done.append(("aim", tuple(place.values())))

    async def order(self, service):
        self.done.append(service)

    async def ask(self, question, *patience):
        if question.service == SET:
            given = question.request.parameters
            self.done.append({one.name: one.value.string_value for one in given})
            return None
        self.done.append(question.service)
        if question.service == LOAD and self.refusal:
            raise ValueError(self.refusal)
        return "said"

    async def poll(self):
        self.done.append("poll")


class Watched(list):
    """Of what is asked for; happens(done) is called after each."""

    def __init__(self, happens):
        super().__init__()
        self._happens = happens

    def append(self, done):
        super().append(done)
        self._happens(done)


@pytest.fixture(autouse=True)
def no_time_passes(monkeypatch):
    own = asyncio.sleep
    monkeypatch.setattr(waiting.asyncio, "sleep", lambda seconds: own(0.0))


def pose(name):
    return ("aim", load(name).tool.pose)


def test_a_scene_is_loaded_with_the_motor_off_once_the_device_says_that_the_hand_is_there():
    commands = Commands(looks=30)
    assert asyncio.run(SceneController(commands).load("wrench_on_nut")) == "said"
    wanted = ["let go", "disable", pose("wrench_on_nut"), "arrived", {"scene": "wrench_on_nut"}, LOAD, "enable", "poll"]
    assert commands.done == [*wanted, "let go"] and commands.looks == -1


def test_the_motor_goes_off_once_the_hand_that_lets_go_has_given_in():
    commands, seen = Commands(), []
    commands.yields = 7
    commands.done = Watched(lambda done: seen.append((done, commands.yields)))
    asyncio.run(SceneController(commands).load("wrench_on_nut"))
    assert seen[:2] == [("let go", 7), ("disable", -1)]


def test_a_start_from_a_fault_clears_it_with_the_hand_at_the_start_and_the_motor_goes_on():
    commands = Commands()
    commands.driving, commands.fault, commands.held_off = False, "estop", True
    assert asyncio.run(SceneController(commands).start_again()) == "said"
    assert commands.done == ["let go", pose("peg_in_hole"), "arrived", "reset", RESET, "enable", "poll", "let go"]


@pytest.mark.parametrize(
    ("when", "becomes", "why", "asked"),
    [
        ("arrived", {"held_off": True}, "the display has been stopped", set()),
        ("reset", {"held_off": True}, None, {"reset"}),
        ("arrived", {"fault": "estop"}, "fault estop is latched", set()),
    ],
)
def test_a_stop_or_another_fault_while_a_fault_is_being_cleared_leaves_the_motor_off(when, becomes, why, asked):
    commands = Commands()
    commands.driving, commands.fault = False, "velocity"
    commands.done = Watched(lambda done: vars(commands).update(becomes if done == when else {}))
    with pytest.raises(ValueError, match=why) if why else contextlib.nullcontext():
        asyncio.run(SceneController(commands).start_again())
    assert {"reset", "enable"} & {one for one in commands.done if isinstance(one, str)} == asked


def test_a_scene_waits_for_what_else_drives_motor_and_hand():
    commands = Commands()
    with (
        commands.alone("the nodes are being started again"),
        pytest.raises(ValueError, match="^wait: the nodes are being"),
    ):
        asyncio.run(SceneController(commands).start_again())
    assert commands.done == []


def test_after_a_refusal_hand_and_tool_are_both_at_the_start_of_what_there_was():
    commands = Commands(refusal="no closed form")
    with pytest.raises(ValueError, match="no closed form"):
        asyncio.run(SceneController(commands).choose_method("closed_form"))
    there = [pose("peg_in_hole"), "arrived"]
    asked = [{"method": "closed_form"}, LOAD, {"method": "auto"}]
    assert commands.done == ["let go", "disable", *there, *asked, *there, RESET, "enable", "let go"]


@pytest.mark.parametrize("fault", ["", "velocity"])
def test_a_motor_that_is_off_stays_off_and_another_scene_clears_no_fault(fault):
    commands = Commands()
    commands.driving, commands.fault = False, fault
    asyncio.run(SceneController(commands).load("wrench_on_nut"))
    loading = [pose("wrench_on_nut"), "arrived", {"scene": "wrench_on_nut"}, LOAD]
    assert commands.done == ["let go", *loading, "poll", "let go"]


class Restarted:
    """A command handler whose nodes say `state` and `fault`, and after a start `then`; `asked`: what was asked for.
    meanwhile(handler): what happens while they start."""

    def __init__(self, state="engaged", fault="", then="idle", meanwhile=lambda handler: None):
        self.statuses, self.asked, self._then, self._meanwhile = {DRIVER: (state, fault)}, [], then, meanwhile
        node = types.SimpleNamespace(create_publisher=lambda *words: None)
        self.client = types.SimpleNamespace(node=node, prepare=lambda *services: None, statuses={}, acall=self._answer)
        self.client.statuses, self.looks = dict(self.statuses), []
        self.handler = CommandHandler(self.client, self, (1.0, 1.0), types.SimpleNamespace(change=self._change))

    def said(self, node, entry, otherwise=""):
        return self.statuses[node][("state", "fault").index(entry)] if node in self.statuses else otherwise

    def look(self):
        self.statuses = dict(self.client.statuses)
        self.looks.append(dict(self.statuses))
        asyncio.get_running_loop().call_soon(self.statuses.update, {DRIVER: (self._then, "")})

    def restart(self):
        return asyncio.run(self.handler.do(messages.Restart(name="delay", value=5.0), None))

    async def _change(self, name, value, enable):
        self.asked.append((name, value, enable))
        self._meanwhile(self.handler)
        return "started again"

    async def _answer(self, question, **patience):
        self.asked.append(question.service.rpartition("/")[2])


def test_nodes_that_are_started_again_are_not_shown_as_their_forerunners_were():
    nodes = Restarted(then="engaged")
    assert nodes.restart() == "started again" and nodes.looks == [{}]
    assert nodes.asked == [("delay", 5.0, True)] and nodes.handler.driving and nodes.handler.fault == ""


@pytest.mark.parametrize("held_off", [True, False], ids=["by a page", "by another"])
def test_nodes_that_are_started_again_after_an_e_stop_are_idle_and_stay_so(held_off):
    nodes = Restarted("fault", "estop")
    nodes.handler.held_off = held_off
    assert not nodes.handler.driving and nodes.handler.fault == "estop"
    nodes.restart()
    nodes.restart()
    assert nodes.asked == 2 * [("delay", 5.0, False)] and not nodes.handler.driving


def test_a_stop_while_the_nodes_start_again_reaches_the_driver_as_soon_as_there_is_one():
    nodes = Restarted(meanwhile=lambda handler: setattr(handler, "held_off", True))
    nodes.restart()
    assert nodes.asked == [("delay", 5.0, True), "disable"]
