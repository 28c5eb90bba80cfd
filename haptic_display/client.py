# SPDX-License-Identifier: Apache-2.0
"""One ROS client for pages, commands and tests: hears what the nodes say, asks their services, leads the hand.

It has no thread, no executor and no callback: `look` takes what has come, and a question is polled until it is
answered.

    with contextlib.closing(Client.join("haptic_status", domain, "/haptic")) as client:
        client.prepare("haptic_driver/estop")              # known from now on, so that the first request goes at once
        client.look()                                      # statuses, heard, truth are up to date
        client.call(trigger("haptic_driver/estop"))        # in a loop: waits, polling
        await client.acall(get_parameters("haptic_driver", ["servo.rate"]))  # beside asyncio: the same, sleeping there

A question is asked again until it is answered, for the answer to a client that the service has not met yet is lost.
again=None asks once what must not be heard twice. The ROS graph may never show a service that is there
(ros2/rmw_fastrtps#792): it is asked all the same, unless wait=False or again=None. What fails is a ValueError of one
sentence; RefusedError is the node's own (service_requests.py). `Client(node)` works on a node that is there, whose
executor, if it is rclpy's SingleThreadedExecutor, does not touch what is polled here; the events executor would take
it away.
"""

import asyncio
import functools
import posixpath
import time
from collections.abc import Iterable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from haptic_device import ros_environment
from haptic_device.message_fields import AXES, truth_names
from haptic_device.nodes.messages import LATEST, STREAM, JointState, statuses_of
from haptic_device.nodes.polled_subscription import PolledSubscription, Untouched
from haptic_device.nodes.ros import begin_ros, made
from haptic_device.recording.layouts import DIAGNOSTICS, JOINTS, JointLayout
from haptic_device.recording.status import Status, of_namespace
from haptic_display.service_requests import Question, kind_of

AGAIN = 0.3  # [s] without an answer after which a service is asked once more
UNSHOWN = 1.0  # [s] for the graph to show a service, counted from its client's start; then it is asked all the same
PATIENCE = 3.0  # [s] for an answer
LOOK_PERIOD = 0.002  # [s] between two looks for it
LAYOUTS = tuple(JointLayout(truth_names(axes)) for axes in (1, 2, 3))


class Client:
    """`statuses`: the last diagnostics by name; `heard`: when each came [s of CLOCK_MONOTONIC]; `truth`: the loopback's
    last one as {name: (position, velocity, effort)}, which came at `truth_heard`; `truths`: all of them, oldest first,
    if `every_truth`, for its owner to shorten; `elsewhere`: of other namespaces {namespace: {name: (last diagnostics,
    when they came)}}."""

    def __init__(self, node: Node, every_truth: bool = False):
        self.node, self._own = node, None
        self._truths = self.subscribe("operator/state", JOINTS, STREAM if every_truth else LATEST, raw=True)
        self._said = self.subscribe("/diagnostics", DIAGNOSTICS, STREAM, raw=True)
        self._services: dict[str, Service] = {}
        self.statuses: dict[str, Status] = {}
        self.heard: dict[str, float] = {}
        self.elsewhere: dict[str, dict[str, tuple[Status, float]]] = {}
        self.truth: dict[str, tuple[float, float, float]] = {}
        self.truth_heard = float("-inf")
        self.truths: list[dict] = []
        self._every_truth = every_truth

    @classmethod
    def join(cls, name: str, domain: int, namespace: str, every_truth: bool = False) -> "Client":
        """On a node of its own, which leaves the network with `close`. ValueError if ROS does not start."""
        ros_environment.check_namespace(namespace)
        context = Context()
        begin_ros([], context=context, domain_id=domain)
        how = {"namespace": namespace, "context": context, "start_parameter_services": False}
        node = made(lambda: rclpy.create_node(name, **how))
        client = cls(node, every_truth)
        client._own = context
        return client

    def close(self) -> None:
        """Leaves the network, if the node is its own."""
        if self._own is not None:
            self.node.destroy_node()
            rclpy.shutdown(context=self._own)

    def subscribe(self, topic: str, type_name: str, qos: QoSProfile, raw: bool = False) -> PolledSubscription:
        """Of a further topic, to be read by who wants it."""
        return PolledSubscription(self.node, topic, type_name, qos, raw)

    def look(self) -> None:
        """Takes what has come of truth and diagnostics."""
        for sample in self._truths.take():
            for layout in LAYOUTS:
                if layout.matches(sample.message):
                    self.truth, self.truth_heard = _by_name(layout, sample.message), time.monotonic()
                    if self._every_truth:
                        self.truths.append(self.truth)
        for sample in self._said.take():
            found = statuses_of(sample.message, sample.received)
            if of_namespace(found.values(), self.node.get_namespace()):
                self.statuses |= found
                self.heard |= dict.fromkeys(found, time.monotonic())
            else:
                where = next(filter(None, (one.values.get("namespace") for one in found.values())), "/")
                told = {name: (one, time.monotonic()) for name, one in found.items()}
                self.elsewhere[where] = self.elsewhere.get(where, {}) | told

    def said(self, node: str, entry: str, otherwise: str = "") -> str:
        """Last value of a node's diagnostic entry."""
        return self.statuses[node].values.get(entry, otherwise) if node in self.statuses else otherwise

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

    @functools.cached_property
    def target(self):
        """Publisher of `operator/target`."""
        return self.node.create_publisher(JointState, "operator/target", LATEST)

    def aim(self, place: Iterable[float]) -> None:
        """Where the loopback's hand shall go while its motion is `follow`: (x, y, theta) in device units [m, m, rad];
        axes that the device does not have are left out."""
        axes = [name for name in AXES if name in self.truth] or list(AXES)
        position = [float(value) for value in place][: len(axes)]
        self.target.publish(JointState(name=axes[: len(position)], position=position))

    def prepare(self, *services: str) -> None:
        """Looks for these services now, so that they are known when they are needed."""
        for service in services:
            if service not in self._services:
                self._services[service] = Service(self.node, service)

    def ask(
        self, question: Question, patience: float = PATIENCE, again: float | None = AGAIN, wait: bool = True
    ) -> "Asking":
        """The question on its way, to be polled. patience [s]; again: sent anew after so long without an answer [s],
        None: never. Without `wait`, a service that the graph does not show is refused at once."""
        return Asking(self, question, patience, again, wait)

    def call(self, question: Question, **how) -> Any:
        """What the answer means, as soon as it is there; how: as of `ask`."""
        with self.ask(question, **how) as asking:
            while not asking.poll():
                time.sleep(LOOK_PERIOD)
        return question.read(asking.answer)

    async def acall(self, question: Question, **how) -> Any:
        """As `call`, beside what else runs in the event loop."""
        with self.ask(question, **how) as asking:
            while not asking.poll():
                await asyncio.sleep(LOOK_PERIOD)
        return question.read(asking.answer)

    def namesakes(self, node: str) -> str:
        """Which nodes of this name run in other namespaces, as a sentence; "" if none does, or one where it should."""
        shown, own = self.node.get_node_names_and_namespaces(), posixpath.join(self.node.get_namespace(), node)
        found = sorted(posixpath.join(where, name) for name, where in shown if name == posixpath.basename(node))
        return f"there is {', '.join(found)}; see --namespace" if found and own not in found else ""

    def service(self, name: str) -> "Service":
        """What is known of a service."""
        self.prepare(name)
        return self._services[name]


