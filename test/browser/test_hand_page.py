# SPDX-License-Identifier: Apache-2.0
"""What the page makes of mouse, keys and buttons that lead the hand: asked of a viewer without nodes."""

import pytest
import waiting
from conftest import PATIENCE, Cable, Tab
from made_up_viewer import STATUS, MadeUpViewer

pytestmark = pytest.mark.timeout(600)
ENGAGED = {"state": "engaged", "fault": "", "withheld": "", "passivity_margin": "1", "passivity_margin_theta": "1"}
LET_GO, STOP = {"do": "let_go"}, {"do": "trigger", "service": "estop"}


@pytest.fixture(scope="module")
def viewer():
    served = MadeUpViewer()
    yield served
    served.close()


@pytest.fixture(scope="module")
def opened(chromium, viewer):
    tab = Tab(chromium)
    tab.page.goto(viewer.address)
    yield tab
    assert tab.complaints == []
    tab.page.close()


@pytest.fixture
def page(opened, viewer):
    """One that leads nothing and holds nothing, with the hand at the middle."""
    opened.page.reload()
    opened.until("document.getElementById('scene_name').options.length > 0")
    viewer.show_drawn(opened, target=[0.0, 0.0, 0.0])
    viewer.asked.clear()
    return opened


def places(viewer):
    """The places that the hand was asked to go to."""
    return [one for one in viewer.asked if one["do"] == "aim"]


def heard(tab, viewer, message):
    """Waits until a page has asked for this."""
    waiting.until(
        lambda: message in viewer.asked, f"{message}", lambda: tab.page.wait_for_timeout(20), lambda: viewer.asked
    )


def led(tab, viewer):
    """Waits until a page has led the hand."""
    waiting.until(lambda: places(viewer), "an aim", lambda: tab.page.wait_for_timeout(20), limit=PATIENCE)


def all_asked(tab, viewer):
    """All that the page had to ask for has come: it has drawn, and its stop is heard after the rest."""
    viewer.show_drawn(tab)
    tab.page.keyboard.press("Escape")
    heard(tab, viewer, STOP)


def holds(tab):
    return tab.page.get_attribute("#hold", "aria-pressed") == "true"


def dragged(tab, x, y, *ways):
    """The mouse goes down at (x, y) and by these ways from there."""
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    for right, down in ways:
        tab.page.mouse.move(x + right, y + down)


def test_a_mouse_that_is_let_go_lets_the_hand_go(page, viewer):
    dragged(page, *page.middle(), (40, 0))
    led(page, viewer)
    assert LET_GO not in viewer.asked and not holds(page)
    page.page.mouse.up()
    heard(page, viewer, LET_GO)
    assert viewer.asked[-1] == LET_GO


def test_with_hold_on_the_hand_stays_at_the_last_place_until_hold_goes_off(page, viewer):
    page.page.click("#hold")
    dragged(page, *page.middle(), (40, 0), (80, 0))
    page.page.mouse.up()
    page.page.mouse.move(*page.middle())
    first = places(viewer)[-1]["x"]
    assert holds(page) and LET_GO not in viewer.asked and first > 0.0
    dragged(page, *page.middle(), (40, 0))
    page.page.mouse.up()
    waiting.until(lambda: places(viewer)[-1]["x"] > first, "a hand led on", lambda: page.page.wait_for_timeout(20))
    assert places(viewer)[-1]["x"] == pytest.approx(1.5 * first), "from where it was led, not from where it is"
    page.page.click("#hold")
    heard(page, viewer, LET_GO)
    assert not holds(page)


def test_keys_switch_hold_on_and_a_click_on_the_plane_or_h_lets_go(page, viewer):
    page.page.focus("#scene")
    for let_go in (lambda: page.page.keyboard.press("h"), lambda: page.page.mouse.click(*page.middle())):
        viewer.asked.clear()
        page.page.keyboard.press("ArrowDown")
        led(page, viewer)
        assert places(viewer)[-1]["y"] == pytest.approx(-0.002) and holds(page) and LET_GO not in viewer.asked
        let_go()
        heard(page, viewer, LET_GO)
        assert not holds(page)
    page.page.keyboard.press("h")
    assert holds(page)


def test_keys_that_follow_one_another_quickly_or_slowly_add_up(page, viewer):
    page.page.focus("#scene")
    for slowly in (False, False, True, True):
        page.page.keyboard.press("ArrowRight")
        for _ in range(3 * slowly):
            viewer.show_drawn(page)
    waiting.until(
        lambda: places(viewer)[-1]["x"] == pytest.approx(0.008),
        "four steps, though the hand has not moved yet",
        lambda: page.page.wait_for_timeout(20),
        lambda: viewer.asked,
    )


def test_a_mouse_of_a_thousand_moves_in_a_frame_asks_once_and_for_the_last_place(page, viewer):
    x, y = page.middle()
    dragged(page, x, y)
    moves = """([x, y]) => {
        const canvas = document.getElementById("scene");
        for (let i = 1; i <= 1000; i++) canvas.dispatchEvent(new PointerEvent("pointermove",
          { pointerId: 1, clientX: x + i / 10, clientY: y }));
    }"""
    page.page.evaluate(moves, [x, y])
    all_asked(page, viewer)
    [asked] = places(viewer)
    viewer.asked.clear()
    page.page.mouse.move(x + 100, y)
    led(page, viewer)
    assert places(viewer)[-1]["x"] == pytest.approx(asked["x"]) and asked["x"] > 0.01
    page.page.mouse.up()


