# SPDX-License-Identifier: Apache-2.0
"""Where things stand on the page, at a desk, on a phone and for who only looks on; the page has no nodes."""

import pytest
from conftest import Tab
from made_up_viewer import STATUS, MadeUpViewer

DESK, PHONE = {"width": 1280, "height": 720}, {"width": 390, "height": 844, "has_touch": True, "is_mobile": True}
STOPPED = {"title": "Emergency stop", "cause": "A person pressed stop.", "first": "", "button": "Reset and engage"}
LESS = {"words": "less force", "todo": "Less force: more force is wanted than the motor holds. Push less."}
ENGAGED = {"haptic_driver": {"level": 0, "message": "", "values": {"state": "engaged", "fault": ""}}}


@pytest.fixture(scope="module")
def stage():
    stage = MadeUpViewer()
    yield stage
    stage.close()


def opened(chromium, stage, size, control=True):
    """A page that shows a scene."""
    tab = Tab(chromium, expert=False, **size)
    tab.page.goto(stage.address if control else stage.looking)
    tab.until(f"document.body.classList.contains('looking') === {str(not control).lower()}")
    stage.show_scene("peg_in_hole")
    tab.until("document.getElementById('task_title').textContent === 'Put the peg into its hole'")
    return tab


def rows(tab):
    """The buttons on the plane that are seen: left edges by the upper edge of their row [CSS pixels]."""
    boxes = [one.bounding_box() for one in tab.page.query_selector_all("#tools button") if one.is_visible()]
    return {round(box["y"]): [one["x"] for one in boxes if round(one["y"]) == round(box["y"])] for box in boxes}


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize("control", [True, False], ids=["leading", "looking on"])
def test_the_buttons_on_the_plane_stand_in_two_rows(chromium, stage, size, control):
    tab = opened(chromium, stage, size, control)
    assert len(rows(tab)) == 2
    assert all(lefts == sorted(lefts) for lefts in rows(tab).values()), "in the order of the tab key"
    tab.page.close()


def test_a_lack_of_force_does_not_move_the_plane_under_the_finger(chromium, stage):
    tab = opened(chromium, stage, PHONE)
    stage.tell("status", STATUS | {"nodes": ENGAGED})
    tab.until_text("state", "^engaged$")
    before = tab.page.locator("#scene").bounding_box()
    stage.tell("status", STATUS | {"nodes": ENGAGED, "unfelt": LESS})
    tab.until("!document.getElementById('withheld').hidden")
    tab.until_text("state", "less force")
    assert tab.page.locator("#scene").bounding_box() == before
    tab.page.close()


@pytest.mark.parametrize("looking", [True, False])
def test_who_only_looks_on_reads_who_may_press_and_others_have_the_button(chromium, stage, looking):
    tab = opened(chromium, stage, DESK, not looking)
    stage.tell("status", STATUS | {"trouble": STOPPED})
    tab.until_text("fault_title", "^Emergency stop$")
    assert tab.page.is_visible("#fault_elsewhere") == looking and tab.page.is_visible("#fault_button") != looking
    assert '"Reset and engage"' in tab.text("fault_elsewhere")
    tab.page.close()


def test_while_a_finger_leads_the_hand_no_explanation_covers_the_plane(chromium, stage):
    tab = opened(chromium, stage, PHONE)
    tab.page.evaluate("document.getElementById('record').focus({preventScroll: true})")
    tab.until_text("about", "^Record: ")
    assert tab.page.is_visible("#about")
    x, y = tab.middle()
    screen = tab.page.context.new_cdp_session(tab.page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    tab.until("document.getElementById('scene').classList.contains('held')")
    assert not tab.page.is_visible("#about")
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    tab.page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_button_that_is_pressed_is_readable(chromium, stage, scheme):
    tab = opened(chromium, stage, DESK)
    tab.page.emulate_media(color_scheme=scheme)
    tab.until(f"document.documentElement.dataset.theme == {scheme!r}")
    tab.page.evaluate("document.querySelectorAll('[aria-pressed]').forEach((one) => (one.ariaPressed = 'true'))")
    found = tab.page.evaluate("""[...document.querySelectorAll('button[aria-pressed]')].map((one) => {
        const { color, backgroundColor } = getComputedStyle(one);
        return [one.id, color, backgroundColor];
    })""")
    assert {"hold", "record", "guide_slow", "layer"} <= {name for name, *_ in found}
    assert [name for name, *colours in found if contrast(*colours) < 4.5] == []
    tab.page.close()


def contrast(*colours):
    """Of two colours as a browser tells them, "rgb(r, g, b)"; 1 to 21."""
    dark, light = sorted(map(luminance, colours))
    return (light + 0.05) / (dark + 0.05)


def luminance(colour):
    parts = [int(number) / 255.0 for number in colour.removeprefix("rgb(").removesuffix(")").split(",")]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
