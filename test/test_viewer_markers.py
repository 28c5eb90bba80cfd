# SPDX-License-Identifier: Apache-2.0
"""Markers show the scene where it is: outlines, poses, arrows as long as forces; messages carry the same numbers."""

import math

import numpy as np
import pytest

from haptic_device.node import wire_markers
from haptic_sim.outline import Outline, combined
from haptic_sim.scene import load
from haptic_sim.shape import turned
from haptic_sim.viewer import markers, shapes

SCENES = ("peg_in_hole", "wrench_on_nut", "four_bar", "zeno_ball", "wall")
FRAME = {
    "handle": (0.01, 0.02, 0.5), "tool": (0.012, 0.02, 0.5), "felt": (3.0, -4.0, 0.1), "force": None,
    "contacts": [(0.0, 1.0, 0.05, 0.06, 0.0, 1.0, 0.0, -2.0, 1e-6), (0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)],
}  # fmt: skip


def upper_area(triangles):
    """Area [m²] of the triangles that look along +z."""
    corners = np.array(triangles).reshape(-1, 3, 3)
    return sum(max(0.0, 0.5 * np.cross(b - a, c - a)[2]) for a, b, c in corners)


@pytest.mark.parametrize("name", SCENES)
def test_each_body_of_a_scene_is_a_marker_with_its_pose_and_its_area(name):
    scene = load(name)
    poses = [(0.001 * i, -0.002, 0.3 * i) for i in range(len(scene.bodies))]
    found = markers.bodies(scene, (0.1, 0.2, 1.0), poses)
    assert [marker.pose for marker in found] == [(0.1, 0.2, 1.0), *poses]
    for marker, solid in zip(found, (scene.tool, *scene.bodies), strict=True):
        discs = sum(math.pi * o.radius**2 for o in solid.outlines)
        inscribed = 0.5 * markers.CIRCLE * math.sin(2.0 * math.pi / markers.CIRCLE) / math.pi
        expected = combined(solid.outlines).area - discs * (1.0 - inscribed)
        assert upper_area(marker.points) == pytest.approx(expected, rel=1e-9)


def test_the_faces_of_a_prism_close_it():
    """Each edge is passed once in either sense, so that no side is open."""
    square = markers.prism(Outline(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))))
    edges = [pair for i in range(0, len(square), 3) for pair in zip(square[i:i + 3], (*square[i + 1:i + 3], square[i]),
                                                                     strict=True)]  # fmt: skip
    assert sorted(edges) == sorted((b, a) for a, b in edges)


def test_arrows_start_where_the_force_acts_and_are_as_long_as_it_is_large():
    found = {(marker.group, marker.number): marker for marker in markers.happenings(FRAME)}
    assert set(found) == {("handle", 0), ("coupling", 0), ("force", 0), ("contacts", 0)}
    tail, tip = np.array(found["force", 0].points)
    assert tail[:2] == pytest.approx(FRAME["handle"][:2]) and (tip - tail)[:2] == pytest.approx(
        markers.NEWTON * np.array([3.0, -4.0])
    )
    tail, tip = np.array(found["contacts", 0].points)
    assert tail[:2] == pytest.approx((0.05, 0.06)) and (tip - tail)[1] == pytest.approx(-2.0 * markers.NEWTON)
    assert np.array(found["coupling", 0].points)[:, :2] == pytest.approx(np.array([(0.01, 0.02), (0.012, 0.02)]))


def test_without_handle_and_tool_only_contacts_are_shown():
    bare = {**FRAME, "handle": None, "tool": None}
    assert [marker.group for marker in markers.happenings(bare)] == ["contacts"]


def test_the_message_carries_pose_points_and_colour():
    [tool, *_] = markers.bodies(load("peg_in_hole"), (0.1, 0.2, 1.0), [(0.0, 0.0, 0.0)])
    [message] = wire_markers.markers(3_000_000_007, "haptic_world", [tool]).markers
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("haptic_world", 3, 7)
    assert (message.ns, message.id, message.type) == ("bodies", 0, message.TRIANGLE_LIST)
    turn = 2.0 * math.atan2(message.pose.orientation.z, message.pose.orientation.w)
    assert (message.pose.position.x, message.pose.position.y, turn) == pytest.approx((0.1, 0.2, 1.0))
    assert [(p.x, p.y, p.z) for p in message.points] == list(tool.points)
    assert message.color.a == pytest.approx(tool.colour[3])


@pytest.mark.parametrize("name", SCENES)
def test_joint_marks_lie_on_the_joints_at_the_start(name):
    scene = load(name)
    places = {solid.name: solid.pose for solid in shapes.solids(scene)}
    there = {body.name: body for body in scene.bodies} | {"tool": scene.tool, "world": None}
    for joint, ends in zip(scene.joints, shapes.joints(scene), strict=True):
        expected = joint.places(*(there[body] for body in joint.bodies))
        for mark, place in zip(ends, expected, strict=True):
            assert turned(mark.point, places.get(mark.solid, (0.0, 0.0, 0.0))) == pytest.approx(place, abs=1e-12)
