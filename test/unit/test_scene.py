# SPDX-License-Identifier: Apache-2.0
"""The scene language: what it takes and what it makes of it. The sentences by which it refuses: test_refusals.py."""

import json
import math

import pytest
from sample_files import SCENE, SQUARE, changed

from haptic_device.config.files import names
from haptic_device.config.yaml_reader import loads
from haptic_sim.scene import checks, geometry
from haptic_sim.scene.language import SceneError, load, parse

BLOCK = {"mass": 1, "pose": [0.1, 0.0, 0], "shapes": [{"vertices": SQUARE}]}


def found_in(scene):
    """What is wrong with it, sentence by sentence."""
    with pytest.raises(SceneError) as refusal:
        parse(scene, "here")
    assert str(refusal.value) == f"here: {refusal.value.found[0]}"
    return refusal.value.found


def with_bodies(*bodies, **more):
    return {**SCENE, "bodies": [*SCENE["bodies"], *bodies], **more}


def test_every_scene_that_comes_along_has_its_file_s_name_and_is_the_same_again_from_a_topic_and_from_a_bag():
    for name in names("scenes"):
        scene = load(name)
        assert scene.name == name
        published = json.loads(scene.model_dump_json(by_alias=True, exclude_unset=True))
        kept = scene.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        assert parse(published, "topic") == parse(kept, "bag") == scene


def test_integers_and_exponents_are_as_good_as_decimals_and_a_scene_cannot_be_altered():
    scene = parse(loads("{name: n, tool: {mass: 1e-1, shapes: [{circle: {radius: 1}}]}}"), "here")
    assert (scene.tool.mass, scene.tool.outlines[0].radius) == (0.1, 1.0)
    with pytest.raises(ValueError, match="frozen"):
        scene.gravity = (0.0, -9.81)


def test_a_polygon_that_is_not_convex_and_simple_is_refused():
    for vertices, words in (
        ([[0, 0], [1, 0]], "at least 3 vertices"),
        ([[0, 0], [1, 0], [1, 0], [0, 1]], "vertex 2 repeats"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses or folds"),
        ([[0, 0], [1, 0], [0.5, 0]], "crosses or folds"),
        ([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]], "concave at vertex 3"),
        ([[math.cos(0.8 * math.pi * i), math.sin(0.8 * math.pi * i)] for i in range(5)], "crosses or folds"),
    ):
        [sentence] = found_in(changed(SCENE, "tool.shapes.0", {"vertices": vertices}))
        assert sentence.startswith("tool.shapes[0].vertices: ") and words in sentence


def test_bodies_may_overlap_of_which_both_are_fixed_or_in_other_layers_or_on_one_pin():
    inside, twin = {**BLOCK, "name": "inside"}, {**SCENE["bodies"][0], "name": "twin"}
    pin = {"type": "pin", "bodies": ["block", "inside"], "at": [0.11, 0.01]}
    assert "overlaps" in found_in(with_bodies(inside))[0]
    for fits in (
        with_bodies(twin),
        with_bodies({**inside, "layers": [1]}),
        with_bodies(inside, joints=[*SCENE["joints"], pin]),
    ):
        assert len(parse(fits, "here").bodies) == 3


def test_a_half_plane_lies_behind_its_line_however_long_the_normal():
    for normal in ([0, 1], [0, 7.5]):
        scene = parse(changed(SCENE, "bodies.0.shapes.0", {"half_plane": {"normal": normal}}), "here")
        heights = [y for _, y in scene.bodies[0].outlines[0].vertices]
        assert max(heights) == pytest.approx(0.0, abs=1e-12)
        assert min(heights) < -5.0


