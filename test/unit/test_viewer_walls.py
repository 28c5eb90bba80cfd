# SPDX-License-Identifier: Apache-2.0
"""What a page may tune: the ranges in which gains are passive, and a parameter file that it sends."""

import asyncio
import types

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from test_viewer import served

from haptic_device import controller_config, gain_check
from haptic_device.description import load_device
from haptic_device.parameter_types import defaults
from haptic_device.parameters import NODES
from haptic_sim.viewer import settings
from haptic_sim.viewer.loading import LARGEST, point_in
from haptic_sim.viewer.passive_range import GAINS, MOST_WALLS, NEW_WALL, PassiveRanges, passive_ranges

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


def just(inside, outside):
    """Values at an end of a range: inside it by a ten-thousandth, and outside."""
    return inside * (1.0 - 1e-4), outside * (1.0 + 1e-4) + 1e-9


def with_one(values, name, i, value):
    """The values with another one of a wall."""
    return values | {name: tuple(value if j == i else old for j, old in enumerate(values[name]))}


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("name", GAINS)
def test_the_driver_takes_a_gain_just_inside_its_range_and_refuses_it_just_outside(point, name):
    values = POINTS[point]
    found = passive_ranges(DEVICE, values, LATENESS)[name]
    others = settings.LIVE[name]
    if found is None:
        ends = [others.low + (others.high - others.low) * i / 200.0 for i in range(201)]
        assert all(refused(values | {name: value}) for value in ends)
        return
    least, most = found
    inside, outside = just(most, most)
    assert not refused(values | {name: max(least, inside)})
    assert most == others.high or refused(values | {name: outside})
    assert least == others.low or refused(values | {name: least * (1.0 - 1e-4) - 1e-9})
    assert least == others.low or not refused(values | {name: least * (1.0 + 1e-4)})


@pytest.mark.parametrize("name", ("wall.stiffness", "wall.damping"))
@pytest.mark.parametrize("i", (0, 1))
def test_the_driver_takes_a_wall_just_inside_its_range_and_refuses_it_just_outside(name, i):
    values = POINTS["walls"]
    least, most = passive_ranges(DEVICE, values, LATENESS)[name][i]
    inside, outside = just(most, most)
    assert least == 0.0 and not refused(with_one(values, name, i, inside))
    assert refused(with_one(values, name, i, outside))


def test_damping_that_is_cancelled_may_be_too_little_of_a_coupling_as_well_as_too_much():
    least, most = passive_ranges(DEVICE, driver(cancellation__ratio=0.7, coupling__damping=1.0), LATENESS)[
        "coupling.damping"
    ]
    assert 0.0 < least < 1.0 < most


@pytest.mark.parametrize("normal", ((0.0, 1.0), (1.0, 0.0), (0.6, 0.8)))
def test_one_wall_more_may_be_as_stiff_as_is_said_whichever_way_it_faces(normal):
    values = POINTS["defaults"]
    _, most = passive_ranges(DEVICE, values, LATENESS)[NEW_WALL]
    wall = {"wall.normals": normal, "wall.offsets": (0.0,), "wall.damping": (0.0,)}
    inside, outside = just(most, most)
    assert not refused(values | wall | {"wall.stiffness": (inside,)})
    assert refused(values | wall | {"wall.stiffness": (outside,)})


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


def test_sliders_go_over_what_is_legal_and_hold_the_default():
    for name, (low, high) in settings.FELT.items():
        declared = settings.LIVE[name]
        assert declared.low <= low < high <= declared.high, name
        assert isinstance(declared.default, tuple) or low <= declared.default <= high, name
    numbers = {name for name, one in settings.LIVE.items() if type(one.default) in (int, float)}
    assert {name for name in numbers - settings.FELT.keys() if not name.startswith("diagnostics.")} == set()


RUNNING = {"haptic_driver": driver(), "haptic_simulation": {"scene": "/somewhere/peg_in_hole.yaml", "method": "auto"}}


def test_a_saved_point_is_loaded_as_it_was_and_what_waits_for_a_start_is_named():
    values = driver(coupling__stiffness=700.0, servo__rate=2000.0) | OBLIQUE
    text = settings.operating_point("/haptic", {"haptic_driver": values, "haptic_simulation": {"scene": "wall"}})
    point = point_in(text.encode(), "/haptic", RUNNING)
    assert point.live == settings.live_of(values) and point.waiting == ["servo.rate", "scene"]
    assert point.sentence == (
        "the file is loaded: it changed coupling.stiffness, wall.normals, wall.offsets, wall.stiffness and 1 more; "
        "only a start of the nodes with this file sets servo.rate, scene"
    )


def test_what_a_file_does_not_name_has_its_default_and_a_scene_by_its_path_is_the_same_scene():
    file = b"/**:\n  ros__parameters: {coupling.damping: 0.5}\n"
    file += b"/haptic/haptic_simulation:\n  ros__parameters: {scene: peg_in_hole}\n"
    with pytest.raises(ValueError, match="did you mean coupling.damping?"):
        point_in(b"/**:\n  ros__parameters: {coupling.dampin: 0.5}\n", "/haptic", RUNNING)
    point = point_in(file, "/haptic", RUNNING | {"haptic_driver": driver(coupling__stiffness=2.0)})
    assert point.live == settings.live_of(driver(coupling__damping=0.5)) and point.waiting == []
    assert point.sentence == "the file is loaded: it changed coupling.stiffness, coupling.damping"
    point = point_in(file, "/haptic", RUNNING | {"haptic_driver": driver(coupling__damping=0.5, clutch__open=True)})
    assert point.sentence == "the file is loaded: it changed clutch.open"
    point = point_in(file, "/haptic", RUNNING | {"haptic_driver": driver(coupling__damping=0.5)})
    assert point.sentence == "the file is loaded: it changed nothing"


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        (b"\xff\xfe", "not"),
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


def posted(file, control=True, **headers):
    """Status and text of the answer to a file that is sent; what was loaded of it."""
    taken = []

    async def load(content):
        taken.append(content)
        if content == b"wrong":
            raise ValueError("wrong is no parameter file")
        return "the file is loaded"

    async def visit(server, http):
        address = server.address(control)
        own = {"Origin": address.rsplit("/", 2)[0]}
        async with http.post(f"{address}operating_point.yaml", data=file, headers=own | headers) as answer:
            return answer.status, (await answer.text()).strip()

    return (*served(visit, load=load)[0], taken)


def test_a_file_that_is_sent_is_loaded_or_refused_with_its_sentence():
    assert posted(b"a: 1") == (200, "the file is loaded", [b"a: 1"])
    assert posted(b"wrong") == (400, "wrong is no parameter file", [b"wrong"])
    whole = b"#" * LARGEST
    assert posted(whole) == (200, "the file is loaded", [whole])
    assert posted(whole + b"#") == (400, "the file has more than 64 kB", [])


def test_a_page_that_looks_on_and_a_foreign_page_load_nothing():
    assert posted(b"a: 1", control=False) == (403, "this page only looks on", [])
    status, sentence, taken = posted(b"a: 1", Origin="http://elsewhere.example")
    assert status == 403 and "elsewhere.example" in sentence and taken == []
