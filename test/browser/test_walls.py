# SPDX-License-Identifier: Apache-2.0
"""Walls and gains on the page: what is made-up news needs no nodes; the rest is with those of the first page."""

import json

import pytest
import waiting
from conftest import PATIENCE, Tab
from made_up_viewer import VALUES, MadeUpViewer

from haptic_device.config.parameter_types import defaults
from haptic_display.page import messages, settings

pytestmark = pytest.mark.timeout(600)
DRIVER, NAME = settings.DRIVER, "coupling.stiffness"
PASSIVE = {"coupling.stiffness": [0.0, 2310.7], "coupling.damping": [0.25, 1.9], "new_wall": [0.0, 1200.0]}


class Stage:
    """A made-up driver behind a page: takes what is set, or refuses it with `refusal`. `asked` is what came."""

    def __init__(self):
        self.driver = json.loads(json.dumps(defaults(settings.NODES[DRIVER])))  # a page gives lists, never tuples
        self.began, self.asked, self.refusal, self.axes = settings.live_of(self.driver), [], "", 3
        self.passive, self.sent = dict(PASSIVE), None
        self._viewer = MadeUpViewer(do=self._do, load=self._load, values=self._values())
        self._viewer.show()
        self.address, self.close = self._viewer.address, self._viewer.close

    def _values(self):
        news = {"values": {DRIVER: self.driver}, "began": self.began, "passive": self.passive}
        workspace = [[-0.1, 0.1], [-0.1, 0.1], [-1.0, 1.0]][: self.axes]
        return VALUES | news | {"workspace": workspace, "damping": [3.0] * self.axes}

    def _do(self, message):
        if isinstance(message, messages.SetAll):
            self.asked.append(message.values)
            self._take(message.values)
        return ""

    def _load(self, file):
        self.sent = file
        self._take({"coupling.stiffness": 123.0})
        return "the file is loaded"

    def _take(self, values):
        if self.refusal:
            raise ValueError(self.refusal)
        self.driver = self.driver | values
        self.tell()

    def lead(self, tab, *handle):
        """The handle is here [m, m, rad], and the page has drawn it there."""
        self._viewer.show_drawn(tab, handle=handle)

    def tell(self, **driver):
        """Values that somebody else has set."""
        self.driver = self.driver | {name.replace("__", "."): value for name, value in driver.items()}
        self._viewer.tell("values", self._values())

    @property
    def walls(self):
        return {name: self.driver[f"wall.{name}"] for name in ("normals", "offsets", "stiffness", "damping")}


@pytest.fixture
def stage():
    found = Stage()
    yield found
    found.close()


@pytest.fixture
def page(chromium, stage):
    """The simple layer before the made-up driver."""
    tab = Tab(chromium, expert=False)
    tab.page.goto(stage.address)
    tab.until("!document.getElementById('add_wall').disabled && document.getElementById('force').textContent !== '–'")
    yield tab
    assert tab.complaints == []
    tab.page.close()


def until(tab, found):
    waiting.until(found, "what the driver was asked for", lambda: tab.page.wait_for_timeout(20), limit=PATIENCE)


def field(name):
    return f"#{name} + input"


def put(tab, name, value):
    tab.page.fill(field(name), str(value))
    tab.page.press(field(name), "Enter")


def in_view(tab, place):
    """Whether all of an element is on the screen, and nothing over it."""
    return tab.page.evaluate(f"""(() => {{
        const one = document.querySelector({place!r});
        const {{ left, top, bottom }} = one.getBoundingClientRect();
        return [top + 2, bottom - 2].every((y) => document.elementFromPoint(left + 2, y) === one);
    }})()""")


def added(tab, stage, count=1):
    tab.page.click("#add_wall")
    until(tab, lambda: len(stage.walls["offsets"]) == count)
    tab.until(f"document.querySelectorAll('.wall').length === {count}")


def dragged(tab, kind, x, y):
    """Drags a dot of the first wall by so many pixels, once it rests."""
    tab.until(f"document.querySelector('.dot.{kind}')?.style.transform")
    dot, box = tab.page.locator(f".dot.{kind}").first, None
    while box != (box := dot.bounding_box()):
        tab.page.wait_for_timeout(200)  # longer than the page takes for a wish
    at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.page.mouse.move(*at)
    tab.page.mouse.down()
    tab.page.mouse.move(at[0] + x, at[1] + y, steps=4)


