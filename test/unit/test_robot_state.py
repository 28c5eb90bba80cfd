# SPDX-License-Identifier: Apache-2.0
"""The device as a robot of ROS: joints, URDF, and transforms that end where the handle is."""

import importlib
import math
import sys
import types
from xml.etree import ElementTree

import pytest
from fake_node import Node

from haptic_device.config.description import load_device
from haptic_device.config.drives import drives, drives_at, place_of
from haptic_device.nodes import robot_state, transforms
from haptic_device.nodes.urdf import states, tree, urdf
from haptic_sim.scene.geometry import turned


@pytest.fixture
def tf(monkeypatch):
    """tf(messages): as if `tf2_msgs.msg` were this module; None: as if it were not installed."""

    def have(messages):
        monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
        _import_again()

    yield have
    monkeypatch.undo()
    _import_again()


def _import_again():
    for module in (transforms, robot_state):
        importlib.reload(module)


def carried(point, transform):
    """Where a transform carries a point of the plane, by the rotation matrix of its quaternion."""
    q, place = transform.rotation, transform.translation
    c, s = q.w**2 - q.z**2, 2.0 * q.w * q.z
    return (place.x + c * point[0] - s * point[1], place.y + s * point[0] + c * point[1])


def test_the_urdf_is_a_chain_from_base_to_handle_with_the_limits_of_the_axes():
    device = load_device("desktop")
    robot = ElementTree.fromstring(urdf(device, "/haptic"))
    names, joints = [link.get("name") for link in robot.findall("link")], robot.findall("joint")
    assert (names[0], names[-1]) == ("haptic_base_link", "haptic_handle")
    for joint, axis, ends in zip(joints, device.axes, zip(names, names[1:], strict=False), strict=True):
        limit = {key: float(value) for key, value in joint.find("limit").items()}
        assert (limit["lower"], limit["upper"]) == axis.workspace
        assert (limit["velocity"], limit["effort"]) == (axis.velocity_limit, axis.motor_limit)
        assert joint.get("type") == ("revolute" if axis.name == "theta" else "prismatic")
        assert (joint.find("parent").get("link"), joint.find("child").get("link")) == ends


def test_the_transforms_end_where_the_handle_is_and_begin_at_the_map(tf):
    tf(types.SimpleNamespace(TFMessage=types.SimpleNamespace))
    node, pose = Node(), (0.1, 0.2, 2.5)
    robot_state.RobotState(node, load_device("desktop")).publish(3_000_000_007, pose, pose, pose)
    [fixed], [message] = node.said["/tf_static"], node.said["/tf"]
    assert [(one.header.frame_id, one.child_frame_id) for one in fixed.transforms] == [
        ("haptic_map", "haptic_base_link")
    ]
    point, frame = (0.03, 0.04), "haptic_handle"
    for one in reversed(message.transforms):
        assert (one.child_frame_id, one.header.stamp.sec, one.header.stamp.nanosec) == (frame, 3, 7)
        point, frame = carried(point, one.transform), one.header.frame_id
    assert frame == "haptic_base_link" and point == pytest.approx(turned((0.03, 0.04), pose), abs=1e-12)


def test_without_the_messages_of_tf_joints_and_description_are_told_all_the_same(tf):
    tf(None)
    node = Node()
    robot_state.RobotState(node, load_device("desktop")).publish(0, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3)
    assert set(node.said) == {"joint_states", "robot_description"} and len(node.said["joint_states"]) == 1
    assert [joint.child for joint in tree(load_device("desktop"))] == ["x_link", "y_link", "handle"]


KNOB = load_device("haply_2diy_gen3")
KNOB = KNOB.model_copy(update={"name": "knob", "axes": (*KNOB.axes, load_device("desktop").axes[2])})  # on five bars
LINKAGES = [*map(load_device, ("haply_2diy_gen3", "pantograph_mk2", "serial_2r", "hapkit")), KNOB]
EACH = pytest.mark.parametrize("device", LINKAGES, ids=lambda device: device.name)
MOTION = [0.3, -0.2, 0.5]  # of the handle [m/s, m/s, rad/s]


def places(device):
    """Middle and two other places of the workspace, and angles of the handle where a motor turns it."""
    turned = (0.0, 0.7, -2.5) if len(device.axes) == 3 else (0.0,) * 3
    for share, angle in zip((0.5, 0.1, 0.85), turned, strict=True):
        x, *y = (low + share * (high - low) for low, high in device.handle.used)
        yield [x, *(y or [0.0]), angle]


