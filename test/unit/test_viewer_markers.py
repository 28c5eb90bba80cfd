# SPDX-License-Identifier: Apache-2.0
"""Markers show the scene where it is: outlines, poses, arrows as long as forces; messages carry the same numbers."""

import math

import numpy as np
import pytest
from fake_node import Node

from haptic_device.nodes import marker_messages
from haptic_display.page import markers, settings
from haptic_sim.scene.drawing import WALL_DEPTH, WALL_LENGTH, drawing_of, happenings, standing, surroundings
from haptic_sim.scene.geometry import Outline, combined, turned
from haptic_sim.scene.language import load, parse

SCENES = ("peg_in_hole", "four_bar", "ratchet", "slider")
SPRUNG = {
    "name": "sprung",
    "bodies": [{"name": "bob", "mass": 1.0, "pose": [0.1, 0.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}],
    "joints": [{"type": "spring", "bodies": ["world", "bob"], "anchors": [[0.0, 0.05], [0.01, 0.0]], "stiffness": 9.0}],
    "tool": {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]},
}
FRAME = {
    "handle": (0.01, 0.02, 0.5),
    "tool": (0.012, 0.02, 0.5),
    "coupled": True,
    "felt": (3.0, -4.0, 0.1),
    "force": None,
    "target": (0.02, 0.03, 1.0),
    "bodies": [],
    "contacts": [(0.0, 1.0, 0.05, 0.06, 0.0, 1.0, 0.0, -2.0, 1e-6), (0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)],
}


def marked(shapes, *roles):
    """Markers of these shapes, or of those of them that have such a role."""
    return [markers.marker(shape) for shape in shapes if not roles or shape.role in roles]


def bodies(scene, *poses):
    """Markers of tool and bodies at these poses."""
    return marked(standing(scene, poses), "tool", "moving", "fixed")


def joints(scene, *poses):
    """Markers of joints and springs with tool and bodies at these poses."""
    return marked(standing(scene, poses), "joint", "spring")


def upper_area(triangles):
    """Area [m²] of the triangles that look along +z."""
    corners = np.array(triangles).reshape(-1, 3, 3)
    return sum(max(0.0, 0.5 * np.cross(b - a, c - a)[2]) for a, b, c in corners)


@pytest.mark.parametrize("name", SCENES)
def test_each_body_of_a_scene_is_a_marker_with_its_pose_and_its_area(name):
    scene = load(name)
    poses = [(0.001 * i, -0.002, 0.3 * i) for i in range(len(scene.bodies))]
    found = bodies(drawing_of(scene), (0.1, 0.2, 1.0), *poses)
    assert [marker.pose for marker in found] == [(0.1, 0.2, 1.0), *poses]
    for marker, solid in zip(found, (scene.tool, *scene.bodies), strict=True):
        discs = sum(math.pi * o.radius**2 for o in solid.outlines)
        inscribed = 0.5 * markers.CIRCLE * math.sin(2.0 * math.pi / markers.CIRCLE) / math.pi
        expected = combined(solid.outlines).area - discs * (1.0 - inscribed)
        assert upper_area(marker.points) == pytest.approx(expected, rel=1e-9)


def test_the_faces_of_a_prism_close_it_for_each_edge_is_passed_once_in_either_sense():
    square = markers.prism(Outline(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))))
    corners = [square[i : i + 3] for i in range(0, len(square), 3)]
    edges = [(one[k], one[(k + 1) % 3]) for one in corners for k in range(3)]
    assert sorted(edges) == sorted((b, a) for a, b in edges)


def test_arrows_start_where_the_force_acts_and_the_hands_target_is_a_ring_that_points_where_it_turns():
    found = {marker.group: marker for marker in reversed(marked(happenings(FRAME)))}
    assert set(found) == {"target", "handle", "coupling", "force", "contacts"}
    for group, place, force in (("force", FRAME["handle"][:2], (3.0, -4.0)), ("contacts", (0.05, 0.06), (0.0, -2.0))):
        tail, tip = np.array(found[group].points)[:, :2]
        assert tail == pytest.approx(place) and tip - tail == pytest.approx(markers.NEWTON * np.array(force))
    assert np.array(found["coupling"].points)[:, :2] == pytest.approx(np.array([(0.01, 0.02), (0.012, 0.02)]))
    ring = found["target"]
    *around, tip = [turned(point[:2], ring.pose) for point in ring.points]
    assert ring.pose == FRAME["target"]
    assert [math.dist(place, (0.02, 0.03)) for place in around] == pytest.approx([markers.TARGET_RADIUS] * len(around))
    assert math.atan2(tip[1] - 0.03, tip[0] - 0.02) == pytest.approx(1.0)


