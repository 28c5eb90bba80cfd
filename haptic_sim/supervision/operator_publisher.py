# SPDX-License-Identifier: Apache-2.0
"""A recorded hand as the target of a running loopback device, in real time."""

import contextlib
import time

from haptic_device import ros_environment
from haptic_device.recording.layouts import JointLayout
from haptic_sim.client import Client
from haptic_sim.replay.recorded_operator import PlayedTarget

PATIENCE = 10.0  # [s] for the loopback device to listen


def play(target: PlayedTarget, axes: tuple[str, ...], scale: tuple[float, ...], namespace: str) -> int:
    """Publishes the target on `operator/target` when it is due; number of samples. Raises ValueError if nobody listens.

    axes: those of the device; scale: world metres (radians) per metre (radian) of each.
    """
    with contextlib.closing(Client.join("haptic_replay", ros_environment.domain(), namespace)) as client:
        _await_listener(client.target)
        return publish(target, client.target, JointLayout(axes), scale)


def _await_listener(publisher) -> None:
    end = time.monotonic() + PATIENCE
    while publisher.get_subscription_count() == 0:
        if time.monotonic() > end:
            raise ValueError(f"nobody listens on {publisher.topic_name}: start haptic_loopback with motion.name follow")
        time.sleep(0.02)


def publish(target: PlayedTarget, publisher, layout: JointLayout, scale: tuple[float, ...]) -> int:
    """The target on this publisher, each sample when it is due; how many."""
    began, none = time.monotonic(), [0.0] * layout.count
    first = int(target.times[0])
    for when, point in zip(target.times, target.points, strict=True):
        time.sleep(max(0.0, began + (int(when) - first) * 1e-9 - time.monotonic()))
        position = [part * factor for part, factor in zip(point, scale, strict=False)][: layout.count]
        publisher.publish(layout.pack(time.time_ns(), position, none, none))
    return len(target.times)
