# SPDX-License-Identifier: Apache-2.0
"""In place of a ROS node: it keeps what is published."""

import types

from haptic_device.realtime.session_clock import SessionClock


class Said(list):
    """A publisher that keeps what is published, for so many listeners."""

    publish, listeners = list.append, 1

    def get_subscription_count(self):
        return self.listeners

    def wait_for_all_acked(self, timeout):
        return True


class Node:
    """`said` has what was published, by topic."""

    def __init__(self, listeners=1):
        self.said, self.listeners, self.clock = {}, listeners, SessionClock()

    def get_namespace(self):
        return "/haptic"

    def get_clock(self):
        return types.SimpleNamespace(now=lambda: types.SimpleNamespace(nanoseconds=5_000_000_000))

    def create_publisher(self, kind, topic, qos):
        said = self.said.setdefault(topic, Said())
        said.listeners = self.listeners
        return said

    def destroy_publisher(self, publisher):
        """It is kept."""
