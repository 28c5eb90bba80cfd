# SPDX-License-Identifier: Apache-2.0
"""Parameter declarations and parameter files: what is accepted, and the sentence that refuses the rest."""

import array
import math
from typing import Literal

import pytest
from examples import few
from hypothesis import example, given
from hypothesis import strategies as st

from haptic_device.config import yaml_reader
from haptic_device.config.parameter_files import operating_point_problems, read_operating_point
from haptic_device.config.parameter_types import Group, Parameter, check_value, fixed, live, parameters_of
from haptic_display.cli import parameters
from haptic_display.run.processes import parameter_text
from haptic_sim.node.parameters import NODES as ALL_NODES

STIFFNESS = Parameter("wall.stiffness", 1000.0, "N/m", "stiffness of the wall", 0.0, 5000.0, live=True, felt=5000.0)
RATE = Parameter("rate", 4000, "Hz", "servo rate", low=1000, high=10000)
AUTOSTART = Parameter("autostart", True, "", "activate by itself")
REALTIME = Parameter("realtime", "prefer", "", "scheduling", choices=("require", "prefer", "off"))
AXES = Parameter("axes", ("x", "y"), "", "axes of the handle")
NORMAL = Parameter("wall.normal", (), "", "normal of the wall", low=-1.0, high=1.0)
SCENE = Parameter("scene", "free_space", "", "name of the scene")
DRIVER = (STIFFNESS, RATE, AUTOSTART, REALTIME, AXES, NORMAL)
NODES = {"haptic_driver": DRIVER, "haptic_simulation": (AUTOSTART, SCENE)}


def refusal(parameter, value):
    with pytest.raises(ValueError) as caught:
        check_value(parameter, value)
    return str(caught.value)


def operating_point(folder, text, **options):
    path = folder / "point.yaml"
    path.write_text(text)
    return read_operating_point(path, NODES, **options)


def problems(text):
    return list(operating_point_problems(yaml_reader.loads(text, ros=True), NODES))


class Wall(Group):
    stiffness: float = live(1000.0, "N/m", "stiffness of the wall", 0.0, 5000.0)
    normal: tuple[float, ...] = fixed((), "", "normal of the wall", -1.0, 1.0)


class Driver(Group):
    rate: int = fixed(4000, "Hz", "servo rate", 1000, 10000)
    autostart: bool = fixed(True, "", "activate by itself")
    realtime: Literal["require", "prefer", "off"] = fixed("prefer", "", "scheduling")
    axes: tuple[str, ...] = fixed(("x", "y"), "", "axes of the handle")
    wall: Wall


def test_a_field_is_a_parameter_called_after_its_group_with_unit_limits_choices_and_whether_it_is_live():
    assert parameters_of(Driver) == (RATE, AUTOSTART, REALTIME, AXES, STIFFNESS, NORMAL)


def test_each_declared_parameter_allows_its_own_default_says_what_it_means_and_is_declared_once():
    for declared in ALL_NODES.values():
        for parameter in declared:
            assert check_value(parameter, parameter.default) == parameter.default
            assert parameter.meaning
            assert parameter.low < parameter.high
        assert len({parameter.name for parameter in declared}) == len(declared)


