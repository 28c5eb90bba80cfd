# SPDX-License-Identifier: Apache-2.0
"""`haptic mark`: a marker into the bag that is being recorded."""

import contextlib
import time
from typing import Annotated

import typer

from haptic_device import ros_environment
from haptic_display.run.processes import NAMESPACE

PATIENCE = 10.0  # [s] to find the recorder, and again for its acknowledgement
RECORDER = "haptic_recorder"


def mark(
    text: Annotated[str, typer.Argument(help="Text of the marker.")],
    namespace: Annotated[str, typer.Option(help="Namespace of the system.")] = NAMESPACE,
) -> None:
    """Set a marker in the bag that is being recorded, at this moment. Exit code 1 if nobody records."""
    from haptic_display.client import Client

    with contextlib.closing(Client.join("haptic_mark", ros_environment.domain(), namespace)) as client:
        _send(client.node, text)


def _send(node, text: str) -> None:
    from rclpy.duration import Duration

    from haptic_device.nodes.messages import TRACE, String

    publisher = node.create_publisher(String, "mark", TRACE)
    end = time.monotonic() + PATIENCE
    while not _heard(node, publisher):
        if time.monotonic() > end:
            why = ros_environment.discovery() or "start haptic record first"
            raise ValueError(f"no {RECORDER} listens on {publisher.topic_name}; {why}")
        time.sleep(0.02)
    publisher.publish(String(data=text))
    if not publisher.wait_for_all_acked(Duration(seconds=PATIENCE)):
        raise ValueError(f"{RECORDER} did not acknowledge the marker within {PATIENCE:g} s")


def _heard(node, publisher) -> bool:
    listeners = node.get_subscriptions_info_by_topic(publisher.topic_name)
    return publisher.get_subscription_count() > 0 and any(info.node_name == RECORDER for info in listeners)
