# SPDX-License-Identifier: Apache-2.0
"""The film of a recording: what it shows is what the bag has, and the page is one file that fetches nothing."""

import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from bag_of_a_run import STIFFNESS, write_run
from filmed_bag import EVERY, SCENE, film_bag, rows_of
from hypothesis import given
from hypothesis import strategies as st
from in_process import haptic
from PIL import Image
from stored_bags import records_of, write

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_display.page.film import page as pages
from haptic_display.page.film import reading
from haptic_display.page.film.clock import MOST, Clock
from haptic_display.page.film.gif import PERIOD, SECONDS, pictures_of
from haptic_display.page.film.page import page_of
from haptic_display.page.film.reading import film_of
from haptic_display.page.linkage import linkage_facts
from haptic_display.run.report.reading import read_run
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load

TICKS = 6000  # 1.5 s
HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    marks = [(1000, "here"), (4000, HOSTILE)]
    return film_bag(tmp_path_factory.mktemp("filmed") / "swing", rows_of(TICKS), marks=marks)


@pytest.fixture(scope="module")
def film(bag):
    return film_of(read_run(bag))


def told(text):
    """What a page was given to show."""
    return json.loads(re.search(r'id="films">(.*?)</script>', text, re.S)[1])


def unpacked(column, step):
    return step * np.cumsum(column)


def test_a_second_of_a_recording_is_sixty_pictures_and_what_is_longer_than_ten_minutes_has_fewer(film):
    assert film.rate == 60.0 and film.pictures == 90
    assert len(Clock(0.0, 599.0).times) == 599 * 60 + 1
    assert len(Clock(-1.0, 5999.0).times) == MOST + 1


def test_handle_tool_and_moving_bodies_are_where_the_simulation_showed_them(film):
    time = film.begin + np.arange(film.pictures) / film.rate
    swung, late = 0.01 * np.sin(20 * time), 0.2 * EVERY * 0.25e-3
    starts = {"handle": (0.0, 0.0, 0.0), "tool": (0.0, 0.001, 0.0), "block": (0.03, 0.0, 0.5)}
    for name, (x, y, angle) in starts.items():
        assert np.abs(film.places[name][:, 0] - swung - x).max() < late
        assert np.ptp(film.places[name][:, 1:] - (y, angle)) == pytest.approx(0.0)
    assert "floor" not in film.places
    far = film.places["tool"] + (1.0, 0.0, 0.0)
    assert reading.room_of(film.places | {"tool": far}, film.scene)[2] == pytest.approx(far[:, 0].max() + 0.005)


def test_force_stretch_energy_and_age_are_those_of_the_bag(film):
    place = film.places["handle"][:, 0]
    assert film.curves["motor"] == pytest.approx(np.abs(STIFFNESS * 0.01) * np.ones(film.pictures), abs=10.0)
    assert np.corrcoef(film.force[:, 0], place)[0, 1] > 0.9, "the model feels the opposite of the motor's force on it"
    assert film.curves["stretch"] == pytest.approx(1.0)
    assert film.curves["age"] == pytest.approx(1.5) and film.curves["oldest"] == pytest.approx(1.5)
    assert film.curves["given"][-1] == pytest.approx(-TICKS / 4, rel=0.02)
    assert film.curves["supplied"][-1] == pytest.approx(2 * TICKS / EVERY, rel=0.02)


def test_contacts_and_marks_are_in_the_pictures_in_which_they_were(film):
    pictures = {picture for picture, *_ in film.contacts}
    assert set(range(31, 36)) <= pictures <= set(range(30, 37)), "from 0.5 s to 0.6 s"
    assert film.contacts[0][2:] == pytest.approx((-0.004, 0.0, 1.5))
    assert film.first_contact == pytest.approx(0.5, abs=1e-3)
    assert [(round(at, 3), text) for at, text in film.marks] == [(0.25, "here"), (1.0, HOSTILE)]


