# SPDX-License-Identifier: Apache-2.0
"""One reader for every file that people write: what is one for the check is one for the demo, the nodes and launch."""

import pytest
import yaml
from examples import few
from hypothesis import example, given
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.config.parameter_files import read_operating_point
from haptic_device.config.yaml_reader import MOST, dump, loads
from haptic_display.run.config_problems import problems
from haptic_sim.node.parameters import NODES
from haptic_sim.scene.language import load

TWICE = "name: twice\ntool: {mass: 0.1, mass: 5.0, shapes: [{circle: {radius: 0.005}}]}\n"
ALIAS = """name: alias
bodies:
  - &base {name: a, mass: 1.0, pose: [0.1, 0.0, 0.0], shapes: [{box: {size: [0.01, 0.02]}}]}
  - {<<: *base, name: b, pose: [-0.1, 0.0, 0.0]}
tool: {mass: 0.1, shapes: [{circle: {radius: 0.005}}]}
"""
MOTOR = "velocity_limit: 3.0, mass: 0.1, damping: 3.0}"
DEVICE = f"""name: twins
axes:
  - &x {{name: x, counts_per_unit: 2e5, motor_limit: 15.0, workspace: [-0.12, 0.12], {MOTOR}
  - {{<<: *x, name: y}}
"""


def written(tmp_path, text, name="mine.yaml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_key_twice_is_refused_by_the_check_and_by_who_runs_it(tmp_path):
    for text, key, read in (
        (TWICE, "mass", load),
        (find("devices", "desktop").read_text() + "name: other\n", "name", load_device),
    ):
        path = written(tmp_path, text)
        assert problems(path)[0].startswith(f"{key} is written twice, the second time in line ")
        with pytest.raises(ValueError, match=f"mine.yaml: {key} is written twice"):
            read(path)


def test_a_scene_and_a_device_with_anchors_and_merge_keys_are_taken_by_both(tmp_path):
    scene, device = written(tmp_path, ALIAS), written(tmp_path, DEVICE, "device.yaml")
    assert problems(scene) == problems(device) == []
    assert [body.pose[0] for body in load(scene).bodies] == [0.1, -0.1]
    assert [axis.mass for axis in load_device(device).axes] == [0.1, 0.1]


def test_a_plain_value_is_the_same_in_every_file_but_for_four_that_ros_reads_otherwise():
    for text, value in {
        "1:30": "1:30",
        "1e3": 1000.0,
        "1.5e-1": 0.15,
        "1_000": "1_000",
        "010": 8,
        "2001-01-01": "2001-01-01",
        "off": False,
        "'off'": "off",
        "!!str 1": "1",
    }.items():
        assert loads(f"a: {text}") == loads(f"a: {text}", ros=True) == {"a": value}
    for text, plain, ros in (("y", "y", True), ("n", "n", False), ("~", None, "~"), ("", None, "")):
        assert (loads(f"a: {text}"), loads(f"a: {text}", ros=True)) == ({"a": plain}, {"a": ros})


def test_a_merge_key_brings_in_what_is_not_there():
    for text, merged in (
        ("a: &a {k: 1, l: 2}\nb: {<<: *a, l: 3}", {"k": 1, "l": 3}),
        ("a: &a {k: 1}\nc: &c {k: 2, m: 4}\nb: {<<: [*a, *c]}", {"k": 1, "m": 4}),
        ("b: {'<<': 1}", {"<<": 1}),
    ):
        assert loads(text)["b"] == merged


REFUSED = [
    ("", "the file holds no mapping of names to values"),
    ("- 1", "the file holds no mapping of names to values"),
    ("a: 1\na: 2", "a is written twice, the second time in line 2"),
    ("? [1]\n: 2", "line 1 has no plain name where one belongs"),
    ("a: 1\nb: {<<: 3}", "line 2 is not YAML: expected a mapping or list of mappings for merging"),
    ("a: &a [*a]", "line 1: an alias stands within what it names"),
    ("a: &a {<<: *a}", "line 1: an alias stands within what it names"),
    ("a: *b", "line 1 is not YAML: found undefined alias"),
    ("a: " + "[" * 100 + "]" * 100, "line 1 is nested 101 deep; the limit is 100"),
    ("a: " + "[" * 100_000 + "]" * 100_000, "line 1 is nested 101 deep; the limit is 100"),
    ("a:\n\tb: 1", "line 2 begins with a tab; use spaces"),
    ("a:\n  - 1\n \t- 2", "line 3 begins with a tab; use spaces"),
    ("a: [1\nb: 2", "line 2 is not YAML: "),
    ("a: \x00", "this is not a YAML text: "),
]


def test_what_no_file_may_hold_is_refused_in_one_sentence():
    for text, sentence in REFUSED:
        with pytest.raises(ValueError) as refused:
            loads(text)
        assert str(refused.value).startswith(sentence)
        assert "\n" not in str(refused.value)
    assert loads("a: " + "[" * 99 + "]" * 99)["a"]  # just within the limit


def test_aliases_within_aliases_end_at_a_limit():
    text = "a0: &a0 [1, 1]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    with pytest.raises(ValueError, match=f"the file holds more than {MOST} values, its aliases followed"):
        loads(text)
    text = "a0: &a0 {k: 1}\n" + "".join(
        f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 60)
    )
    assert loads(text)["a59"] == {"k": 1}, "what merges name twice is one"
    depth = "[" * 90, "]" * 90
    text = f"a0: &a0 {depth[0]}{depth[1]}\n" + "".join(
        f"a{i}: &a{i} {depth[0]}*a{i - 1}{depth[1]}\n" for i in range(1, 60)
    )
    with pytest.raises(ValueError, match="aliases nest values too deep"):
        loads(text)


def test_a_tag_that_is_written_makes_no_merge_key():
    for ros in (False, True):
        assert loads("x: {!!merge y: {a: 1}}", ros=ros) == {"x": {"y": {"a": 1}}}


def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path):
    path = tmp_path / "scene.yaml"
    path.symlink_to(path)  # a loop
    for read in (load, lambda path: read_operating_point(path, NODES)):
        with pytest.raises(ValueError) as refused:
            read(path)
        assert "[Errno" not in str(refused.value)
        assert str(path) in str(refused.value)


TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")))


@few(30)
@given(st.recursive(TEXT, st.lists))
@example("y")
@example("1e3")
@example("010")
@example("1_000")
@example("~")
@example("<<")
def test_text_that_is_written_is_read_as_text_again(content):
    for flow in (False, True):
        written = dump({"name": content, "number": 1e3, "count": 3}, flow)
        assert loads(written, ros=True) == {"name": content, "number": 1000.0, "count": 3}
        assert yaml.safe_load(written) == {"name": content, "number": 1000.0, "count": 3}
