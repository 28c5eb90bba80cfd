# SPDX-License-Identifier: Apache-2.0
"""The scene language: what it takes, what it makes of it, and the sentences by which it refuses."""

import copy
import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.share import names
from haptic_sim.outline import Outline, combined, convex, rectangle
from haptic_sim.scene import SceneError, load, parse

SQUARE = [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]
GOOD = {
    "name": "sample",
    "materials": {"steel": {"friction": 0.2}},
    "bodies": [
        {
            "name": "table", "fixed": True, "material": "steel",
            "shapes": [{"box": {"size": [1, 0.1], "center": [0, -0.05]}}],
        },
        {"name": "block", "mass": 1, "pose": [0.1, 0.0, 0], "shapes": [{"vertices": SQUARE}]},
    ],
    "tool": {"mass": 0.1, "pose": [0, 0.05, 0], "shapes": [{"circle": {"radius": 0.01}}]},
    "measure": {"pushed": {"body": "block", "point": [0, 0], "axis": [2, 0], "from": 0.1, "to": 0.3}},
}


def changed(path, value):
    """GOOD with one entry replaced, or removed if the value is None."""
    scene = copy.deepcopy(GOOD)
    *way, last = path
    place = scene
    for key in way:
        place = place[key]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return scene


@pytest.mark.parametrize("name", names("scenes"))
def test_every_scene_that_comes_along_loads_and_has_its_file_s_name(name):
    assert load(name).name == name


def test_integers_and_exponents_are_as_good_as_decimals():
    scene = parse(yaml.safe_load("{name: n, tool: {mass: 1e-1, shapes: [{circle: {radius: 1}}]}}"), "here")
    assert (scene.tool.mass, scene.tool.outlines[0].radius) == (0.1, 1.0)


def test_a_scene_cannot_be_altered():
    with pytest.raises(ValueError, match="frozen"):
        parse(GOOD, "here").gravity = (0.0, -9.81)


SENTENCES = [
    (("tool", "mass"), 0, ["here: tool.mass is 0", "greater than 0 kg"]),
    (("tool", "mass"), -1.5, ["tool.mass is -1.5", "greater than 0 kg"]),
    (("tool", "mass"), math.nan, ["tool.mass is nan", "finite"]),
    (("tool", "mass"), True, ["tool.mass is True", "must be a number"]),
    (("tool", "mass"), "heavy", ["tool.mass is 'heavy'", "valid number"]),
    (("tool", "mass"), None, ["tool.mass is missing", "add it"]),
    (("tool", "masss"), 1, ["here: tool: has no key 'masss'", "did you mean 'mass'"]),
    (("graviti",), [0, 0], ["here: has no key 'graviti'", "did you mean 'gravity'"]),
    (("bodies", 1, "mass"), None, ["bodies[1]", "needs a mass in kg", "fixed: true"]),
    (("bodies", 1, "pose"), [0, math.inf, 0], ["bodies[1].pose[1] is inf", "finite"]),
    (("bodies", 1, "material"), "steal", ["bodies[1].material is 'steal'", "has steel"]),
    (("bodies", 1, "name"), "table", ["bodies[1].name is 'table'", "taken"]),
    (("bodies", 1, "name"), "tool", ["bodies[1].name is 'tool'", "taken"]),
    (("materials", "steel", "friction"), -0.1, ["materials.steel.friction is -0.1", "greater than or equal to 0"]),
    (("materials", "steel", "restitution"), 1.01, ["materials.steel.restitution is 1.01", "less than or equal to 1"]),
    (("tool", "shapes"), [], ["tool.shapes", "at least 1"]),
    (("tool", "shapes", 0), {}, ["tool.shapes[0]", "exactly one of vertices, circle, box"]),
    (("tool", "shapes", 0), {"circle": {"radius": 0}}, ["tool.shapes[0].circle.radius is 0", "greater than 0 m"]),
    (("measure", "pushed", "body"), "blok", ["measure.pushed.body is 'blok'", "block"]),
    (("measure", "pushed", "to"), 0.1, ["measure.pushed", "from and to that differ"]),
    (("tool", "pose"), [0, 0.005, 0], ["bodies[0] ('table') overlaps tool ('tool') by 5 mm", "move one of them"]),
    (("bodies", 1, "pose"), [0.1, -0.001, 0], ["bodies[1] ('block') overlaps bodies[0] ('table') by 1 mm"]),
]


@pytest.mark.parametrize(("path", "value", "words"), SENTENCES)
def test_what_is_wrong_is_said_in_one_sentence_with_its_place_and_value(path, value, words):
    with pytest.raises(SceneError) as refusal:
        parse(changed(path, value), "here")
    sentence = str(refusal.value)
    assert all(word in sentence for word in words), sentence
    assert "\n" not in sentence


