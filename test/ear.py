# SPDX-License-Identifier: Apache-2.0
"""A node of this process that hears what the others say and asks their services; and one that leads the hand too."""

import time

import rclpy
import waiting
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from waiting import LIMIT

from haptic_device.message_fields import AXES, exchange_names, truth_names
from haptic_device.nodes import messages
from haptic_device.recording.layouts import JointLayout
from haptic_sim import client
from haptic_sim.service_requests import Question, RefusedError, change_state, state_of, trigger

ONCE_MORE = 3.0  # [s] after which a service is asked again that has answered before


class Served:
    """A node whose callbacks are served while it waits, and beside it a client that asks services."""

    def __init__(self, domain, name, namespace="/haptic"):
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, namespace=namespace, context=self.context)
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.node)
        asks = {"namespace": namespace, "context": self.context, "start_parameter_services": False}
        self.client = client.Client(rclpy.create_node(f"{name}_asks", **asks))

    def close(self):
        self._executor.shutdown()
        self.client.node.destroy_node()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def look(self, seconds=0.01):
        """Serves what has come, or comes in this time."""
        self._executor.spin_once(timeout_sec=seconds)

    def last(self):
        """What is said of a wait that was in vain."""
        return ""

    def until(self, condition, what):
        """Listens until the condition holds, and returns what it gives; what: what is waited for."""
        return waiting.until(condition, what, self.look, self.last)

    def send(self, service, request):
        """Asks a service once, when it is there; the question on its way."""
        self.until(lambda: self.client.service(service).ready, f"the service {service}")
        asking = self.client.ask(Question(service, request), patience=2.0 * LIMIT, again=None)
        asking.poll()
        return asking

    def ask(self, service, request):
        """A service's answer. Asked again after a while: an answer is lost if its server has not found us yet."""
        again = ONCE_MORE if self.client.service(service).met else client.AGAIN
        with self.client.ask(Question(service, request), patience=2.0 * LIMIT, again=again) as asking:
            self.until(asking.poll, f"an answer of {service}")
        return asking.answer

    def told(self, question):
        """(accepted, what was said) of a question that a node may refuse."""
        try:
            return True, question.read(self.ask(question.service, question.request))
        except RefusedError as refusal:
            return False, str(refusal)

    def trigger(self, name, node="haptic_driver"):
        """A service without arguments: (success, message)."""
        return self.told(trigger(f"{node}/{name}"))

    def set(self, name, value, node="haptic_driver"):
        """Sets a live parameter: (accepted, reason)."""
        wish = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        [result] = self.ask(f"{node}/set_parameters", wish).results
        return result.successful, result.reason

    def state(self, node):
        """Number of the state that a managed node is in."""
        question = state_of(node)
        return question.read(self.ask(question.service, question.request))

    def change(self, node, transition, wanted):
        """Asks for a transition once, for the second would be refused; returns with the answer, or once the node is in
        the state wanted if that was lost."""
        question = change_state(node, transition)
        asking, asked = self.send(question.service, question.request), time.monotonic()
        self.until(
            lambda: asking.poll() or (time.monotonic() > asked + ONCE_MORE and self.state(node) == wanted),
            f"{node} is in state {wanted}",
        )
        assert asking.answer is None or (asking.answer.success and self.state(node) == wanted)


class Ear(Served):
    """Keeps what the nodes of a namespace say, asks the driver, and leads the hand."""

    def __init__(self, domain, namespace="/haptic", axes=3):
        super().__init__(domain, "ear", namespace)
        self.truths, self.handles, self.said, self.alone = [], [], {}, {}
        self.axes, self.namespace = axes, namespace
        self._handles = None
        self._hear("operator/state", JointLayout(truth_names(axes)), self.truths, messages.STREAM)
        self.node.create_subscription(messages.DiagnosticArray, "/diagnostics", self._note, 50)
        self.tool = self.node.create_publisher(messages.JointState, "tool", messages.LATEST)
        self.target = self.node.create_publisher(messages.JointState, "operator/target", messages.LATEST)

    def _hear(self, topic, layout, kept, qos):
        return self.node.create_subscription(
            messages.JointState, topic, lambda data: kept.append(layout.unpack(data)), qos, raw=True
        )

    def hear_handles(self, wanted=True):
        """Keeps handle samples from now on, or no more; they are many."""
        if wanted:
            layout = JointLayout(exchange_names(self.axes))
            self._handles = self._hear("handle", layout, self.handles, messages.LATEST)
        else:
            self.node.destroy_subscription(self._handles)

    def _note(self, array):
        for status in array.status:
            values = {entry.key: entry.value for entry in status.values}
            self.said.setdefault(status.name, []).append((status.level[0], status.message, values))
            if len(array.status) == 1:  # without the figures of each half second
                self.alone.setdefault(status.name, []).append(values)

    def last(self):
        return {name: said[-1] for name, said in self.said.items() if said}

    def _next(self, kept, condition, what):
        """The first of what is kept from now on for which the condition holds; each is judged once."""
        place = len(kept)

        def found():
            nonlocal place
            while place < len(kept):
                one, place = kept[place], place + 1
                if condition(one):
                    return [one]
            return None

        return self.until(found, what)[0]

    def news(self, name, condition, what=None):
        """Values of the next diagnostics of a node for which condition(level, message, values) holds."""
        heard = self.said.setdefault(name, [])
        return self._next(heard, lambda said: condition(*said), what or f"news of {name}")

    def truth(self, condition, what="a truth"):
        """The first truth from now on for which the condition holds."""
        return self._next(self.truths, condition, what)

    def motor(self, truth):
        return truth.effort[self.axes : 2 * self.axes]

    def time(self, truth):
        """CLOCK_MONOTONIC [s] up to which the plant was integrated."""
        return truth.position[2 * self.axes + 1]

    def motor_off_after(self, when):
        """Waits for a truth past this time [s] of the plant; judges that in none past it the motor pushes."""
        self.truth(lambda truth: self.time(truth) > when, what=f"a truth past {when} s")
        assert not any(self.motor(truth).any() for truth in self.truths if self.time(truth) > when)

    def cleared(self):
        """Waits until no fault is latched and the motor is off, with a servo that runs."""
        self.until(lambda: self.trigger("reset")[0], "the driver can be reset")

    def engaged(self):
        """Enables, and waits until the driver says that its forces act; what it then said."""
        heard = self.said["haptic_driver"]
        begin = len(heard)
        assert (answer := self.trigger("enable")) == (True, "enabled"), answer
        return self.until(
            lambda: next((said for said in heard[begin:] if said[2]["state"] == "engaged"), None), "it is engaged"
        )

    def go_to(self, x, y=0.0, theta=0.0):
        """Has the hand follow to a target, and waits until it wants to be there."""
        names, position = list(AXES[: self.axes]), [x, y, theta][: self.axes]
        begin, asked = len(self.truths), 0.0

        def there():
            nonlocal asked
            if time.monotonic() > asked + 0.05:
                self.target.publish(messages.JointState(name=names, position=position))
                asked = time.monotonic()
            latest = self.truths[-1] if len(self.truths) > begin else None
            return latest and abs(latest.position[self.axes : 2 * self.axes] - position).max() < 1e-5

        self.until(there, f"the hand wants to be at {position}")