def test_what_the_scene_showed_before_the_first_tick_is_in_the_film(tmp_path):
    rows = rows_of(6000)
    rows["engage"][:2000] = 0.0
    film = film_of(read_run(film_bag(tmp_path / "late", rows, marks=[(400, "before")])))
    assert film.begin == pytest.approx(-0.5, abs=0.02) and film.pictures == 90
    assert film.marks == [(pytest.approx(-0.4), "before")]
    swung = 0.01 * np.sin(20 * (0.5 + film.begin + np.arange(film.pictures) / film.rate))
    assert np.abs(film.places["handle"][:, 0] - swung).max() < 0.2 * EVERY * 0.25e-3
    assert np.isnan(film.curves["motor"][:25]).all() and np.isfinite(film.curves["motor"][35:]).all()


def test_what_a_bag_lacks_is_said_and_the_rest_is_shown(tmp_path):
    rows = rows_of(2000)
    film = film_of(read_run(write_run(tmp_path / "driver", rows)))
    assert film.scene is None and film.notes[0].startswith("the scene was not recorded")
    assert np.ptp(film.places["handle"][:, 0]) > 0.01 and np.isfinite(film.curves["motor"]).all()
    assert "scene was not recorded" in page_of([film])
    undescribed = film_of(read_run(film_bag(tmp_path / "undescribed", rows, scene=None)))
    assert undescribed.scene is None and "does not describe the scene" in undescribed.notes[0]
    file = next(film_bag(tmp_path / "bare", rows).glob("*.mcap"))
    messages, attachments = records_of(file)
    write(file, [one for one in messages if one[1].topic != "/haptic/trace"], attachments)
    topics = film_of(read_run(tmp_path / "bare"))
    assert np.isfinite(topics.places["tool"]).all() and topics.pictures == pytest.approx(film.pictures, abs=2)
    assert any("no trace" in note for note in topics.notes)


