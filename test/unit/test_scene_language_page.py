# SPDX-License-Identifier: Apache-2.0
"""docs/reference/scene_language.md: its tables have the keys of the language, and its example does what it says."""

import re
from pathlib import Path

import numpy as np
import pytest

from haptic_device.yaml_reader import load as load_yaml
from haptic_sim.config_problems import problems
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.method_registry import offered
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import Exchanged, hand, rollout, way
from haptic_sim.scene import language
from haptic_sim.scene.joints import JOINTS, Joint
from haptic_sim.scene.shapes import SHAPES, Body, Material, Tool

PAGE = (Path(__file__).parents[2] / "docs/reference/scene_language.md").read_text(encoding="utf-8")
DOOR = "door"


def section(heading):
    return PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]


def rows(text):
    """Cells of the first table."""
    table = re.search(r"^\|.*?(?=\n\n|\Z)", text, re.DOTALL | re.MULTILINE).group()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def named(cell):
    """Keys in a cell: names in backticks, with those of an inner mapping left out."""
    return re.findall(r"`(\w+)(?:: \{[^`]*)?`", cell)


def keys(part):
    """Keys of a part of the language, as a file writes them."""
    return {field.alias or name for name, field in part.model_fields.items()}


@pytest.mark.parametrize(
    ("heading", "part"),
    [
        ("Scene", language.Scene),
        ("Materials", Material),
        ("Bodies", Body),
        ("Tool", Tool),
        ("Measure", language.Measure),
        ("Task", language.Task),
    ],
)
def test_each_table_has_the_keys_of_its_part_and_no_other(heading, part):
    listed = [name for row in rows(section(heading)) for name in named(row[0])]
    assert sorted(listed) == sorted(keys(part))


def test_each_shape_has_its_keys():
    listed = {named(row[0])[0]: {*named(row[1])} for row in rows(section("Shapes"))}
    assert listed == {name: keys(kind) - {"vertices"} for name, kind in SHAPES.items()}


def test_each_joint_has_its_keys():
    common, own = section("Joints").split("Every type but")
    assert {name for row in rows(common) for name in named(row[0])} == keys(Joint) | {"type"}
    listed = {named(row[0])[0]: {*named(row[2])} for row in rows(own)}
    assert listed == {name: keys(kind) - keys(Joint) - {"type"} for name, kind in JOINTS.items()}


def test_the_methods_that_a_scene_may_ask_for_stand_in_its_table():
    [method] = [row for row in rows(section("Scene")) if row[0] == "`method`"]
    assert tuple(named(method[2])) == offered()


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    [block] = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path_factory.mktemp("scene") / "door.yaml"
    path.write_text(block, encoding="utf-8")
    return path


def test_the_example_passes_the_check_and_shows_every_key_that_most_scenes_have(example):
    assert problems(example) == []
    assert {*load_yaml(example)} == keys(language.Scene) - {"gravity", "method", "sub_step", "error"}


def test_the_hand_of_the_example_opens_the_door_as_its_task_asks(example):
    scene = language.load(example)
    path = way(hand(scene), np.arange(0.0, scene.motion["duration"], 1e-3))
    poses = rollout(Exchanged(Simulation(reduce_scene(scene)), path[0]), path, bodies=[DOOR]).poses[DOOR]
    opened = [scene.measure["opened"].fraction(tuple(pose)) for pose in poses]
    assert opened[0] == 0.0 and max(opened) >= scene.task.done["opened"]
