# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes`: the list, the pictures, the explanations, and how bad input is refused."""

import numpy as np
import pytest
from in_process import haptic
from matplotlib.figure import Figure
from matplotlib.image import imread

from haptic_device.share import names
from haptic_sim.compile import compile_scene
from haptic_sim.compile.explain import explain
from haptic_sim.draw import draw, handle_way
from haptic_sim.scene import load

LIBRARY = {"free_space", "wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block", "slider", "four_bar",
           "pendulum", "stack", "hammer_nail", "ratchet"}
PNG = b"\x89PNG\r\n\x1a\n"


def test_the_list_names_every_scene_with_its_method():
    listed = haptic("scenes").stdout
    assert all(name in listed for name in names("scenes"))
    assert set(names("scenes")) >= LIBRARY
    assert "closed_form" in listed


def test_a_drawn_scene_is_a_picture_with_tool_and_wall_in_it(tmp_path):
    done = haptic("scenes", "--draw", "wall", "--out", tmp_path / "picture.png")
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / "picture.png"))
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    pixels = imread(tmp_path / "picture.png")[..., :3]
    orange = (pixels[..., 0] > 0.9) & (pixels[..., 2] < 0.5)
    grey = (np.ptp(pixels, axis=2) < 0.01) & (abs(pixels[..., 0] - 0.79) < 0.03)
    assert orange.sum() > 1000
    assert grey.sum() > 1000


@pytest.mark.parametrize("name", names("scenes"))
def test_every_picture_shows_the_whole_tool_its_way_and_every_body_that_ends(name):
    scene, axes = load(name), Figure().subplots()
    draw(scene, axes)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    places = 1e3 * np.array([scene.tool.pose[:2], *(body.pose[:2] for body in scene.bodies if not body.fixed),
                             *handle_way(scene)[:, :2]])
    assert (places > [left, low]).all()
    assert (places < [right, high]).all()


@pytest.mark.parametrize("name", names("scenes"))
def test_every_scene_suggests_a_motion_that_begins_where_the_tool_is_and_measures_something(name):
    scene = load(name)
    assert handle_way(scene)[0] == pytest.approx(scene.tool.pose, abs=1e-9)
    assert scene.measure or name == "free_space"
    assert scene.description


def test_the_wall_is_explained_as_one_axis_in_closed_form():
    done = haptic("scenes", "--explain", "wall")
    assert done.returncode == 0
    assert "contact acts along [1, 0] alone, in closed form" in done.stdout
    assert "closed_form" in done.stdout


@pytest.mark.parametrize(("name", "words"), [
    ("four_bar", ["2 of 12", "none can happen", "partitioned"]),
    ("peg_in_hole", ["3 of 3 pairs of shapes", "tool-hole", "have to be solved together", "matters"]),
    ("stack_20", ["63, three each", "(21)"]),
])
def test_an_explanation_says_freedoms_contacts_and_method(name, words):
    scene = load(name)
    said = " ".join(answer for _, answer in explain(scene, compile_scene(scene)))
    assert all(word in said for word in words), said


def test_the_gallery_has_a_section_and_a_picture_for_every_scene(tmp_path, monkeypatch):
    from haptic_sim.cli import gallery

    monkeypatch.setattr(gallery, "names", lambda folder: ["wall", "four_bar"])
    gallery.write(tmp_path / "page")
    page = (tmp_path / "page" / "README.md").read_text()
    for name in ("wall", "four_bar"):
        assert f"![{name}]({name}.png)" in page
        assert (tmp_path / "page" / f"{name}.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize(("words", "sentence"), [
    (["--draw", "nowhere"], "nowhere is neither a file nor a name"),
    (["--explain", "nowhere"], "nowhere is neither a file nor a name"),
    (["--out", "a.png"], "--out names the picture of --draw"),
    (["--draw", "wall", "--out", "/nowhere/a.png"], "/nowhere/a.png"),
])
def test_bad_input_ends_in_one_sentence(words, sentence):
    done = haptic("scenes", *words)
    assert done.returncode == 1
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1
