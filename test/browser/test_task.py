# SPDX-License-Identifier: Apache-2.0
"""The task card, the chooser, the view: a real Chromium before a page whose news are made up."""

import itertools
from dataclasses import asdict

import pytest
from conftest import PATIENCE, Tab
from made_up_viewer import HELLO, STATUS, VALUES, MadeUpViewer
from waiting import until

from haptic_device.config.files import names
from haptic_display.page.tasks import tasks
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load

pytestmark = pytest.mark.timeout(300)
OFF = {"state": "off", "share": 0.0, "slow": False}
WITH_TASKS = [task["name"] for task in tasks()]


@pytest.fixture(scope="module")
def stage():
    stage = MadeUpViewer(hello=HELLO | {"scenes": names("scenes"), "tasks": tasks()})
    yield stage
    stage.close()


@pytest.fixture(scope="module")
def page(chromium, stage):
    tab = Tab(chromium, expert=False)
    tab.page.goto(stage.address)
    tab.until("document.querySelectorAll('#scene_name option').length > 0")
    yield tab
    assert tab.complaints == []
    tab.page.close()


def set_scene(page, stage, name, **frame):
    task = load(name).task
    title = task.title if task else name.replace("_", " ").capitalize()
    stage.show_scene(name, **frame)
    page.until(f"document.getElementById('task_title').textContent === {title!r}")


def guide(stage, **changes):
    """What the viewer says of the guide."""
    stage.tell("status", STATUS | {"guide": OFF | changes})


def asked(stage, message):
    until(lambda: stage.asked and stage.asked[-1] == message, f"{message} is asked for", limit=PATIENCE)


def test_the_card_says_what_to_do_how_far_it_is_and_that_it_is_done_and_all_begins_anew(page, stage):
    set_scene(page, stage, "peg_in_hole")
    task = load("peg_in_hole").task
    assert page.text("goal") == task.goal and page.text("task_hint") == task.hint
    for share, said in ((0.25, "^25 % of the hole's depth$"), (0.949, "^95 %")):
        stage.show(results=[share])
        page.until_text("progress", said)
        assert page.text("done") == "" and not page.page.is_visible("#next_scene")
    stage.show(results=[0.95])
    page.until_text("done", "Done")
    page.page.click("#next_scene")
    asked(stage, {"do": "scene", "name": "wrench_on_nut"})
    for state, said in (("starting", "Starting"), ("playing", "^Pause$")):
        guide(stage, state=state)
        page.until_text("guide_play", said)
    page.until_text("progress", "^95 %")
    assert page.text("done") == "", "what was reached before Show me does not count after it"
    stage.show(results=[0.0])
    page.until_text("progress", "^0 %")
    stage.show(results=[1.0])
    page.until_text("done", "Done")
    guide(stage)
    stage.show(results=[0.0])
    page.page.click("#start_scene")
    asked(stage, {"do": "start_scene"})
    page.until("document.getElementById('done').textContent === ''")


def test_all_that_a_task_asks_for_counts_a_force_only_in_contact_and_without_a_task_results_are_shown(page, stage):
    set_scene(page, stage, "corner", results=[1.0, 0.5])
    page.until_text("progress", "^50 %")
    assert page.text("done") == ""
    stage.show(results=[1.0, 0.98])
    page.until_text("done", "Done")
    set_scene(page, stage, "wall", felt=[4.0, 3.0, 0.0])
    page.until_text("progress", "^0 % of 5 N$")
    stage.show(contacts=[[0, 1, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]], felt=[2.0, 0.0, 0.0])
    page.until_text("progress", "^40 % of 5 N$")
    assert page.text("done") == ""
    stage.show(felt=[4.0, 3.0, 0.0])
    page.until_text("done", "Done")
    set_scene(page, stage, "incline", results=[0.5])
    assert page.text("goal") == f"{load('incline').description}."
    page.until_text("progress", "^slid: 50 %$")
    stage.show(results=[])
    page.until_text("progress", "^slid: – %$")


def test_the_chooser_has_the_tasks_first_by_their_titles_and_the_rest_as_test_cases(page, stage):
    first = page.page.evaluate("[...document.querySelectorAll('#scene_name > option')].map((one) => one.value)")
    rest = page.page.evaluate("[...document.querySelectorAll('#scene_name optgroup option')].map((one) => one.value)")
    assert first == WITH_TASKS and first[0] == "peg_in_hole" and sorted(first + rest) == sorted(names("scenes"))
    assert page.page.text_content("#scene_name > option") == load("peg_in_hole").task.title
    assert "Free space" in page.page.text_content("#scene_name optgroup")
    stage.tell("answer 1", {"to": {"do": "scene"}, "done": True, "sentence": "scene is wrench_on_nut"})
    page.until_text("scene_answer", "^scene is Turn the nut$")
    for name in ("maze", "incline"):
        stage.tell("values", VALUES | {"values": {"haptic_simulation": {"scene": name, "method": "auto"}}})
        page.until(f"document.getElementById('scene_name').value === {name!r}")
    page.page.select_option("#scene_name", "maze")
    asked(stage, {"do": "scene", "name": "maze"})


