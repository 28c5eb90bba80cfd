# SPDX-License-Identifier: Apache-2.0
"""People before the page: a real Chromium, the live nodes behind it. Run by `make test-browser`, in this order."""

import http.client
import math
import subprocess
import time
from urllib.parse import urlsplit

import numpy as np
import psutil
import pytest
from conftest import PATIENCE, Cable, Tab

pytestmark = pytest.mark.timeout(600)


def asked(address, path="", **headers):
    """Status of a request to the server, beside any page."""
    url = urlsplit(address)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE)
    connection.request("GET", (url.path if not path.startswith("/") else "") + path, headers=headers)
    return connection.getresponse().status


def test_a_wrong_token_a_foreign_origin_and_a_foreign_host_are_forbidden(system):
    wrong = system.address[:-6] + "AAAAA/"
    socket = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    assert asked(system.address) == 200
    assert asked(wrong) == asked(wrong, "socket", **socket) == asked(system.address, "/") == 403
    assert asked(system.address, "socket", Origin="http://elsewhere.example", **socket) == 403
    assert asked(system.address, "socket", **socket) == 403
    assert asked(system.address, Host="elsewhere.example") == 403


def test_the_peg_is_dragged_into_the_hole_with_the_mouse(tab, figure):
    tab.engage()
    x, y = tab.middle()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x - 3, y, steps=3)
    for step in range(200):
        tab.page.mouse.move(x - 3, y + 2 * step)
        if float(tab.text("result_insertion_fraction")) >= 0.9:
            break
        time.sleep(0.02)
    tab.shot("peg")
    tab.until("Number(document.getElementById('result_insertion_fraction').textContent) >= 0.9")
    figure("insertion_fraction by mouse", ">= 0.9", tab.text("result_insertion_fraction"))
    tab.page.mouse.up()


def test_frames_are_received_and_drawn(tab):
    for count in ("received", "drawn"):
        tab.until(f"Number(document.documentElement.dataset.{count}) > 0")


def test_the_hand_follows_each_move_of_the_mouse_to_its_side(tab, listener):
    tab.engage()
    x, y = tab.middle()

    def at(side):
        tab.page.mouse.move(x + 4.0 * side, y)
        return side

    def wants():
        return listener.truths[-1][1].position[3]

    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    places = [listener.rested()[0]]
    for _ in map(at, (-1.0, 1.0)):
        listener.until(lambda: wants() != places[-1], "the hand moves")
        places.append(listener.rested()[0])
    _, left, right = places
    assert left < right
    middle = 0.5 * (left + right)
    for side in map(at, (-1.0, 1.0) * 5):
        listener.until(lambda side=side: (wants() - middle) * side > 0.0, f"the hand at the side {side:+g}")
    tab.page.mouse.up()


def push_down(tab):
    """Presses the tool upon something, until the motor pushes back with more than 2 N."""
    tab.page.focus("#scene")
    force = "Math.abs(parseFloat(document.getElementById('force').textContent))"
    tab.until(f"{force} > 2", before=lambda: tab.page.keyboard.press("ArrowDown"))


def test_a_display_that_withholds_force_is_not_green_and_says_why_and_what_to_do(tab):
    tab.engage()
    tab.page.click("[data-service=disable]")
    tab.until_text("state", "^idle$")
    tab.page.focus("#scene")
    stretch = "parseFloat(document.getElementById('stretch').textContent)"
    tab.until(f"{stretch} > 3", before=lambda: tab.page.keyboard.press("ArrowDown"))  # nothing holds the hand back
    tab.page.click("[data-service=enable]")
    tab.until_text("withheld", "Tool not felt. Drag the blue handle onto the orange tool: [0-9.]+ mm")
    assert tab.page.get_attribute("#state", "data-level") == "warn" and tab.page.is_visible("#withheld")
    tab.shot("withheld")
    tab.engage()
    tab.until("document.getElementById('withheld').hidden && document.getElementById('state').dataset.level === 'good'")


def zeroed(listener, since):
    """Time at which the motor came to rest after this one."""
    return next((at for at, force in listener.motor() if at > since and force == 0.0), None)


