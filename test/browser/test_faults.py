# SPDX-License-Identifier: Apache-2.0
"""Each fault and each node that ends, on the page: its words, its number, and the one button that mends it.

A made-up driver tells of each fault; on running nodes the e-stop and a handle outside the workspace are provoked."""

import contextlib
import re
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest
import rclpy
from conftest import PATIENCE, Tab
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from haptic_device.control.faults import TABLE
from haptic_device.message_fields import AXES
from haptic_device.nodes import messages
from haptic_sim.client import Client
from haptic_sim.supervision.processes import NAMESPACE

pytestmark = pytest.mark.timeout(600)
FAKED = "/faked"
DETAIL = "x = 0.124 m; the limit is 0.12 m"
PRESSED = "Reset and engage"


class FakeDriver:
    """A driver that says what the test wants, and clears its fault as one does. stuck: its cause stays."""

    def __init__(self, domain):
        self.fault, self.detail, self.withheld, self.stuck = "", "", "", False
        self._context, self._over = Context(), False
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("haptic_driver", namespace=FAKED, context=self._context)
        self._said = self._node.create_publisher(messages.DiagnosticArray, "/diagnostics", 10)
        self.state = "engaged"
        for name in ("enable", "disable", "reset", "estop"):
            self._node.create_service(Trigger, f"~/{name}", getattr(self, f"_{name}"))
        self._node.create_timer(0.1, self._say)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def falls(self, fault, detail):
        self.fault, self.detail, self.state = fault, detail, "fault"

    def close(self):
        self._over = True
        self._thread.join(PATIENCE)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _run(self):
        while not self._over:
            self._executor.spin_once(0.05)

    def _say(self):
        values = {"namespace": FAKED, "state": self.state, "fault": self.fault, "fault_detail": self.detail}
        values |= {"withheld": self.withheld, "ticks": 1}
        told = messages.diagnostics(time.time_ns(), "haptic_driver", "", "ok", self.state, values)
        self._said.publish(told)

    def _reset(self, request, answer):
        if self.stuck:
            answer.message = f"fault {self.fault} is latched again: its cause is still there"
            return answer
        self.fault, self.detail, self.state, answer.success = "", "", "idle", True
        return answer

    def _enable(self, request, answer):
        answer.success = not self.fault
        answer.message = f"fault {self.fault} is latched; call ~/reset first" if self.fault else "enabled"
        self.state = self.state if self.fault else "engaged"
        return answer

    def _disable(self, request, answer):
        self.state, answer.success = self.fault and "fault" or "idle", True
        return answer

    def _estop(self, request, answer):
        self.falls("estop", "")
        answer.success = True
        return answer


@pytest.fixture(scope="module")
def faked(ros_domain):
    fake = FakeDriver(ros_domain)
    yield fake
    fake.close()


@pytest.fixture(scope="module")
def page(faked, chromium):
    """A page of `haptic view` before the fake driver."""
    command = [sys.executable, "-m", "haptic_sim.cli.main", "view", "--namespace", FAKED]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    tab = Tab(chromium, expert=False)
    try:
        tab.page.goto(next(re.search(r"open (http\S+)", line)[1] for line in viewer.stdout))
        tab.until_text("state", "^engaged$")
        yield tab
    finally:
        tab.page.close()
        viewer.send_signal(signal.SIGINT)
        viewer.wait(PATIENCE)


def gone(tab):
    tab.until("document.getElementById('fault').hidden")


def mend(tab, label=PRESSED):
    """Presses the banner's button of this name, and waits for an engaged display."""
    assert tab.text("fault_button") == label
    tab.page.click("#fault_button")
    gone(tab)
    tab.until_text("state", "^engaged$")


@pytest.mark.parametrize("fault", TABLE, ids=lambda fault: fault.name)
def test_each_fault_is_on_the_page_in_its_words_with_its_number_and_one_button_ends_it(page, faked, fault):
    faked.falls(fault.name, DETAIL)
    page.until_text("fault_title", f"^{re.escape(fault.title)}$")
    assert page.page.is_visible("#fault") and page.page.get_attribute("#fault", "role") == "alert"
    assert page.text("fault_cause").lower() == f"{fault.cause}; {DETAIL}.".lower()
    assert page.text("fault_first").lower() == (fault.first and f"{fault.first}.").lower()
    assert page.page.is_visible("#fault_first") == bool(fault.first)
    assert page.text("state") == f"fault: {fault.title}"
    mend(page)


