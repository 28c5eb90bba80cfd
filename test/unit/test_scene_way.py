# SPDX-License-Identifier: Apache-2.0
"""The way that a scene suggests: its places, what is drawn of it, and tasks that it does."""

import json
import math
from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config.files import names
from haptic_display.page.tasks import tasks
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.language import load, parse
from haptic_sim.scene.motion import MOST_TURNS, flat_motion, way_of

START, TARGET = (0.01, 0.05, 0.1), (0.02, 0.0, 0.2)
POSES = {"start": list(START), "target": list(TARGET)}
DISC = {"mass": 0.1, "pose": list(START), "shapes": [{"circle": {"radius": 0.01}}]}


@pytest.mark.parametrize(
    ("motion", "way"),
    [
        ({"name": "press_wall"}, [START, TARGET]),
        ({"name": "let_go"}, [START, TARGET]),
        ({"name": "insert_peg"}, [START, (0.02, 0.05, 0.2), TARGET]),
        ({"name": "tap", "taps": 2}, [START, TARGET, START, TARGET]),
        ({"name": "hold", "target": list(START)}, [START]),
        ({"name": "waypoints", "waypoints": [[0.0, 0.0], [0.0, 0.1, 1.0]]}, [START, (0.0, 0.0, 0.1), (0.0, 0.1, 1.0)]),
    ],
)
def test_the_way_there_is_shown_and_not_the_way_back(motion, way):
    assert list(way_of(flat_motion(POSES | motion), (9.0, 9.0, 9.0))) == way


def test_a_circle_begins_at_its_rightmost_point_and_closes_after_each_turn():
    way = way_of({"name": "circle", "start": [0.03, 0.0, 0.0], "radius": 0.03, "turns": -1.0}, START)
    assert way[0] == (0.03, 0.0, 0.0) and way[-1] == pytest.approx(way[0], abs=1e-12)
    assert {round(math.hypot(x, y), 12) for x, y, _ in way} == {0.03}
    assert way[1][1] < 0.0, "clockwise"


def test_no_more_turns_and_taps_are_shown_than_anybody_can_follow():
    for few, many in ((20, 21), (20, 1_000_000_000)):
        ways = [len(way_of(POSES | {"name": "tap", "taps": taps}, START)) for taps in (few, many)]
        assert ways == [2 * MOST_TURNS] * 2
    assert len(way_of({"name": "circle", "turns": 1e300}, START)) == len(
        way_of({"name": "circle", "turns": 20.0}, START)
    )


SCRAP = st.one_of(st.none(), st.integers(), st.floats(), st.text(max_size=3), st.lists(st.floats(), max_size=4))
KEYS = st.sampled_from(["start", "target", "duration", "radius", "turns", "taps"])
SCRIPTS = st.sampled_from(["circle", "tap", "insert_peg", "press_wall", "hold", "nonsense"])


@given(SCRIPTS, st.dictionaries(KEYS, SCRAP))
def test_whatever_a_motion_says_what_is_drawn_of_it_is_finite(name, given_motion):
    drawing = drawing_of(parse({"name": "one", "tool": DISC, "motion": given_motion | {"name": name}}, "here"))
    assert all(math.isfinite(number) for place in drawing.way for number in place)
    assert drawing.way and 0.0 < drawing.seconds < math.inf
    json.dumps(asdict(drawing), allow_nan=False)


def test_the_way_of_a_task_goes_before_that_of_the_motion_and_the_tool_fits_into_the_room_at_its_end():
    task = {"title": "t", "goal": "g", "force": 1.0, "way": [[0.01, 0.05, 0.1], [0.5, 0.05, 0.0]], "seconds": 7.0}
    drawing = drawing_of(parse({"name": "one", "tool": DISC, "motion": POSES, "task": task}, "here"))
    assert drawing.way[-1] == (0.5, 0.05, 0.0) and drawing.seconds == 7.0
    assert drawing.room[2] > 0.51
    told = {"title": "t", "goal": "g", "hint": "", "done": {}, "force": 1.0, "words": "{percent} %", "next": ""}
    assert drawing.task == told


def test_tasks_are_offered_in_the_order_in_which_one_leads_to_the_next_and_begin_where_the_tool_is():
    offered = tasks()
    scenes = {task["name"]: load(task["name"]) for task in offered}
    assert offered[0]["name"] == "peg_in_hole" and scenes.keys() == {n for n in names("scenes") if load(n).task}
    assert [task["title"] for task in offered] == [scene.task.title for scene in scenes.values()]
    following = [*scenes, scenes[offered[-1]["name"]].task.next]
    assert [scene.task.next for scene in scenes.values()] == following[1:] and following[-1] in scenes
    for name, scene in scenes.items():
        way, poses = drawing_of(scene).way, {body: solid.pose for body, solid in scene.solids.items()}
        assert way[0] == pytest.approx(scene.tool.pose, abs=1e-9) and len(way) > 1
        at_start = [scene.measure[key].fraction(poses[scene.measure[key].body]) for key in scene.task.done]
        assert all(fraction < 0.05 for fraction in at_start), f"{name}: nothing is done at the start"


@pytest.mark.parametrize(("name", "place"), [("peg_in_hole", "insertion_fraction"), ("drive_nail", "driven")])
def test_the_outline_at_the_end_of_the_way_lies_on_what_stops_the_tool(name, place):
    scene = load(name)
    end = drawing_of(scene).way[-1]
    face = min(turned(vertex, end)[1] for outline in scene.tool.outlines for vertex in outline.vertices)
    assert face == pytest.approx(-scene.measure[place].end, abs=1e-3)
