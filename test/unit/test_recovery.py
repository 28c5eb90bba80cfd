# SPDX-License-Identifier: Apache-2.0
"""What the banner's one button does, with nodes and a driver that the test makes up."""

import asyncio
from types import SimpleNamespace

import pytest
from made_up_clock import Clock

from haptic_display.page import recovery, waiting
from haptic_display.page.commands import CommandHandler
from haptic_display.page.recovery import DOING, Recovery
from haptic_display.page.trouble import Trouble

DRIVER, SIMULATION, RECORDER = "haptic_driver", "haptic_simulation", "haptic_recorder"
FAULT = Trouble("Handle too fast", "…", "…", "Reset and engage", fault="velocity")
AIM = ("aim", {"x": 0.13, "y": 0.0, "theta": 0.0})
ENDED = Trouble("The simulation has ended", "…", "", "Start the simulation again", (SIMULATION,))


class Display:
    """A display as a command handler sees it; `done` is what was asked for. engages: at which attempt; stuck: its fault
    stays; axes: of the simulated hand; stop: what is asked for when somebody stops it, by a page or with a fault."""

    alone, check_wanted = CommandHandler.alone, CommandHandler.check_wanted

    def __init__(self, engages=1, stuck=False, axes=3, nodes=True, appears=True, stop=None, fault="velocity"):
        self.done, self.held_off, self.drove, self.doing, self.fault = Done(self, stop), True, True, "", fault
        self._engages, self._stuck, self._appears = engages, stuck, appears
        truth = SimpleNamespace(position=(0.13, 0.0, 0.0)[:axes])
        self.state = SimpleNamespace(statuses={DRIVER: 1, SIMULATION: 1}, axes=axes, truth=truth, said=self._said)
        self.state.to_world, self.state.look = list, lambda: None
        self.client = SimpleNamespace(statuses=dict(self.state.statuses), heard=dict(self.state.statuses))
        self.hand = SimpleNamespace(release=lambda: None)
        self.scenes = SimpleNamespace(enter=self._start_scene)
        self.arrived = self.inside = True
        self.recovery = Recovery(self, SimpleNamespace(start_again=self._start_nodes) if nodes else None)

    def mend(self, trouble, title=None):
        return asyncio.run(self.recovery.mend(trouble, title or (trouble and trouble.title)))

    def let_go(self):
        self.done.append("let go")

    def aim(self, place):
        self.done.append(("aim", place))

    async def order(self, service):
        self.done.append(service)
        if service == "reset" and self._stuck:
            raise ValueError("fault velocity is latched again: its cause is still there")
        if service == "reset":
            self.fault = ""
        self._engages -= service == "enable"

    async def poll(self):
        pass

    async def _start_scene(self, change):
        self.done.append("start of the scene")
        self._engages -= 1

    async def _start_nodes(self, names):
        self.done.append(tuple(names))
        for name in names:
            self.state.statuses.pop(name, None)
        if self._appears:
            self.state.statuses |= dict.fromkeys(names, 1)

    def _said(self, node, entry):
        return "engaged" if self._engages <= 0 else "waiting for a small force"


class Done(list):
    """Somebody presses e-stop as soon as `stop` was asked for."""

    def __init__(self, display, stop):
        super().__init__()
        self._display, self._stop = display, stop

    def append(self, asked):
        super().append(asked)
        self._display.held_off |= asked == self._stop


@pytest.fixture(autouse=True)
def no_time(monkeypatch):
    clock = Clock().put(monkeypatch, recovery, waiting)

    async def sleep(seconds):
        clock.now += seconds

    for module in (recovery, waiting):
        monkeypatch.setattr(module, "asyncio", SimpleNamespace(sleep=sleep))


def test_a_fault_is_cleared_and_the_display_engaged_where_the_handle_is():
    display = Display()
    assert display.mend(FAULT) == "engaged"
    assert display.done == [AIM, "reset", "enable", "let go"]
    assert not display.held_off


def test_a_display_that_cannot_engage_there_engages_at_the_start_of_the_scene_but_a_persons_hand_is_led_by_nobody():
    display = Display(engages=2)
    assert display.mend(FAULT) == "engaged at the start of the scene"
    assert display.done[1:] == ["reset", "enable", "start of the scene", "let go"]
    display = Display(engages=2, axes=0)
    assert display.mend(FAULT) == "enabled: lead the handle to the tool"
    assert display.done == ["reset", "enable", "let go"]


def test_a_fault_whose_cause_stays_is_the_answer_and_nothing_is_enabled():
    display = Display(stuck=True)
    with pytest.raises(ValueError, match="its cause is still there"):
        display.mend(FAULT)
    assert "enable" not in display.done


def test_a_simulation_is_started_again_and_begins_its_scene_again_but_overrules_nobody_who_wants_the_motor_off():
    display = Display(engages=2, fault="")
    display.held_off = False
    assert display.mend(ENDED) == "engaged"
    assert display.done == [(SIMULATION,), AIM, "reset", "start of the scene", "enable", "let go"]
    for wants in ({"held_off": True}, {"drove": False}, {"fault": "estop"}, {}):
        display = Display(fault="", stop=None if wants else (SIMULATION,))  # before, or while they start
        vars(display).update({"held_off": False} | wants)
        assert display.mend(ENDED) == "the simulation runs again"
        assert display.done == [(SIMULATION,)]


@pytest.mark.parametrize("stop", [AIM, "reset", "enable", "start of the scene"])
def test_a_stop_wins_whenever_it_comes_and_nothing_is_ordered_after_it(stop):
    for trouble, fault in ((FAULT, "velocity"), (ENDED, "")):  # also while nodes are started again
        display = Display(engages=3, stop=stop, fault=fault)
        display.held_off = bool(fault)
        with pytest.raises(ValueError, match="the display has been stopped"):
            display.mend(trouble)
        assert display.done[-2:] == [stop, "let go"] and display.held_off


def test_a_fault_that_came_meanwhile_is_not_cleared():
    display = Display(fault="estop")
    with pytest.raises(ValueError, match="fault estop is latched; call ~/reset first"):
        display.mend(FAULT)
    assert "reset" not in display.done


def test_the_button_does_what_it_said_and_nothing_for_another_trouble_or_while_something_else_is_done():
    display = Display()
    with pytest.raises(ValueError, match="something else is wrong by now: Handle too fast"):
        display.mend(FAULT, "The simulation has ended")
    for doing in ("the scene is being changed", DOING):
        with display.alone(doing), pytest.raises(ValueError, match="^wait: .* is being "):
            display.mend(FAULT)
    assert display.done == [] and display.held_off and display.doing == ""