DECIMAL, FINITE = "a number with a decimal point in N/m is needed", "a finite number in N/m is needed"
UNQUOTED = "ROS takes an unquoted y, yes, on, n, no or off for a boolean: put the text in quotes"
VALUES = [
    (STIFFNESS, 300, "wall.stiffness is 300 (integer); write 300.0 N/m", 300.0),
    (STIFFNESS, True, f"wall.stiffness is true (boolean); {DECIMAL}"),
    (STIFFNESS, "soft", f"wall.stiffness is 'soft' (text); {DECIMAL}"),
    (STIFFNESS, [], f"wall.stiffness is [] (list); {DECIMAL}"),
    (STIFFNESS, math.nan, f"wall.stiffness is nan; {FINITE}"),
    (STIFFNESS, math.inf, f"wall.stiffness is inf; {FINITE}"),
    (STIFFNESS, -1.0, "wall.stiffness is -1.0 N/m; at least 0.0 N/m is needed", 0.0),
    (STIFFNESS, 6000.0, "wall.stiffness is 6000.0 N/m; at most 5000.0 N/m is allowed", 5000.0),
    (RATE, 4000.0, "rate is 4000.0 (decimal number); write 4000 Hz", 4000),
    (RATE, 0.5, "rate is 0.5 (decimal number); a whole number in Hz is needed"),
    (RATE, 999, "rate is 999 Hz; at least 1000 Hz is needed", 1000),
    (RATE, True, "rate is true (boolean); a whole number in Hz is needed"),
    (AUTOSTART, 1, "autostart is 1 (integer); true or false is needed", True),
    (REALTIME, "maybe", "realtime is 'maybe'; it must be one of require, prefer, off", "off"),
    (REALTIME, 3, 'realtime is 3 (integer); put it in quotes: "3"'),
    (REALTIME, False, f"realtime is false (boolean); {UNQUOTED}"),
    (AXES, "x", "axes is 'x'; write a list: ['x']", ("x",)),
    (NORMAL, [0.0, 1.1], "wall.normal[1] is 1.1; at most 1.0 is allowed", (0.0, 1.0)),
    (NORMAL, [0, 1], "wall.normal[0] is 0 (integer); write 0.0", ()),
]


def test_a_refusal_names_parameter_value_and_limit_in_one_sentence_and_what_is_right_comes_back_unchanged():
    for parameter, value, sentence, *right in VALUES:
        assert refusal(parameter, value) == sentence
        assert [check_value(parameter, one) for one in right] == right
    assert check_value(AXES, ["x", "y"]) == ("x", "y")
    assert check_value(NORMAL, array.array("d", [0.0, 1.0])) == (0.0, 1.0)


@given(st.floats())
@example(0.0)
@example(5000.0)
@example(math.nextafter(0.0, -math.inf))
@example(math.nextafter(5000.0, math.inf))
def test_a_number_is_accepted_exactly_when_it_lies_between_its_limits(value):
    if 0.0 <= value <= 5000.0:
        assert check_value(STIFFNESS, value) == value
    else:
        assert refusal(STIFFNESS, value).startswith("wall.stiffness is ")


def test_a_file_gives_each_node_its_values_nested_or_dotted(tmp_path):
    text = """
/**/haptic_driver:
  ros__parameters:
    wall: {stiffness: 3e2, normal: [0.0, 1.0]}
    rate: 2000
    axes: [x, "y"]
    use_sim_time: false
/haptic/haptic_simulation:
  ros__parameters:
    scene: wall
"""
    assert operating_point(tmp_path, text) == {
        "haptic_driver": {"wall.stiffness": 300.0, "wall.normal": (0.0, 1.0), "rate": 2000, "axes": ("x", "y")},
        "haptic_simulation": {"scene": "wall"},
    }


def scene_of(folder, name):
    return operating_point(folder, f"/**: {{ros__parameters: {{scene: {name}}}}}")["haptic_simulation"]["scene"]


def test_a_file_is_looked_for_beside_the_file_that_names_it(tmp_path, monkeypatch):
    (tmp_path / "points").mkdir()
    (tmp_path / "scenes").mkdir()
    for place in ("scenes/mine.yaml", "points/mine.yaml"):
        (tmp_path / place).write_text("")
    monkeypatch.chdir(tmp_path / "scenes")
    assert scene_of(tmp_path / "points", "mine.yaml") == str(tmp_path / "points/mine.yaml")
    assert scene_of(tmp_path / "points", "../scenes/mine.yaml") == str(tmp_path / "scenes/mine.yaml")
    assert scene_of(tmp_path / "points", tmp_path / "scenes/mine.yaml") == str(tmp_path / "scenes/mine.yaml")
    assert scene_of(tmp_path / "points", "wall") == "wall"


