# SPDX-License-Identifier: Apache-2.0
"""The running driver and loopback in the hands of a tool: looks at them, tunes the driver, leaves it as it was found.

A value that is no longer what this tool has set was set by somebody else: then the tool gives way.
"""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from haptic_device.config.description import Device
from haptic_device.control.faults import FAULTS
from haptic_device.control.records import TRACE_ROW
from haptic_device.nodes.messages import TRACE
from haptic_device.recording.layouts import CLOUD
from haptic_device.recording.status import Status, number
from haptic_display.client import Client
from haptic_display.device_tools.mock_simulation import MockAnswerer, MockSimulation
from haptic_display.run.news import News
from haptic_display.run.processes import undisturbed
from haptic_display.service_requests import Question, RefusedError, get_parameters, set_parameters, trigger

DRIVER, LOOPBACK, SIMULATION = "haptic_driver", "haptic_loopback", "haptic_simulation"
PATIENCE = 15.0  # [s] for a service
AGAIN = 3.0  # [s] without an answer after which it is asked once more; all calls may be repeated
POLICY = "passivity.policy"
Check = Callable[[], dict[str, str]]
"""May raise, and gives the last line that each node printed whose log is at hand."""


class FaultError(ValueError):
    """The driver is in fault; its name is `fault`."""

    def __init__(self, fault: str):
        super().__init__(f"{DRIVER} is in fault {fault}: clear it first (~/reset, then ~/enable)")
        self.fault = fault


