# SPDX-License-Identifier: Apache-2.0
"""A bare answerer in the simulation's place: every handle sample comes back as it is, with what makes it an answer.

The simulation's own thread takes the bytes, and computes nothing: the least round trip that this middleware has.
"""

import struct
import sys
import time

import rclpy
from rclpy.signals import SignalHandlerOptions

from haptic_device.control import exchange_samples
from haptic_device.message_fields import AXES, exchange_names
from haptic_device.nodes.lifecycle import hear_the_end
from haptic_device.nodes.messages import LATEST, JointState
from haptic_device.realtime.scheduling import go_realtime
from haptic_device.recording.layouts import JointLayout
from haptic_sim.node.exchange_thread import ExchangeThread

LOOK_UP = 0.05  # [s]
PRIORITY = 60
SESSION = 4711.0
PLACE = JointLayout(exchange_names(len(AXES))).offsets[0] + 8 * (len(AXES) + exchange_samples.SESSION)


def main() -> int:
    """Answers until SIGINT or SIGTERM."""
    told = hear_the_end()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("haptic_simulation", namespace="/haptic")
    publisher = node.create_publisher(JointState, "tool", LATEST)
    sequence = 0.0

    def turn(messages):
        nonlocal sequence
        if messages:
            sequence += 1.0
            publisher.publish(_answer(messages[-1], sequence))

    thread = ExchangeThread(node, turn, lambda: go_realtime("prefer", PRIORITY))
    thread.start()
    while not told:
        time.sleep(LOOK_UP)
    thread.stop()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def _answer(data, sequence):
    answer = bytearray(data)
    asked = struct.unpack_from("<dd", answer, PLACE)  # session and sequence stand first, then those that are answered
    struct.pack_into("<dddd", answer, PLACE, SESSION, sequence, *asked)
    return bytes(answer)


if __name__ == "__main__":
    sys.exit(main())