def test_of_hundreds_of_bodies_only_neighbours_are_looked_at_and_an_overlap_is_still_found(monkeypatch):
    looked = []
    monkeypatch.setattr(checks, "overlap", lambda *pair: looked.append(pair) or geometry.overlap(*pair))
    places = [[0.03 * (k % 20), 0.2 + 0.03 * (k // 20), 0.1] for k in range(300)]
    tiles = [{**BLOCK, "name": f"tile_{k}", "pose": place} for k, place in enumerate(places)]
    assert len(parse(with_bodies(*tiles), "here").bodies) == 302
    assert len(looked) < 10
    tiles[170]["pose"] = tiles[171]["pose"][:2] + [0.5]
    assert found_in(with_bodies(*tiles))[0].startswith("bodies[173] ('tile_171') overlaps bodies[172] ('tile_170')")


def test_every_thing_that_is_wrong_has_its_sentence_and_what_stands_beside_it_is_looked_at_too():
    others = {"name": "in the block"}, {"name": "mistyped", "mas": 2}, {"name": "wrong", "mass": -1}
    pin = {"type": "pin", "bodies": ["blok", "block"], "at": [0, 0]}
    found = found_in(with_bodies(*(BLOCK | one for one in others), joints=[*SCENE["joints"], pin], colour="red"))
    for words in (
        "bodies[3]: has no key 'mas'; did you mean 'mass'?",
        "has no key 'colour'",
        "bodies[4].mass is -1: it should be greater than 0 kg",
        "joints[1].bodies[0] is 'blok'; it must be one of",
        "bodies[2] ('in the block') overlaps bodies[1] ('block')",
    ):
        assert sum(sentence.startswith(words) for sentence in found) == 1, (words, found)
    assert len(found) == 5


def test_what_is_missing_for_a_mistyped_key_is_not_told_twice():
    scene = changed(changed(SCENE, "tool.mass", ...), "tool.mas", 0.1)
    assert found_in(scene) == ("tool: has no key 'mas'; did you mean 'mass'?",)


def test_waypoints_are_pairs_or_triples_and_a_pair_keeps_the_angle_of_the_start():
    for waypoints, flat in (
        ([[0.1, 0.2], [0.3, 0.4, 0.5]], [0.1, 0.2, 0.7, 0.3, 0.4, 0.5]),
        ([0.1, 0.2, 0.7], [0.1, 0.2, 0.7]),
    ):
        motion = {"name": "waypoints", "start": [0.0, 0.0, 0.7], "waypoints": waypoints}
        assert parse({**SCENE, "motion": motion}, "here").motion["waypoints"] == flat


def measured(**changes):
    return parse({**SCENE, "measure": {"pushed": SCENE["measure"]["pushed"] | changes}}, "here").measure["pushed"]


def test_a_measure_is_zero_at_from_and_one_at_to_along_its_unit_axis_and_its_point_turns_with_the_body():
    assert [measured().fraction((x, 7.0, 1.0)) for x in (0.1, 0.2, 0.3)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)
    assert measured(point=[0, -0.1]).fraction((0.0, 0.0, math.pi / 2)) == pytest.approx(0.0, abs=1e-12)


def test_without_an_axis_a_measure_is_the_angle_of_its_body_which_is_never_wrapped():
    turn = {"pushed": {"body": "block", "from": 1, "to": 3}}
    measure = parse({**SCENE, "measure": turn}, "here").measure["pushed"]
    assert [measure.fraction((7.0, 7.0, turn)) for turn in (1.0, 2.0, 3.0, 21.0)] == [0.0, 0.5, 1.0, 10.0]


def test_a_half_plane_that_a_body_starts_beside_is_refused():
    def ball(along):
        place = [3.0 + 0.8 * along + 0.6 * 0.05, 4.0 - 0.6 * along + 0.8 * 0.05, 0.0]
        return {"name": "ball", "mass": 0.1, "pose": place, "shapes": [{"circle": {"radius": 0.05}}]}

    slope = {"name": "slope", "fixed": True, "shapes": [{"half_plane": {"point": [3.0, 4.0], "normal": [0.6, 0.8]}}]}
    tool = {"mass": 0.1, "pose": [3.6, 4.8, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    for along in (99.9, -99.9):
        assert parse({"name": "t", "bodies": [slope, ball(along)], "tool": tool}, "here").name == "t"
    for along in (100.1, -100.1):
        assert found_in({"name": "t", "bodies": [slope, ball(along)], "tool": tool}) == (
            "bodies[1] ('ball') starts 100.1 m along the half_plane of bodies[0] ('slope') from its point, 100 m of it "
            "are modelled; move the point nearer",
        )