def test_a_name_that_could_be_two_files_or_is_none_is_refused_with_the_places_looked_at(tmp_path, monkeypatch):
    (tmp_path / "wall").write_text("")
    with pytest.raises(ValueError, match=rf"scene 'wall' is both the file {tmp_path}/wall and a name in config/scenes"):
        scene_of(tmp_path, "wall")
    assert scene_of(tmp_path, "./wall") == str(tmp_path / "wall")
    (tmp_path / "here").mkdir()
    (tmp_path / "here/own.yaml").write_text("")
    monkeypatch.chdir(tmp_path / "here")  # where nobody looks
    with pytest.raises(ValueError, match=rf"scene 'own.yaml' is neither the file {tmp_path}/own.yaml nor a name in"):
        scene_of(tmp_path, "own.yaml")


def test_a_wildcard_section_reaches_each_node_that_knows_the_name(tmp_path):
    values = operating_point(tmp_path, "/**:\n  ros__parameters: {autostart: false, scene: wall}\n")
    assert values == {"haptic_driver": {"autostart": False}, "haptic_simulation": {"autostart": False, "scene": "wall"}}


def test_a_later_section_wins_and_another_namespace_does_not_count(tmp_path):
    text = """
/**: {ros__parameters: {wall.stiffness: 1.0}}
/left/haptic_driver: {ros__parameters: {wall.stiffness: 2.0}}
/right: {haptic_driver: {ros__parameters: {wall.stiffness: 3.0}}}
"""
    stiffness = {
        namespace: operating_point(tmp_path, text, namespace=namespace)["haptic_driver"]["wall.stiffness"]
        for namespace in ("/haptic", "/left", "/right")
    }
    assert stiffness == {"/haptic": 1.0, "/left": 2.0, "/right": 3.0}


DRIVER_SAYS, ALL_SAY = "/**/haptic_driver: {ros__parameters: %s}", "/**: {ros__parameters: %s}"
MISTAKES = {
    DRIVER_SAYS % "{wall.stifness: 1.0}": (
        "/**/haptic_driver: wall.stifness is not a parameter of haptic_driver; did you mean wall.stiffness?"
    ),
    DRIVER_SAYS % "{axes: [x, y]}": f"/**/haptic_driver: axes[1] is true (boolean); {UNQUOTED}",
    "/**/haptic_drver: {ros__parameters: {rate: 2000}}": (
        "haptic_drver is not a node of this package; did you mean haptic_driver?"
    ),
    "haptic_driver: {ros__parameters: {rate: 2000}}": (
        "haptic_driver reaches only a node outside any namespace; write /**/haptic_driver or /haptic/haptic_driver"
    ),
    ALL_SAY % "{zzz: 1}": "/**: zzz is not a parameter of haptic_driver or haptic_simulation",
    ALL_SAY % "{rate: 1.5}": "/**: rate is 1.5 (decimal number); a whole number in Hz is needed",
    "/**/haptic_driver: {rate: 2000}": (
        "/**/haptic_driver/rate holds 2000; a node name with ros__parameters below it belongs there"
    ),
    "/**:\n  ros__parameters:\n": "/**/ros__parameters holds no parameters; indent them below it",
    "ros__parameters: {rate: 2000}": "ros__parameters stands without a node name above it, such as /**/haptic_driver",
}


def test_each_mistake_in_a_file_gets_its_sentence():
    for text, sentence in MISTAKES.items():
        assert sentence in problems(text)


def test_every_mistake_is_listed_and_reading_stops_at_the_first(tmp_path):
    text = "/**/haptic_driver: {ros__parameters: {rate: 5, realtime: never, wall.stiffness: .nan}}"
    assert len(problems(text)) == 3
    with pytest.raises(ValueError, match=r"point.yaml: /\*\*/haptic_driver: rate is 5 Hz; at least 1000 Hz is needed"):
        operating_point(tmp_path, text)


@few(30)
@given(st.text())
def test_any_text_is_either_read_or_refused_in_one_line(text):
    try:
        document = yaml_reader.loads(text, ros=True)
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert all("\n" not in sentence for sentence in operating_point_problems(document, NODES))


def test_a_value_that_is_written_is_read_as_it_was():
    for value in (-1.5, 3, True, "off", 'two\nlines "so"', "", (0.5, 1e-9), (), ("y", "a=b"), 1e300, -0.0):
        found = parameters.read_value(parameter_text(value))
        assert (tuple(found) if isinstance(found, list) else found) == value