def test_the_guide_plays_pauses_steps_and_slows_and_is_hidden_where_no_hand_can_be_led(page, stage):
    set_scene(page, stage, "maze")
    page.until("!document.getElementById('guide').hidden")
    for button, act in (("play", "play"), ("step", "step"), ("slow", "slow")):
        page.page.click(f"#guide_{button}")
        asked(stage, {"do": "guide", "act": act})
    guide(stage, state="playing", slow=True)
    page.until_text("guide_play", "^Pause$")
    assert page.page.get_attribute("#guide_slow", "aria-pressed") == "true"
    page.page.click("#guide_play")
    asked(stage, {"do": "guide", "act": "pause"})
    page.page.click("#guide_slow")
    asked(stage, {"do": "guide", "act": "fast"})
    guide(stage, state="paused")
    page.until_text("guide_play", "^Go on$")
    guide(stage)
    page.until_text("guide_play", "^Show me$")
    stage.show(target=None)
    page.until("document.getElementById('guide').hidden")


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_tool_way_and_its_end_are_on_the_screen_in_every_scene_with_a_task(page, size):
    page.page.set_viewport_size({"width": size[0], "height": size[1]})
    for name in WITH_TASKS:
        drawing = drawing_of(load(name))
        places = [drawing.solids[0].pose[:2], *(place[:2] for place in drawing.way)]
        seen = page.page.evaluate(
            """([room, places]) => import("./plane.js").then(({ Plane }) => {
                const plane = new Plane(document.getElementById("scene"));
                plane.room = room;
                const { clientWidth, clientHeight } = plane.canvas;
                const there = places.map((place) => plane.toPixels(place).map((x) => x / plane.ratio));
                return there.every(([x, y]) => x > 0 && y > 60 && x < clientWidth && y < clientHeight - 40);
            })""",
            [drawing.room, places],
        )
        assert seen, name
    page.page.set_viewport_size({"width": 1280, "height": 720})


def test_the_view_moves_with_the_right_button_shift_two_fingers_and_buttons_and_zooms_and_the_hand_stays(page, stage):
    set_scene(page, stage, "peg_in_hole")
    planes = page.page.evaluate("""() => import("./plane.js").then(({ Plane }) => {
        const plane = new Plane(document.getElementById("scene"));
        const near = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) < 1e-9;
        const { clientWidth, clientHeight } = plane.canvas;
        const [x0, y0] = [clientWidth / 2 - 30, clientHeight / 2 + 20];
        const before = plane.toWorld([x0, y0]);
        plane.zoomBy(2, [x0, y0]);
        const kept = near(before, plane.toWorld([x0, y0]));
        plane.fit();
        plane.pan(30, -20);
        const moved = near(before, plane.toWorld([x0 + 30, y0 - 20]));
        plane.pan(1e9, 0);
        const [x] = plane.toPixels([plane.room[0], 0]);
        return { kept, moved, held: x > 0 && x <= plane.canvas.width };
    })""")
    assert planes == {"kept": True, "moved": True, "held": True}
    picture, (x, y) = "document.getElementById('scene').toDataURL()", page.middle()
    page.page.click("#fit")
    page.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.page.evaluate(f"window.before = {picture}")
    touch = page.page.context.new_cdp_session(page.page)

    def drag(button="left"):
        page.page.mouse.down(button=button)
        page.page.mouse.move(x + 60, y + 30, steps=3)
        page.page.mouse.up(button=button)

    def with_key(key, act):
        page.page.keyboard.down(key)
        act()
        page.page.keyboard.up(key)

    def fingers(kind, *places):
        points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def two_fingers():
        held = "document.getElementById('scene').classList.contains('held')"
        fingers("touchStart", (x, y))
        page.until(held)
        fingers("touchStart", (x, y), (x + 80, y))
        page.until(f"!{held}")  # the hand lets go
        stage.asked.clear()
        fingers("touchMove", (x, y + 40), (x + 120, y + 40))
        fingers("touchEnd")

    stage.asked.clear()
    for act in (
        lambda: drag("right"),
        lambda: with_key("Shift", drag),
        lambda: page.page.locator("#scene").press("Control+ArrowUp"),
        lambda: with_key("Control", lambda: page.page.mouse.wheel(0, -200)),
        two_fingers,
    ):
        page.page.mouse.move(x, y)
        act()
        page.until(f"{picture} !== window.before")
        page.page.click("#fit")
        page.until(f"{picture} === window.before")
    assert stage.asked == [], "the hand was not led"