class Tuning:
    """A client beside driver and loopback. Raises ValueError sentences.

    With a `tool`, it answers the driver in place of a simulation whenever it looks.
    """

    def __init__(self, domain: int, namespace: str, trace: bool = False, tool: bool = False):
        self._client = Client.join("haptic_tuning", domain, namespace, every_truth=True)
        self._trace = self._client.subscribe("trace", CLOUD, TRACE) if trace else None
        self.tool = MockAnswerer(self._client.node, MockSimulation()) if tool else None
        self.aim, self.close = self._client.aim, self._client.close
        self.truths, self.statuses = self._client.truths, self._client.statuses
        self.rows: list[np.ndarray] = []
        self._held: dict[str, Any] = {}  # what this tool has set, of the parameters that it will put back

    def look(self) -> None:
        """Appends what came to `truths` (name: (position, velocity, effort)) and `rows`, and updates `statuses`."""
        self._client.look()
        if self._trace is not None:
            self.rows += [_rows(sample.message) for sample in self._trace.take()]
        if self.tool is not None:
            self.tool.answer()

    def watch(self, seconds: float, aim: Callable[[float], Iterable[float]] | None = None) -> None:
        """Looks for so long; aim(elapsed) says every few milliseconds where the hand shall be (x, y, theta)."""
        began = time.monotonic()
        while (elapsed := time.monotonic() - began) < seconds:
            if aim is not None:
                self.aim(aim(elapsed))
            self.look()
            self.refuse_fault()
            time.sleep(0.004)

    def said(self, entry: str) -> str:
        """Last value of an entry of the driver's diagnostics, or an empty text."""
        return self._client.said(DRIVER, entry)

    def refuse_fault(self) -> None:
        """Raises FaultError if the driver is in fault."""
        if (name := self.said("fault")) in FAULTS:
            raise FaultError(name)

    def wait_engaged(self, check: Check = dict) -> None:
        """Until the driver is engaged and what this tool looks at comes, the trace, or else a simulated device's truth.

        ValueError if the driver is in fault, or there is no more news.
        """
        looked_at = self.rows if self._trace is not None else self.truths

        def engaged() -> object:
            self.refuse_fault()
            return self.said("state") == "engaged" and looked_at

        wanted = "a loopback" if self._trace is None else "a trace (publish.trace)"
        lack = f"no engaged driver with {wanted} is heard in {self._client.node.get_namespace()}"
        self._wait(engaged, check, lack, LOOPBACK, "start both and enable the driver, or let this command start them")

    def wait_answered(self, check: Check = dict) -> None:
        """Until a simulation answers the driver; ValueError if there is no more news."""

        def answered() -> bool:
            return number(self.said("exchange_answered")) > 0

        self._wait(answered, check, "no simulation answers the driver", SIMULATION, "start one")

    def _wait(self, condition: Callable[[], object], check: Check, lack: str, other: str, todo: str) -> None:
        """todo: what to do where the nodes are somebody else's."""
        news = News(self._client, DRIVER, other)
        while True:
            printed = check()
            self.look()
            if condition():
                return
            if news.ended(printed):
                todo = "" if printed else f"; {todo}"
                raise ValueError(f"{lack}, and {news.last_words()}{todo}")
            time.sleep(0.02)

    def recover(self) -> None:
        """Clears the driver's fault, and waits until it is engaged again."""
        self.trigger("reset")
        self.trigger("enable")
        self.look()  # what was said before the reset
        self.statuses.clear()
        self.wait_engaged()

    def get(self, names: Iterable[str]) -> dict[str, Any]:
        """Values of the driver's parameters; lists as tuples."""
        return self._call(get_parameters(DRIVER, names))

    def set(self, **values: Any) -> None:
        """Sets parameters of the driver, `__` for the dot, all or none; ValueError with its sentence if it refuses."""
        wanted = {name.replace("__", "."): value for name, value in values.items()}
        self._refuse_stranger()
        self._write(wanted)

    @contextlib.contextmanager
    def as_found(self, names: Iterable[str]) -> Iterator[dict[str, Any]]:
        """Yields the values of these parameters, and puts them back whatever ends the block.

        A tool of its own is let go of before, lest gains that come back pull the handle to it. The policy is off first:
        on a servo that runs late now, it might refuse gains that it had taken.
        """
        found = self.get({*names, POLICY})
        self._held = dict(found)
        try:
            yield found
        finally:
            with undisturbed():
                if self.tool is not None:
                    time.sleep(sum(self.get(["exchange.hold", "exchange.fade"]).values()))
                self._write(found | {POLICY: "off"})
                self._write(found)
                self._held = {}

    def trigger(self, service: str) -> None:
        """Calls ~/enable, ~/reset and their like, whether it refuses or not."""
        with contextlib.suppress(RefusedError):
            self._call(trigger(f"{DRIVER}/{service}"))

    def _refuse_stranger(self) -> None:
        for name, value in self.get(self._held).items():
            if value != self._held[name]:
                raise ValueError(
                    f"something else set {name} to {value} meanwhile, this command had set {self._held[name]}"
                )

    def _write(self, values: dict[str, Any]) -> None:
        try:
            self._call(set_parameters(DRIVER, values))
        except RefusedError as refusal:
            raise ValueError(f"{DRIVER} refused: {refusal}") from None
        self._held |= {name: value for name, value in values.items() if name in self._held}

    def _call(self, question: Question) -> Any:
        return self._client.call(question, patience=PATIENCE, again=AGAIN)


def refuse_other_device(said: Status, device: Device, described: bool = True) -> None:
    """ValueError unless the driver that said it has a device of this name, and if `described` of this damping."""
    theirs, ours = said.values.get("physical_damping", ""), ", ".join(f"{axis.damping:g}" for axis in device.axes)
    if said.hardware != device.name or (described and theirs != ours):
        raise ValueError(
            f"haptic_driver has the device {said.hardware}, physical damping {theirs}, and --device is {device.name}, "
            f"{ours}: give the description that the driver has"
        )


def _rows(cloud: Any) -> np.ndarray:
    """Servo ticks of a block of the trace. Raises ValueError where the driver is of another version."""
    if cloud.point_step != TRACE_ROW.itemsize:
        raise ValueError(
            f"a tick of the trace has {cloud.point_step} bytes, not {TRACE_ROW.itemsize}: "
            "the driver is of another version"
        )
    return np.frombuffer(cloud.data, TRACE_ROW)