def test_a_press_on_e_stop_zeroes_the_motor_before_it_is_let_go_and_it_stays_so(tab, listener):
    tab.engage()
    push_down(tab)
    button = tab.page.locator("#estop").bounding_box()
    tab.page.mouse.move(button["x"] + 20, button["y"] + 10)
    began = time.monotonic()
    tab.page.mouse.down()
    zero = listener.until(lambda: zeroed(listener, began), "the motor at zero")
    tab.page.mouse.up()
    tab.until_text("state", "fault: Emergency stop")
    tab.shot("fault")
    assert {force for at, force in listener.motor() if at >= zero} == {0.0}


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
    far.page.click("#start_scene")
    far.until_text("scene_answer", "Not sent: no connection")
    far.page.click("#estop")
    far.until_text("banner", "E-STOP has NOT been heard")
    far.shot("unconnected")
    assert far.harm() == []
    push_down(tab)  # while a page is looked at, the other may be silent for so long that the hand lets go
    listener.until(lambda: listener.motor()[-1][1] > 0.0, "a motor that pushes")
    began, cable.whole = time.monotonic(), True
    listener.until(lambda: zeroed(listener, began), "the motor at zero")
    far.until_text("state", "fault: Emergency stop")
    tab.engage()
    cable.cut()
    far.until_text("state", "no viewer")
    cable.whole = True
    far.until_text("state", "^engaged$")
    listener.later()
    assert far.text("state") == "engaged" and not far.page.is_visible("#banner"), "what was heard is not said again"
    far.page.close()


def test_the_tone_is_off_until_it_is_asked_for_and_then_as_loud_as_the_force(tab):
    tone, force = "document.documentElement.dataset.tone", "parseFloat(document.getElementById('force').textContent)"
    tab.engage()
    tab.until(f"{tone} === ''")
    tab.page.check("#tone")
    tab.until(f"{tone} !== '' && Math.abs({tone} - 0.3 / 15 * {force}) < 0.004")
    push_down(tab)
    tab.until(f"{tone} > 0.03 && Math.abs({tone} - 0.3 / 15 * {force}) < 0.004")
    tab.page.uncheck("#tone")
    tab.until(f"{tone} === ''")


def test_the_keyboard_alone_stops_resets_engages_and_turns(tab, listener):
    tab.engage()
    push_down(tab)
    began = time.monotonic()
    tab.page.keyboard.press("Escape")
    listener.until(lambda: zeroed(listener, began), "the motor at zero")
    tab.until_text("state", "fault: Emergency stop")
    tab.page.focus("[data-service=reset]")
    tab.page.keyboard.press("Enter")
    tab.until("!/fault/.test(document.getElementById('state').textContent)")
    tab.page.focus("#start_scene")
    tab.page.keyboard.press("Enter")
    tab.until_text("scene_answer", "at its start")
    tab.page.focus("[data-service=enable]")
    tab.page.keyboard.press("Enter")
    tab.until_text("state", "^engaged$")
    before = listener.truths[-1][1].position[5]
    tab.page.focus("#scene")
    listener.until(
        lambda: tab.page.keyboard.press("q") or listener.truths[-1][1].position[5] > before + 0.1, "a turn to the left"
    )
    tab.page.focus("#turn_right")
    tab.page.keyboard.down("Space")
    try:
        listener.until(lambda: listener.truths[-1][1].position[5] < before + 0.05, "a turn to the right")
    finally:
        tab.page.keyboard.up("Space")


def test_the_wheel_turns_the_hand_by_a_degree_a_notch_and_moves_it_nowhere(tab, listener):
    tab.until_text("state", "^engaged$")
    before = listener.rested()
    tab.page.mouse.move(*tab.middle())
    for notches in (-3, 3):
        tab.page.mouse.wheel(0, 100 * notches)
        there = before + [0.0, 0.0, math.radians(max(0, -notches))]
        listener.until(
            lambda there=there: np.abs(listener.truths[-1][1].position[3:6] - there).max() < 1e-6,
            f"the hand at {there}",
        )


def test_a_slider_changes_the_gain_of_the_driver(tab):
    slider = tab.page.locator("#tuned_coupling_damping")
    before = tab.page.locator("#tuned_coupling_damping + input").input_value()
    slider.focus()
    for _ in range(5):
        slider.press("ArrowLeft")
    tab.page.focus("#scene")
    tab.until(f"document.querySelector('#tuned_coupling_damping + input').value != {before!r}")
    assert tab.text("tuned_coupling_damping_answer") == ""
    number = tab.page.locator("#tuned_coupling_damping + input")
    number.fill(before)
    number.press("Enter")


def test_another_scene_and_method_are_loaded_and_an_impossible_one_is_refused(tab):
    tab.choose("scene_name", "wrench_on_nut", "scene is wrench_on_nut")
    tab.choose("method_name", "partitioned", "scene is wrench_on_nut")
    tab.page.focus("#scene")
    tab.until(
        "Number(document.getElementById('result_turned').textContent) > 0.01",
        before=lambda: tab.page.keyboard.press("ArrowUp"),
    )
    tab.shot("wrench")
    tab.choose("method_name", "closed_form", "no closed form")
    assert "refused" in tab.page.get_attribute("#scene_answer", "class")
    tab.choose("method_name", "auto", "scene is wrench_on_nut")
    tab.choose("scene_name", "peg_in_hole", "scene is peg_in_hole")


