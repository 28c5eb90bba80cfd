# SPDX-License-Identifier: Apache-2.0
"""A process that floods the topics which the nodes listen to, as fast as it is told, with what is not theirs.

`python test/fault_injection/flood.py RATE SECONDS`. Mutations of the right message, other names,
other sizes, NaN, noise.
"""

import math
import os
import random
import sys
import time

import numpy as np
import rclpy
from rclpy.context import Context

from haptic_device.message_fields import AXES, LOCAL_CONTACT, MOST, TAIL, exchange_names
from haptic_device.nodes.messages import LATEST, JointState, PointCloud2
from haptic_device.recording.layouts import CloudLayout, JointLayout
from haptic_display.run.processes import NAMESPACE

COMMAND = [sys.executable, __file__]
SENT = "sent "
TOPICS = ("tool", "handle", "operator/target")
KINDS = 64  # different messages a topic
MEETING = 10.0  # [s] at most until every topic has a listener
RARE = 20  # messages to one set of local contacts, which is ten times as long


def mutations(layout: JointLayout, count: int, seed: int = 1) -> list[bytes]:
    """Messages that begin as right ones of another session: bytes turned, cut, grown, numbers wild, names others."""
    dice, size = random.Random(seed), layout.count
    whole = layout.pack(0, *[[dice.choice((0.0, 1.0, 1e3, math.nan, math.inf, -1e300)) for _ in range(size)]] * 3)
    return [mutated(whole, dice) for _ in range(count)]


def mutated(message: bytes, dice: random.Random) -> bytes:
    """The message with something wrong in it."""
    data = bytearray(message)
    kind = dice.randrange(5)
    if kind == 0:
        for _ in range(dice.randrange(1, 9)):
            data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    elif kind == 1:
        data = data[: dice.randrange(4, len(data))]
    elif kind == 2:
        data += dice.randbytes(dice.randrange(1, 512))
    elif kind == 3:
        begin = dice.randrange(4, len(data))
        data[begin : begin + dice.randrange(1, 64)] = dice.randbytes(dice.randrange(1, 64))
    else:
        data = data[:4] + bytearray(dice.randbytes(dice.randrange(0, 2048)))
    return bytes(data)


def _messages() -> dict[str, list[bytes]]:
    exchanged = JointLayout(exchange_names(3))
    targets = [JointLayout(names) for names in (AXES[:2], ("a", "b", "c"), AXES + ("x",), TAIL)]
    foreign = [message for layout in targets for message in mutations(layout, KINDS // 4)]
    dice, contacts = random.Random(3), _contacts()
    return {
        "tool": mutations(exchanged, KINDS),
        "handle": mutations(exchanged, KINDS, 2),
        "operator/target": foreign,
        "local_contacts": [mutated(contacts, dice) for _ in range(KINDS)],
    }


def _contacts() -> bytes:
    return CloudLayout(LOCAL_CONTACT).pack(0, np.zeros(MOST, LOCAL_CONTACT))


def main() -> int:
    """Floods, and prints how many messages it sent."""
    rate, seconds = float(sys.argv[1]), float(sys.argv[2])
    context = Context()
    rclpy.init(context=context, domain_id=int(os.environ.get("ROS_DOMAIN_ID", "0") or "0"))
    node = rclpy.create_node("flood", namespace=NAMESPACE, context=context)
    messages = _messages()
    publishers = [(node.create_publisher(JointState, topic, LATEST), messages[topic]) for topic in TOPICS]
    contacts = node.create_publisher(PointCloud2, "local_contacts", LATEST)
    met = time.monotonic() + MEETING
    while time.monotonic() < met and not all(one.get_subscription_count() for one, _ in publishers):
        time.sleep(0.05)
    began, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - began) < seconds:
        for _ in range(max(0, int(elapsed * rate) - sent)):
            publisher, kinds = publishers[sent % len(publishers)]
            publisher.publish(kinds[sent // len(publishers) % len(kinds)])
            if sent % RARE == 0:
                contacts.publish(messages["local_contacts"][sent // RARE % KINDS])
            sent += 1
        time.sleep(0.0005)
    print(f"{SENT}{sent}", flush=True)
    node.destroy_node()
    rclpy.shutdown(context=context)
    return 0


if __name__ == "__main__":
    sys.exit(main())
