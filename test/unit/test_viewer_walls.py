# SPDX-License-Identifier: Apache-2.0
"""What a page may tune: the ranges in which gains are passive, and a parameter file that it sends."""

import asyncio
import json
import math
import types

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import NODES
from haptic_device.config.yaml_reader import load as load_yaml
from haptic_device.control import controller_config, gain_check
from haptic_display.page import settings
from haptic_display.page.loading import LARGEST, point_in
from haptic_display.page.passive_range import GAINS, MOST_WALLS, NEW_WALL, PassiveRanges, passive_ranges
from haptic_display.run.config_problems import problems

DEVICE, LATENESS = load_device("desktop"), 2e-4
OBLIQUE = {
    "wall.normals": (0.0, 1.0, 0.6, 0.8),
    "wall.offsets": (-0.02, -0.1),
    "wall.stiffness": (500.0, 800.0),
    "wall.damping": (0.1, 0.0),
}


def driver(**given):
    return defaults(NODES["haptic_driver"]) | {name.replace("__", "."): value for name, value in given.items()}


POINTS = {
    "defaults": driver(),
    "cancelled": driver(cancellation__ratio=0.6, coupling__damping=0.5),
    "slow": driver(servo__rate=1000.0, coupling__stiffness=700.0, velocity__estimator="adaptive_window"),
    "walls": driver() | OBLIQUE,
    "a narrow band": driver(cancellation__ratio=0.4, cancellation__band=1e-4) | OBLIQUE,
    "too stiff": driver(coupling__stiffness=90000.0),
}


def refused(values):
    """Whether the driver would refuse these values, by its own check."""
    return bool(gain_check.refusal(controller_config.settings_from(DEVICE, values)[0], LATENESS))


def ends_of(values, name, found, i=None):
    """Refused just inside the most of a range and just outside, by a ten-thousandth; i: of this wall."""

    def wanted(value):
        one = tuple(value if j == i else old for j, old in enumerate(values[name])) if i is not None else value
        return refused(values | {name: one})

    return wanted(found * (1.0 - 1e-4)), wanted(found * (1.0 + 1e-4) + 1e-9)


@pytest.mark.parametrize("point", POINTS)
def test_the_driver_takes_a_gain_just_inside_its_range_and_refuses_it_just_outside(point):
    values = POINTS[point]
    ranges = passive_ranges(DEVICE, values, LATENESS)
    for name in GAINS:
        declared, found = settings.LIVE[name], ranges[name]
        if found is None:
            ends = [declared.low + (declared.high - declared.low) * i / 200.0 for i in range(201)]
            assert all(refused(values | {name: value}) for value in ends)
            continue
        least, most = found
        inside, outside = ends_of(values, name, most)
        assert (inside, outside) == (False, most != declared.high), name
        if least != declared.low:
            assert refused(values | {name: least * (1.0 - 1e-4) - 1e-9})
            assert not refused(values | {name: least * (1.0 + 1e-4)})


def test_the_driver_takes_a_wall_just_inside_its_range_and_refuses_it_just_outside():
    values = POINTS["walls"]
    for name in ("wall.stiffness", "wall.damping"):
        for i, (least, most) in enumerate(passive_ranges(DEVICE, values, LATENESS)[name]):
            assert (least, *ends_of(values, name, most, i)) == (0.0, False, True)


def test_one_wall_more_may_be_as_stiff_as_is_said_whichever_way_it_faces_and_no_stiffer_the_worst_way():
    _, most = passive_ranges(DEVICE, POINTS["defaults"], LATENESS)[NEW_WALL]
    wall = {"wall.offsets": (0.0,), "wall.damping": (0.0,), "wall.stiffness": (0.0,)}
    ways = ((0.0, 1.0), (0.6, 0.8), (math.cos(math.pi / 8), math.sin(math.pi / 8)))
    ends = [ends_of(POINTS["defaults"] | wall | {"wall.normals": way}, "wall.stiffness", most, 0) for way in ways]
    assert not any(inside for inside, _ in ends) and any(outside for _, outside in ends)


def test_there_is_no_range_for_a_wall_beyond_the_most_and_none_where_walls_do_not_fit():
    many = {"wall.normals": (0.0, 1.0) * 64}
    many |= {f"wall.{name}": (0.0,) * 64 for name in ("offsets", "stiffness", "damping")}
    found = passive_ranges(DEVICE, driver() | many, LATENESS)
    assert found[NEW_WALL] is None and len(found["wall.stiffness"]) == MOST_WALLS
    assert passive_ranges(DEVICE, driver(wall__offsets=(0.0,)), LATENESS) == {}


def test_ranges_are_found_anew_when_values_or_lateness_change_and_not_else():
    said = {"lateness_counted_us": "100.0"}
    ranges = PassiveRanges(types.SimpleNamespace(said=lambda node, entry: said.get(entry, "")))

    def after(values, late):
        said["lateness_counted_us"] = late
        asyncio.run(ranges.follow(DEVICE, values))
        return ranges.found

    first = after(driver(), "100.0")
    assert after(driver(), "101.0") is first
    later = after(driver(), "110.0")
    assert later["coupling.stiffness"][1] < first["coupling.stiffness"][1]
    damped = after(driver(coupling__damping=2.0), "110.0")
    assert damped["coupling.stiffness"][1] < later["coupling.stiffness"][1]
    assert after(driver(), "") == {}


