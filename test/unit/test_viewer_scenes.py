# SPDX-License-Identifier: Apache-2.0
"""Scenes changed by a page: what the nodes are asked for, and when, by commands that have no nodes."""

import asyncio
import types

import pytest

from haptic_device.description import load_device
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load
from haptic_sim.viewer import messages, waiting
from haptic_sim.viewer.commands import EDGE, CommandHandler
from haptic_sim.viewer.scene_controller import SceneController
from haptic_sim.viewer.settings import DRIVER, SIMULATION

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
    commands, order, seen = Commands(), Commands.order, []
    commands.yields = 7

    async def watched(service):
        seen.append((service, commands.yields))
        await order(commands, service)

    commands.order = watched
    asyncio.run(SceneController(commands).load("wrench_on_nut"))
    assert seen[0] == ("disable", -1) and commands.done[:2] == ["let go", "disable"]


def test_a_start_from_a_fault_clears_it_with_the_hand_at_the_start_and_the_motor_goes_on():
    commands = Commands()
    commands.driving, commands.fault, commands.held_off = False, "estop", True
    assert asyncio.run(SceneController(commands).start_again()) == "said"
    assert commands.done == ["let go", pose("peg_in_hole"), "arrived", "reset", RESET, "enable", "poll", "let go"]


@pytest.mark.parametrize("when", ("arrived", "reset"))
def test_a_stop_while_a_fault_is_being_cleared_leaves_the_motor_off(when):
    commands = Commands()
    commands.driving, commands.fault = False, "velocity"

    class Stopped(list):
        def append(self, done):
            super().append(done)
            commands.held_off = commands.held_off or done == when

    commands.done = Stopped()
    try:
        asyncio.run(SceneController(commands).start_again())
    except ValueError as refusal:
        assert "the display has been stopped" in str(refusal) and when == "arrived"
    assert "enable" not in commands.done and ("reset" in commands.done) == (when == "reset")


def test_a_fault_that_somebody_else_latched_meanwhile_is_not_cleared():
    commands = Commands()
    commands.driving, commands.fault = False, "velocity"

    class Stopped(list):
        def append(self, done):
            super().append(done)
            commands.fault = "estop" if done == "arrived" else commands.fault

    commands.done = Stopped()
    with pytest.raises(ValueError, match="fault estop is latched"):
        asyncio.run(SceneController(commands).start_again())
    assert not {"reset", "enable"} & {one for one in commands.done if isinstance(one, str)}


def test_a_scene_waits_for_what_else_drives_motor_and_hand():
    commands = Commands()
    with (
        commands.alone("the nodes are being started again"),
        pytest.raises(ValueError, match="^wait: the nodes are being"),
    ):
        asyncio.run(SceneController(commands).start_again())
    assert commands.done == []


def test_the_start_of_another_scene_clears_no_fault():
    commands = Commands()
    commands.driving, commands.fault = False, "velocity"
    asyncio.run(SceneController(commands).load("wrench_on_nut"))
    assert not {"reset", "enable"} & {one for one in commands.done if isinstance(one, str)}


def test_after_a_refusal_hand_and_tool_are_both_at_the_start_of_what_there_was():
    commands = Commands(refusal="no closed form")
    with pytest.raises(ValueError, match="no closed form"):
        asyncio.run(SceneController(commands).choose_method("closed_form"))
    there = [pose("peg_in_hole"), "arrived"]
    asked = [{"method": "closed_form"}, LOAD, {"method": "auto"}]
    assert commands.done == ["let go", "disable", *there, *asked, *there, RESET, "enable", "let go"]


def test_a_motor_that_a_page_has_switched_off_stays_off():
    commands = Commands()
    commands.driving = False
    asyncio.run(SceneController(commands).start_again())
    assert commands.done == ["let go", pose("peg_in_hole"), "arrived", RESET, "poll", "let go"]


@pytest.fixture
def handler():
    """One whose nodes never answer; the world is the device's workspace."""
    node = types.SimpleNamespace(create_publisher=lambda *words: None)
    client = types.SimpleNamespace(node=node, prepare=lambda *services: None)
    return CommandHandler(client, types.SimpleNamespace(truth=None, axes=3, to_world=list), (1.0, 1.0))


def test_what_is_saved_is_asked_of_each_node_that_is_heard_and_not_remembered(handler):
    async def answer(question, **patience):
        if "driver" in question.service:
            return {"coupling.stiffness": 1200.0}
        raise ValueError("haptic_simulation does not answer")

    handler.values, handler.client.acall = {"haptic_loopback": {"device": "desktop"}}, answer
    handler.state.statuses = {"haptic_driver": None}
    assert asyncio.run(handler.heard()) == {"haptic_driver": {"coupling.stiffness": 1200.0}}
    handler.state.statuses["haptic_simulation"] = None
    with pytest.raises(ValueError, match="haptic_simulation does not answer"):
        asyncio.run(handler.heard())
    handler.state.statuses = {}
    with pytest.raises(ValueError, match="no node is heard of"):
        asyncio.run(handler.heard())


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
    assert nodes.asked == [("delay", 5.0, True)] and nodes.handler.driving


@pytest.mark.parametrize("held_off", [True, False], ids=["by a page", "by another"])
def test_nodes_that_are_started_again_after_an_e_stop_are_idle_and_stay_so(held_off):
    nodes = Restarted("fault", "estop")
    nodes.handler.held_off = held_off
    nodes.restart()
    nodes.restart()
    assert nodes.asked == 2 * [("delay", 5.0, False)] and not nodes.handler.driving


def test_a_stop_while_the_nodes_start_again_reaches_the_driver_as_soon_as_there_is_one():
    nodes = Restarted(meanwhile=lambda handler: setattr(handler, "held_off", True))
    nodes.restart()
    assert nodes.asked == [("delay", 5.0, True), "disable"]


def test_the_motor_is_on_if_the_driver_says_so(handler):
    nodes = Restarted()
    nodes.handler.held_off = True
    assert nodes.handler.driving and nodes.handler.fault == ""
    nodes.statuses[DRIVER] = ("fault", "velocity")
    assert not nodes.handler.driving and nodes.handler.fault == "velocity"


def test_a_page_leads_no_hand_to_the_edge_of_the_workspace_but_draws_all_of_it(handler):
    handler.device = load_device("desktop")
    assert handler.workspace == tuple(axis.workspace for axis in handler.device.axes)
    for (low, high), axis in zip(handler.limits.workspace, handler.device.axes, strict=True):
        width = axis.workspace[1] - axis.workspace[0]
        assert low == pytest.approx(axis.workspace[0] + EDGE * width)
        assert high == pytest.approx(axis.workspace[1] - EDGE * width)
    handler.device = None
    assert handler.workspace is None


def test_a_hand_has_arrived_when_the_device_says_so_and_not_when_it_was_told(handler):
    truth, handler.hand.goal = types.SimpleNamespace(target=[0.0, 0.0, 0.0]), (0.01, 0.0, 0.0)
    handler.state.truth = truth
    assert not handler.arrived
    truth.target = [0.01, 0.0, 0.0]
    assert handler.arrived
    handler.state.truth = None
    assert not handler.arrived
