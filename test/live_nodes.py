# SPDX-License-Identifier: Apache-2.0
"""Live nodes of the device in processes of their own, and an ear and a hand in this one.

Nothing here judges how fast the machine is: whoever waits says what for, and has LIMIT for it, which is no assertion.
"""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from haptic_device.node import wire
from haptic_device.runtime import page
from haptic_device.process import ending_with_us
from haptic_sim.cli.processes import parameter_text

MODULES = {
    "haptic_driver": "haptic_device.node.driver",
    "haptic_loopback": "haptic_device.node.loopback",
    "haptic_simulation": "haptic_sim.node.simulation",
}
SLOW = {
    "servo__rate": 1000.0,
    "coupling__stiffness": 1000.0, "coupling__damping": 1.0,
    "coupling__rotational_stiffness": 1.0, "coupling__rotational_damping": 0.001,
}  # fmt: skip
"""Of a driver in a test of what it says and refuses: a slower servo leaves more of the processors to the others."""
LIMIT = 200.0  # [s] for whatever is waited for: a node that starts on a busy machine, or compiles first
CUT = "device_watchdog"
STEADY = {"motor_watchdog": 2.0}  # [s] of a loopback whose servo may be held up by whatever else the machine does
PATIENT = {"fault__silence": 1.0, "fault__unattended": 0.0}  # of a driver whose device and Python may be
BEARS = {"haptic_loopback": STEADY, "haptic_driver": PATIENT}
"""What nodes are started with if a test does not say otherwise: no fault only because a process stood still."""
HOLDING = {"passivity__control": False}  # of one whose walls still push after a stall: else they let go for its energy


def command(name, namespace="/haptic", renamed=(), **given):
    """Command line of a node; parameters with `__` for a dot, and what it BEARS; renamed: topics as old:=new."""
    given = BEARS.get(name, {}) | given
    words = [w for key, value in given.items() for w in ("-p", f"{key.replace('__', '.')}:={parameter_text(value)}")]
    rules = [word for rule in renamed for word in ("-r", rule)]
    return [sys.executable, "-m", MODULES[name], "--ros-args", "-r", f"__ns:={namespace}", *rules, *words]


def refusal_of(process):
    """The last line that a node said when it refused to start."""
    said = process.communicate(timeout=LIMIT)[1]
    assert process.returncode == 1, said
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


MAINS = """
import gc, importlib, json, sys
from haptic_device.node import own_port
own_port.KINDS = ()  # a process can give a port of its own to one participant only
main = importlib.import_module(sys.argv[1]).main
for arguments in json.loads(sys.argv[2]):
    print(f"\\n{main(arguments)} END", file=sys.stderr, flush=True)
    gc.collect()  # one participant at a time
"""
APART = """<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><library_settings>
<intraprocess_delivery>OFF</intraprocess_delivery></library_settings></dds>
"""
"""Fast DDS 2.14 can lock itself up when one of several participants of a process ends and tells the others directly."""


def refusals_of(name, arguments):
    """[(exit code, what was said)] of a node's main run with each of these argument lists, in a process of its own."""
    words = [sys.executable, "-c", MAINS, MODULES[name], json.dumps(arguments)]
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as profile:
        profile.write(APART)
        profile.flush()
        environment = {**os.environ, "FASTRTPS_DEFAULT_PROFILES_FILE": profile.name}
        said = subprocess.run(
            ending_with_us(words), stderr=subprocess.PIPE, text=True, timeout=LIMIT, check=True, env=environment
        ).stderr
    runs = [run.rstrip().rpartition("\n") for run in said.split(" END\n")[:-1]]
    return [(int(code), text.strip()) for text, _, code in runs]


def page_path(namespace="/haptic"):
    return page.FOLDER / page.page_name(os.environ["ROS_DOMAIN_ID"], namespace)


def _strange(name, level=0, **values):
    """The bytes of a status as no node of ours says it."""
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(level=bytes([level]), name=name, message="[/x] [bold", values=pairs)
    return bytes(serialize_message(DiagnosticArray(status=[status])))


