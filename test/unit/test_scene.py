# SPDX-License-Identifier: Apache-2.0
"""The scene language: what it takes, what it makes of it, and the sentences by which it refuses."""

import copy
import json
import math

import pytest

from haptic_device.config_files import names
from haptic_device.yaml_reader import loads
from haptic_sim.scene import checks, geometry
from haptic_sim.scene.language import SceneError, load, parse

SQUARE = [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]
TABLE = {"box": {"size": [1, 0.1], "center": [0, -0.05]}}
GOOD = {
    "name": "sample",
    "materials": {"steel": {"friction": 0.2}},
    "bodies": [
        {"name": "table", "fixed": True, "material": "steel", "shapes": [TABLE]},
        {"name": "block", "mass": 1, "pose": [0.1, 0.0, 0], "shapes": [{"vertices": SQUARE}]},
    ],
    "tool": {"mass": 0.1, "pose": [0, 0.05, 0], "shapes": [{"circle": {"radius": 0.01}}]},
    "joints": [{"name": "hinge", "type": "pin", "bodies": ["world", "block"], "at": [0.11, 0.01]}],
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


@pytest.mark.parametrize("name", names("scenes"))
def test_a_scene_is_the_same_again_from_what_is_published_and_from_what_a_bag_keeps(name):
    scene = load(name)
    published = json.loads(scene.model_dump_json(by_alias=True, exclude_unset=True))
    kept = scene.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    assert parse(published, "topic") == parse(kept, "bag") == scene


def test_integers_and_exponents_are_as_good_as_decimals():
    scene = parse(loads("{name: n, tool: {mass: 1e-1, shapes: [{circle: {radius: 1}}]}}"), "here")
    assert (scene.tool.mass, scene.tool.outlines[0].radius) == (0.1, 1.0)


def test_a_scene_cannot_be_altered():
    with pytest.raises(ValueError, match="frozen"):
        parse(GOOD, "here").gravity = (0.0, -9.81)


def joint(kind, body="world", at=(0, 0), **more):
    """A joint of the block, at a place or at anchors."""
    where = {"anchors": at} if isinstance(at[0], list) else {"at": list(at)}
    return {"type": kind, "bodies": [body, "block"], **where, **more}


TASK = {"title": "Push", "goal": "Push the block.", "done": {"pushed": 0.95}, "words": "{percent} % of the way"}


def tasked(**changes):
    """TASK with entries replaced; without those that are None."""
    return {key: value for key, value in {**TASK, **changes}.items() if value is not None}


J = ("joints", 0)
APART = "'world' and 'block' are 5 mm apart", "[0.003, 0.004] m", "move a body or an anchor"
SENTENCES = [
    (("tool", "mass"), -1.5, ["tool.mass is -1.5", "greater than 0 kg"]),
    (("tool", "mass"), math.nan, ["tool.mass is nan", "finite"]),
    (("tool", "mass"), True, ["tool.mass is True", "must be a number"]),
    (("tool", "mass"), "heavy", ["tool.mass is 'heavy'", "must be a number"]),
    (("tool", "mass"), None, ["tool.mass is missing", "add it"]),
    (("graviti",), [0, 0], ["here: has no key 'graviti'", "did you mean 'gravity'"]),
    (("bodies", 1, "mass"), None, ["bodies[1]", "needs a mass in kg", "fixed: true"]),
    (("bodies", 1, "pose"), [0, math.inf, 0], ["bodies[1].pose[1] is inf", "finite"]),
    (("bodies", 1, "material"), "steal", ["bodies[1].material is 'steal'", "has steel"]),
    (("bodies", 1, "name"), "table", ["bodies[1].name is 'table'", "taken"]),
    (("bodies", 1, "name"), "tool", ["bodies[1].name is 'tool'", "taken"]),
    (("materials", "steel", "restitution"), 1.01, ["materials.steel.restitution is 1.01", "less than or equal to 1"]),
    (("tool", "shapes", 0), {"half_plane": {"normal": [0, 1]}}, ["tool: has a half_plane", "fixed body", "take a box"]),
    (("bodies", 1, "shapes", 0), {"half_plane": {"normal": [0, 1]}}, ["bodies[1]: has a half_plane", "fixed: true"]),
    (("bodies", 0, "shapes", 0), {"half_plane": {"normal": [0, 0]}}, ["half_plane.normal", "some length"]),
    (("bodies", 0, "velocity"), [1, 0, 0], ["bodies[0]: is fixed", "velocity cannot be [1.0, 0.0, 0.0]"]),
    (("bodies", 1, "surface_velocity"), [1, 0], ["bodies[1]: has the surface_velocity [1.0, 0.0] m/s, which only"]),
    (("bodies", 0, "surface_velocity"), [math.inf, 0], ["bodies[0].surface_velocity[0] is inf", "finite"]),
    (("tool", "surface_velocity"), [1, 0], ["tool: has no key 'surface_velocity'"]),
    (("bodies", 1, "name"), "world", ["bodies[1].name is 'world'", "taken"]),
    (("method",), "euler", ["method is 'euler'", "impulse, penalty_explicit, penalty_implicit, partitioned"]),
    (("sub_step",), 0, ["sub_step is 0", "greater than 0 s"]),
    (("error",), math.nan, ["error is nan", "finite"]),
    (("tool", "shapes", 0), {"circle": {"radius": 0}}, ["tool.shapes[0].circle.radius is 0", "greater than 0 m"]),
    (("tool", "shapes", 0), {"box": {"size": [1, 0]}}, ["tool.shapes[0].box.size[1] is 0", "greater than 0 m"]),
    (("tool", "shapes", 0), {"circle": {"radios": 1}}, ["tool.shapes[0].circle: has no key 'radios'", "'radius'"]),
    (("tool", "shapes", 0), {"circel": {"radius": 1}}, ["tool.shapes[0]: must have exactly one of", "circle"]),
    (("measure", "pushed", "axis"), [0, 0], ["measure.pushed.axis is [0, 0]", "some length"]),
    (("measure", "pushed", "body"), "blok", ["measure.pushed.body is 'blok'", "block"]),
    (("measure", "pushed"), {"body": "block", "from": 1, "to": 1}, ["measure.pushed", "from and to that differ"]),
    (("task",), tasked(title=None), ["task.title is missing", "add it"]),
    (("task",), tasked(title=""), ["task.title is ''", "a character at least"]),
    (("task",), tasked(goal="x" * 201), ["task.goal", "at most 200 characters"]),
    (("task",), tasked(goal=3), ["task.goal is 3", "it should be text"]),
    (("task",), tasked(done={"pushd": 0.9}), ["task.done.pushd is the fraction of no measure", "measure has pushed"]),
    (("task",), tasked(done={"pushed": 0}), ["task.done.pushed is 0", "greater than 0"]),
    (("task",), tasked(done={"pushed": 1.001}), ["task.done.pushed is 1.001", "less than or equal to 1"]),
    (("task",), tasked(done={}), ["task", "needs done (measure: least fraction) or force in N"]),
    (("task",), tasked(force=0), ["task.force is 0", "greater than 0 N"]),
    (("task",), tasked(words="far"), ["task.words is 'far'", "write {percent} once"]),
    (("task",), tasked(words="{percent} of {percent}"), ["task.words", "write {percent} once"]),
    (("task",), tasked(way=[[0, 0]]), ["task.way[0][2] is missing"]),
    (("task",), tasked(way=[[0, 0, math.nan]]), ["task.way[0][2] is nan", "finite"]),
    (("task",), tasked(way=[[0, 0, 0]] * 32), ["task.way", "32 entries", "at most 31"]),
    (("task",), tasked(seconds=0), ["task.seconds is 0", "greater than 0 s"]),
    (("task",), tasked(hints="no"), ["task", "has no key 'hints'", "did you mean 'hint'"]),
    (("measure", "pushed", "to"), 0.1, ["measure.pushed", "from and to that differ"]),
    (("tool", "pose"), [0, 0.005, 0], ["bodies[0] ('table') overlaps tool ('tool') by 5 mm", "move one of them"]),
    (("joints", 0, "bodies"), ["world", "blok"], ["joints[0] ('hinge').bodies[1] is 'blok'", "block, world"]),
    (("joints", 0, "bodies"), ["table", "world"], ["joints[0] ('hinge') joins two bodies that cannot move"]),
    (("joints", 0, "bodies"), ["block", "block"], ["joints[0]: joins 'block' to itself"]),
    (("joints", 0, "at"), None, ["joints[0]: needs exactly one of at", "anchors"]),
    (("joints", 0, "at"), [math.nan, 0], ["joints[0].at[0] is nan", "finite"]),
    (("joints", 0, "type"), None, ["joints[0].type is missing", "add it"]),
    (("joints", 0, "axis"), [1, 0], ["joints[0]: has no key 'axis'", "known here are", "friction_torque"]),
    (("joints", 0, "limit"), [-1, 1], ["joints[0]: has no key 'limit'", "did you mean 'limits'"]),
    (("joints", 0, "limits"), [0.5, 1], ["joints[0].limits is [0.5, 1]", "must enclose 0"]),
    (("joints", 0, "limits"), [0.0, -0.4], ["joints[0].limits is [0.0, -0.4]", "the smaller limit stands first"]),
    (("joints", 0, "friction_torque"), -1, ["joints[0].friction_torque is -1", "greater than or equal to 0"]),
    (("joints", 0, "motor"), {"speed": 1, "max_torque": 0}, ["joints[0].motor.max_torque is 0", "0 N m"]),
    (("joints", 0, "motor"), {"speed": 1, "max_force": 2}, ["joints[0].motor: has no key 'max_force'", "'max_torque'"]),
    (("joints", 0, "motor"), {"speed": 1}, ["joints[0].motor.max_torque is missing; add it"]),
    (J, joint("slider", axis=[0, 1], motor={"speed": 1, "max_torque": 2}), ["no key 'max_torque'", "'max_force'"]),
    (J, joint("spring", stiffness=1, motor={"speed": 1, "max_force": 2}), ["joints[0]: has no key 'motor'", "rest"]),
    (J, joint("slider"), ["joints[0].axis is missing; add it"]),
    (J, joint("spring"), ["a spring needs a stiffness"]),
    (J, joint("spring", stiffness=1, rest=-1), ["joints[0].rest is -1", "greater than or equal to 0 m"]),
    (J, joint("weld", "tool"), ["joints[0] welds 'tool'", "shapes"]),
    (J, joint("pin", at=[[0.1, 0.02], [0.003, 0.024]]), ["joints[0] cannot be met", *APART]),
    (J, joint("slider", axis=[0, 1], at=[[0.1, 0], [0.003, 1]]), ["cannot be met", "3 mm apart", "move a body"]),
    (J, joint("spring", stiffness=1), ["joints[0] has no length", "write rest: 0 or move an anchor"]),
    (("bodies", 1, "velocity"), [0, 2, 0], ["joints[0] ('hinge') is pulled apart at 2 m/s", "'world' and 'block'"]),
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


@pytest.mark.parametrize(("gap", "accepted"), [(0.9e-6, True), (1.1e-6, False)])
def test_anchors_may_miss_each_other_by_the_rounding_of_a_file_and_no_more(gap, accepted):
    scene = changed(J, joint("pin", at=[[0.1 + gap, 0.0], [0.0, 0.0]]))
    if accepted:
        assert parse(scene, "here").joints[0].bodies == ("world", "block")
    else:
        with pytest.raises(SceneError, match="cannot be met"):
            parse(scene, "here")


def test_a_velocity_about_the_pin_is_allowed():
    spinning = changed(("bodies", 1, "velocity"), [0.01 * 3.0, -0.01 * 3.0, 3.0])
    assert parse(spinning, "here").bodies[1].velocity[2] == 3.0


def test_bodies_of_other_layers_or_on_one_pin_may_overlap():
    inside = {"name": "inside", "mass": 1, "pose": [0.1, 0.0, 0.0], "shapes": [{"vertices": SQUARE}]}
    pin = {"type": "pin", "bodies": ["block", "inside"], "at": [0.11, 0.01]}
    with pytest.raises(SceneError, match="overlaps"):
        parse({**GOOD, "bodies": [*GOOD["bodies"], inside]}, "here")
    assert parse({**GOOD, "bodies": [*GOOD["bodies"], {**inside, "layers": [1]}]}, "here")
    assert parse({**GOOD, "bodies": [*GOOD["bodies"], inside], "joints": [*GOOD["joints"], pin]}, "here")


def test_a_half_plane_lies_behind_its_line_however_long_the_normal():
    for normal in ([0, 1], [0, 7.5]):
        scene = parse(changed(("bodies", 0, "shapes", 0), {"half_plane": {"normal": normal}}), "here")
        heights = [y for _, y in scene.bodies[0].outlines[0].vertices]
        assert max(heights) == pytest.approx(0.0, abs=1e-12)
        assert min(heights) < -5.0


def test_fixed_bodies_may_overlap_each_other():
    twin = {**GOOD["bodies"][0], "name": "twin"}
    assert len(parse({**GOOD, "bodies": [*GOOD["bodies"], twin]}, "here").bodies) == 3


def test_of_hundreds_of_bodies_only_neighbours_are_looked_at_and_an_overlap_is_still_found(monkeypatch):
    looked = []
    monkeypatch.setattr(checks, "overlap", lambda *pair: looked.append(pair) or geometry.overlap(*pair))
    places = [[0.03 * (k % 20), 0.2 + 0.03 * (k // 20), 0.1] for k in range(300)]
    tile = {"mass": 1, "shapes": [{"vertices": SQUARE}]}
    tiles = [{**tile, "name": f"tile_{k}", "pose": place} for k, place in enumerate(places)]
    assert len(parse({**GOOD, "bodies": [*GOOD["bodies"], *tiles]}, "here").bodies) == 302
    assert len(looked) < 10
    tiles[170]["pose"] = tiles[171]["pose"][:2] + [0.5]
    with pytest.raises(SceneError, match=r"bodies\[173\] \('tile_171'\) overlaps bodies\[172\] \('tile_170'\)"):
        parse({**GOOD, "bodies": [*GOOD["bodies"], *tiles]}, "here")


def test_every_thing_that_is_wrong_has_its_sentence_and_what_stands_beside_it_is_looked_at_too():
    block = {"mass": 1, "pose": [0.1, 0.0, 0], "shapes": [{"vertices": SQUARE}]}
    others = {"name": "in the block"}, {"name": "mistyped", "mas": 2}, {"name": "wrong", "mass": -1}
    bodies = [*GOOD["bodies"], *(block | other for other in others)]
    wrong = {**GOOD, "colour": "red", "bodies": bodies, "joints": [*GOOD["joints"], joint("pin", "blok")]}
    with pytest.raises(SceneError) as refusal:
        parse(wrong, "here")
    found = refusal.value.found
    assert str(refusal.value) == f"here: {found[0]}" and len(found) == 5
    for words in (
        "bodies[3]: has no key 'mas'; did you mean 'mass'?",
        "has no key 'colour'",
        "bodies[4].mass is -1: it should be greater than 0 kg",
        "joints[1].bodies[0] is 'blok'; it must be one of",
        "bodies[2] ('in the block') overlaps bodies[1] ('block')",
    ):
        assert sum(sentence.startswith(words) for sentence in found) == 1, (words, found)


def test_a_wrong_part_makes_nothing_around_it_look_wrong():
    for path, value in (
        (("bodies", 1, "mass"), -1),
        (("bodies", 0, "shapes"), []),
        (("materials", "steel", "friction"), -1),
        (("tool",), None),
        (("tool", "mass"), 0),
        (("joints", 0, "type"), "hook"),
        (("measure", "pushed", "axis"), [0, 0]),
        (("name",), None),
    ):
        with pytest.raises(SceneError) as refusal:
            parse(changed(path, value), "here")
        assert len(refusal.value.found) == 1, refusal.value.found


def test_what_is_missing_for_a_mistyped_key_is_not_told_twice():
    scene = changed(("tool", "mass"), None)
    scene["tool"]["mas"] = 0.1
    with pytest.raises(SceneError) as refusal:
        parse(scene, "here")
    assert refusal.value.found == ("tool: has no key 'mas'; did you mean 'mass'?",)


@pytest.mark.parametrize(
    ("waypoints", "flat"),
    [
        ([[0.1, 0.2], [0.3, 0.4, 0.5]], [0.1, 0.2, 0.7, 0.3, 0.4, 0.5]),
        ([0.1, 0.2, 0.7], [0.1, 0.2, 0.7]),
    ],
)
def test_waypoints_are_pairs_or_triples_and_a_pair_keeps_the_angle_of_the_start(waypoints, flat):
    motion = {"name": "waypoints", "start": [0.0, 0.0, 0.7], "waypoints": waypoints}
    assert parse({**GOOD, "motion": motion}, "here").motion["waypoints"] == flat


@pytest.mark.parametrize("point", [[0.1], [0.1, 0.2, 0.3, 0.4], 0.1])
def test_a_waypoint_of_another_length_is_refused(point):
    motion = {"name": "waypoints", "waypoints": [[0.0, 0.0], point]}
    with pytest.raises(SceneError) as refusal:
        parse({**GOOD, "motion": motion}, "here")
    assert str(refusal.value) == f"here: motion: waypoints[1] is {point}; write [x, y] or [x, y, theta]"


def test_a_scene_that_is_not_there_is_answered_with_those_that_are():
    with pytest.raises(SceneError, match=r"peg_in_whole.*peg_in_hole, .* and \d+ more; did you mean peg_in_hole\?"):
        load("peg_in_whole")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"name: a\ntool: [1,\n", "line 3 is not YAML: "),
        (b"\xff\xd8\xff\xe0", "this is not a YAML text: "),
        (b"", "the file holds no mapping"),
    ],
)
def test_a_file_that_holds_no_scene_is_refused_with_its_name_and_the_reason(tmp_path, content, sentence):
    path = tmp_path / "own.yaml"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=rf"own\.yaml: {sentence}"):
        load(path)


def test_a_measure_is_zero_at_from_and_one_at_to_along_its_unit_axis():
    measure = parse(GOOD, "here").measure["pushed"]
    assert [measure.fraction((x, 7.0, 1.0)) for x in (0.1, 0.2, 0.3)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)


def test_without_an_axis_a_measure_is_the_angle_of_its_body_which_is_never_wrapped():
    measure = parse(changed(("measure", "pushed"), {"body": "block", "from": 1, "to": 3}), "here").measure["pushed"]
    assert [measure.fraction((7.0, 7.0, turn)) for turn in (1.0, 2.0, 3.0, 21.0)] == [0.0, 0.5, 1.0, 10.0]


def test_a_task_takes_what_is_just_within_its_bounds():
    given = tasked(goal="x" * 200, done={"pushed": 1}, force=1e-3, way=[[0, 0, 0]] * 31, seconds=1e-3)
    task = parse(changed(("task",), given), "here").task
    assert (task.done, task.force, len(task.way), task.hint, task.next) == ({"pushed": 1.0}, 1e-3, 31, "", "")


def test_a_measure_that_is_wrong_does_not_make_the_task_look_wrong_that_names_it():
    given = changed(("task",), TASK) | {"measure": {"pushed": {"body": "block", "from": "far", "to": 1}}}
    with pytest.raises(SceneError) as refusal:
        parse(given, "here")
    assert len(refusal.value.found) == 1


def test_a_measured_point_turns_with_its_body():
    measure = parse(changed(("measure", "pushed", "point"), [0, -0.1]), "here").measure["pushed"]
    assert measure.fraction((0.0, 0.0, math.pi / 2)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("along", "fits"), [(99.9, True), (-99.9, True), (100.1, False), (-100.1, False)])
def test_a_half_plane_that_a_body_starts_beside_is_refused(along, fits):
    plane = {"half_plane": {"point": [3.0, 4.0], "normal": [0.6, 0.8]}}
    place = [3.0 + 0.8 * along + 0.6 * 0.05, 4.0 - 0.6 * along + 0.8 * 0.05, 0.0]
    ball = {"name": "ball", "mass": 0.1, "pose": place, "shapes": [{"circle": {"radius": 0.05}}]}
    scene = {
        "name": "t",
        "bodies": [{"name": "slope", "fixed": True, "shapes": [plane]}, ball],
        "tool": {"mass": 0.1, "pose": [3.6, 4.8, 0.0], "shapes": [{"circle": {"radius": 0.01}}]},
    }
    if fits:
        assert parse(scene, "s").name == "t"
        return
    with pytest.raises(SceneError) as refused:
        parse(scene, "s")
    assert str(refused.value) == (
        "s: bodies[1] ('ball') starts 100.1 m along the half_plane of bodies[0] ('slope') from its point, 100 m of it "
        "are modelled; move the point nearer"
    )
