# SPDX-License-Identifier: Apache-2.0
"""What the viewer says is wrong, in which words, and when the tool on the page is not felt."""

from types import SimpleNamespace

import pytest
from made_up_clock import Clock

from haptic_device.control import withheld
from haptic_device.control.faults import TABLE
from haptic_device.recording.status import Status
from haptic_display.device_tools.tuning import FaultError
from haptic_display.page import trouble as module
from haptic_display.page.page_words import in_page_words
from haptic_display.page.trouble import LAST_WORDS, STANDS, TroubleFinder
from haptic_display.page.unfelt import unfelt

DRIVER, SIMULATION, LOOPBACK = "haptic_driver", "haptic_simulation", "haptic_loopback"
FRAME = {"handle": [0.0, 0.0, 0.0], "tool": [0.012, 0.0, 0.0]}


class Viewed:
    """What a viewer has heard. ended: {name: how}, of nodes that are its own to start; None: of somebody else's."""

    def __init__(self, clock, ended=None):
        self._clock, self.statuses, self.axes = clock, {}, 3
        node = SimpleNamespace(get_namespace=lambda: "/haptic")
        self.client = SimpleNamespace(statuses={}, heard={}, node=node)
        self.nodes = None if ended is None else SimpleNamespace(changing=False, ended=lambda: ended)
        self.finder = TroubleFinder(self, self.client, self.nodes)

    def hear(self, name, **values):
        self.statuses[name] = self.client.statuses[name] = Status(0, 0, "", values)
        self.client.heard[name] = self._clock.now
        return self

    def said(self, node, entry, otherwise=""):
        return self.statuses[node].values.get(entry, otherwise) if node in self.statuses else otherwise

    def look(self, held=False):
        self.finder.look(held)
        return self.finder.trouble


@pytest.fixture
def clock(monkeypatch):
    return Clock().put(monkeypatch, module)


def test_each_fault_is_told_with_title_cause_number_and_what_to_press_until_it_is_cleared(clock):
    for fault in TABLE:
        viewed = Viewed(clock).hear(DRIVER, fault=fault.name, fault_detail="0.83 m/s")
        found = viewed.look()
        assert (found.title, found.fault, found.button) == (fault.title, fault.name, "Reset and engage")
        assert found.cause.lower() == f"{fault.cause}; 0.83 m/s.".lower()
        assert found.first.lower() == (fault.first and f"{fault.first}.").lower(), "the button says the rest"
        viewed.hear(DRIVER, fault=fault.name, fault_first="look at the line")
        assert viewed.look().first == "Look at the line." and "Look at the line, then press" in viewed.look().told
        viewed.hear(DRIVER, fault="", fault_detail="")
        assert viewed.look() is None


def test_nodes_that_ended_or_fell_silent_go_before_the_fault_that_they_caused_and_one_button_starts_them_again(clock):
    for ended, unheard, title, button in (
        ((LOOPBACK,), (), "The device has ended", "Start the device again"),
        ((DRIVER, SIMULATION), (), "The nodes have ended", "Start the nodes again"),
        ((LOOPBACK,), (SIMULATION,), "The device has ended. The simulation does not answer", "Start the nodes again"),
        ((), (SIMULATION, LOOPBACK), "The nodes do not answer", "Start the nodes again"),
    ):
        viewed = Viewed(clock, {name: f"{name} was ended by SIGKILL" for name in ended})
        for name in unheard:
            viewed.hear(name)
            del viewed.statuses[name]
        found = (viewed if DRIVER in ended else viewed.hear(DRIVER, fault="device_silent")).look()
        assert (found.title, found.button, set(found.nodes)) == (title, button, {*ended, *unheard})
        assert all(f"{name} was ended by SIGKILL" in found.cause for name in ended)


def test_a_node_that_ended_and_that_somebody_else_has_started_again_is_no_trouble(clock):
    viewed = Viewed(clock, {SIMULATION: "it was ended"}).hear(SIMULATION)
    assert viewed.look().nodes == (SIMULATION,)
    clock.now += LAST_WORDS - 0.01
    assert viewed.hear(SIMULATION).look().nodes == (SIMULATION,), "its own last words"
    clock.now += 0.02
    assert viewed.hear(SIMULATION).look() is None


def test_a_silent_node_is_told_with_the_command_that_starts_it_unless_it_was_never_heard(clock):
    viewed = Viewed(clock).hear(DRIVER)
    assert viewed.look() is None and unfelt(viewed, FRAME, False)["words"] == ""
    assert viewed.hear(SIMULATION).look() is None
    assert unfelt(viewed, FRAME, True) == {"words": "", "todo": ""}
    del viewed.statuses[SIMULATION]
    found = viewed.look()
    assert (found.title, found.button) == ("The simulation does not answer", "")
    assert "ros2 run haptic_display haptic_simulation --ros-args -r __ns:=/haptic" in found.first
    assert unfelt(viewed, FRAME, True)["words"] == "simulation silent"


def test_force_that_the_tools_port_keeps_short_is_told_as_less_force_in_the_simulations_words(clock):
    viewed = Viewed(clock).hear(DRIVER, state="engaged").hear(SIMULATION, withheld="the tool's port kept it short")
    told = unfelt(viewed, FRAME, True)
    assert told == {"words": "less force", "todo": "Less force: the tool's port kept it short."}
    viewed.hear(DRIVER, state="engaged", withheld="clutch")
    assert "clutch" in unfelt(viewed, FRAME, True)["todo"], "the driver's cause is said first"


def test_the_terminal_is_told_of_each_trouble_once_when_its_number_is_known(clock):
    def told(fault, detail="", later=STANDS + 0.01):
        viewed.hear(DRIVER, fault=fault, fault_detail=detail).look()
        clock.now += later
        viewed.look()
        return viewed.finder.news()

    viewed = Viewed(clock)
    assert told("velocity", later=0.0) == ""
    words = told("velocity", "0.83 m/s")
    assert "Handle too fast (fault velocity): " in words
    assert "0.83 m/s. Hold the handle still, then press Reset" in words
    assert told("velocity", "0.83 m/s") == told("") == ""
    assert told("velocity"), "it came again"


def test_no_sentence_of_the_page_names_a_service(clock):
    for said in (str(FaultError("estop")), *(cause.cure for cause in withheld.TABLE)):
        assert "~/" not in in_page_words(said) and "set clutch" not in in_page_words(said)
    for cause in withheld.TABLE:
        viewed = Viewed(clock).hear(DRIVER, withheld=cause.name, state="engaged").hear(SIMULATION)
        told = unfelt(viewed, FRAME, True)
        assert told["words"] in ("tool not felt", "less force") and told["todo"] and "~/" not in told["todo"]


def test_what_the_hand_must_do_depends_on_whose_hand_it_is(clock):
    viewed = Viewed(clock).hear(DRIVER, withheld="waiting").hear(SIMULATION)
    told = unfelt(viewed, FRAME, True)["todo"]
    assert told == "Tool not felt. Drag the blue handle onto the orange tool: 12 mm to go."
    viewed.axes = 0
    assert unfelt(viewed, FRAME, True)["todo"] == "Tool not felt. Lead the handle to the tool: 12 mm to go."