def seen_by_others(robot, positions):
    """{link: (x, y, angle)} in the base, as whoever reads this URDF finds them at these positions of its joints."""
    found, waiting = {"haptic_base_link": (0.0, 0.0, 0.0)}, robot.findall("joint")
    while waiting:
        joint = next(one for one in waiting if one.find("parent").get("link") in found)
        waiting.remove(joint)
        parent, origin = found[joint.find("parent").get("link")], joint.find("origin")
        x, y, _ = map(float, origin.get("xyz").split()) if origin is not None else (0.0,) * 3
        # along x or y, or about z
        along = [float(one) * positions[joint.get("name")] for one in joint.find("axis").get("xyz").split()]
        found[joint.find("child").get("link")] = (*turned((x + along[0], y + along[1]), parent), parent[2] + along[2])
    return found


@EACH
def test_whoever_reads_the_urdf_of_a_linkage_finds_the_handle_where_the_joints_put_it_and_loops_closed(device):
    robot, told = ElementTree.fromstring(urdf(device, "/haptic")), [joint.name for joint in tree(device)]
    assert told[: len(device.axes)] == [drive.name for drive in drives(device)]
    children = [joint.find("child").get("link") for joint in robot.findall("joint")]
    assert sorted(["haptic_base_link", *children]) == sorted(link.get("name") for link in robot.findall("link"))
    for joint, element in zip(device.joints, robot.findall("joint"), strict=False):
        limit = {key: float(value) for key, value in element.find("limit").items()}
        assert (limit["lower"], limit["upper"], limit["effort"]) == (*joint.limits, joint.limit)
    for place in places(device):
        position = drives_at(device, place)
        assert place_of(device, position) == pytest.approx(place, abs=1e-12)
        limits = [joint.limits for joint in device.joints]
        assert all(low <= at <= high for at, (low, high) in zip(position, limits, strict=False))
        found = seen_by_others(robot, dict(zip(told, states(device, position, MOTION)[0], strict=True)))
        x, y, angle = found["haptic_handle"]
        assert (x, y, math.remainder(angle - place[2], math.tau)) == pytest.approx((*place[:2], 0.0), abs=1e-12)
        if device.kinematics.type == "five_bar":  # the other branch ends there too
            end = turned((device.kinematics.distal, 0.0), found["haptic_distal_2"])
            assert end == pytest.approx((x, y), abs=1e-12)


@EACH
def test_joints_turn_as_fast_as_their_angles_change_while_the_handle_moves(device):
    step, velocity = 1e-6, MOTION if len(device.joints) > 1 else [MOTION[0], 0.0, 0.0]
    for place in places(device):
        before, after = (
            states(device, drives_at(device, [p + way * v for p, v in zip(place, velocity, strict=True)]), velocity)[0]
            for way in (-step, step)
        )
        seen = [math.remainder(b - a, math.tau) / (2.0 * step) for a, b in zip(before, after, strict=True)]
        assert states(device, drives_at(device, place), velocity)[1] == pytest.approx(seen, rel=1e-6, abs=1e-6)


@EACH
def test_the_transforms_of_a_linkage_end_where_the_pose_is(tf, device):
    tf(types.SimpleNamespace(TFMessage=types.SimpleNamespace))
    for place in places(device):
        node = Node()
        robot_state.RobotState(node, device).publish(0, drives_at(device, place), [0.0] * 3, [0.0] * 3)
        ways = {one.child_frame_id: one for one in node.said["/tf"][0].transforms}
        point, frame = (0.003, 0.004), "haptic_handle"
        while frame != "haptic_base_link":
            point, frame = carried(point, ways[frame].transform), ways[frame].header.frame_id
        assert point == pytest.approx(turned((0.003, 0.004), place), abs=1e-12)


def test_a_handle_that_cannot_be_there_is_told_nowhere_and_a_home_there_is_refused():
    device, node = load_device("serial_2r"), Node()
    otherwise = [0.5, -0.5, 0.0]  # assembled with the elbow on the other side
    robot_state.RobotState(node, device).publish(0, otherwise, [0.0] * 3, [0.0] * 3)
    assert node.said["joint_states"] == [] and place_of(device, otherwise) is None
    with pytest.raises(ValueError, match=r"cannot have its handle at x = 0.3 m, y = 0.3 m"):
        drives_at(device, [0.3, 0.3, 0.0])