def test_a_drag_beyond_the_workspace_and_back_asks_for_the_place_where_it_began(page, viewer):
    x, y = page.middle()
    dragged(page, x, y, (30, 0), (600, 0))
    waiting.until(
        lambda: any(one["x"] > 0.13 for one in places(viewer)),
        "a place beyond",
        lambda: page.page.wait_for_timeout(20),
    )
    page.page.mouse.move(x, y)
    waiting.until(
        lambda: places(viewer)[-1]["x"] == pytest.approx(0.0, abs=1e-9),
        "the place where it began",
        lambda: page.page.wait_for_timeout(20),
        lambda: places(viewer),
    )
    page.page.mouse.up()


def test_a_page_that_another_leads_before_is_told_stops_dragging_and_can_take_over(page, viewer):
    x, y = page.middle()
    assert not page.page.is_visible("#leader")
    dragged(page, x, y, (20, 0))
    viewer.tell("leader", "other")
    page.until_text("leader", "Another page leads the hand")
    page.until("!document.getElementById('leader').hidden")
    viewer.asked.clear()
    page.page.mouse.move(x + 60, y)
    page.page.mouse.up()
    page.page.click("#take_over")
    heard(page, viewer, {"do": "take_over"})
    assert viewer.asked == [{"do": "take_over"}]
    viewer.tell("leader", "you")
    page.until("document.getElementById('leader').hidden")
    assert holds(page), "it leads, with no pointer down"
    viewer.tell("leader", "none")
    page.until("document.getElementById('hold').getAttribute('aria-pressed') === 'false'")


def test_after_the_hand_was_led_elsewhere_a_pointer_that_is_still_down_goes_on_from_there(page, viewer):
    x, y = page.middle()
    dragged(page, x, y, (50, 0))
    viewer.tell("leader", "none")
    viewer.show_drawn(page, target=[-0.05, 0.0, 0.0])
    viewer.asked.clear()
    for way in (51, 52):
        page.page.mouse.move(x + way, y)
    led(page, viewer)
    assert -0.06 < places(viewer)[-1]["x"] < -0.04
    page.page.mouse.up()


def test_without_a_hand_to_lead_whoever_drags_or_presses_a_key_is_told(page, viewer):
    viewer.show_drawn(page, target=None)
    page.page.focus("#scene")
    page.page.keyboard.press("ArrowUp")
    page.until_text("hint", "There is no hand to lead yet")
    dragged(page, *page.middle(), (40, 0))
    page.page.mouse.up()
    all_asked(page, viewer)
    assert viewer.asked == [STOP] and not holds(page)


def test_whoever_drags_at_a_real_device_is_told_to_move_its_handle(page, viewer):
    viewer.tell("status", STATUS | {"nodes": {"haptic_driver": {"level": 0, "message": "", "values": ENGAGED}}})
    viewer.show_drawn(page, target=None)
    page.until_text("state", "^engaged$")
    dragged(page, *page.middle(), (40, 0))
    page.until_text("hint", "^This is a real device: move its handle yourself.$")
    page.page.mouse.up()
    viewer.tell("status", STATUS)


def test_a_view_only_page_has_the_e_stop_and_escape_and_leads_nothing(chromium, viewer):
    looking = Tab(chromium)
    looking.page.goto(viewer.looking)
    looking.until_text("keys", "This page is view-only. Esc: e-stop.")
    viewer.show_drawn(looking)
    assert looking.page.is_visible("#estop")
    shown = [name for name in ("enable", "disable", "reset") if looking.page.is_visible(f"[data-service={name}]")]
    assert shown == [] and not looking.page.is_visible("#hold")
    for press in (lambda: looking.page.keyboard.press("Escape"), lambda: looking.page.click("#estop")):
        viewer.asked.clear()
        press()
        heard(looking, viewer, STOP)
    viewer.asked.clear()
    viewer.tell("leader", "other")
    dragged(looking, *looking.middle(), (40, 0))
    looking.until_text("hint", "view-only")
    looking.page.mouse.up()
    assert not looking.page.is_visible("#leader") and viewer.asked == []
    looking.page.close()


def test_that_something_was_not_sent_is_forgotten_with_the_connection(chromium, viewer):
    cable, far = Cable(viewer.address), Tab(chromium)
    far.page.goto(cable.address)
    far.until("document.getElementById('scene_name').options.length > 0")
    cable.cut()
    far.until_text("state", "no viewer")
    far.page.click("#start_scene")
    far.until_text("scene_answer", "Not sent: no connection")
    cable.whole = True
    far.until_text("scene_answer", "^$")
    far.page.close()


def test_a_refusal_goes_when_what_was_refused_is_edited(page, viewer):
    no = {"to": {"do": "scene", "name": "wall"}, "done": False, "sentence": "wall is no scene"}
    viewer.tell("answer 1", no)
    page.until_text("scene_answer", "wall is no scene")
    page.page.evaluate("document.getElementById('mark_text').dispatchEvent(new InputEvent('input', { bubbles: true }))")
    assert page.text("scene_answer") == "wall is no scene", "elsewhere"
    page.page.evaluate(
        "document.getElementById('scene_name').dispatchEvent(new InputEvent('input', { bubbles: true }))"
    )
    assert page.text("scene_answer") == "" and "refused" not in page.page.get_attribute("#scene_answer", "class")
