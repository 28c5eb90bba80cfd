# SPDX-License-Identifier: Apache-2.0
"""A recorded hand as the target of a running loopback device, in real time."""

import os
import time

import rclpy
from rclpy.context import Context

from haptic_device.nodes.messages import LATEST, JointState
from haptic_device.recording.layouts import JointLayout
from haptic_sim.played import PlayedTarget

PATIENCE = 10.0  # [s] for the loopback device to listen


def play(target: PlayedTarget, axes: tuple[str, ...], scale: tuple[float, ...], namespace: str) -> int:
    """Publishes the target on `operator/target` when it is due; number of samples. Raises ValueError if nobody listens.

    axes: those of the device; scale: world metres (radians) per metre (radian) of each.
    """
    context = Context()
    rclpy.init(context=context, domain_id=int(os.environ.get("ROS_DOMAIN_ID", "0") or "0"))
    try:
        node = rclpy.create_node("haptic_replay", namespace=namespace, context=context)
        publisher = node.create_publisher(JointState, "operator/target", LATEST)
        _await_listener(publisher)
        return _publish(target, publisher, JointLayout(axes), scale)
    finally:
        rclpy.shutdown(context=context)


def _await_listener(publisher) -> None:
    end = time.monotonic() + PATIENCE
    while publisher.get_subscription_count() == 0:
        if time.monotonic() > end:
            raise ValueError(f"nobody listens on {publisher.topic_name}: start haptic_loopback with motion.name follow")
        time.sleep(0.02)


def _publish(target, publisher, layout, scale) -> int:
    began, none = time.monotonic(), [0.0] * layout.count
    first = int(target.times[0])
    for when, point in zip(target.times, target.points, strict=True):
        time.sleep(max(0.0, began + (int(when) - first) * 1e-9 - time.monotonic()))
        position = [part * factor for part, factor in zip(point, scale, strict=False)][: layout.count]
        publisher.publish(layout.pack(time.time_ns(), position, none, none))
    return len(target.times)
