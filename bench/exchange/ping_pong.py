# SPDX-License-Identifier: Apache-2.0
"""A bare answerer in the simulation's place: every handle sample comes back as it is, with what makes it an answer.

It waits for bytes as the simulation does, and computes nothing: the least round trip that this middleware has.
"""

import struct
import sys

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from haptic_device.control import exchange_samples
from haptic_device.message_fields import AXES, exchange_names
from haptic_device.nodes.lifecycle import hear_the_end
from haptic_device.nodes.messages import LATEST, JointState
from haptic_device.nodes.polled_subscription import Untouched
from haptic_device.realtime.scheduling import go_realtime
from haptic_device.recording.layouts import JointLayout

LOOK_UP_NS = 50_000_000
PRIORITY = 60
SESSION = 4711.0


def main() -> int:
    """Answers until SIGINT or SIGTERM."""
    told = hear_the_end()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("haptic_simulation", namespace="/haptic")
    publisher = node.create_publisher(JointState, "tool", LATEST)
    subscription = node.create_subscription(
        JointState, "handle", lambda data: None, LATEST, raw=True, callback_group=Untouched()
    )
    go_realtime("prefer", PRIORITY)
    place = JointLayout(exchange_names(len(AXES))).offsets[0] + 8 * (len(AXES) + exchange_samples.SESSION)
    wait_set, sequence = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle), 0.0
    while not told:
        wait_set.clear_entities()
        wait_set.add_subscription(subscription.handle)
        wait_set.wait(LOOK_UP_NS)
        if (data := _latest(subscription)) is not None:
            sequence += 1.0
            publisher.publish(_answer(data, place, sequence))
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def _latest(subscription):
    latest = None
    while (taken := subscription.handle.take_message(JointState, True)) is not None:
        latest = taken[0]
    return latest


def _answer(data, place, sequence):
    answer = bytearray(data)
    asked = struct.unpack_from("<dd", answer, place)  # session and sequence stand first, then those that are answered
    struct.pack_into("<dddd", answer, place, SESSION, sequence, *asked)
    return bytes(answer)


if __name__ == "__main__":
    sys.exit(main())