OUTLINES = [
    ([[0, 0], [1, 0]], "at least 3 vertices"),
    ([[0, 0], [1, 0], [1, 0], [0, 1]], "vertex 2 repeats"),
    ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses or folds"),
    ([[0, 0], [1, 0], [0.5, 0]], "crosses or folds"),
    ([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]], "concave at vertex 3"),
    ([[math.cos(0.8 * math.pi * i), math.sin(0.8 * math.pi * i)] for i in range(5)], "crosses or folds"),
]


@pytest.mark.parametrize(("vertices", "words"), OUTLINES)
def test_a_polygon_that_is_not_convex_and_simple_is_refused(vertices, words):
    with pytest.raises(SceneError, match=rf"here: tool.shapes\[0\].vertices: .*{words}"):
        parse(changed(("tool", "shapes", 0), {"vertices": vertices}), "here")


@pytest.mark.parametrize(("height", "accepted"), [(0.01, True), (0.01 - 0.5e-9, True), (0.01 - 2e-9, False)])
def test_touching_at_the_start_is_allowed_and_overlap_is_not(height, accepted):
    scene = changed(("tool", "pose"), [0, height, 0])
    if accepted:
        assert parse(scene, "here").tool.pose[1] == height
    else:
        with pytest.raises(SceneError, match="overlaps"):
            parse(scene, "here")


def test_fixed_bodies_may_overlap_each_other():
    twin = {**GOOD["bodies"][0], "name": "twin"}
    assert len(parse({**GOOD, "bodies": [*GOOD["bodies"], twin]}, "here").bodies) == 3


def test_a_scene_that_is_not_there_is_answered_with_those_that_are():
    with pytest.raises(SceneError, match="peg_in_whole.*free_space.*peg_in_hole.*wall"):
        load("peg_in_whole")


def test_broken_yaml_is_told_with_its_file_and_line(tmp_path):
    path = tmp_path / "broken.yaml"
    path.write_text("name: a\ntool: [1,\n")
    with pytest.raises(SceneError, match=r"broken\.yaml is not YAML: .*line 3"):
        load(path)


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "image.yaml"
    path.write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(SceneError, match=r"image\.yaml cannot be read"):
        load(path)


def test_a_file_that_holds_no_mapping_is_refused(tmp_path):
    path = tmp_path / "empty.yaml"
    path.write_text("")
    with pytest.raises(SceneError, match=r"empty\.yaml"):
        load(path)


def test_a_measure_is_zero_at_from_and_one_at_to_along_its_unit_axis():
    measure = parse(GOOD, "here").measure["pushed"]
    assert [measure.fraction((x, 7.0, 1.0)) for x in (0.1, 0.2, 0.3)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)


def test_a_measured_point_turns_with_its_body():
    measure = parse(changed(("measure", "pushed", "point"), [0, -0.1]), "here").measure["pushed"]
    assert measure.fraction((0.0, 0.0, math.pi / 2)) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(1e-3, 10), st.floats(1e-3, 10), st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4))
def test_lamina_of_a_rectangle_is_that_of_the_textbook_wherever_it_lies(width, height, x, y, angle):
    lamina = combined([Outline(rectangle((width, height), (x, y), angle))])
    area = width * height
    assert lamina.area == pytest.approx(area, rel=1e-9)
    assert lamina.centroid == pytest.approx((x, y), abs=1e-9)
    assert lamina.second_moment == pytest.approx(area * (width**2 + height**2) / 12, rel=1e-8)


def test_two_halves_have_the_inertia_of_the_whole():
    halves = combined([Outline(rectangle((1.0, 2.0), (x, 0.0), 0.0)) for x in (-0.5, 0.5)])
    assert halves.second_moment == pytest.approx(4.0 * (2.0**2 + 2.0**2) / 12, rel=1e-12)


def test_tool_s_inertia_is_taken_about_the_grip():
    tool = parse(changed(("tool", "shapes", 0), {"circle": {"radius": 0.01, "center": [0, 0.02]}}), "here").tool
    assert tool.mass_properties.inertia == pytest.approx(0.1 * (0.01**2 / 2 + 0.02**2), rel=1e-12)
    assert tool.mass_properties.center == (0.0, 0.0)


@given(st.integers(3, 12), st.booleans(), st.floats(0, 7))
def test_vertices_may_be_listed_in_either_sense_and_come_out_counter_clockwise(count, clockwise, angle):
    turns = [angle + 2 * math.pi * i / count for i in range(count)]
    ring = [(math.cos(turn), math.sin(turn)) for turn in turns]
    expected = 0.5 * count * math.sin(2 * math.pi / count)
    assert combined([Outline(convex(ring[::-1] if clockwise else ring))]).area == pytest.approx(expected, rel=1e-12)