def test_walls_are_added_below_the_handle_stiffened_one_by_one_moved_by_keys_and_taken_away(page, stage):
    stage.lead(page, 0.02, 0.03, 0.0)
    added(page, stage)
    assert stage.walls == {"normals": [0, 1], "offsets": [0.02], "stiffness": [600], "damping": [0]}
    assert set(stage.asked[-1]) == {f"wall.{name}" for name in stage.walls} and page.text("walls_answer") == ""
    added(page, stage, 2)
    put(page, "wall_2_stiffness", 20)
    until(page, lambda: stage.walls["stiffness"] == [600, 20])
    stage.refusal = "wall.stiffness 9000 N/m of wall 1 with damping 0 N s/m needs b > 4: at most 2000 N/m"
    put(page, "wall_2_stiffness", 9000)
    page.until_text("wall_2_answer", "^wall.stiffness 9000 N.m with damping 0 N s.m needs b > 4: at most 2000 N.m$")
    page.until("document.querySelector('#wall_2_stiffness + input').value === '20'")
    assert page.text("wall_1_answer") == page.text("walls_answer") == ""
    at_the_field = ".tuned:has(#wall_2_stiffness) > #wall_2_answer"
    assert in_view(page, at_the_field)
    page.page.fill(field("wall_2_stiffness"), "8")
    assert page.text("wall_2_answer") == ""
    stage.refusal = ""
    put(page, "wall_2_stiffness", 1500)
    page.until("document.getElementById('wall_2_answer').textContent === ''")
    page.page.click("#wall_2_remove")
    until(page, lambda: stage.walls["offsets"] == [0.02])
    for name, found in (
        ("place", lambda: stage.walls["offsets"][0] < 0.02),
        ("direction", lambda: stage.walls["normals"] != [0, 1]),
        ("stiffness", lambda: stage.walls["stiffness"][0] < 600),
    ):
        page.page.focus(f"#wall_1_{name}")
        page.page.keyboard.press("ArrowLeft")
        until(page, found)
    page.page.click("#wall_1_remove")
    until(page, lambda: stage.walls["offsets"] == [])
    page.until("document.querySelectorAll('.wall, .dot').length === 0")
    stage.axes = 1
    stage.tell()
    stage.lead(page, 0.0, 0.0, 0.0)
    added(page, stage)
    assert stage.walls["normals"] == [1, 0] and stage.walls["offsets"] == [-0.01], "across the one axis"
    assert page.page.locator("#wall_1_direction, .dot.turn").count() == 0


def test_a_wall_is_dragged_along_its_normal_turned_about_itself_taken_back_and_waits_at_the_hand(page, stage):
    added(page, stage)
    dragged(page, "move", 30, 60)
    until(page, lambda: stage.walls["offsets"][0] < -0.015)
    page.page.mouse.up()
    assert stage.walls["normals"] == [0, 1]
    dragged(page, "turn", -70, -70)
    until(page, lambda: stage.walls["normals"][0] < -0.9)
    page.page.mouse.up()
    page.page.click("#undo")
    until(page, lambda: stage.walls["normals"] == [0, 1])
    page.page.click("#undo")
    until(page, lambda: stage.walls["offsets"] == [-0.01])
    dragged(page, "move", 0, -150)
    until(page, lambda: stage.walls["offsets"] == [0.0])
    stage.lead(page, 0.0, 0.004, 0.0)
    until(page, lambda: stage.walls["offsets"] == [0.004])
    assert page.text("wall_1_answer") == "The hand is in the way: the wall stops at it."
    stage.lead(page, 0.0, 0.2, 0.0)
    until(page, lambda: stage.walls["offsets"][0] > 0.015)
    page.page.mouse.up()
    page.until("document.getElementById('wall_1_answer').textContent === ''")


