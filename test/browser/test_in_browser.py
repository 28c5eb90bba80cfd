# SPDX-License-Identifier: Apache-2.0
"""People before the page: a real Chromium, the live nodes behind it. Each test is a journey of one person."""

import itertools
import time

import numpy as np
import pytest
from conftest import Cable, Tab

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
    down = itertools.count(0, 8)
    tab.until(f"{FORCE} > {newton}", before=lambda: tab.page.mouse.move(x + 60, y + next(down)))


def push_down(tab):
    """Presses the tool upon something by keys, until the motor pushes back with more than 2 N."""
    tab.page.focus("#scene")
    tab.until(f"{FORCE} > 2", before=lambda: tab.page.keyboard.press("ArrowDown"))


def gives_in(listener):
    listener.until(lambda: listener.motor()[-1][1] < 0.5 and apart(listener) < 1e-3, "a hand that pulls at nothing")


def zero_since(listener, began):
    """Waits until the motor is at zero after this time; since when it is."""
    motor = listener.motor
    zero = lambda: next((at for at, force in motor() if at > began and force == 0.0), None)  # noqa: E731
    return listener.until(zero, "the motor at zero")


def test_the_peg_is_dragged_into_the_hole_and_no_further_than_the_workspace_goes(tab, listener):
    tab.engage()
    x, y = tab.middle()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x - 3, y, steps=3)
    down = itertools.count(0, 2)
    inserted = "Number(document.getElementById('result_insertion_fraction').textContent) >= 0.9"
    tab.until(inserted, before=lambda: tab.page.mouse.move(x - 3, y + next(down)))
    tab.shot("peg")
    tab.page.mouse.up()
    gives_in(listener)
    tab.engage()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + 380, y, steps=30)
    tab.until_text("hint", "edge of the workspace")
    tab.page.mouse.up()
    assert max(truth.position[3] for _, truth in list(listener.truths)) < 0.1201
    assert tab.complaints == []


def test_a_mouse_that_is_let_go_leaves_no_force_with_hold_on_it_stays_and_under_load_another_scene_may_be_chosen(
    tab, listener
):
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
    pushing(tab, 15)
    for scene, title in (("wrench_on_nut", "Turn the nut"), ("peg_in_hole", "Put the peg into its hole")):
        tab.page.select_option("#scene_name", scene)
        tab.until_text("scene_answer", f"scene is {title}")
        tab.page.mouse.up()
        tab.until_text("state", "^engaged$|fault")
        assert tab.text("state") == "engaged" and apart(listener) < 5e-3
    assert tab.complaints == []


@pytest.mark.parametrize("way", ["the button", "space at the terminal", "Escape on a page that looks", "Escape"])
def test_each_way_to_stop_zeroes_the_motor_on_every_page_and_back_to_the_start_repairs(
    system, tab, chromium, listener, way
):
    looking = Tab(chromium)
    looking.page.goto(system.looking)
    looking.until_text("state", "^engaged$")
    button = tab.page.locator("#estop").bounding_box()

    def hold_the_button():
        tab.page.mouse.move(button["x"] + 20, button["y"] + 10)
        tab.page.mouse.down()

    stop = {
        "the button": hold_the_button,
        "space at the terminal": lambda: system.press(" "),
        "Escape on a page that looks": lambda: looking.page.keyboard.press("Escape"),
        "Escape": lambda: tab.page.keyboard.press("Escape"),
    }[way]
    tab.engage()
    push_down(tab)
    began = time.monotonic()
    stop()
    zero = zero_since(listener, began)
    tab.page.mouse.up()  # it was heard before the button is let go
    for page in (tab, looking):
        page.until_text("state", "fault: Emergency stop")
    listener.until(lambda: apart(listener) < 1e-3, "a hand that has let go")
    assert {force for at, force in listener.motor() if at >= zero} == {0.0}, "and it stays so"
    tab.page.click("#start_scene")
    tab.until_text("state", "^engaged$")
    assert looking.complaints == tab.complaints == []
    looking.page.close()


