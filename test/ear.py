# SPDX-License-Identifier: Apache-2.0
"""Nodes of this process that hear what others say and ask their services: of a person, and of a device."""

import time

import rclpy
import waiting
from handle_samples import HOME, MS, handle
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger
from waiting import LIMIT

from haptic_device.config.parameters import DRIVER
from haptic_device.control import exchange_samples
from haptic_device.message_fields import AXES, exchange_names, truth_names
from haptic_device.nodes import messages
from haptic_device.recording.layouts import DIAGNOSTICS, JOINTS, JointLayout
from haptic_display import client
from haptic_display.service_requests import (
    Question,
    RefusedError,
    change_state,
    get_parameters,
    set_parameters,
    state_of,
    trigger,
)

SIMULATION, LOAD = "haptic_simulation", "haptic_simulation/load_scene"
ONCE_MORE = 3.0  # [s] after which a service is asked again that has answered before


class Listener:
    """A node that hears topics and asks services while it waits."""

    def __init__(self, domain, name, namespace="/haptic", parameters=False):
        self.context, self._heard = Context(), {}
        rclpy.init(context=self.context, domain_id=domain)
        given = {"namespace": namespace, "context": self.context, "start_parameter_services": parameters}
        self.node = rclpy.create_node(name, **given)
        self.client = client.Client(self.node)

    def close(self):
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def hear(self, topic, note, qos, kind=JOINTS, raw=False):
        """note() takes each message of this topic; what `forget` ends."""
        heard = self.client.subscribe(topic, kind, qos, raw)
        self._heard[heard] = note
        return heard

    def forget(self, heard):
        del self._heard[heard]
        heard.close()

    def look(self, seconds=0.01):
        """Hears what has come, or comes in this time."""
        end = time.monotonic() + seconds
        while not self._take() and time.monotonic() < end:
            time.sleep(0.001)

    def _take(self):
        taken = [(note, sample) for heard, note in self._heard.items() for sample in heard.take()]
        for note, sample in taken:
            note(sample.message)
        return taken

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


class Ear(Listener):
    """Keeps what the nodes of a namespace say, asks the driver, and leads the hand."""

    def __init__(self, domain, namespace="/haptic", axes=3):
        super().__init__(domain, "ear", namespace)
        self.truths, self.handles, self.said, self.alone = [], [], {}, {}
        self.axes, self.namespace = axes, namespace
        self._handles = None
        self._keep("operator/state", JointLayout(truth_names(axes)), self.truths, messages.STREAM)
        self.hear("/diagnostics", self._note, 50, DIAGNOSTICS)
        self.tool = self.node.create_publisher(messages.JointState, "tool", messages.LATEST)
        self.target = self.node.create_publisher(messages.JointState, "operator/target", messages.LATEST)

    def _keep(self, topic, layout, kept, qos):
        return self.hear(topic, lambda data: kept.append(layout.unpack(data)), qos, raw=True)

    def hear_handles(self, wanted=True):
        """Keeps handle samples from now on, or no more; they are many."""
        if wanted:
            layout = JointLayout(exchange_names(self.axes))
            self._handles = self._keep("handle", layout, self.handles, messages.STREAM)
        else:
            self.forget(self._handles)

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

    def as_started(self, given):
        """Leaves no fault, the motor off, hand and handle at the middle, and the driver's live parameters as given,
        with `__` for the dot, or as they are by default."""
        self.until(lambda: self.truths and self.said.get("haptic_driver"), "both nodes say something")
        self.go_to(0.0)
        self.truth(lambda truth: abs(truth.velocity[: self.axes]).max() < 1e-3, what="the handle is still")
        self.cleared()
        assert self.trigger("disable") == (True, "motor zero")
        begun = {parameter.name: parameter.default for parameter in DRIVER if parameter.live}
        begun |= {name: value for key, value in given.items() if (name := key.replace("__", ".")) in begun}
        _, now = self.told(get_parameters("haptic_driver", begun))
        if other := {name: value for name, value in begun.items() if now[name] != value}:
            assert self.told(set_parameters("haptic_driver", other))[0]

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


class Peer(Listener):
    """A device side in this process: sends handle samples, keeps what comes back; `said` [(message, values)]."""

    def __init__(self, domain):
        super().__init__(domain, "peer")
        self.tools, self.said, self.sequence = [], [], 0
        self.handle = self.node.create_publisher(messages.JointState, "handle", messages.LATEST)
        self.layout = JointLayout(exchange_names(3))
        self._tool = self.hear(
            "tool", lambda data: self.tools.append(self.layout.unpack(data)), messages.STREAM, raw=True
        )
        self.hear("/diagnostics", self._note, 50, DIAGNOSTICS)

    def _note(self, array):
        self.said += [
            (status.message, {entry.key: entry.value for entry in status.values})
            for status in array.status
            if status.name == SIMULATION
        ]

    def last(self):
        return self.said[-1:]

    def news(self, what, condition):
        """Values of the next diagnostics for which condition(message, values) holds."""
        begin = len(self.said)
        return self.until(lambda: next((one for one in self.said[begin:] if condition(*one)), None), what)[1]

    def call(self, service):
        """(success, message) of a service without arguments."""
        return self.trigger(service, SIMULATION)

    def pause(self, wanted):
        answer = self.ask(f"{SIMULATION}/pause", SetBool.Request(data=wanted))
        return answer.success, answer.message

    def load_scene(self, name):
        assert self.set("scene", name, SIMULATION) == (True, "")
        return self.answer_of_load(self.send(LOAD, Trigger.Request()))

    def answer_of_load(self, asked):
        """(success, message) of a load that was asked for once: a second is refused while a world is compiled."""
        self.until(asked.poll, "a world is loaded")
        return asked.answer.success, asked.answer.message

    def send_handle(self, position, step=1):
        """One sample of a handle at rest, `step` ms after the one before."""
        self.sequence += step
        stamp_ns = self.sequence * MS
        self.handle.publish(handle(float(self.sequence), position=position, stamp_ns=stamp_ns, speed=0.0))

    def answered(self):
        """Number of the sample that was answered last."""
        return self.tools[-1].position[3 + exchange_samples.ANSWERED] if self.tools else 0.0

    def lead(self, position=HOME, times=1, step=1):
        """Sends samples one by one, each until it is answered or, lost or in a silence, the next has to be sent: with
        more and more patience, so that also on a slow machine none is left to be answered later."""
        self.until(lambda: self.handle.get_subscription_count() and self._tool.matched, "a simulation")
        for _ in range(times):
            self._lead_once(position, step)
        return self.tools[-1]

    def _lead_once(self, position, step):
        self.send_handle(position, step)
        sent, patience = time.monotonic(), 0.05

        def answered():
            nonlocal sent, patience
            if self.answered() == self.sequence:
                return True
            if time.monotonic() > sent + patience:
                self.send_handle(position, step)
                sent, patience = time.monotonic(), 1.5 * patience
            return False

        self.until(answered, "an answer to a handle sample")
