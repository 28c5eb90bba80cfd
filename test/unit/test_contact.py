# SPDX-License-Identifier: Apache-2.0
"""Local contacts: their geometry follows the tool exactly, a corner goes round a corner, nonsense is refused."""

import math

import numpy as np
import pytest
from apart import apart

from haptic_device.control import contact_model
from haptic_device.jit import kernel
from haptic_sim.exchange.local_contacts import LocalContacts
from haptic_sim.method_registry import make
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load, parse

# kept in the cache
place, hide_others, judge_table = (
    kernel(law.py_func) for law in (contact_model.place, contact_model.hide_others, contact_model.judge_table)
)


def one(**given):
    row = np.zeros(len(contact_model.EACH))
    for name, value in ({"identity": 1.0, "kind": contact_model.FLAT_THERE, "normal_x": 1.0} | given).items():
        row[contact_model.EACH.index(name)] = value
    return row


def placed(row, pose, age=0.0, back=0.0):
    out = np.zeros(contact_model.PLACE)
    place(row, np.array(pose, float), age, back, out)
    return out


def test_a_corner_of_the_tool_has_the_lever_arm_of_its_present_turn():
    gap, nx, ny, ax, ay = placed(one(tool_x=0.01, tool_y=0.02), (0.5, 0.0, math.pi / 2))
    assert (gap, nx, ny) == pytest.approx((0.48, 1.0, 0.0)) and (ax, ay) == pytest.approx((-0.02, 0.01))


def test_an_edge_of_the_tool_turns_its_normal_and_touches_at_the_other_bodys_point():
    row = one(kind=contact_model.FLAT_HERE, normal_x=0.0, normal_y=1.0, tool_y=-0.01, point_x=0.03)
    gap, nx, ny, ax, ay = placed(row, (0.0, 0.02, 0.1))
    assert (nx, ny) == pytest.approx((-math.sin(0.1), math.cos(0.1)))
    assert gap == pytest.approx(0.02 * math.cos(0.1) - 0.01 + 0.03 * math.sin(0.1))
    assert (ax, ay) == pytest.approx((0.03, -0.02))


@pytest.mark.parametrize("kind", [contact_model.FLAT_THERE, contact_model.FLAT_HERE])
def test_the_rate_of_a_gap_is_its_normal_and_arm_times_the_tools_velocity(kind):
    row = one(kind=kind, normal_x=0.6, normal_y=0.8, tool_x=0.01, tool_y=-0.03, point_x=0.02, point_y=0.01)
    pose, way = np.array((0.1, -0.2, 0.7)), np.array((0.3, -0.5, 2.0))
    gap, nx, ny, ax, ay = placed(row, pose)
    step = 1e-6
    rate = (placed(row, pose + step * way)[0] - placed(row, pose - step * way)[0]) / (2 * step)
    assert rate == pytest.approx(nx * way[0] + ny * way[1] + way[2] * (ax * ny - ay * nx), rel=1e-7)


def test_a_surface_that_moves_and_is_pushed_back_is_where_that_has_brought_it():
    row = one(velocity_x=0.2)
    assert placed(row, (0.1, 0, 0), age=0.01)[0] == pytest.approx(0.098)
    assert placed(row, (0.1, 0, 0), age=0.01, back=0.003)[0] == pytest.approx(0.101)


def test_a_disc_beyond_the_end_of_an_edge_is_held_by_its_corner():
    row = one(radius=0.01, tool_radius=0.01, high=0.02)  # the edge goes up from the origin
    assert placed(row, (0.03, 0.01, 0))[0] == pytest.approx(0.02)
    gap, nx, ny, ax, ay = placed(row, (0.03, -0.04, 0))
    assert gap == pytest.approx(0.04) and (nx, ny) == pytest.approx((0.6, -0.8))
    assert (ax, ay) == pytest.approx((-0.006, 0.008))


def test_of_a_group_the_plane_with_the_largest_gap_counts():
    table, gaps, shown = np.zeros((8, len(contact_model.EACH))), np.zeros((8, contact_model.PLACE)), np.zeros(8)
    table[:4, contact_model.IDENTITY], table[:3, contact_model.GROUP] = (1, 2, 3, 4), (7, 7, 8)
    gaps[:4, 0] = 0.1, 0.2, 0.0, -1.0
    hide_others(table, gaps, shown)
    assert shown.tolist() == [0, 1, 1, 1, 0, 0, 0, 0]


@pytest.mark.parametrize(
    "given, verdict",
    [
        ({}, contact_model.ACCEPTED),
        ({"normal_x": 0.0}, contact_model.NOT_A_CONTACT),
        ({"normal_x": 1.01}, contact_model.NOT_A_CONTACT),
        ({"friction": -0.1}, contact_model.NOT_A_CONTACT),
        ({"restitution": 1.1}, contact_model.NOT_A_CONTACT),
        ({"mobility": -1.0}, contact_model.NOT_A_CONTACT),
        ({"kind": 4.0}, contact_model.NOT_A_CONTACT),
        ({"gap": math.nan}, contact_model.NOT_FINITE),
        ({"point_x": math.inf}, contact_model.NOT_FINITE),
        *(({name: 1e14}, contact_model.NOT_FINITE) for name in ("point_x", "point_y", "velocity_x", "velocity_y")),
    ],
)
def test_what_is_no_contact_is_refused(given, verdict):
    table = np.zeros((contact_model.MOST, len(contact_model.EACH)))
    table[3] = one(**given)
    assert judge_table(table) == verdict


