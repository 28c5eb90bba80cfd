# SPDX-License-Identifier: Apache-2.0
"""A publisher that a recorder hears, and what of its messages is in the bag on the disk."""

import time

import numpy as np
import yaml
from bag_of_a_run import joints
from ear import Listener
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from haptic_device.recording import load

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
BURST = 50  # messages sent at once: far fewer than any queue on the way to the recorder holds
PROBE = -1.0  # x of the messages sent until the recorder is there
STIFFNESS = "coupling.stiffness"


class Speaker(Listener):
    """Publishes numbered samples, and does so until the bag on the disk has them."""

    def __init__(self, ros_domain):
        super().__init__(ros_domain, "publisher", parameters=True)
        self._publishers, self._executor = {}, SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.node.declare_parameter(STIFFNESS, 750.0)

    def look(self, seconds=0.05):  # a bag is read in that time
        self._executor.spin_once(timeout_sec=seconds)

    def close(self):
        self._executor.shutdown()
        super().close()

    def begin(self, topic, qos=BEST_EFFORT):
        self._publishers[topic] = self.node.create_publisher(JointState, topic, qos)

    def end(self, topic):
        self.node.destroy_publisher(self._publishers.pop(topic))

    def say(self, topic, *numbers):
        if topic not in self._publishers:
            self.begin(topic)
        for number in numbers:
            self._publishers[topic].publish(joints(("x", "y"), [number, -number], time.time_ns()))

    def meet(self, bag, topic, number=PROBE):
        """Publishes this number until it is in the bag."""

        def there():
            self.say(topic, number)
            return number in kept(bag, topic)

        self.until(there, f"a message of {topic} in {bag}")

    def publish(self, bag, topic, count):
        """Publishes `count` numbered samples once the recorder hears, and waits until the last is on the disk."""
        self.meet(bag, topic)
        for first in range(0, count, BURST):
            last = min(count, first + BURST) - 1
            self.say(topic, *range(first, last + 1))
            self.until(lambda last=last: last in kept(bag, topic), f"message {last} of {topic} in {bag}")


def joint(bag, topic):
    """What is on the disk of a topic, of a bag that may still be written; None if there is nothing yet."""
    try:
        return load(bag).joint(topic)
    except (ValueError, OSError):
        return None


def kept(bag, topic):
    """Entry x of every message of a topic on the disk."""
    found = joint(bag, topic)
    return np.zeros(0) if found is None else found.entry("x")


def numbers(bag, topic):
    """The same without the probes."""
    found = kept(bag, topic)
    return found[found != PROBE]


def custom_data(bag):
    """What the recorder says of a bag that has ended, its losses too."""
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["custom_data"]
