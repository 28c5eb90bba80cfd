# SPDX-License-Identifier: Apache-2.0
"""Recording on the page, and the film of a recording: first without nodes, from files and made-up news, then live."""

from pathlib import Path

import pytest
import waiting
from conftest import PATIENCE, Tab
from filmed_bag import SCENE, film_bag, rows_of
from made_up_viewer import MadeUpViewer

from haptic_device.analysis.report.reading import read_run
from haptic_sim.film.write import write_film

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
    scene = SCENE | {"name": HOSTILE}
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
    """The span of time in the plots [s]."""
    return [float(word) for word in tab.page.evaluate("document.documentElement.dataset.shown").split(" to ")]


def second_pixels(tab):
    """How many pixels of the plane have the second recording's colour."""
    return tab.page.evaluate(f"""() => {{
        const canvas = document.getElementById("scene");
        const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data.slice(i, i + 3).join() === "{SECOND}") count += 1;
        return count;
    }}""")


def test_a_film_opens_from_a_file_and_tells_what_it_is_of(film):
    tab = film("one")
    assert tab.page.title() == f"Replay: {HOSTILE}" and tab.page.query_selector("img") is None
    about = tab.text("about")
    for fact in ("recordingfirst", "methodimpulse", "length1.5 s", "exchange"):
        assert fact in about
    assert tab.page.evaluate("performance.getEntriesByType('resource').length") == 0, "nothing is fetched"


def test_scrubbing_and_the_keys_move_the_time_and_what_is_read_out(film):
    tab = film("one")
    before = tab.text("force")
    tab.page.locator("#time").click(position={"x": 200, "y": 20})
    tab.until(f"document.getElementById('force').textContent !== {before!r}")
    for key, said in (("Home", "0.00 s"), ("ArrowRight", "0.02 s"), ("Shift+ArrowRight", "0.52 s"), ("End", "1.48 s")):
        tab.page.keyboard.press(key)
        tab.until_text("clock", f"^{said} of 1.48 s")
    assert tab.page.get_attribute("#time", "aria-valuetext") == "1.48 s"


def test_it_plays_at_the_chosen_speed_and_stops_at_its_end(film):
    tab = film("one")
    tab.page.click("[data-speed='0.25']")
    assert tab.page.get_attribute("[data-speed='0.25']", "aria-pressed") == "true"
    tab.page.focus("#time")
    tab.page.keyboard.press("Space")
    tab.until("document.getElementById('play').textContent === 'Pause' && document.getElementById('time').value > 0.02")
    tab.page.keyboard.press("Space")
    tab.until("document.getElementById('play').textContent === 'Play'")
    tab.page.click("[data-speed='2']")
    tab.page.click("#play")
    tab.until_text("clock", "^1.48 s")
    tab.until_text("play", "^Play$")


def test_a_mark_leads_to_its_time_and_stays_text(film):
    tab = film("one")
    tab.page.click("#marks button >> nth=1")
    tab.until_text("clock", "^1.00 s")
    assert HOSTILE in tab.text("marks")


def test_a_span_that_is_dragged_is_shown_in_all_plots_and_a_double_click_shows_all(film):
    tab = film("one")
    everything = shown(tab)
    box = tab.page.locator("#plot_force").bounding_box()
    y = box["y"] + 40
    tab.page.mouse.move(box["x"] + 300, y)
    tab.page.mouse.down()
    tab.page.mouse.move(box["x"] + 600, y, steps=5)
    tab.page.mouse.up()
    low, high = shown(tab)
    assert everything[0] < low < high < everything[1] and high - low < 0.5 * (everything[1] - everything[0])
    tab.page.locator("#plot_age").dblclick(position={"x": 300, "y": 40})
    assert shown(tab) == everything


def test_the_plots_are_zoomed_by_keyboard_alone_and_a_click_goes_to_its_time(film):
    tab = film("one")
    everything = shown(tab)
    tab.page.focus("#closer")
    tab.page.keyboard.press("Space")
    assert shown(tab)[1] < everything[1] and tab.text("play") == "Play", "space on a button presses that button"
    tab.page.focus("#wider")
    tab.page.keyboard.press("Enter")
    assert shown(tab) == everything
    tab.page.locator("#plot_energy").click(position={"x": 500, "y": 40})
    tab.until("document.getElementById('time').value > 0.3")


def test_two_recordings_are_on_top_of_each_other_aligned_at_the_first_contact(film):
    assert second_pixels(film("one")) == 0
    tab = film("both")
    assert second_pixels(tab) == 0, "it begins later"
    tab.page.click("#marks button >> nth=0")
    waiting.until(lambda: second_pixels(tab) > 0, "outlines of the second", limit=PATIENCE)
    assert "second, on top of first" in tab.text("overlaid") and "the second is moved by 0.10 s" in tab.text("overlaid")
    tab.page.keyboard.press("End")
    waiting.until(lambda: second_pixels(tab) == 0, "the end of the second", limit=PATIENCE)