STRANGE = (
    b"", b"\xff" * 40, _strange("cut short")[:-9], _strange("no text").replace(b"no text", b"no\xfftext"),
    _strange("seven", 7), _strange("all bits", 255), _strange("[/x]", **{"[/x]": "[/x]"}),
    _strange("haptic_driver", fault="overheated", state="[/x]", missed="[/x]", age_ms_p50="", exchange_answered="many",
             exchange_sent="", realtime="[/x]", physical_damping="[/x], 2", rate_hz=""),
    _strange("haptic_simulation", **{"result.insertion_fraction": "all of it", "result.[/x]": "", "refused.x": "often",
                                     "tool_port_energy": "", "max_contact_force": "[/x]",
                                     "max_penetration": ""}),
)  # fmt: skip
"""Serialized messages of /diagnostics that are broken, or foreign and named as ours."""


@contextlib.contextmanager
def strange_diagnostics():
    """Says all that is STRANGE again and again, in this process's domain."""
    context, stop = Context(), threading.Event()
    rclpy.init(context=context)
    node = rclpy.create_node("stranger", context=context)
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 50)

    def speak():
        while not stop.wait(0.05):
            for message in STRANGE:
                publisher.publish(message)

    speaking = threading.Thread(target=speak)
    speaking.start()
    try:
        yield
    finally:
        stop.set()
        speaking.join()
        node.destroy_node()
        rclpy.shutdown(context=context)


class Write(NamedTuple):
    """A write of the servo into its page."""

    written: int  # [ns of CLOCK_MONOTONIC]
    deadline: int  # [ns] that it announced, up to which the plant may be integrated with the motor before
    engaged: int
    motor: list

    @property
    def over(self):
        """CLOCK_MONOTONIC [s] up to which this motor may act on a STEADY device if no other write follows."""
        return max(self.written * 1e-9 + STEADY["motor_watchdog"], self.deadline * 1e-9)


def last_write(namespace="/haptic"):
    """The last write of a servo that writes no more, also of one that was killed half way through it."""
    words = np.fromfile(page_path(namespace), np.int64)[page.SERVO_FIRST :][: page.SERVO_WORDS]
    return Write(int(words[1]), int(words[2]), int(words[4]), words[5:].view(np.float64).tolist())


class Nodes:
    """Processes by name; every one of them has ended when the context is left."""

    def __init__(self, logs: Path):
        self._logs, self.running, self._count = logs, {}, 0

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        for name in reversed(list(self.running)):
            self.end(name)

    def start(self, name, **given):
        self._count += 1
        path = self._logs / f"{self._count}_{name}.log"
        with open(path, "w") as log:
            process = subprocess.Popen(ending_with_us(command(name, **given)), stdout=log, stderr=log)
        process.log, process.given = path, given
        self.running[name] = process
        return process

    def have(self, name, **given):
        """The node runs with these parameters, from now on or as before."""
        if name in self.running and (self.running[name].poll() is not None or self.running[name].given != given):
            self.end(name)
        return self.running[name] if name in self.running else self.start(name, **given)

    def lack(self, *names):
        """These nodes do not run."""
        for name in names:
            if name in self.running:
                self.end(name)

    def end(self, name, number=signal.SIGINT):
        """Signals a node and waits for its end; its exit code."""
        process = self.running.pop(name)
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGCONT)  # a test that failed may have left it stopped
        process.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(60.0)
        if process.poll() is None:
            process.kill()
            process.wait(60.0)
        return process.returncode


