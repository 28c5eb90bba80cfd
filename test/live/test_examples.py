# SPDX-License-Identifier: Apache-2.0
"""The example's own node, run as a plain file beside a display."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from waiting import exit_code, until

EXAMPLE = Path(__file__).parents[2] / "examples/greatest_force.py"


@contextlib.contextmanager
def driver(domain):
    """push(x, y) [N] is published as a driver's wrench in /left."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("driver", namespace="left", context=context, enable_rosout=False)
    wrench = node.create_publisher(WrenchStamped, "wrench", qos_profile_sensor_data)

    def push(x, y):
        message = WrenchStamped()
        message.wrench.force.x, message.wrench.force.y = x, y
        wrench.publish(message)

    try:
        yield push
    finally:
        node.destroy_node()
        context.shutdown()


def test_the_example_prints_each_greater_force_in_its_namespace_and_ends_on_ctrl_c(start, ros_domain, tmp_path):
    log = tmp_path / "log"

    def said():
        return [line.partition("hand: ")[2] for line in log.read_text().splitlines() if "greatest force" in line]

    with log.open("w") as stream, driver(ros_domain) as push:
        command = [sys.executable, str(EXAMPLE), "--ros-args", "-r", "__ns:=/left"]
        node = start(command, stdout=stream, stderr=subprocess.STDOUT)
        for force, lines in (((3.0, -4.0), ["5.00 N"]), ((0.0, 12.0), ["5.00 N", "12.00 N"])):
            until(lambda lines=lines: said() == lines, f"{lines}", lambda force=force: push(*force))
        node.send_signal(signal.SIGINT)
        assert exit_code(node) == 0
    assert "Traceback" not in log.read_text()
