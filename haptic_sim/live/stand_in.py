# SPDX-License-Identifier: Apache-2.0
"""A tool that turns to where it is told, answering the driver in place of a simulation: the coupling turns the handle.

Beside the handle in x and y, and never farther from it in theta than the leash, so that the torque is bounded wherever
the handle is.
"""

import time

from haptic_device.nodes.messages import LATEST, JointState
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.recording.layouts import JOINTS
from haptic_sim.node.endpoint import Port
from haptic_sim.simulation import ToolSample

STILL = (0.0, 0.0, 0.0)


class StandIn:
    """`angle` [rad]: where the tool wants to be; `leash` [rad]: its largest distance from the handle."""

    def __init__(self, node):
        self._node, self._port = node, Port(STILL)
        self._handle = PolledSubscription(node, "handle", JOINTS, LATEST, raw=True)
        self._publisher = node.create_publisher(JointState, "tool", LATEST)
        self.angle = self.leash = 0.0

    def refuse_company(self) -> None:
        """Raises ValueError if somebody else answers the driver."""
        if self._node.count_publishers("tool") > 1:
            raise ValueError("a simulation answers the driver, so theta cannot be turned; end it first")

    def answer(self) -> None:
        """Answers the newest handle sample, if there is one."""
        sample = self._handle.latest()
        question = self._port.take(sample.message, time.monotonic_ns()) if sample else None
        if question is None:
            return
        x, y, theta = question.handle.position
        theta = min(theta + self.leash, max(theta - self.leash, self.angle))
        self._publisher.publish(self._port.answer(question, ToolSample((x, y, theta), STILL, STILL, False, 0.0)))
