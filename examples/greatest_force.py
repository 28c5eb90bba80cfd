#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A node beside the display: prints the greatest force on the hand so far, whenever it has grown by a tenth.

python3 greatest_force.py --ros-args -r __ns:=/haptic
"""

import math
import signal

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

LEAST = 0.01  # [N] below which nothing is said


class GreatestForce(Node):
    """Listens to `wrench`: what the motors do to the handle, in the device's frame, 100 times a second."""

    def __init__(self):
        super().__init__("greatest_force")
        self.greatest = 0.0  # [N] that was said last
        # Streams of the display are best effort: a reliable subscription would never get a message.
        self.create_subscription(WrenchStamped, "wrench", self._on_wrench, qos_profile_sensor_data)

    def _on_wrench(self, message):
        force = math.hypot(message.wrench.force.x, message.wrench.force.y)
        if force > max(LEAST, 1.1 * self.greatest):
            self.greatest = force
            self.get_logger().info(f"greatest force on the hand: {force:.2f} N")


def main():
    """Runs until Ctrl-C, which ends rclpy's context; a KeyboardInterrupt might come in the middle of a message."""
    signal.signal(signal.SIGINT, lambda *_: None)
    rclpy.init()
    node = GreatestForce()
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
