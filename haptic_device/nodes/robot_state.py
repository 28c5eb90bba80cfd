# SPDX-License-Identifier: Apache-2.0
"""The device as other tools of ROS know a robot: `joint_states`, `robot_description`, and its frames on /tf."""

from haptic_device.message_fields import frame_id
from haptic_device.nodes import messages
from haptic_device.nodes.transforms import Transforms
from haptic_device.nodes.urdf import states, tree, urdf
from haptic_device.recording.layouts import JointLayout


class RobotState:
    """Publishes a device's joints, in the device's own units [m | rad], and what they are joints of."""

    def __init__(self, node, device):
        self._node, self._device, self._tree, room = node, device, tree(device), node.get_namespace()
        self._layout = JointLayout([joint.name for joint in self._tree])
        self._joints = node.create_publisher(messages.JointState, "joint_states", messages.TRACE)
        self._description = node.create_publisher(messages.String, "robot_description", messages.STATE)
        self._description.publish(messages.String(data=urdf(device, room)))
        self._frames = [(frame_id(room, joint.parent), frame_id(room, joint.child)) for joint in self._tree]
        self._transforms = Transforms(node, [(frame_id(room, "map"), frame_id(room, "base_link"), (0.0, 0.0, 0.0))])

    def publish(self, stamp_ns, position, velocity, effort):
        """Tells the joints at a stamp [ns], and nothing of a linkage whose handle cannot be there.

        position, effort: of three drives [m | rad], [N | N m]; velocity: of the handle at the device.
        """
        if (found := states(self._device, position, velocity)) is None:
            return
        places, speeds = found
        n, passive = len(self._device.axes), len(self._tree) - len(self._device.axes)
        self._joints.publish(self._layout.pack(stamp_ns, places, speeds, [*effort[:n], *[0.0] * passive]))
        moved = (_moved(*one) for one in zip(self._tree, places, strict=True))
        self._transforms.publish(stamp_ns, ((*ends, way) for ends, way in zip(self._frames, moved, strict=True)))

    def close(self):
        """Ends the publishers."""
        self._transforms.close()
        for publisher in (self._joints, self._description):
            self._node.destroy_publisher(publisher)


def _moved(joint, position):
    """(x, y, θ) of its child in its parent."""
    (x, y), kind = joint.place, joint.kind
    return x + position * (kind == "x"), y + position * (kind == "y"), position * (kind == "theta")
