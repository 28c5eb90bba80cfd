# SPDX-License-Identifier: Apache-2.0
"""Recording on the page, and the film of a recording: first without nodes, from files and made-up news, then live."""

from pathlib import Path

import pytest
import waiting
from conftest import PATIENCE, Tab
from filmed_bag import SCENE, film_bag, rows_of
from made_up_viewer import MadeUpViewer

from haptic_display.page.film.write import write_film
from haptic_display.run.report.reading import read_run

pytestmark = pytest.mark.timeout(600)
HOSTILE = "<img src=x onerror=alert(1)>"
SECOND = "106,63,181"  # the colour of the second recording, in light
BAGS = [
    {"name": name, "seconds": seconds, "size": 1.5e6}
    for name, seconds in (("two", 65.2), (HOSTILE, 3.0), ("cut", None))
]
NEWS = {"state": "ready", "seconds": 0.0, "bag": "", "name": "", "bags": BAGS}


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """Folders with a film of one recording, and of two: the second touches 0.1 s earlier, and is shorter."""
    folder = tmp_path_factory.mktemp("films")
    joint = {"type": "pin", "bodies": ["world", "block"], "at": [0.03, 0.0], "stiffness": 1.0}
    scene = SCENE | {"name": HOSTILE, "joints": [joint, joint | {"stiffness": 0.0}]}
    marks = [(1000, "here"), (4000, HOSTILE)]
    first = read_run(film_bag(folder / "first", rows_of(6000), scene, marks))
    second = read_run(film_bag(folder / "second", rows_of(4000, (1600, 2000)), scene))
    write_film([first], folder / "one")
    write_film([first, second], folder / "both")
    return folder


@pytest.fixture
def film(chromium, films):
    """Opens a film as a file; the page is closed afterwards, and must have had no complaint."""
    opened = []

    def open_film(name, **given):
        tab = Tab(chromium, expert=False, **given)
        opened.append(tab)
        tab.page.goto((films / name / "film.html").as_uri())
        tab.until("document.getElementById('force').textContent.endsWith('N')")
        return tab

    yield open_film
    for tab in opened:
        assert tab.complaints == []
        tab.page.close()


def shown(tab):
    """The span of time in the charts [s]."""
    return [float(word) for word in tab.page.get_attribute("#strips", "data-shown").split(" to ")]


def second_pixels(tab):
    """How many pixels of the plane have the second recording's colour."""
    return tab.page.evaluate(f"""() => {{
        const canvas = document.getElementById("scene");
        const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data.slice(i, i + 3).join() === "{SECOND}") count += 1;
        return count;
    }}""")


def test_a_film_opens_from_a_file_is_played_scrubbed_and_zoomed_by_mouse_and_by_keyboard_alone(film):
    tab = film("one")
    assert tab.page.title() == f"paused — Film: {HOSTILE}" and tab.page.query_selector("img") is None
    content = "JSON.parse(document.getElementById('films').textContent)[0].scene"
    assert tab.page.evaluate(f"{content}.sprung") == [True, False], "a joint's own spring is seen here too"
    for fact in ("recordingfirst", "methodimpulse", "length1.5 s", "exchange"):
        assert fact in tab.text("facts")
    assert tab.page.evaluate("performance.getEntriesByType('resource').length") == 0, "nothing is fetched"
    before, everything = tab.text("force"), shown(tab)
    tab.page.locator("#time").click(position={"x": 200, "y": 20})
    tab.until(f"document.getElementById('force').textContent !== {before!r}")
    for key, said in (("Home", "0.00 s"), ("ArrowRight", "0.02 s"), ("Shift+ArrowRight", "0.52 s"), ("End", "1.48 s")):
        tab.page.keyboard.press(key)
        tab.until_text("clock", f"^{said} of 1.48 s")
    assert tab.page.get_attribute("#time", "aria-valuetext") == "1.48 s"
    tab.page.click("[data-speed='0.25']")
    assert tab.page.get_attribute("[data-speed='0.25']", "aria-pressed") == "true"
    tab.page.focus("#time")
    tab.page.keyboard.press("Home")
    tab.page.keyboard.press("Space")
    tab.until("document.getElementById('play').textContent === 'Pause' && document.getElementById('time').value > 0.02")
    tab.page.click("[data-speed='2']")
    tab.until_text("play", "^Play$")
    tab.until_text("clock", "^1.48 s")
    tab.page.click("#marks button >> nth=1")
    tab.until_text("clock", "^1.00 s")
    assert HOSTILE in tab.text("marks")
    tab.page.hover("#strip_force", position={"x": 300, "y": 40})
    tab.page.mouse.wheel(0, -400)
    low, high = shown(tab)
    assert everything[0] < low < high < everything[1] and high - low < 0.5 * (everything[1] - everything[0])
    tab.page.locator("#strip_force").click(position={"x": 44, "y": 40})
    tab.until(f"Math.abs(document.getElementById('time').value - {low}) < 0.02")
    tab.page.locator("#strip_age").dblclick(position={"x": 300, "y": 40})
    assert shown(tab) == everything
    tab.page.focus("#closer")
    tab.page.keyboard.press("Space")
    assert shown(tab) != everything and tab.text("play") == "Play", "space on a button presses that button"
    tab.page.focus("#wider")
    tab.page.keyboard.press("Enter")
    assert shown(tab) == everything


