# SPDX-License-Identifier: Apache-2.0
"""The hand that a page leads, and every way to stop: a real Chromium, the live nodes behind it."""

import time

import numpy as np
import pytest
from conftest import Tab

pytestmark = pytest.mark.timeout(600)
FORCE = "Math.abs(parseFloat(document.getElementById('force').textContent))"


def apart(listener):
    """How far the hand's target is from the handle [m]."""
    truth = listener.truths[-1][1].position
    return float(np.hypot(*(truth[3:5] - truth[:2])))


def pushing(tab, listener, newton):
    """Drags the tool onto what is below, until the motor pushes back with so much; the mouse stays down."""
    tab.engage()
    x, y = tab.middle()
    tab.page.mouse.move(x + 60, y)
    tab.page.mouse.down()
    down = iter(range(0, 300, 2))
    tab.until(f"{FORCE} > {newton}", before=lambda: tab.page.mouse.move(x + 60, y + next(down)))


def test_a_mouse_that_is_let_go_leaves_no_force_and_with_hold_on_the_force_stays(tab, listener):
    pushing(tab, listener, 8)
    tab.page.mouse.up()
    listener.until(lambda: listener.motor()[-1][1] < 0.5 and apart(listener) < 1e-3, "a hand that pulls at nothing")
    tab.page.focus("#scene")
    tab.page.keyboard.press("h")
    pushing(tab, listener, 8)
    tab.page.mouse.up()
    tab.page.wait_for_timeout(1000.0)
    assert listener.motor()[-1][1] > 5.0
    tab.page.focus("#scene")
    tab.page.keyboard.press("h")
    listener.until(lambda: listener.motor()[-1][1] < 0.5 and apart(listener) < 1e-3, "a hand that pulls at nothing")


def test_another_scene_may_be_chosen_while_the_hand_pushes_with_15_n(tab, listener):
    pushing(tab, listener, 15)
    faults = "[...document.querySelectorAll('#nodes li')].some((one) => /fault:/.test(one.textContent))"
    for scene in ("wrench_on_nut", "peg_in_hole"):
        tab.page.select_option("#scene_name", scene)
        tab.until_text("scene_answer", f"scene is {scene}")
        tab.until_text("state", "^engaged$|fault")
        assert tab.text("state") == "engaged" and not tab.page.evaluate(faults)
        if scene == "wrench_on_nut":
            tab.page.mouse.up()
    assert apart(listener) < 5e-3


def test_back_to_the_start_repairs_a_display_that_was_stopped(tab, listener):
    pushing(tab, listener, 5)
    tab.page.keyboard.press("Escape")
    tab.page.mouse.up()
    tab.until_text("state", "fault: estop")
    tab.page.click("#start_scene")
    tab.until_text("scene_answer", "at its start")
    tab.until_text("state", "^engaged$")


def stopped(tab, listener, press):
    """Pushes, presses, and waits for a motor at rest and a fault on the page."""
    pushing(tab, listener, 5)
    began = time.monotonic()
    press()
    listener.until(lambda: any(at > began and force == 0.0 for at, force in listener.motor()), "the motor at zero")
    tab.until_text("state", "fault: estop")
    tab.page.mouse.up()
    listener.until(lambda: apart(listener) < 1e-3, "a hand that has let go")


def test_space_in_the_terminal_is_the_e_stop(system, tab, listener):
    stopped(tab, listener, lambda: system.press(" "))
    tab.engage()


def test_escape_on_a_view_only_page_is_the_e_stop(system, tab, chromium, listener):
    looking = Tab(chromium)
    looking.page.goto(system.looking)
    looking.until_text("state", "^engaged$")
    stopped(tab, listener, lambda: looking.page.keyboard.press("Escape"))
    looking.until_text("state", "fault: estop")
    looking.page.close()
    tab.engage()


def test_one_page_leads_the_hand_and_another_may_take_over(system, tab, chromium, listener):
    tab.engage()
    other = Tab(chromium)
    other.page.goto(system.address)
    other.until_text("state", "^engaged$")
    tab.page.bring_to_front()
    tab.page.focus("#scene")
    tab.page.keyboard.press("ArrowRight")
    other.until("!document.getElementById('leader').hidden")
    assert not tab.page.is_visible("#leader")
    other.page.click("#take_over")
    tab.until("!document.getElementById('leader').hidden")
    other.until("document.getElementById('leader').hidden")
    before = listener.rested()[0]
    tab.page.keyboard.press("ArrowRight")
    tab.until_text("hint", "another page leads the hand: press Take over")
    assert listener.rested()[0] == pytest.approx(before, abs=1e-6)
    other.page.focus("#scene")
    other.page.keyboard.press("ArrowLeft")
    listener.until(lambda: listener.truths[-1][1].position[3] < before - 1e-3, "the hand to the left")
    other.page.close()
    tab.until("document.getElementById('leader').hidden")
    tab.engage()
