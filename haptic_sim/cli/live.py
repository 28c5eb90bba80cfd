# SPDX-License-Identifier: Apache-2.0
"""What the running nodes say, looked at a few times a second: the loopback's truth and everyone's diagnostics."""

import time

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from haptic_device.message_fields import AXES, truth_names
from haptic_device.nodes.messages import LATEST, STREAM, statuses_of
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.recording.layouts import DIAGNOSTICS, JOINTS, JointLayout, JointSample
from haptic_device.status import Status
from haptic_sim.cli.commands import Commands
from haptic_sim.cli.processes import NAMESPACE


class Live:
    """A small node without an executor: `look` takes what waits, nothing wakes it in between."""

    def __init__(self, domain: int, name: str = "haptic_demo"):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(name, namespace=NAMESPACE, context=self._context)
        self._truth = PolledSubscription(self._node, "operator/state", JOINTS, LATEST, raw=True)
        self._said = PolledSubscription(self._node, "/diagnostics", DIAGNOSTICS, STREAM, raw=True)
        self._layouts = [JointLayout(truth_names(axes)) for axes in (1, 2, 3)]
        self.truth: dict[str, tuple[float, float, float]] = {}
        self.statuses: dict[str, Status] = {}
        self.heard: dict[str, float] = {}
        self.commands = Commands(self._node, self._context)

    def look(self) -> None:
        """Brings `truth` (name: position, velocity, effort), `statuses` (name: last one) and `heard` [s] up to date."""
        if (sample := self._truth.latest()) is not None:
            self._read_truth(sample.message)
        for sample in self._said.take():
            found = statuses_of(sample.message, sample.received)
            self.statuses |= found
            self.heard |= dict.fromkeys(found, time.monotonic())

    def close(self) -> None:
        """Leaves the network."""
        self.commands.close()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    @property
    def motor_force(self) -> float:
        """Magnitude of the motor's force on the handle [N], in translation."""
        return sum(self.truth[name][2] ** 2 for name in ("motor_x", "motor_y") if name in self.truth) ** 0.5

    @property
    def motor_commanded(self) -> bool:
        """Whether the motor pushes or turns at all."""
        return any(self.truth.get(f"motor_{axis}", (0, 0, 0))[2] != 0 for axis in AXES)

    @property
    def motion_done(self) -> bool:
        """Whether the operator's scripted motion has ended."""
        return bool(self.truth.get("motion_done", (0.0,))[0])

    def said(self, node: str, entry: str) -> str:
        """Last value of a node's diagnostic entry, or an empty text."""
        return self.statuses[node].values.get(entry, "") if node in self.statuses else ""

    def _read_truth(self, data: bytes) -> None:
        for layout in self._layouts:
            if layout.matches(data):
                self.truth = _by_name(layout, layout.unpack(data))


def _by_name(layout: JointLayout, sample: JointSample) -> dict[str, tuple[float, float, float]]:
    return dict(zip(layout.names, zip(sample.position, sample.velocity, sample.effort, strict=True), strict=True))