@pytest.mark.parametrize("room, verdict", [(-0.9e-3, contact_model.ACCEPTED), (-1.1e-3, contact_model.NO_WAY_OUT)])
def test_planes_face_to_face_that_leave_no_room_are_refused(room, verdict):
    table = np.zeros((contact_model.MOST, len(contact_model.EACH)))
    table[0], table[1] = one(gap=room / 2), one(identity=2.0, normal_x=-1.0, gap=room / 2)
    assert judge_table(table) == verdict


@pytest.mark.parametrize("name", ["wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block"])
def test_the_nearest_contact_is_as_far_as_fcl_says_where_features_face_each_other(name):
    scene = load(name)
    near = LocalContacts(reduce_scene(scene), make("impulse", reduce_scene(scene), 1e-3))
    shown, gaps = np.zeros(contact_model.MOST), np.zeros((contact_model.MOST, contact_model.PLACE))
    pose = np.array(scene.tool.pose)
    for row, gap in zip(near.table, gaps, strict=True):
        if row[contact_model.IDENTITY]:
            place(row, pose, 0.0, 0.0, gap)
            assert gap[0] <= max(row[contact_model.GAP], gap[0])
    hide_others(near.table, gaps, shown)
    least = min(
        apart(scene.tool, scene.tool.pose, body, body.pose)
        for body in scene.bodies
        if body.name != "floor" or name == "corner"
    )
    found = gaps[shown > 0.0, 0].min()
    assert found <= least + 1e-9
    if name in ("wall", "corner"):
        assert found == pytest.approx(least, abs=1e-9)


def test_a_peg_in_its_hole_sends_both_flanks_and_keeps_them_in_their_places():
    scene = load("peg_in_hole")
    deep = scene.model_copy(update={"tool": scene.tool.model_copy(update={"pose": (0.0, 0.07, 0.0)})})
    near = LocalContacts(reduce_scene(deep), make("impulse", reduce_scene(deep), 1e-3))
    close = near.table[(near.table[:, contact_model.IDENTITY] > 0) & (near.table[:, contact_model.GAP] < 2e-4)]
    assert len(close) >= 4 and near.trust > 1e-3
    before = near.table[:, contact_model.IDENTITY].copy()
    near.look(1e-3)
    np.testing.assert_array_equal(near.table[:, contact_model.IDENTITY], before)


def test_wherever_the_tool_goes_within_the_trust_a_set_touches_where_the_shapes_do():
    scene, random = load("peg_in_hole"), np.random.default_rng(1)
    gaps, shown = np.zeros((contact_model.MOST, contact_model.PLACE)), np.zeros(contact_model.MOST)
    for _ in range(60):
        pose = np.array((random.uniform(-2e-3, 2e-3), random.uniform(0.06, 0.115), random.uniform(-0.02, 0.02)))
        here = scene.model_copy(update={"tool": scene.tool.model_copy(update={"pose": tuple(pose)})})
        near = LocalContacts(reduce_scene(here), make("impulse", reduce_scene(here), 1e-3))
        for row, gap in zip(near.table, gaps, strict=True):
            place(row, pose, 0.0, 0.0, gap)
        known = near.table[:, contact_model.IDENTITY] > 0.0
        for nx, ny in gaps[known, contact_model.NX : contact_model.NY + 1].tolist():
            there = pose - 0.99 * near.trust * np.array((nx, ny, 0.0))
            for row, gap in zip(near.table, gaps, strict=True):
                place(row, there, 0.0, 0.0, gap)
            hide_others(near.table, gaps, shown)
            inside = apart(here.tool, tuple(there), here.bodies[0], here.bodies[0].pose) <= 0.0
            assert (gaps[shown > 0.0, 0].min() < 0.0) == inside


@pytest.mark.parametrize("speed, stands_in", [(0.0, True), (1e-3, False)])
def test_a_tool_that_can_touch_a_belt_is_not_trusted_to_the_servo(speed, stands_in):
    scene = load("push_block")
    belt, block = scene.bodies
    scene = scene.model_copy(update={"bodies": (belt.model_copy(update={"surface_velocity": (speed, 0.0)}), block)})
    assert (LocalContacts(reduce_scene(scene), make("partitioned", reduce_scene(scene), 1e-3)).trust > 0.0) == stands_in


@pytest.mark.parametrize(
    "more, mobility", [({}, 0.5), ({"motor": {"speed": 0.0, "max_force": 1.0}}, 0.0), ({"friction_force": 1.0}, 0.0)]
)
def test_what_a_slider_carries_gives_way_by_its_mass_unless_a_motor_or_friction_holds_it(more, mobility):
    load_ = {"name": "load", "mass": 2.0, "pose": [0.021, 0.0, 0.0], "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    guide = {"type": "slider", "bodies": ["world", "load"], "at": [0.021, 0.0], "axis": [1.0, 0.0], **more}
    tool = {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}
    scene = parse({"name": "t", "bodies": [load_], "joints": [guide], "tool": tool}, "t")
    near = LocalContacts(reduce_scene(scene), make("partitioned", reduce_scene(scene), 1e-3))
    assert near.table[:, contact_model.IDENTITY].any()
    assert near.table[:, contact_model.MOBILITY].max() == pytest.approx(mobility)


def test_a_nut_on_its_bolt_gives_way_by_turning_alone():
    scene = load("wrench_on_nut")
    near = LocalContacts(reduce_scene(scene), make("partitioned", reduce_scene(scene), 1e-3))
    inertia = scene.bodies[0].mass_properties.inertia
    for row in near.table[near.table[:, contact_model.IDENTITY] > 0]:
        assert 0.0 <= row[contact_model.MOBILITY] <= 0.013**2 / inertia
