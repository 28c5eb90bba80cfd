# SPDX-License-Identifier: Apache-2.0
"""The running driver and loopback in the hands of a tool: looks at them, tunes the driver, leaves it as it was found.

A value that is no longer what this tool has set was set by somebody else: then the tool gives way.
"""

import contextlib
import signal
import time
from collections.abc import Iterator

import numpy as np
import rclpy
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from haptic_device.control.faults import NAMES
from haptic_device.control.records import TRACE_ROW
from haptic_device.message_fields import AXES, truth_names
from haptic_device.nodes.messages import LATEST, STREAM, TRACE, JointState, statuses_of
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, JointLayout
from haptic_device.status import Status, number
from haptic_sim.cli.mock_simulation import MockAnswerer, MockSimulation

PATIENCE = 15.0  # [s] for a service
ATTEMPTS = 5  # the answer to a client whom the service has not discovered yet is lost; all calls may be repeated
APPEARANCE = 60.0  # [s] for a driver that has just been started to be engaged; the first start compiles the kernels
POLICY = "passivity.policy"


class Tuning:
    """A node beside driver and loopback, without callbacks: `look` takes what has come. Raises ValueError sentences.

    With a `tool`, it answers the driver in place of a simulation whenever it looks.
    """

    def __init__(self, domain: int, namespace: str, trace: bool = False, tool: bool = False):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("haptic_tuning", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._state = PolledSubscription(self._node, "operator/state", JOINTS, STREAM, raw=True)
        self._said = PolledSubscription(self._node, "/diagnostics", DIAGNOSTICS, STREAM, raw=True)
        self._trace = PolledSubscription(self._node, "trace", CLOUD, TRACE) if trace else None
        self.tool = MockAnswerer(self._node, MockSimulation()) if tool else None
        self._target = self._node.create_publisher(JointState, "operator/target", LATEST)
        self._layouts = [JointLayout(truth_names(axes)) for axes in (1, 2, 3)]
        self._services = {}
        self.truths: list[dict] = []
        self.rows: list[np.ndarray] = []
        self.statuses: dict = {}
        self._held: dict = {}  # what this tool has set, of the parameters that it will put back

    def close(self) -> None:
        """Leaves the network."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def look(self) -> None:
        """Appends what came to `truths` (name: (position, velocity, effort)) and `rows`, and updates `statuses`."""
        for sample in self._state.take():
            self.truths += [
                _by_name(layout, sample.message) for layout in self._layouts if layout.matches(sample.message)
            ]
        for sample in self._said.take():
            self.statuses |= statuses_of(sample.message, sample.received)
        if self._trace is not None:
            self.rows += [_rows(sample.message) for sample in self._trace.take()]
        if self.tool is not None:
            self.tool.answer()

    def watch(self, seconds: float, aim=None) -> None:
        """Looks for so long; aim(elapsed) says every few milliseconds where the hand shall be (x, y, theta)."""
        began = time.monotonic()
        while (elapsed := time.monotonic() - began) < seconds:
            if aim is not None:
                self.aim(aim(elapsed))
            self.look()
            self.refuse_fault()
            time.sleep(0.004)

    def aim(self, point) -> None:
        """Where the loopback's hand shall go, as long as its motion is `follow`."""
        axes = AXES[: len([name for name in AXES if name in self.truths[-1]])] if self.truths else AXES
        message = JointState(name=list(axes), position=[float(value) for value in point[: len(axes)]])
        self._target.publish(message)

    def said(self, entry: str) -> str:
        """Last value of an entry of the driver's diagnostics, or an empty text."""
        return self.statuses["haptic_driver"].values.get(entry, "") if "haptic_driver" in self.statuses else ""

    def refuse_fault(self) -> None:
        """Raises ValueError if the driver is in fault."""
        if (name := self.said("fault")) in NAMES:
            raise ValueError(f"haptic_driver is in fault {name}: clear it first (~/reset, then ~/enable)")

    def wait_engaged(self, check=lambda: None) -> None:
        """Until the driver is engaged and the truth comes; ValueError if it is in fault or does not come."""
        end = time.monotonic() + APPEARANCE
        while time.monotonic() < end:
            check()
            self.look()
            self.refuse_fault()
            if self.said("state") == "engaged" and self.truths:
                return
            time.sleep(0.02)
        room = self._node.get_namespace()
        if not self.truths:
            raise ValueError(f"no loopback is heard of in {room}; start one, or let this command start both nodes")
        state = self.said("state") or "not heard of"
        raise ValueError(
            f"haptic_driver is {state}; start it with a loopback and enable it, or let this command start both"
        )

    def wait_answered(self, check=lambda: None) -> None:
        """Until a simulation answers the driver, whose first start compiles longer; ValueError if none does."""
        end = time.monotonic() + APPEARANCE
        while not number(self.said("exchange_answered")) > 0:
            if time.monotonic() > end:
                raise ValueError(f"no simulation answered the driver within {APPEARANCE:g} s")
            check()
            self.look()
            time.sleep(0.02)

    def recover(self) -> None:
        """Clears the driver's fault, and waits until it is engaged again."""
        self.trigger("reset")
        self.trigger("enable")
        self.look()  # what was said before the reset
        self.statuses.clear()
        self.wait_engaged()

    def get(self, names) -> dict:
        """Values of the driver's parameters; lists as tuples."""
        answer = self._call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
        values = [parameter_value_to_python(value) for value in answer.values]
        return {name: _plain(value) for name, value in zip(names, values, strict=True)}

    def set(self, **values) -> None:
        """Sets parameters of the driver, `__` for the dot, all or none; ValueError with its sentence if it refuses."""
        wanted = {name.replace("__", "."): value for name, value in values.items()}
        self._refuse_stranger()
        self._write(wanted)

    @contextlib.contextmanager
    def as_found(self, names) -> Iterator[dict]:
        """Yields the values of these parameters, and puts them back whatever ends the block.

        A tool of its own is let go of before, lest gains that come back pull the handle to it. The policy is off first:
        on a servo that runs late now, it might refuse gains that it had taken.
        """
        found = self.get({*names, POLICY})
        self._held = dict(found)
        try:
            yield found
        finally:
            with _undisturbed():
                if self.tool is not None:
                    time.sleep(sum(self.get(["exchange.hold", "exchange.fade"]).values()))
                self._write(found | {POLICY: "off"})
                self._write(found)
                self._held = {}

    def trigger(self, service: str) -> None:
        """Calls ~/enable, ~/reset and their like."""
        self._call(Trigger, service, Trigger.Request())

    def _refuse_stranger(self) -> None:
        for name, value in self.get(self._held).items():
            if value != self._held[name]:
                raise ValueError(
                    f"something else set {name} to {value} meanwhile, this command had set {self._held[name]}"
                )

    def _write(self, values) -> None:
        parameters = [_parameter(name, value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = self._call(SetParametersAtomically, "set_parameters_atomically", request).result
        if not result.successful:
            raise ValueError(f"haptic_driver refused: {result.reason}")
        self._held |= {name: value for name, value in values.items() if name in self._held}

    def _call(self, kind, name, request):
        if name not in self._services:
            self._services[name] = self._node.create_client(kind, f"haptic_driver/{name}")
        client = self._services[name]
        if not client.wait_for_service(PATIENCE):
            raise ValueError(
                f"haptic_driver offers no {name} in {self._node.get_namespace()}; does it run in this domain?"
            )
        for _ in range(ATTEMPTS):
            future = client.call_async(request)
            self._executor.spin_until_future_complete(future, PATIENCE / ATTEMPTS)
            if future.done():
                return future.result()
            client.remove_pending_request(future)
        raise ValueError(f"haptic_driver did not answer {name} within {PATIENCE:g} s")


def refuse_other_device(said: Status, device, described: bool = True) -> None:
    """ValueError unless the driver that said it has a device of this name, and if `described` of this damping."""
    theirs, ours = said.values.get("physical_damping", ""), ", ".join(f"{axis.damping:g}" for axis in device.axes)
    if said.hardware != device.name or (described and theirs != ours):
        raise ValueError(
            f"haptic_driver has the device {said.hardware}, physical damping {theirs}, and --device is {device.name}, "
            f"{ours}: give the description that the driver has"
        )


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Ctrl-C and its like wait until the block is over."""
    heard = []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: heard.append(True)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if heard:
        raise KeyboardInterrupt


def _rows(cloud) -> np.ndarray:
    """Servo ticks of a block of the trace. Raises ValueError where the driver is of another version."""
    if cloud.point_step != TRACE_ROW.itemsize:
        raise ValueError(
            f"a tick of the trace has {cloud.point_step} bytes, not {TRACE_ROW.itemsize}: "
            "the driver is of another version"
        )
    return np.frombuffer(cloud.data, TRACE_ROW)


def _plain(value):
    return tuple(value) if not isinstance(value, bool | int | float | str) and value is not None else value


def _parameter(name, value):
    kind = Parameter.Type.DOUBLE_ARRAY if isinstance(value, tuple) else None
    return Parameter(name, kind, list(value)) if kind else Parameter(name, value=value)


def _by_name(layout, data) -> dict:
    sample = layout.unpack(data)
    return dict(zip(layout.names, zip(sample.position, sample.velocity, sample.effort, strict=True), strict=True))