def test_a_button_that_cannot_clear_a_fault_says_why_in_the_words_of_the_page(page, faked):
    faked.falls("position", DETAIL)
    faked.stuck = True
    page.until_text("fault_title", "outside the workspace")
    page.page.click("#fault_button")
    page.until_text(
        "fault_answer", "its cause is still there. Lead the handle back into the workspace, then press Reset"
    )
    page.page.click("[data-service=enable]")
    page.until_text("hint", "Handle outside the workspace is active. Press Reset and engage.")
    for scheme in ("light", "dark"):
        page.page.emulate_media(color_scheme=scheme)
        page.until(f"document.documentElement.dataset.theme == {scheme!r}")
        assert page.harm() == []
    page.shot("banner")
    box = page.page.locator("#fault_button").bounding_box()
    assert box["height"] >= 44 and box["width"] >= 44
    faked.stuck = False
    page.until("!document.getElementById('fault_button').disabled")
    page.page.focus("#fault_button")
    page.page.keyboard.press("Enter")
    gone(page)
    page.until_text("state", "^engaged$")


def test_a_fault_that_another_clears_takes_its_banner_away(page, faked):
    faked.falls("velocity", DETAIL)
    page.until_text("fault_title", "Handle too fast")
    faked.fault, faked.detail, faked.state = "", "", "engaged"
    gone(page)


def test_a_display_that_withholds_force_is_not_green_and_says_what_the_hand_must_do(page, faked):
    faked.withheld = "waiting"
    page.until_text("withheld", "Tool not felt. Lead the handle to the tool")
    assert page.text("state") == "engaged: tool not felt" and page.page.get_attribute("#state", "data-level") == "warn"
    faked.withheld = ""
    page.until(
        "document.getElementById('withheld').hidden && document.getElementById('state').dataset.level === 'good'"
    )


def node_of(system, module):
    """The process of the demo that runs this module."""
    [found] = [one for one in psutil.Process(system.process.pid).children() if module in one.cmdline()]
    return found


@pytest.fixture
def live(tab):
    """The page of the running demo, once that is engaged."""
    tab.until_text("state", "^engaged$")
    tab.engage()
    return tab


LOOPBACK, SIMULATION = "haptic_device.nodes.loopback", "haptic_sim.node.simulation"


def test_the_e_stop_is_told_and_one_press_goes_on(live):
    tab = live
    tab.page.click("#estop")
    tab.until_text("fault_title", "^Emergency stop$")
    tab.shot("fault_estop")
    mend(tab)


def test_a_handle_led_out_of_the_workspace_is_led_back_by_the_button(live, ros_domain):
    tab, places = live, []
    tab.page.click("[data-service=disable]")
    tab.until_text("state", "^idle$")
    with contextlib.closing(Client.join("leads_out", ros_domain, NAMESPACE)) as client:

        def lead_out():
            client.look()
            if client.truth:  # step by step, no faster than a handle may be
                x, y, theta = places[-1] if places else [client.truth[axis][0] for axis in AXES]
                places.append([min(0.125, x + 0.002), y, theta])
                client.aim(places[-1])

        tab.until("/outside/.test(document.getElementById('fault_title').textContent)", before=lead_out)
    tab.until_text("fault_cause", r"the handle was at x = 0\.12[0-9]* m; the workspace ends at 0\.12 m\.$")
    tab.shot("fault_position")
    mend(tab)


@pytest.mark.parametrize(
    ("module", "ended", "who"),
    [
        (SIMULATION, signal.SIGKILL, "simulation"),
        (LOOPBACK, signal.SIGSTOP, "device"),
    ],
    ids=("killed simulation", "stopped device"),
)
def test_a_node_that_ended_or_is_silent_is_told_and_started_again_by_the_button(system, live, module, ended, who):
    tab = live
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