def test_a_gain_has_plain_words_its_passive_band_and_a_field_that_what_comes_meanwhile_leaves_alone(page, stage):
    label = page.page.text_content("label[for=gain_coupling_stiffness]")
    assert label.strip() == "How stiff the tool is held [N/m]"
    assert page.text("gain_coupling_stiffness_passive") == "stable up to 2310 N/m"
    assert page.text("gain_coupling_damping_passive") == "stable from 0.25 to 1.9 N s/m"
    share = "(parseFloat(document.querySelector('#gains .passive i').style.width) / 100) ** 3"
    assert pytest.approx(5000.0 * page.page.evaluate(share), rel=1e-3) == 2310.7
    stage.passive = {"coupling.stiffness": [0.0, 400.0]}
    stage.tell()
    page.until_text("gain_coupling_stiffness_passive", "^now not stable: stable up to 400 N.m$")
    page.page.click("#tuning .fold")
    folded = page.page.evaluate("getComputedStyle(document.querySelector('#tuning .fold'), '::after').content")
    assert "not stable" in folded
    page.page.click("#tuning .fold")
    stage.passive = {"coupling.stiffness": None}
    stage.tell()
    page.until_text("gain_coupling_stiffness_passive", "no value is stable: lower other gains")
    page.page.fill(field("gain_coupling_stiffness"), "80000")  # legal beyond what can be felt
    stage.tell(coupling__damping=1.5)
    page.until(f"document.querySelector('{field('gain_coupling_damping')}').value === '1.5'")
    page.page.press(field("gain_coupling_stiffness"), "Enter")
    until(page, lambda: stage.driver[NAME] == 80000)
    page.page.evaluate("""() => new Promise((done) => {
        const slider = document.getElementById("gain_coupling_stiffness"), number = slider.nextElementSibling;
        for (const value of [400, 410]) { // the second waits until it is sent
            slider.value = value;
            slider.dispatchEvent(new Event("input", { bubbles: true }));
        }
        number.value = "750";
        number.dispatchEvent(new Event("change", { bubbles: true }));
        setTimeout(done, 200); // behind what the slider had waiting
    })""")
    put(page, "gain_coupling_damping", 1.25)
    until(page, lambda: stage.driver["coupling.damping"] == 1.25)
    assert stage.driver[NAME] == 750, "what is typed counts though the slider was moved just before"
    for again in (lambda: page.page.fill(field("gain_coupling_stiffness"), "90"), lambda: stage.tell(force__limit=9.0)):
        stage.refusal = "coupling.stiffness 90000 N/m needs b > 14"
        put(page, "gain_coupling_stiffness", 90000)
        page.until_text("gain_coupling_stiffness_answer", "needs b > 14")
        page.until(f"document.querySelector('#gain_coupling_stiffness + input').value === '{stage.driver[NAME]:g}'")
        stage.refusal = ""
        again()
        page.until("document.getElementById('gain_coupling_stiffness_answer').textContent === ''")
        page.page.focus("#scene")


def test_steps_go_back_and_forward_by_button_and_key_but_not_in_a_field_and_defaults_are_one_step(page, stage):
    def are(stiffness, damping):
        until(page, lambda: (stage.driver[NAME], stage.driver["coupling.damping"]) == (stiffness, damping))
        page.until(f"document.querySelector('{field('gain_coupling_stiffness')}').value === '{stiffness:g}'")
        page.until(f"document.querySelector('{field('gain_coupling_damping')}').value === '{damping:g}'")

    assert page.page.is_disabled("#undo") and page.page.is_disabled("#redo") and page.page.is_disabled("#defaults")
    put(page, "gain_coupling_stiffness", 700)
    put(page, "gain_coupling_damping", 0.5)
    page.page.focus("#scene")
    are(700, 0.5)
    pressed = "new KeyboardEvent('keydown', {key: 'z', ctrlKey: true, bubbles: true, cancelable: true})"
    assert page.page.evaluate(f"document.getElementById('mark_text').dispatchEvent({pressed})")  # is the field's own
    page.page.keyboard.press("Control+z")
    are(700, 1.0)
    page.page.keyboard.press("Control+Shift+z")
    are(700, 0.5)
    for _ in range(2):
        page.page.click("#undo")
    are(1000, 1.0)
    assert page.page.is_disabled("#undo") and page.page.is_disabled("#defaults")
    page.page.click("#redo")
    are(700, 1.0)
    added(page, stage)
    page.until("!document.getElementById('defaults').disabled")
    page.page.click("#defaults")
    until(page, lambda: settings.live_of(stage.driver) == settings.live_of(stage.began))
    page.until("document.getElementById('defaults').disabled && !document.getElementById('undo').disabled")
    page.page.click("#undo")
    until(page, lambda: len(stage.walls["offsets"]) == 1 and stage.driver[NAME] == 700)


