# SPDX-License-Identifier: Apache-2.0
"""A fault or a node that ends, on the page: its words, its number, and the one button that mends it.

A made-up viewer tells of faults; on running nodes the e-stop and a handle outside the workspace are provoked."""

import contextlib
import signal

import psutil
import pytest
from conftest import Tab
from made_up_viewer import STATUS, MadeUpViewer

from haptic_device.message_fields import AXES
from haptic_display.client import Client
from haptic_display.run.processes import NAMESPACE

pytestmark = pytest.mark.timeout(600)
PRESSED = "Reset and engage"
FIRST = "Lead the handle back into the workspace."
OUTSIDE = {
    "title": "Handle outside the workspace",
    "cause": "It is at x = 0.124 m.",
    "first": FIRST,
    "button": PRESSED,
    "fault": "position",
}
FAST = OUTSIDE | {"title": "Handle too fast", "first": ""}
UNFELT = {"words": "tool not felt", "todo": "Tool not felt. Lead the handle to the tool."}


def driver(state, fault=""):
    values = {"state": state, "fault": fault, "withheld": "", "passivity_margin": "1", "passivity_margin_theta": "1"}
    return {"nodes": {"haptic_driver": {"level": 2 if fault else 0, "message": "", "values": values}}}


def gone(tab):
    tab.until("document.getElementById('fault').hidden")


def mend(tab, label=PRESSED):
    """Presses the banner's button of this name, and waits for an engaged display."""
    assert tab.text("fault_button") == label
    tab.page.click("#fault_button")
    gone(tab)
    tab.until_text("state", "^engaged$")


def test_a_fault_has_its_words_one_button_ends_it_or_says_why_not_and_a_lack_of_force_is_not_green(chromium):
    def refused_once(message):
        if message.do == "mend" and not told:
            told.append(message)
            raise ValueError("its cause is still there")
        if message.do == "mend":
            viewer.tell("status", STATUS | driver("engaged"))
        return "engaged"

    told, viewer, tab = (
        [],
        MadeUpViewer(do=refused_once, status=STATUS | driver("engaged")),
        Tab(chromium, expert=False),
    )
    tab.page.goto(viewer.address)
    for trouble in (FAST, OUTSIDE):
        viewer.tell("status", STATUS | driver("fault", "position") | {"trouble": trouble})
        tab.until_text("fault_title", f"^{trouble['title']}$")
        assert tab.page.is_visible("#fault") and tab.page.get_attribute("#fault", "role") == "alert"
        assert (tab.text("fault_cause"), tab.text("fault_first")) == (trouble["cause"], trouble["first"])
        assert tab.page.is_visible("#fault_first") == bool(trouble["first"])
        assert (
            tab.text("state") == f"fault: {trouble['title']}"
            and tab.page.get_attribute("#state", "data-level") == "bad"
        )
    tab.page.click("#fault_button")
    tab.until_text("fault_answer", "its cause is still there")
    for scheme in ("light", "dark"):
        tab.page.emulate_media(color_scheme=scheme)
        tab.until(f"document.documentElement.dataset.theme == {scheme!r}")
        assert tab.harm() == []
    tab.until("!document.getElementById('fault_button').disabled")
    tab.page.focus("#fault_button")
    tab.page.keyboard.press("Enter")
    gone(tab)
    tab.until_text("state", "^engaged$")
    assert [message for message in viewer.asked if message["do"] == "mend"] == [
        {"do": "mend", "title": OUTSIDE["title"]}
    ] * 2
    viewer.tell("status", STATUS | driver("engaged") | {"unfelt": UNFELT})
    tab.until_text("withheld", f"^{UNFELT['todo']}$")
    assert tab.text("state") == "engaged: tool not felt" and tab.page.get_attribute("#state", "data-level") == "warn"
    viewer.tell("status", STATUS | driver("engaged"))
    tab.until("document.getElementById('withheld').hidden && document.getElementById('state').dataset.level === 'good'")
    assert tab.complaints == []
    tab.page.close()
    viewer.close()


def node_of(system, module):
    """The process of the demo that runs this module."""
    [found] = [one for one in psutil.Process(system.process.pid).children() if module in one.cmdline()]
    return found


LOOPBACK, SIMULATION = "haptic_device.nodes.loopback", "haptic_sim.node.simulation"


def test_an_e_stop_and_a_handle_led_out_of_the_workspace_are_told_and_one_press_goes_on(tab, ros_domain):
    tab.engage()
    tab.page.click("#estop")
    tab.until_text("fault_title", "^Emergency stop$")
    tab.shot("fault_estop")
    mend(tab)
    tab.page.click("[data-service=disable]")
    tab.until_text("state", "^idle$")
    goals = [0.08]  # [m]
    with contextlib.closing(Client.join("leads_out", ros_domain, NAMESPACE)) as client:

        def lead_out():  # a hand aims no farther than the edge: from a rest before it, the handle swings over
            client.look()
            if client.truth:
                (x, speed, _), (y, _, _), (theta, _, _) = (client.truth[axis] for axis in AXES)
                if abs(x - goals[-1]) < 1e-3 and abs(speed) < 1e-3:
                    goals.append(0.2 - goals[-1])
                client.aim((goals[-1], y, theta))

        tab.until("/outside/.test(document.getElementById('fault_title').textContent)", before=lead_out)
    tab.until_text(
        "fault_cause", r"the handle was at x = (0\.12[0-9]+|just beyond 0\.12) m; the workspace ends at 0\.12 m\.$"
    )
    tab.shot("fault_position")
    mend(tab)


@pytest.mark.parametrize(
    ("module", "ended", "who"),
    [(SIMULATION, signal.SIGKILL, "simulation"), (LOOPBACK, signal.SIGSTOP, "device")],
    ids=("killed simulation", "stopped device"),
)
def test_a_node_that_ended_or_is_silent_is_told_and_started_again_by_the_button(system, tab, module, ended, who):
    tab.engage()
    node_of(system, module).send_signal(ended)
    if ended == signal.SIGKILL:
        tab.until_text("fault_title", f"^The {who} has ended$")
        tab.until_text("fault_cause", f"{module.rpartition('.')[2]} was ended by SIGKILL .signal 9.")
    else:
        tab.until_text("fault_title", f"^The {who} does not answer$")
    if who == "simulation":
        tab.until("document.getElementById('scene').dataset.unfelt === 'simulation silent'")
        tab.until_text("state", "simulation silent")
        assert tab.page.get_attribute("#state", "data-level") != "good"
    tab.shot(f"fault_{who}")
    mend(tab, f"Start the {who} again")
    tab.until("document.getElementById('scene').dataset.unfelt === ''")
    tab.until("Number.isFinite(Number(document.getElementById('result_insertion_fraction').textContent))")