def test_two_recordings_are_on_top_of_each_other_aligned_at_the_first_contact_and_axe_finds_nothing(film):
    assert second_pixels(film("one")) == 0
    for scheme, (width, height) in (("light", (1280, 720)), ("dark", (390, 844))):
        tab = film("both", width=width, height=height, color_scheme=scheme)
        assert tab.page.evaluate("document.documentElement.dataset.theme") == scheme
        assert tab.harm() == []
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= width, "nothing sticks out at the side"
        if scheme == "light":
            assert second_pixels(tab) == 0, "it begins later"
            tab.page.click("#marks button >> nth=0")
            waiting.until(lambda tab=tab: second_pixels(tab) > 0, "outlines of the second", limit=PATIENCE)
            said = tab.text("overlaid")
            assert "second, on top of first" in said and "the second is moved by 0.10 s" in said
            tab.page.keyboard.press("End")
            waiting.until(lambda tab=tab: second_pixels(tab) == 0, "the end of the second", limit=PATIENCE)


def test_the_panel_says_at_once_what_was_pressed_then_what_is_and_lists_what_can_be_played(chromium):
    viewer, tab, looking = MadeUpViewer(recordings=NEWS), Tab(chromium), Tab(chromium)
    for page, address in ((tab, viewer.address), (looking, viewer.looking)):
        page.page.goto(address)
        page.until_text("bag_count", "^3$")
    tab.page.click("#record")
    assert tab.text("record_state") == "starting" and tab.page.is_disabled("#record")
    viewer.tell("recordings", NEWS | {"state": "recording", "seconds": 62.0})
    tab.until("/^recording$/.test(record_state.textContent) && /^1:0[2-9]$/.test(record_clock.textContent)")
    assert tab.text("record") == "Stop recording" and tab.page.get_attribute("#record", "aria-pressed") == "true"
    tab.page.click("#record")
    assert tab.text("record_state") == "saving" and tab.page.get_attribute("#record", "aria-pressed") == "false"
    viewer.tell("recordings", NEWS | {"state": "saved", "bag": "/somewhere/haptic_bags/two", "name": "two"})
    tab.until("!document.getElementById('saved').hidden")
    assert (tab.text("record_state"), tab.text("record_clock")) == ("saved", "")
    assert tab.page.input_value("#bag_path") == "/somewhere/haptic_bags/two"
    links = "all => all.map((a) => `${a.textContent} ${a.getAttribute('href')}`)"
    assert tab.page.eval_on_selector_all("#saved_links a", links) == ["Play film.html?bag=two"]
    viewer.tell("recordings", NEWS | {"state": "no recorder"})
    tab.until_text("record", "No recorder runs")
    tab.page.click("#earlier summary")
    lengths = [text.split(", ", 1)[1] for text in tab.page.locator("#bags span").all_text_contents()]
    assert lengths == ["1:05, 1.5 MB", "0:03, 1.5 MB", "not closed, 1.5 MB"]
    assert tab.page.query_selector("#bags img") is None, "names stay text"
    played = ["two", "%3Cimg%20src%3Dx%20onerror%3Dalert(1)%3E", "cut"]
    assert tab.page.eval_on_selector_all("#bags a", links) == [f"Play film.html?bag={name}" for name in played]
    assert not looking.page.is_visible("#record") and looking.page.is_visible("#earlier")
    assert [message["on"] for message in viewer.asked] == [True, False]
    assert tab.harm("#recording") == tab.complaints == looking.complaints == []
    for page in (tab, looking):
        page.page.close()
    viewer.close()


def test_a_run_is_recorded_marked_saved_and_played(system, tab):
    tab.until("!document.getElementById('record').disabled")
    tab.page.click("#record")
    tab.until_text("record_state", "^recording$")
    tab.page.fill("#mark_text", "here")
    tab.page.click("#mark")
    tab.until_text("record_answer", "mark set: here")
    tab.until_text("record_clock", "^0:0[2-9]$")
    tab.page.click("#record")
    tab.until_text("record_state", "^saved$")
    tab.until("document.querySelectorAll('#saved_links a').length === 1")
    bag = Path(tab.page.input_value("#bag_path"))
    assert bag.parent == Path(system.folder) / "haptic_bags" and (bag / "metadata.yaml").is_file()
    with tab.page.context.expect_page() as popup:
        tab.page.click("#saved_links a")
    played = popup.value
    played.wait_for_selector("#marks button", timeout=1e3 * PATIENCE)
    assert bag.name in played.text_content("#facts") and "here" in played.text_content("#marks")
    played.click("#play")
    waiting.until(lambda: float(played.input_value("#time")) > 0.1, "the film plays", limit=PATIENCE)
    played.close()
    assert tab.complaints == []