AT_ONCE = """([place, value, ...undos]) => {  // no answer comes between
    const number = document.querySelector(place);
    number.value = value;
    number.dispatchEvent(new Event("change"));
    for (const key of undos) document.dispatchEvent(new KeyboardEvent("keydown", {key, ctrlKey: true}));
}"""


def test_an_undo_does_not_wait_for_the_answer_to_what_it_takes_back(page, stage):
    put(page, "gain_coupling_stiffness", 700)
    until(page, lambda: stage.driver[NAME] == 700)
    page.page.evaluate(AT_ONCE, [field("gain_coupling_damping"), 0.5, "z", "y", "z"])
    until(page, lambda: len(stage.asked) == 5)
    assert stage.asked[1:] == [{"coupling.damping": value} for value in (0.5, 1.0, 0.5, 1.0)]
    stage.refusal = "no"
    page.page.evaluate(AT_ONCE, [field("gain_coupling_damping"), 0.7])
    page.until_text("gain_coupling_damping_answer", "^no$")
    stage.refusal = ""
    page.page.click("#undo")  # what was refused is no step
    until(page, lambda: stage.asked[6:] == [{NAME: 1000}])
    stage.refusal = "no"
    page.page.click("#tuning .fold")
    page.page.keyboard.press("Control+y")
    page.until_text("gain_coupling_stiffness_answer", "^no$")
    assert in_view(page, "#gain_coupling_stiffness_answer"), "of a panel that was folded"


def loaded(tab, content):
    tab.page.set_input_files("#load_file", {"name": "mine.yaml", "mimeType": "text/yaml", "buffer": content})


def test_a_file_is_loaded_and_undone_or_refused_in_its_sentence(page, stage):
    loaded(page, b"# mine\n")
    page.until_text("tuning_answer", "^mine.yaml: the file is loaded$")
    assert stage.sent == b"# mine\n"
    page.until("!document.getElementById('undo').disabled")
    page.page.click("#undo")
    until(page, lambda: stage.driver["coupling.stiffness"] == 1000.0)
    stage.refusal = "line 1 is not YAML"
    loaded(page, b"[")
    page.until_text("tuning_answer", "^mine.yaml: line 1 is not YAML$")
    assert [complaint for complaint in page.complaints if "400" not in complaint] == []
    page.complaints.clear()  # of the browser, which tells of each refusal
    loaded(page, b"#" * 70000)
    page.until_text("tuning_answer", "mine.yaml has 69 kB; the limit is 64 kB")


def test_a_wall_that_is_moved_into_the_live_hand_is_no_fault(tab, listener):
    tab.until(
        "!document.getElementById('scene_name').disabled && document.getElementById('state').textContent !== 'idle'"
    )
    tab.engage()
    tab.page.click("#add_wall")
    tab.until("document.querySelectorAll('.wall').length === 1 && document.querySelector('.dot.move')?.style.transform")
    tab.until("document.getElementById('wall_1_stiffness_passive').textContent.startsWith('stable up to')")
    dragged(tab, "move", 0, -150)
    tab.until_text("wall_1_answer", "The hand is in the way: the wall stops at it.")
    tab.shot("wall_at_hand")
    tab.page.mouse.up()
    listener.later()
    assert tab.text("state").startswith("engaged"), "its force may be less, but nothing stops"
    groups, frames = listener.marked()
    assert groups >= {"bodies", "walls", "workspace", "target", "handle", "coupling"} and frames == {"haptic_map"}
    tab.page.click("#wall_1_remove")
    tab.until("document.querySelectorAll('.wall').length === 0")
    assert tab.text("state").startswith("engaged") and tab.text("walls_answer") == ""
    before = tab.page.input_value(field("tuned_coupling_stiffness"))
    put(tab, "tuned_coupling_stiffness", 90000)
    tab.until_text("tuned_coupling_stiffness_answer", "needs b > ")
    assert tab.page.input_value(field("tuned_coupling_stiffness")) == before and tab.complaints == []