@pytest.mark.parametrize("scheme", ("light", "dark"))
@pytest.mark.parametrize("size", ((1280, 720), (390, 844)), ids=("desk", "phone"))
def test_a_film_passes_the_accessibility_check(film, scheme, size):
    tab = film("both", width=size[0], height=size[1], color_scheme=scheme)
    assert tab.page.evaluate("document.documentElement.dataset.theme") == scheme
    assert tab.harm() == []
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= size[0], "nothing sticks out at the side"
    tab.shot(f"film_{scheme}_{size[0]}")


@pytest.fixture
def viewer():
    served = MadeUpViewer(recordings=NEWS)
    yield served
    served.close()


def opened(chromium, address):
    tab = Tab(chromium)
    tab.page.goto(address)
    tab.until_text("bag_count", "^3$")
    return tab


def test_the_panel_says_at_once_what_was_pressed_and_then_what_is(chromium, viewer):
    tab = opened(chromium, viewer.address)
    tab.page.click("#record")
    assert tab.text("record_state") == "starting" and tab.page.is_disabled("#record")
    viewer.tell("recordings", NEWS | {"state": "recording", "seconds": 62.0})
    tab.until("/^recording$/.test(record_state.textContent) && /^1:0[2-9]$/.test(record_clock.textContent)")
    assert tab.text("record") == "Stop recording" and tab.page.get_attribute("#record", "aria-pressed") == "true"
    tab.page.click("#record")
    assert tab.text("record_state") == "saving"
    viewer.tell("recordings", NEWS | {"state": "saved", "bag": "/somewhere/haptic_bags/two", "name": "two"})
    tab.until("!document.getElementById('saved').hidden")
    assert tab.text("record_state") == "saved" and tab.text("record_clock") == ""
    assert tab.page.input_value("#bag_path") == "/somewhere/haptic_bags/two"
    found = tab.page.eval_on_selector_all(
        "#saved_links a", "all => all.map((a) => [a.textContent, a.getAttribute('href')])"
    )
    files = (("Report", "report.html"), ("Replay", "film.html"), ("GIF", "film.gif"))
    assert found == [[name, f"recordings/{file}?bag=two"] for name, file in files]
    viewer.tell("recordings", NEWS | {"state": "no recorder"})
    tab.until_text("record", "No recorder runs")
    assert tab.harm("#recording") == [] and tab.complaints == []
    assert [message["on"] for message in viewer.asked] == [True, False]
    tab.page.close()


def test_two_recordings_of_the_list_are_chosen_and_names_stay_text(chromium, viewer):
    tab = opened(chromium, viewer.address)
    tab.page.click("#earlier summary")
    assert [text.split(", ", 1)[1] for text in tab.page.locator("#bags label").all_text_contents()] == [
        "1:05, 1.5 MB",
        "0:03, 1.5 MB",
        "not closed, 1.5 MB",
    ]
    assert tab.page.query_selector("#bags img") is None
    boxes = tab.page.locator("#bags input")
    boxes.nth(0).check()
    assert not tab.page.is_visible("#pair")
    boxes.nth(1).check()
    pair = tab.page.get_attribute("#pair a", "href")
    assert pair == "recordings/film.html?bag=two&bag=%3Cimg%20src%3Dx%20onerror%3Dalert(1)%3E"
    boxes.nth(2).check()
    assert not tab.page.is_visible("#pair") and tab.page.is_visible("#pair_note")
    assert tab.harm("#recording") == [] and tab.complaints == []
    tab.page.close()


def test_a_page_that_looks_on_only_has_the_list_and_no_button_to_record(chromium, viewer):
    tab = opened(chromium, viewer.looking)
    assert not tab.page.is_visible("#record") and tab.page.is_visible("#earlier")
    tab.page.close()


def test_a_run_is_recorded_marked_saved_and_its_report_and_replay_open(system, tab):
    tab.until("!document.getElementById('record').disabled")
    tab.page.click("#record")
    tab.until_text("record_state", "^recording$")
    tab.page.fill("#mark_text", "here")
    tab.page.click("#mark")
    tab.until_text("record_answer", "mark set: here")
    tab.until_text("record_clock", "^0:0[2-9]$")
    tab.page.click("#record")
    tab.until_text("record_state", "^saved$")
    tab.until("document.querySelectorAll('#saved_links a').length === 3")
    bag = Path(tab.page.input_value("#bag_path"))
    assert bag.parent == Path(system.folder) / "haptic_bags" and (bag / "metadata.yaml").is_file()
    with tab.page.context.expect_page() as popup:
        tab.page.click("#saved_links a >> text=Replay")
    replay = popup.value
    replay.wait_for_selector("#marks button", timeout=1e3 * PATIENCE)
    assert bag.name in replay.text_content("#about") and "here" in replay.text_content("#marks")
    replay.click("#play")
    waiting.until(lambda: float(replay.input_value("#time")) > 0.1, "the replay plays", limit=PATIENCE)
    answer = tab.page.request.get(f"{system.looking}recordings/report.html?bag={bag.name}")
    assert answer.status == 200 and bag.name in answer.text() and "Making" not in answer.text()
    replay.close()