def test_what_is_pressed_without_a_connection_is_said_and_a_stop_goes_with_the_next(system, tab, chromium, listener):
    tab.engage()
    push_down(tab)
    cable, far = Cable(system.address), Tab(chromium)
    far.page.goto(cable.address)
    far.until_text("state", "^engaged$")
    cable.cut()
    far.until_text("state", "no viewer")
    far.page.click("[data-service=enable]")
    far.until_text("hint", "Not sent: no connection")
    far.page.click("#estop")
    far.until_text("banner", "E-STOP has NOT been heard")
    far.shot("unconnected")
    assert far.harm() == []
    push_down(tab)  # while a page is looked at, the other may be silent for so long that the hand lets go
    listener.until(lambda: listener.motor()[-1][1] > 0.0, "a motor that pushes")
    began, cable.whole = time.monotonic(), True
    zero_since(listener, began)
    far.until_text("state", "fault: Emergency stop")
    tab.engage()
    cable.cut()
    far.until_text("state", "no viewer")
    cable.whole = True
    far.until_text("state", "^engaged$")
    listener.later()
    assert far.text("state") == "engaged" and not far.page.is_visible("#banner"), "what was heard is not said again"
    far.page.close()


def test_the_keyboard_alone_stops_resets_engages_and_turns_and_the_tone_is_as_loud_as_the_force(tab, listener):
    tone, force = "document.documentElement.dataset.tone", "parseFloat(document.getElementById('force').textContent)"
    tab.engage()
    tab.until(f"{tone} === ''")
    tab.page.check("#tone")
    push_down(tab)
    tab.until(f"{tone} > 0.03 && Math.abs({tone} - 0.3 / 15 * {force}) < 0.004")
    tab.page.uncheck("#tone")
    tab.until(f"{tone} === ''")
    tab.page.keyboard.press("Escape")
    tab.until_text("state", "fault: Emergency stop")
    for button, name, said in (
        ("[data-service=reset]", "state", "^(?!fault)"),
        ("#start_scene", "scene_answer", "at its start"),
        ("[data-service=enable]", "state", "^engaged$"),
    ):
        tab.page.focus(button)
        tab.page.keyboard.press("Enter")
        tab.until_text(name, said)
    before = listener.rested()[2]
    tab.page.focus("#scene")
    turned = lambda: listener.truths[-1][1].position[5]  # noqa: E731
    listener.until(lambda: tab.page.keyboard.press("q") or turned() > before + 0.1, "a turn to the left")
    tab.page.focus("#turn_right")
    tab.page.keyboard.down("Space")
    try:
        listener.until(lambda: turned() < before + 0.05, "a turn to the right")
    finally:
        tab.page.keyboard.up("Space")
    assert tab.complaints == []


def delay(tab, milliseconds):
    """Starts the nodes again with this delay for study."""
    number = tab.page.locator("#offer_delay + input")
    number.fill(str(milliseconds))
    number.press("Enter")
    tab.until_text("restart_answer", f"delay is {milliseconds}; the nodes have been started again")
    tab.until_text("state", "^engaged$")


def test_scenes_methods_and_a_delay_are_chosen_an_impossible_one_is_refused_and_a_restart_loses_nothing(tab):
    stiffness = tab.page.locator("#tuned_coupling_stiffness + input")
    tab.choose("scene_name", "wrench_on_nut", "scene is Turn the nut")
    tab.choose("method_name", "closed_form", "no closed form")
    assert "refused" in tab.page.get_attribute("#scene_answer", "class")
    tab.choose("method_name", "impulse", "scene is Turn the nut")
    tab.page.focus("#scene")
    turned = "Number(document.getElementById('result_turned').textContent) > 0.01"
    tab.until(turned, before=lambda: tab.page.keyboard.press("ArrowUp"))
    delay(tab, 25)
    tab.until("Number(/age p50 . p99([0-9.]+)/.exec(document.getElementById('figures').textContent)?.[1]) > 15")
    for value, differs in (("300", "true"), ("400", "false")):
        stiffness.fill(value)
        stiffness.press("Enter")
        tab.page.focus("#scene")
        tab.until(f"document.getElementById('defaults').disabled !== {differs}")
        delay(tab, 0)
        tab.until("document.getElementById('result_turned')")
        assert (tab.page.input_value("#scene_name"), stiffness.input_value()) == ("wrench_on_nut", value)
    tab.choose("method_name", "auto", "scene is Turn the nut")
    tab.choose("scene_name", "peg_in_hole", "scene is Put the peg into its hole")
    assert tab.complaints == []