def test_drags_beyond_the_workspace_are_clamped_with_a_hint(tab, listener):
    tab.engage()
    x, y = tab.middle()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + 380, y, steps=30)
    tab.until_text("hint", "edge of the workspace")
    tab.page.mouse.up()
    assert max(truth.position[3] for _, truth in list(listener.truths)) < 0.1201
    tab.engage()


def test_a_reload_and_a_second_tab_recover_by_themselves(system, tab, chromium):
    tab.page.reload()
    second = Tab(chromium)
    second.page.goto(system.address)
    for page in (tab, second):
        page.until("Number(document.documentElement.dataset.received) > 0")
        page.until_text("state", "^engaged$")
    second.page.close()


def test_a_page_that_only_looks_on_shows_all_and_moves_nothing(system, chromium, listener):
    tab = Tab(chromium)
    tab.page.goto(system.looking)
    tab.until("Number(document.documentElement.dataset.drawn) > 0")
    assert not tab.page.is_visible("[data-service=enable]") and not tab.page.is_visible("#tuning")
    heard = len(listener.targets)
    tab.page.evaluate("""() => new Promise((done) => {
        const socket = new WebSocket(new URL("socket", location.href.replace("http", "ws")));
        socket.onopen = () => socket.send('{"do": "aim", "x": 0.05}');
        socket.onmessage = (event) => event.data.includes("view-only") && done();
    })""")
    assert len(listener.targets) == heard
    tab.page.close()


def test_a_simulation_that_is_killed_and_started_by_somebody_else_is_shown_again(system, tab, start):
    tab.until_text("state", "^engaged$")
    [simulation] = [
        child
        for child in psutil.Process(system.process.pid).children()
        if "haptic_sim.node.simulation" in child.cmdline()
    ]
    words, around = simulation.cmdline(), simulation.environ()
    simulation.kill()
    tab.until("document.getElementById('result_insertion_fraction').textContent === '–'")
    tab.until_text("fault_cause", "haptic_simulation was ended by SIGKILL .signal 9.")
    start(words, env=around, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    tab.until("Number.isFinite(Number(document.getElementById('result_insertion_fraction').textContent))")
    tab.until_text("state", "^engaged$")


def stiffen(tab, value, differs):
    """Gives the driver this coupling.stiffness, until the page has it from there; differs: from what it began with."""
    number = tab.page.locator("#tuned_coupling_stiffness + input")
    number.fill(value)
    number.press("Enter")
    tab.page.focus("#scene")
    tab.until(f"document.getElementById('defaults').disabled === {'false' if differs else 'true'}")
    assert number.input_value() == value


def delay(tab, milliseconds):
    """Starts the nodes again with this delay for study."""
    number = tab.page.locator("#offer_delay + input")
    number.fill(str(milliseconds))
    number.press("Enter")
    tab.until_text("restart_answer", f"delay is {milliseconds}; the nodes have been started again")
    tab.until_text("state", "^engaged$")


def test_nodes_that_start_again_with_a_delay_are_found_again_and_lose_nothing(tab):
    delay(tab, 25)
    tab.until("Number(/age p50 . p99([0-9.]+)/.exec(document.getElementById('figures').textContent)?.[1]) > 15")
    tab.choose("scene_name", "wrench_on_nut", "scene is wrench_on_nut")
    stiffen(tab, "900", differs=True)
    delay(tab, 0)
    tab.until("document.getElementById('result_turned')")
    assert tab.page.input_value("#scene_name") == "wrench_on_nut"
    assert tab.page.input_value("#tuned_coupling_stiffness + input") == "900"
    stiffen(tab, "1200", differs=False)
    tab.choose("scene_name", "peg_in_hole", "scene is peg_in_hole")


def test_a_finger_on_a_phone_leads_the_hand(system, chromium, listener):
    phone = Tab(chromium, 390, 844, has_touch=True, is_mobile=True)
    phone.page.goto(system.address)
    phone.until("Number(document.documentElement.dataset.drawn) > 0")
    before = listener.until(lambda: listener.truths, "a truth")[-1][1].position[4]
    x, y = phone.middle()
    screen = phone.page.context.new_cdp_session(phone.page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(20):
        screen.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y + 4 * step}]})
        time.sleep(0.02)
    listener.until(lambda: listener.truths[-1][1].position[4] < before - 0.02, "the hand further down")
    phone.shot("phone")
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert phone.complaints == [] and phone.page.evaluate("window.scrollY") == 0
    phone.page.close()


def test_the_console_had_no_complaint(tab):
    assert tab.complaints == []
