# SPDX-License-Identifier: Apache-2.0
"""The device as a robot of ROS: joints, URDF, and transforms that end where the handle is."""

import importlib
import sys
import types
from xml.etree import ElementTree

import pytest
from fake_node import Node

from haptic_device.config.description import load_device
from haptic_device.nodes import robot_state, transforms
from haptic_device.nodes.urdf import links, urdf
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
    assert links(load_device("desktop")) == ("base_link", "x_link", "y_link", "handle")
