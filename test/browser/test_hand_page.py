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


def until(tab, viewer, found, what):
    waiting.until(found, what, lambda: tab.page.wait_for_timeout(20), lambda: viewer.asked, limit=PATIENCE)


def heard(tab, viewer, message):
    """Waits until a page has asked for this."""
    until(tab, viewer, lambda: message in viewer.asked, f"{message}")


def at(tab, viewer, **place):
    """Waits until the hand was last asked to go there."""

    def there():
        last = places(viewer)[-1:]
        return last and all(last[0][axis] == pytest.approx(x, abs=1e-9) for axis, x in place.items())

    until(tab, viewer, there, f"the hand at {place}")


def led(tab, viewer):
    """Waits until a page has led the hand; where to."""
    until(tab, viewer, lambda: places(viewer), "an aim")
    return places(viewer)[-1]["x"]


def holds(tab):
    return tab.page.get_attribute("#hold", "aria-pressed") == "true"


def dragged(tab, x, y, *ways):
    """The mouse goes down at (x, y) and by these ways from there."""
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    for right, down in ways:
        tab.page.mouse.move(x + right, y + down)


def test_a_mouse_leads_the_hand_until_it_is_let_go_and_with_hold_on_until_hold_goes_off(page, viewer):
    dragged(page, *page.middle(), (40, 0))
    led(page, viewer)
    assert LET_GO not in viewer.asked and not holds(page)
    page.page.mouse.up()
    heard(page, viewer, LET_GO)
    assert viewer.asked[-1] == LET_GO
    viewer.asked.clear()
    page.page.click("#hold")
    dragged(page, *page.middle(), (40, 0), (80, 0))
    page.page.mouse.up()
    page.page.mouse.move(*page.middle())
    first = led(page, viewer)
    assert holds(page) and LET_GO not in viewer.asked and first > 0.0
    dragged(page, *page.middle(), (40, 0))
    page.page.mouse.up()
    at(page, viewer, x=1.5 * first)  # from where it was led, not from where it is
    page.page.click("#hold")
    heard(page, viewer, LET_GO)
    assert not holds(page)


def test_keys_add_up_hold_the_hand_and_a_click_on_the_plane_or_h_lets_go(page, viewer):
    page.page.focus("#scene")
    for slowly in (False, False, True, True):
        page.page.keyboard.press("ArrowRight")
        for _ in range(3 * slowly):
            viewer.show_drawn(page)
    at(page, viewer, x=0.008)  # four steps, though the hand has not moved yet
    for let_go in (lambda: page.page.keyboard.press("h"), lambda: page.page.mouse.click(*page.middle())):
        assert holds(page) and LET_GO not in viewer.asked
        let_go()
        heard(page, viewer, LET_GO)
        assert not holds(page)
        viewer.asked.clear()
        page.page.keyboard.press("ArrowDown")
        at(page, viewer, y=-0.002)


def test_of_a_thousand_moves_in_a_frame_the_last_is_asked_for_and_a_drag_beyond_and_back_ends_where_it_began(
    page, viewer
):
    x, y = page.middle()
    dragged(page, x, y)
    moves = """([x, y]) => {
        const canvas = document.getElementById("scene");
        for (let i = 1; i <= 1000; i++) canvas.dispatchEvent(new PointerEvent("pointermove",
          { pointerId: 1, clientX: x + i / 10, clientY: y }));
    }"""
    page.page.evaluate(moves, [x, y])
    viewer.show_drawn(page)
    page.page.keyboard.press("Escape")
    heard(page, viewer, STOP)  # after all that it had to ask for
    [asked] = places(viewer)
    page.page.mouse.up()
    viewer.asked.clear()
    dragged(page, x, y, (100, 0))
    at(page, viewer, x=asked["x"])
    assert asked["x"] > 0.01
    page.page.mouse.move(x + 600, y)
    until(page, viewer, lambda: any(one["x"] > 0.13 for one in places(viewer)), "a place beyond")
    page.page.mouse.move(x, y)
    at(page, viewer, x=0.0)
    page.page.mouse.up()


def test_another_page_that_leads_stops_a_drag_until_it_is_taken_over_and_a_pointer_goes_on_from_the_hand(page, viewer):
    x, y = page.middle()
    assert not page.page.is_visible("#leader")
    dragged(page, x, y, (20, 0))
    viewer.tell("leader", "other")
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
    dragged(page, x, y, (50, 0))
    viewer.tell("leader", "none")
    viewer.show_drawn(page, target=[-0.05, 0.0, 0.0])
    viewer.asked.clear()
    for way in (51, 52):
        page.page.mouse.move(x + way, y)
    assert -0.06 < led(page, viewer) < -0.04
    page.page.mouse.up()


def test_without_a_hand_to_lead_whoever_drags_or_presses_a_key_is_told_what_there_is(page, viewer):
    viewer.show_drawn(page, target=None)
    page.page.focus("#scene")
    page.page.keyboard.press("ArrowUp")
    page.until_text("hint", "There is no hand to lead yet")
    viewer.tell("status", STATUS | {"nodes": {"haptic_driver": {"level": 0, "message": "", "values": ENGAGED}}})
    page.until_text("state", "^engaged$")
    dragged(page, *page.middle(), (40, 0))
    page.until_text("hint", "^This is a real device: move its handle yourself.$")
    page.page.mouse.up()
    page.page.keyboard.press("Escape")
    heard(page, viewer, STOP)
    assert viewer.asked == [STOP] and not holds(page)
    viewer.tell("status", STATUS)


def test_a_view_only_page_has_the_e_stop_and_escape_and_leads_nothing(chromium, viewer):
    looking = Tab(chromium)
    looking.page.goto(viewer.looking)
    looking.until_text("keys", "This page is view-only. Esc: e-stop.")
    viewer.show_drawn(looking)
    shown = [name for name in ("enable", "disable", "reset") if looking.page.is_visible(f"[data-service={name}]")]
    assert shown == [] and not any(looking.page.is_visible(name) for name in ("#hold", "#record", "#tuning"))
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


def test_what_was_not_sent_is_said_and_forgotten_with_the_connection_and_a_refusal_when_it_is_edited(chromium, viewer):
    cable, far = Cable(viewer.address), Tab(chromium)
    far.page.goto(cable.address)
    far.until("document.getElementById('scene_name').options.length > 0")
    cable.cut()
    far.until_text("state", "no viewer")
    far.page.click("#start_scene")
    far.until_text("scene_answer", "Not sent: no connection")
    cable.whole = True
    far.until_text("scene_answer", "^$")
    no = {"to": {"do": "scene", "name": "wall"}, "done": False, "sentence": "wall is no scene"}
    viewer.tell("answer 1", no)
    far.until_text("scene_answer", "wall is no scene")
    for name, left in (("mark_text", no["sentence"]), ("scene_name", "")):
        edited = f"document.getElementById('{name}').dispatchEvent(new InputEvent('input', {{ bubbles: true }}))"
        far.page.evaluate(edited)
        assert far.text("scene_answer") == left
    far.page.close()