def test_every_live_parameter_of_the_driver_is_declared_to_the_page_and_sliders_go_over_what_is_legal():
    told = json.loads(json.dumps(settings.declarations(), allow_nan=False))
    assert [one["name"] for one in told] == [one.name for one in NODES["haptic_driver"] if one.live]
    for one in told:
        declared, (low, high) = settings.LIVE[one["name"]], one["felt"] or (0.0, 0.0)
        number = one["kind"] in ("number", "whole") and not declared.name.startswith("diagnostics.")
        assert declared.low <= low < high <= declared.high if one["felt"] else not number, declared.name
        assert not number or low <= declared.default <= high, declared.name


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [
        ("coupling.stiffness", 300, 300.0),
        ("wall.stiffness", [1, 2.5], [1.0, 2.5]),
        ("velocity.window", 4.0, 4),
        ("passivity.policy", "warn", "warn"),
        ("passivity.control", False, False),
        ("coupling.stiffness", "stiff", None),
        ("coupling.stiffness", True, None),
        ("passivity.control", 1, None),
        ("servo.rate", 1000.0, None),
        ("nonsense", 1, None),
    ],
)
def test_values_of_the_page_get_the_type_of_the_declaration_or_are_refused_before_anybody_is_asked(name, given, taken):
    if taken is None:
        with pytest.raises(ValueError, match=name):
            settings.typed(name, given)
    else:
        assert settings.typed(name, given) == taken and type(settings.typed(name, given)) is type(taken)


RUNNING = {"haptic_driver": driver(), "haptic_simulation": {"scene": "/somewhere/peg_in_hole.yaml", "method": "auto"}}


def test_a_saved_point_names_what_differs_passes_the_check_and_is_loaded_as_it_was(tmp_path):
    values = driver(coupling__stiffness=700.0, servo__rate=2000.0) | OBLIQUE
    text = settings.operating_point("/haptic", {"haptic_driver": values, "haptic_simulation": {"scene": "wall"}})
    path = tmp_path / "saved.yaml"
    path.write_text(text)
    assert list(problems(path)) == []
    [(_, saved), _] = load_yaml(path).items()
    assert saved["ros__parameters"].keys() == {"coupling.stiffness", "servo.rate", *OBLIQUE}
    point = point_in(text.encode(), "/haptic", RUNNING)
    assert point.live == settings.live_of(values) and point.waiting == ["servo.rate", "scene"]
    assert point.sentence == (
        "the file is loaded: it changed coupling.stiffness, wall.normals, wall.offsets, wall.stiffness and 1 more; "
        "only a start of the nodes with this file sets servo.rate, scene"
    )


def test_what_a_file_does_not_name_has_its_default_and_a_scene_by_its_path_is_the_same_scene():
    file = b"/**:\n  ros__parameters: {coupling.damping: 0.5}\n"
    file += b"/haptic/haptic_simulation:\n  ros__parameters: {scene: peg_in_hole}\n"
    for running, changed in (
        (driver(coupling__stiffness=2.0), "coupling.stiffness, coupling.damping"),
        (driver(coupling__damping=0.5, clutch__open=True), "clutch.open"),
        (driver(coupling__damping=0.5), "nothing"),
    ):
        point = point_in(file, "/haptic", RUNNING | {"haptic_driver": running})
        assert point.live == settings.live_of(driver(coupling__damping=0.5)) and point.waiting == []
        assert point.sentence == f"the file is loaded: it changed {changed}"


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        (b"\xff\xfe", "not"),
        (b"/**:\n  ros__parameters: {coupling.dampin: 0.5}\n", "did you mean coupling.damping?"),
        (b"a: [", "line 2 is not YAML"),
        (b"bodies: 3", "belongs there"),
        (b"{}", "the file has no ros__parameters for a node in /haptic"),
        (b"/other/haptic_driver:\n  ros__parameters: {coupling.damping: 0.5}", "for a node in /haptic"),
        (b"/haptic/haptic_driver:\n  ros__parameters: {coupling.damping: 2000.0}", "at most 1000.0 N s/m is allowed"),
        (b"/haptic/haptic_driver:\n  ros__parameters: {a: 1, b: 2, coupling.damping: x}", r"\(and 2 more\)"),
        (b"#" * (LARGEST + 1), "more than 64 kB"),
    ],
)
def test_a_file_that_is_no_operating_point_is_refused_in_one_sentence(file, sentence):
    with pytest.raises(ValueError, match=sentence) as refusal:
        point_in(file, "/haptic", RUNNING)
    assert "\n" not in str(refusal.value)


@hypothesis_settings(max_examples=50)
@given(st.binary() | st.text().map(str.encode))
def test_no_file_at_all_does_more_than_refuse(file):
    with pytest.raises(ValueError):
        point_in(file, "/haptic", RUNNING)
