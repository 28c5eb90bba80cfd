#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A node beside the display: prints the greatest force on the hand so far, whenever it has grown by a tenth.

python3 greatest_force.py --ros-args -r __ns:=/haptic
"""

import math
import signal

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions

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
    """Runs until it is told to end, also in the middle of a message: rclpy's own handler ends its context under it."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    told = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told.append(True))
    node = GreatestForce()
    while not told:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