@pytest.mark.parametrize("name", SCENES)
def test_joints_are_marked_where_they_hold_also_when_their_bodies_have_moved(name):
    """Everything turned and shifted as one, or not at all: each joint's mark goes along."""
    scene, drawn = load(name), drawing_of(load(name))
    there = {body.name: body for body in scene.bodies} | {"tool": scene.tool, "world": None}
    for whole in ((0.0, 0.0, 0.0), (0.03, -0.02, 0.7)):
        moved = [(*turned(solid.pose[:2], whole), solid.pose[2] + whole[2]) for solid in drawn.solids]
        found = joints(drawn, *moved)
        for marker, joint in zip(found, scene.joints, strict=True):
            place, _ = joint.places(*(there[body] for body in joint.bodies))
            expected = place if joint.bodies[0] == "world" else turned(place, whole)
            assert marker.pose[:2] == pytest.approx(expected, abs=1e-12)
            assert marker.kind == ("sphere" if joint.type == "pin" else "cube")


def test_a_spring_is_a_line_between_its_ends():
    scene = drawing_of(parse(SPRUNG, "sprung"))
    _, spring = joints(scene, (0.0, 0.0, 0.0), (0.2, 0.1, math.pi / 2))
    assert (spring.group, spring.kind) == ("springs", "line")
    assert np.array(spring.points)[:, :2] == pytest.approx(np.array([(0.0, 0.05), (0.2, 0.11)]))


def test_walls_of_the_servo_end_where_the_handle_is_free_within_the_line_of_the_workspace():
    driver = {"wall.normals": [0.0, 1.0, -0.6, 0.8], "wall.offsets": [-0.02, 0.05]}
    *walls, line = marked(surroundings(settings.walls(driver), ((-0.1, 0.2), (-0.3, 0.4), (-1.0, 1.0))))
    places = np.array(line.points)
    assert places[0].tolist() == places[-1].tolist() and len(walls) == 2
    assert (*places.min(0)[:2], *places.max(0)[:2]) == (-0.1, -0.3, 0.2, 0.4)
    for unknown in ({}, {"wall.normals": [], "wall.offsets": []}, {"wall.normals": [0.0, 1.0]}):
        assert list(surroundings(settings.walls(unknown), None)) == []
    for marker, normal, offset in zip(walls, ((0.0, 1.0), (-0.6, 0.8)), driver["wall.offsets"], strict=True):
        along = [np.dot(normal, turned(point[:2], marker.pose)) for point in marker.points]
        assert (min(along), max(along)) == pytest.approx((offset - WALL_DEPTH, offset))
        assert upper_area(marker.points) == pytest.approx(WALL_DEPTH * WALL_LENGTH)


def test_a_body_whose_place_is_not_known_is_left_out_with_its_joints():
    scene = drawing_of(load("four_bar"))
    poses = [solid.pose for solid in scene.solids]
    poses[1] = None  # the crank, which three joints hold on to
    assert [marker.number for marker in bodies(scene, *poses)] == [0, *range(2, len(poses))]
    assert [marker.number for marker in joints(scene, *poses)] == [2, 3]


GROUPS = {"bodies", "joints", "walls", "workspace", "target", "handle", "coupling", "force", "contacts"}


@pytest.mark.parametrize(
    ("known", "lacking"),
    [
        ({}, set()),
        ({"scene": None}, {"bodies", "joints"}),
        ({"tool": None}, {"bodies", "joints", "coupling"}),
        ({"coupled": False}, {"coupling"}),
        ({"walls": [], "workspace": None, "target": None}, {"walls", "workspace", "target"}),
        ({"handle": None, "tool": None, "target": None}, GROUPS - {"walls", "workspace", "contacts"}),
    ],
)
def test_the_topic_shows_everything_that_is_known_and_nothing_that_is_not(known, lacking):
    ear, scene = Node(), drawing_of(load("wrench_on_nut"))
    bodies = [solid.pose for solid in scene.solids[1:]]
    given = {"scene": scene, "walls": [(0.0, 1.0, 0.0)], "workspace": ((-0.1, 0.1), (-0.1, 0.1))} | known
    frame = {name: known.get(name, value) for name, value in {**FRAME, "bodies": bodies}.items()}
    for node in (ear, deaf := Node(listeners=0)):
        markers.MarkerPublisher(node, 30.0).show(given["scene"], frame, given["walls"], given["workspace"], 1.0)
    [said] = ear.said["markers"]
    assert deaf.said["markers"] == [], "without a listener none is made"
    assert {marker.ns for marker in said.markers} == GROUPS - lacking
    assert len({(marker.ns, marker.id) for marker in said.markers}) == len(said.markers)


def test_the_message_carries_pose_points_and_colour():
    [tool, *_] = bodies(drawing_of(load("peg_in_hole")), (0.1, 0.2, 1.0), (0.0, 0.0, 0.0))
    [message] = marker_messages.markers(3_000_000_007, "haptic_world", [tool]).markers
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("haptic_world", 3, 7)
    assert (message.ns, message.id, message.type) == ("bodies", 0, message.TRIANGLE_LIST)
    turn = 2.0 * math.atan2(message.pose.orientation.z, message.pose.orientation.w)
    assert (message.pose.position.x, message.pose.position.y, turn) == pytest.approx((0.1, 0.2, 1.0))
    assert [(p.x, p.y, p.z) for p in message.points] == list(tool.points)
    assert message.color.a == pytest.approx(tool.colour[3])
