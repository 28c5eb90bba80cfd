# SPDX-License-Identifier: Apache-2.0
"""Live nodes of the device in processes of their own, and an ear and a hand in this one."""

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from haptic_device.node import wire
from haptic_device.runtime import page
from haptic_device.runtime.process import die_with_parent
from haptic_sim.cli.processes import parameter_text

MODULES = {
    "haptic_driver": "haptic_device.node.driver",
    "haptic_loopback": "haptic_device.node.loopback",
    "haptic_simulation": "haptic_sim.node.simulation",
}


def command(name, namespace="/haptic", renamed=(), **given):
    """Command line of a node; parameters with `__` for a dot; renamed: topics as old:=new."""
    words = [w for key, value in given.items() for w in ("-p", f"{key.replace('__', '.')}:={parameter_text(value)}")]
    rules = [word for rule in renamed for word in ("-r", rule)]
    return [sys.executable, "-m", MODULES[name], "--ros-args", "-r", f"__ns:={namespace}", *rules, *words]


def refusal_of(process):
    """The last line that a node said when it refused to start."""
    said = process.communicate(timeout=90.0)[1]
    assert process.returncode == 1, said
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


def page_path(namespace="/haptic"):
    return page.FOLDER / page.page_name(os.environ["ROS_DOMAIN_ID"], namespace)


def last_heartbeat(namespace="/haptic"):
    """CLOCK_MONOTONIC [s] of the servo's last write into the page."""
    block = np.zeros(page.SERVO_WORDS, np.int64)
    page.read_servo(np.fromfile(page_path(namespace), np.int64), block)
    return block[1] * 1e-9


def held_up():
    """Seconds that others on this machine make work of 0.1 s of processor time longer."""
    began = time.monotonic()
    end = time.process_time() + 0.1
    while time.process_time() < end:
        continue
    return 20.0 * max(0.0, time.monotonic() - began - 0.1)


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
        path, own = self._logs / f"{self._count}_{name}.log", os.getpid()
        with open(path, "w") as log:
            process = subprocess.Popen(
                command(name, **given), stdout=log, stderr=log, preexec_fn=lambda: die_with_parent(own)
            )
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
        process.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(20.0)
        if process.poll() is None:
            process.kill()
            process.wait()
        return process.returncode


class Ear:
    """A node of this process in the namespace: keeps what the others say, asks their services."""

    def __init__(self, domain, namespace="/haptic", axes=3):
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("ear", namespace=namespace, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.truths, self.handles, self.said, self._clients = [], [], {}, {}
        self.axes, self.namespace = axes, namespace
        self._handles = None
        self._hear("operator/state", wire.JointLayout(wire.truth_names(axes)), self.truths, wire.STREAM)
        self.node.create_subscription(wire.DiagnosticArray, "/diagnostics", self._note, 10)
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

    def until(self, condition, seconds=60.0):
        """Listens until the condition holds."""
        end = time.monotonic() + seconds
        while not (found := condition()):
            assert time.monotonic() < end, f"what was waited for did not come; last said: {self.last()}"
            self._executor.spin_once(timeout_sec=0.01)
        return found

    def last(self):
        return {name: said[-1] for name, said in self.said.items()}

    def news(self, name, condition, seconds=60.0):
        """Values of the next diagnostics of a node for which condition(level, message, values) holds."""
        heard = self.said.setdefault(name, [])
        begin = len(heard)
        return self.until(lambda: next((said for said in heard[begin:] if condition(*said)), None), seconds)

    def ask(self, service, kind, request, again=60.0):
        """A service's answer. Asked again after this time: an answer is lost if its server was found a moment ago."""
        client = self._clients.get(service) or self.node.create_client(kind, service)
        self._clients[service], answers, asked = client, [], -math.inf
        self.until(client.service_is_ready)

        def answered():
            nonlocal asked
            if time.monotonic() > asked + again:
                asked = time.monotonic()
                answers.append(client.call_async(request))
            return next((answer for answer in answers if answer.done()), None)

        return self.until(answered).result()

    def trigger(self, name):
        """A service of the driver: (success, message)."""
        answer = self.ask(f"haptic_driver/{name}", Trigger, Trigger.Request(), again=3.0)
        return answer.success, answer.message

    def set(self, name, value, node="haptic_driver"):
        """Sets a live parameter: (accepted, reason)."""
        wish = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        [result] = self.ask(f"{node}/set_parameters", SetParameters, wish).results
        return result.successful, result.reason

    def truth(self, condition, seconds=60.0):
        """The first truth from now on for which the condition holds."""
        begin = len(self.truths)
        return self.until(lambda: next((truth for truth in self.truths[begin:] if condition(truth)), None), seconds)

    def motor(self, truth):
        return truth.effort[self.axes : 2 * self.axes]

    def time(self, truth):
        """CLOCK_MONOTONIC [s] up to which the plant was integrated."""
        return truth.position[2 * self.axes + 1]

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

        self.until(there)