def test_fit_finds_tool_handle_and_workspace_wherever_they_are_and_what_is_out_of_view_is_pointed_to(page, stage):
    out = "document.getElementById('scene').dataset.outside"
    set_scene(page, stage, "free_space", tool=[0.9, 0.5, 0.0], handle=[-0.3, -0.9, 0.0])
    page.until(f"{out} === 'tool handle'")
    page.shot("outside")
    page.page.click("#fit")
    page.until(f"{out} === ''")
    stage.show(tool=[0.0, 0.0, 0.0], handle=[0.01, 0.0, 0.0])
    page.page.click("#fit")
    for _ in range(4):
        page.page.click("#zoom_in")
    page.until(f"{out} === ''")
    page.page.focus("#scene")
    for _ in range(30):
        page.page.keyboard.press("Control+ArrowRight")
    page.until(f"{out} === 'tool handle'")
    page.page.click("#fit")


COLOURED = """(colour) => {  // how many pixels of the plane have the colour
    const canvas = document.getElementById("scene");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (`rgb(${data.slice(i, i + 3).join(", ")})` === colour) count += 1;
    return count;
}"""
ANCHOR = """(type) => import("./scene.js").then(({ SceneView }) => {  // what is called of a canvas
    const called = [];
    const context = new Proxy({}, { get: (_, name) => () => called.push(name) });
    SceneView.prototype.paintAnchor.call({ plane: { ratio: 1 } }, context, type, [0, 0]);
    return called.filter((name) => ["arc", "rect", "lineTo"].includes(name)).join();
})"""


def test_springs_are_seen_the_couplings_at_any_zoom_and_a_joints_own_and_only_a_slider_has_a_square(page, stage):
    set_scene(page, stage, "ratchet", handle=[0.034, 0.003, 0.0])
    page.page.evaluate("document.documentElement.dataset.theme = 'light'")
    for button, times in (("#zoom_out", 0), ("#zoom_out", 4), ("#zoom_in", 6)):
        for _ in range(times):
            page.page.click(button)
        page.page.wait_for_timeout(300)
        assert page.page.evaluate(COLOURED, "rgb(0, 158, 115)") > 4, "the coupling's green"
    page.page.click("#fit")
    picture = "document.getElementById('scene').toDataURL()"
    page.page.evaluate(f"window.before = {picture}")
    drawing = asdict(drawing_of(load("ratchet")))
    stage.tell("scene", drawing | {"sprung": [False] * 3})
    page.page.click("#fit")
    page.until(f"{picture} !== window.before")
    marks = {type: page.page.evaluate(ANCHOR, type) for type in ("pin", "slider", "weld", "spring")}
    assert marks == {"pin": "arc", "slider": "rect", "weld": "lineTo,lineTo", "spring": "arc"}


def test_charts_stand_still_and_show_a_shorter_time_until_they_go_on(page, stage):
    set_scene(page, stage, "peg_in_hole")
    chart, newton = "document.getElementById('strip_force').toDataURL()", itertools.count(1)

    def moves():
        page.page.evaluate(f"window.before = {chart}")
        stage.show_drawn(page, force=[float(next(newton)), 0.0, 0.0])
        page.page.wait_for_timeout(700)  # several pictures of a chart
        return page.page.evaluate(f"{chart} !== window.before")

    assert moves()
    page.page.click("#pause")
    page.page.wait_for_timeout(300)
    assert not moves()
    for act in (
        lambda: page.page.click("#closer"),
        lambda: (page.page.hover("#strip_force"), page.page.mouse.wheel(0, -200)),
        lambda: page.page.click("#wider"),
    ):
        page.page.evaluate(f"window.before = {chart}")
        act()
        page.until(f"{chart} !== window.before")
    page.shot("charts_paused")
    assert not moves()
    page.page.click("#pause")
    assert moves()


def test_the_card_has_no_serious_findings_in_light_and_dark(page, stage):
    set_scene(page, stage, "maze", results=[1.0])
    page.until_text("done", "Done")
    page.page.click("#legend summary")
    for theme in ("light", "dark"):
        page.page.evaluate(f"document.documentElement.dataset.theme = {theme!r}")
        assert page.harm() == []
        page.shot(f"task_{theme}")


def test_show_me_does_the_task_and_a_drag_ends_it(tab):
    tab.engage()
    for shown in ("^Pause$", "^Go on$", "^Pause$"):
        tab.page.click("#guide_play")
        tab.until_text("guide_play", shown)
    tab.until_text("done", "Done")
    tab.until_text("guide_play", "^Show me$")
    tab.shot("shown")
    tab.page.click("#guide_play")
    tab.until_text("guide_play", "^Pause$")
    x, y = tab.middle()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + 5, y, steps=2)
    tab.page.mouse.up()
    tab.until_text("guide_play", "^Show me$")
    assert tab.text("done") == "" and tab.complaints == []
