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


def pushing(tab, newton):
    """Drags the tool onto what is below, until the motor pushes back with so much; the mouse stays down."""
    x, y = tab.middle()
    tab.page.mouse.move(x + 60, y)
    tab.page.mouse.down()
    down = iter(range(0, 600, 8))
    tab.until(f"{FORCE} > {newton}", before=lambda: tab.page.mouse.move(x + 60, y + next(down)))


def gives_in(listener):
    listener.until(lambda: listener.motor()[-1][1] < 0.5 and apart(listener) < 1e-3, "a hand that pulls at nothing")


def test_a_mouse_that_is_let_go_leaves_no_force_and_with_hold_on_the_force_stays(tab, listener):
    tab.engage()
    pushing(tab, 8)
    tab.page.mouse.up()
    gives_in(listener)
    tab.page.keyboard.press("h")
    pushing(tab, 8)
    tab.page.mouse.up()
    listener.later()
    assert listener.motor()[-1][1] > 5.0
    tab.page.keyboard.press("h")
    gives_in(listener)


def test_another_scene_may_be_chosen_while_the_hand_pushes_with_15_n(tab, listener):
    pushing(tab, 15)
    for scene in ("wrench_on_nut", "peg_in_hole"):
        tab.page.select_option("#scene_name", scene)
        tab.until_text("scene_answer", f"scene is {scene}")
        tab.page.mouse.up()
        tab.until_text("state", "^engaged$|fault")
        assert tab.text("state") == "engaged"
    assert apart(listener) < 5e-3


def test_each_way_to_stop_stops_and_back_to_the_start_repairs(system, tab, chromium, listener):
    looking = Tab(chromium)
    looking.page.goto(system.looking)
    looking.until_text("state", "^engaged$")
    escape, escape_looking = tab.page.keyboard, looking.page.keyboard
    for stop in (lambda: system.press(" "), lambda: escape_looking.press("Escape"), lambda: escape.press("Escape")):
        tab.page.focus("#scene")
        tab.until(f"{FORCE} > 3", before=lambda: tab.page.keyboard.press("ArrowDown"))
        began = time.monotonic()
        stop()
        listener.until(
            lambda began=began: any(at > began and force == 0.0 for at, force in listener.motor()), "the motor at zero"
        )
        for page in (tab, looking):
            page.until_text("state", "fault: Emergency stop")
        listener.until(lambda: apart(listener) < 1e-3, "a hand that has let go")
        tab.page.click("#start_scene")
        tab.until_text("state", "^engaged$")
    looking.page.close()


def test_one_page_leads_the_hand_and_another_may_take_over(system, tab, chromium, listener):
    other = Tab(chromium)
    other.page.goto(system.address)
    other.until_text("state", "^engaged$")
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
