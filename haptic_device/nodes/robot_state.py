# SPDX-License-Identifier: Apache-2.0
"""The device as other tools of ROS know a robot: `joint_states`, `robot_description`, and its frames on /tf."""

from haptic_device.message_fields import AXES, frame_id
from haptic_device.nodes import messages
from haptic_device.nodes.transforms import Transforms
from haptic_device.nodes.urdf import links, urdf
from haptic_device.recording.layouts import JointLayout


class RobotState:
    """Publishes a device's joints, in the device's own units [m, m, rad], and what they are joints of."""

    def __init__(self, node, device):
        self._node, room = node, node.get_namespace()
        self._layout = JointLayout(AXES[: len(device.axes)])
        self._joints = node.create_publisher(messages.JointState, "joint_states", messages.TRACE)
        self._description = node.create_publisher(messages.String, "robot_description", messages.STATE)
        self._description.publish(messages.String(data=urdf(device, room)))
        self._frames = [frame_id(room, link) for link in links(device)]
        self._transforms = Transforms(node, [(frame_id(room, "map"), self._frames[0], (0.0, 0.0, 0.0))])

    def publish(self, stamp_ns, position, velocity, effort):
        """Tells the joints at a stamp [ns]: position [m | rad], velocity, the motor's effort [N | N m], one an axis."""
        n = self._layout.count
        self._joints.publish(self._layout.pack(stamp_ns, position[:n], velocity[:n], effort[:n]))
        ways = (tuple(position[i] if i == axis else 0.0 for i in range(3)) for axis in range(n))
        self._transforms.publish(stamp_ns, zip(self._frames, self._frames[1:], ways, strict=False))

    def close(self):
        """Ends the publishers."""
        self._transforms.close()
        for publisher in (self._joints, self._description):
            self._node.destroy_publisher(publisher)
