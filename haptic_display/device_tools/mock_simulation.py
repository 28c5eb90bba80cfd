# SPDX-License-Identifier: Apache-2.0
"""A tool that turns to where it is told, in place of a simulation: the coupling then turns the handle."""

import time

from rclpy.node import Node

from haptic_device.nodes.messages import LATEST, JointState
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.recording.layouts import JOINTS
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.exchange.port import HandleSample
from haptic_sim.exchange.simulation import Counters, ToolSample
from haptic_sim.protocol import STILL


class MockSimulation:
    """A tool beside the handle in x and y, and never farther from it in theta than the leash, so that the torque is
    bounded wherever the handle is. `angle` [rad]: where the tool wants to be; `leash` [rad]: its largest distance.
    """

    sub_step_ns, counters = 1_000_000, Counters()  # it makes none

    def __init__(self) -> None:
        self.angle = self.leash = 0.0

    def exchange(self, handle: HandleSample, most: int | None = None) -> ToolSample:
        """The tool where it is told to be, as far as the leash lets it."""
        x, y, theta = handle.position
        theta = min(theta + self.leash, max(theta - self.leash, self.angle))
        return ToolSample((x, y, theta), STILL, STILL, False, 0.0)

    def rejoin(self) -> None:
        """A tool without motion of its own has no time base."""


class MockAnswerer:
    """Has the driver's handle samples answered by a mock simulation, whenever somebody looks."""

    def __init__(self, node: Node, simulation: MockSimulation):
        self._node, self.simulation, self._endpoint = node, simulation, ExchangeEndpoint(simulation, STILL)
        self._handle = PolledSubscription(node, "handle", JOINTS, LATEST, raw=True)
        self._publisher = node.create_publisher(JointState, "tool", LATEST)

    def refuse_company(self) -> None:
        """Raises ValueError if somebody else answers the driver."""
        if self._node.count_publishers("tool") > 1:
            raise ValueError("a simulation answers the driver, so theta cannot be turned; end it first")

    def answer(self) -> None:
        """Answers the newest handle sample, if there is one."""
        waiting = [sample.message for sample in self._handle.take()]
        if (tool := self._endpoint.answer(waiting, time.monotonic_ns())) is not None:
            self._publisher.publish(tool)