class Service:
    """A service's client whose answers are taken by whoever looks, and given to who asked.

    `asked`: the requests that wait for an answer; `met`: whether it ever answered; `all_the_same`: when it may be asked
    though it is not shown [s of CLOCK_MONOTONIC]."""

    def __init__(self, node: Node, name: str):
        self._client = node.create_client(kind_of(name), name, callback_group=Untouched())
        self.all_the_same = time.monotonic() + UNSHOWN
        self.asked: dict[int, Asking] = {}
        self._logger = node.get_logger()
        self.met = False

    @property
    def ready(self) -> bool:
        """Whether the ROS graph shows that somebody offers it."""
        return self._client.service_is_ready()

    def send(self, asking: "Asking") -> None:
        with (handle := self._client.handle):
            self.asked[handle.send_request(asking.question.request)] = asking

    def take(self) -> None:
        while True:
            try:
                with (handle := self._client.handle):
                    header, answer = handle.take_response(self._client.srv_type.Response)
            except RuntimeError as error:  # one that cannot be read is not the end of what is still to come
                self._logger.error(f"an answer of {self._client.srv_name} could not be taken: {error}")
                return
            if header is None:
                return
            self.met = True
            if (asking := self.asked.pop(header.request_id.sequence_number, None)) is not None:
                asking.answer = answer

    def forget(self, asking: "Asking") -> None:
        self.asked = {number: one for number, one in self.asked.items() if one is not asking}


class Asking:
    """A question on its way, until the context is left; `answer` is None until it is there."""

    def __init__(self, client: Client, question: Question, patience: float, again: float | None, wait: bool):
        self.question, self.answer = question, None
        self._service, self._client = client.service(question.service), client
        self._patience, self._end = patience, time.monotonic() + patience
        self._again, self._next, self._wait, self._shown = again, 0.0, wait, False

    def poll(self) -> bool:
        """Sends what is due; whether the answer is there. ValueError if none came in time."""
        now = time.monotonic()
        self._service.take()
        if self.answer is not None:
            return True
        if now >= self._end:
            raise ValueError(self._silence())
        if not self._shown and self._service.ready:
            self._shown, self._next = True, now
        if not (self._shown or self._wait):
            raise ValueError(self._silence())
        all_the_same = self._again is not None and now >= self._service.all_the_same
        if now >= self._next and (self._shown or all_the_same):
            self._service.send(self)
            self._next = self._end if self._again is None else now + self._again
        return False

    def __enter__(self) -> "Asking":
        return self

    def __exit__(self, *exception) -> None:
        """No answer is waited for any more."""
        self._service.forget(self)

    def _silence(self) -> str:
        node, _, service = self.question.service.rpartition("/")
        if self._shown or self._service.met:
            return f"{node} did not answer ~/{service} within {self._patience:g} s"
        why = self._client.namesakes(node) or ros_environment.discovery() or "does it run in this domain?"
        return f"{node} offers no ~/{service} in {self._client.node.get_namespace()}; {why}"


def _by_name(layout: JointLayout, data: bytes) -> dict[str, tuple[float, float, float]]:
    _, *parts = layout.numbers(data)
    return dict(zip(layout.names, zip(*parts, strict=True), strict=True))