class Ear:
    """A node of this process in the namespace: keeps what the others say, asks their services."""

    def __init__(self, domain, namespace="/haptic", axes=3):
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("ear", namespace=namespace, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.truths, self.handles, self.said, self.alone, self._clients = [], [], {}, {}, {}
        self.axes, self.namespace = axes, namespace
        self._handles = None
        self._hear("operator/state", wire.JointLayout(wire.truth_names(axes)), self.truths, wire.STREAM)
        self.node.create_subscription(wire.DiagnosticArray, "/diagnostics", self._note, 50)
        self.tool = self.node.create_publisher(wire.JointState, "tool", wire.LATEST)
        self.target = self.node.create_publisher(wire.JointState, "operator/target", wire.LATEST)

    def close(self):
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def _hear(self, topic, layout, kept, qos):
        return self.node.create_subscription(
            wire.JointState, topic, lambda data: kept.append(layout.unpack(data)), qos, raw=True
        )

    def hear_handles(self, wanted=True):
        """Keeps handle samples from now on, or no more; they are many."""
        if wanted:
            layout = wire.JointLayout(wire.exchange_names(self.axes))
            self._handles = self._hear("handle", layout, self.handles, wire.LATEST)
        else:
            self.node.destroy_subscription(self._handles)

    def _note(self, array):
        for status in array.status:
            values = {entry.key: entry.value for entry in status.values}
            self.said.setdefault(status.name, []).append((status.level[0], status.message, values))
            if len(array.status) == 1:  # without the figures of each half second
                self.alone.setdefault(status.name, []).append(values)

    def until(self, condition, what=None, seconds=LIMIT):
        """Listens until the condition holds, and returns what it gives; what: what is waited for."""
        end = time.monotonic() + seconds
        while not (found := condition()):
            if time.monotonic() > end:
                code = condition.__code__ if hasattr(condition, "__code__") else None
                where = f"the condition of {code.co_filename}:{code.co_firstlineno}" if code else repr(condition)
                raise AssertionError(f"not within {seconds:g} s: {what or where}; last said: {self.last()}")
            self._executor.spin_once(timeout_sec=0.01)
        return found

    def last(self):
        return {name: said[-1] for name, said in self.said.items() if said}

    def _next(self, kept, condition, what, seconds, begin=None):
        """The first of what is kept from now on, or from `begin` on, for which the condition holds; each is judged
        once."""
        place = len(kept) if begin is None else begin

        def found():
            nonlocal place
            while place < len(kept):
                one, place = kept[place], place + 1
                if condition(one):
                    return [one]
            return None

        return self.until(found, what, seconds)[0]

    def news(self, name, condition, seconds=LIMIT, what=None):
        """Values of the next diagnostics of a node for which condition(level, message, values) holds."""
        heard = self.said.setdefault(name, [])
        return self._next(heard, lambda said: condition(*said), what or f"news of {name}", seconds)

    def ask(self, service, kind, request, again=3.0):
        """A service's answer. Asked again after this time: an answer is lost if its server was found a moment ago."""
        client = self._clients.get(service) or self.node.create_client(kind, service)
        self._clients[service], answers, asked = client, [], -math.inf
        self.until(client.service_is_ready, f"the service {service}")

        def answered():
            nonlocal asked
            if time.monotonic() > asked + again:
                asked = time.monotonic()
                answers.append(client.call_async(request))
            return next((answer for answer in answers if answer.done()), None)

        return self.until(answered, f"an answer of {service}").result()

    def trigger(self, name):
        """A service of the driver: (success, message)."""
        answer = self.ask(f"haptic_driver/{name}", Trigger, Trigger.Request())
        return answer.success, answer.message

    def set(self, name, value, node="haptic_driver"):
        """Sets a live parameter: (accepted, reason)."""
        wish = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        [result] = self.ask(f"{node}/set_parameters", SetParameters, wish).results
        return result.successful, result.reason

    def truth(self, condition, seconds=LIMIT, what=None):
        """The first truth from now on for which the condition holds."""
        return self._next(self.truths, condition, what or "a truth", seconds)

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
        """No fault is latched, and the motor is off."""
        assert (answer := self.trigger("reset"))[0], answer

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
        names, position = list(wire.AXES[: self.axes]), [x, y, theta][: self.axes]
        begin, asked = len(self.truths), 0.0

        def there():
            nonlocal asked
            if time.monotonic() > asked + 0.05:
                self.target.publish(wire.JointState(name=names, position=position))
                asked = time.monotonic()
            latest = self.truths[-1] if len(self.truths) > begin else None
            return latest and abs(latest.position[self.axes : 2 * self.axes] - position).max() < 1e-5

        self.until(there, f"the hand wants to be at {position}")