def test_a_bag_that_is_cut_off_is_shown_as_far_as_it_goes_and_says_so(bag, tmp_path):
    [file] = bag.glob("*.mcap")
    data = file.read_bytes()
    (tmp_path / "short_0.mcap").write_bytes(data[: len(data) * 2 // 3])
    film = film_of(read_run(tmp_path))
    assert 1 < film.pictures < 90 and film.notes


def test_the_page_has_every_number_to_the_step_that_it_says(film):
    [shown] = told(page_of([film]))
    x, _, angle = shown["places"]["handle"]
    assert np.abs(unpacked(x, 1e-5) - film.places["handle"][:, 0]).max() <= 0.5e-5 + 1e-12
    assert unpacked(shown["places"]["block"][2], 1e-4) == pytest.approx(0.5)
    assert np.abs(unpacked(shown["force"][0], 1e-2) - film.force[:, 0]).max() <= 0.5e-2 + 1e-9
    assert len(angle) == film.pictures


@given(st.lists(st.one_of(st.just(math.nan), st.integers(-(10**9), 10**9).map(float)), min_size=1, max_size=30))
def test_whatever_is_packed_comes_out_as_it_was(numbers):
    whole, found = 0, []
    for step in pages._packed(np.array(numbers)):
        whole += step or 0
        found.append(math.nan if step is None else whole)
    assert found == pytest.approx(numbers if len(found) > 1 else numbers[:1], nan_ok=True)


@given(st.binary(max_size=40))
def test_a_description_of_any_bytes_is_json_or_nothing(data):
    found = reading._text(data)
    assert found is None or json.dumps(found)


def test_walls_of_the_servo_are_those_that_the_driver_had(tmp_path):
    bag = film_bag(tmp_path / "run", rows_of(1000))
    [file] = bag.glob("*.mcap")
    messages, attachments = records_of(file)
    for walls, wanted in (("[0.0, 1.0]", [(0.0, 1.0, -0.05)]), ("[0.0]", []), ("here", []), ("[.nan, 1.0]", [])):
        given = f"/haptic/haptic_driver:\n  ros__parameters:\n    wall.normals: {walls}\n    wall.offsets: [-0.05]\n"
        one = SimpleNamespace(
            create_time=1, log_time=1, name="parameters/haptic_driver.yaml", media_type="", data=given.encode()
        )
        write(file, messages, [*attachments, one])
        film = film_of(read_run(bag))
        assert film.walls == wanted and page_of([film])


def test_the_links_of_a_film_are_those_of_the_device_that_was_recorded(tmp_path):
    bag = film_bag(tmp_path / "run", rows_of(1000))
    [file] = bag.glob("*.mcap")
    messages, attachments = records_of(file)
    described, facts = find("devices", "serial_2r").read_bytes(), linkage_facts(load_device("serial_2r"))
    for data, wanted in ((described, facts), (b"name: serial_2r\nkinematics: 2", None), (b"", None)):
        one = SimpleNamespace(create_time=1, log_time=1, name="device/serial_2r.yaml", media_type="", data=data)
        write(file, messages, [*attachments, one])
        film = film_of(read_run(bag))
        assert film.linkage == wanted and told(page_of([film]))[0]["linkage"] == wanted


def test_the_page_is_one_file_that_fetches_nothing(film):
    text = page_of([film._replace(marks=[])])
    task = film._replace(scene=drawing_of(load("wrench_on_nut")))
    assert "<title>Film: Turn the nut</title>" in page_of([task]), "the scene by its title"
    assert not re.search(r"https?://|(?:src|href)=|@import|url\(|\bimport\b.*\bfrom\b|^export ", text, re.M)
    policy = re.search(r'Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'") and "unsafe" not in policy


def test_a_hostile_scene_stays_text(tmp_path):
    scene = SCENE | {"name": HOSTILE, "description": HOSTILE}
    text = page_of([film_of(read_run(film_bag(tmp_path / "run", rows_of(1000), scene, marks=[(10, HOSTILE)])))])
    assert "<img" not in text and text.count("<script") == text.count("</script>") == 2
    assert told(text)[0]["scene"]["name"] == HOSTILE


def test_each_module_is_there_once_behind_what_it_imports_and_no_line_is_taken_that_cannot_be_inlined(monkeypatch):
    texts = {
        "a.js": 'import { b } from "./b.js";\nimport { c } from "./c.js";\nb(c);\n',
        "b.js": 'import { c } from "./c.js";\nexport function b() {}\n',
        "c.js": "export const c = 1;\n",
        "film.js": 'import * as pen from "./pen.js";\n',
    }
    monkeypatch.setattr(pages, "_text", texts.__getitem__)
    heads = [part.splitlines()[0] for part in pages._modules("a.js", set())]
    assert heads == ["const { c } = (() => {", "const { b } = (() => {", "const {  } = (() => {"]
    with pytest.raises(ValueError, match=r"film.js: a film cannot take the line 'import \* as pen"):
        list(pages._modules("film.js", set()))


@pytest.mark.parametrize("seconds, wanted", [(1.0, 13), (5.76, 72), (60.0, 72)])
def test_the_gif_has_at_most_six_seconds_in_real_time(film, seconds, wanted):
    count = round(seconds * 60) + 1
    long = film._replace(coupled=np.ones(count, bool), first_contact=None)
    chosen = pictures_of(long)
    assert len(chosen) == wanted and chosen[-1] < count and PERIOD * len(chosen) <= SECONDS + 1e-9 <= 6.0
    assert set(np.diff(chosen)) <= {4, 5, 6}
    late = long._replace(first_contact=seconds / 2.0)
    assert pictures_of(late)[0] == (29 * 60 if seconds == 60.0 else 0), "a second before the first contact"


def test_the_command_names_what_it_wrote_and_the_gif_moves_and_is_small(bag, film, tmp_path):
    done = haptic("report", bag, "--film", "--out", tmp_path / "out")
    assert done.returncode == 0
    names = [line.rpartition("/")[2] for line in done.stdout.splitlines()]
    assert names == ["report.html", "film.html", "film.gif"] and "2/2 done" in done.stderr
    assert all((tmp_path / "out" / name).stat().st_size > 0 for name in names)
    gif = tmp_path / "out" / "film.gif"
    with Image.open(gif) as picture:
        assert picture.n_frames == len(pictures_of(film)) and picture.info.get("loop") == 0
        assert {picture.info["duration"] for n in range(picture.n_frames) if picture.seek(n) is None} == {80}
    assert gif.stat().st_size < 3e6


@pytest.mark.parametrize(
    ("bags", "said"), [("none", "does not exist"), (".", "holds no .mcap file"), ("bag bag bag", "shows at most 2")]
)
def test_what_cannot_be_filmed_is_refused_in_one_sentence(bags, said, bag, tmp_path):
    given = [bag if name == "bag" else tmp_path / name for name in bags.split()]
    done = haptic("report", *given, "--film", "--out", tmp_path / "out")
    assert done.returncode == 1 and said in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
