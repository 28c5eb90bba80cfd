# SPDX-License-Identifier: Apache-2.0
"""Live nodes in processes of their own: started, ended, refused, and told nonsense."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message
from waiting import exit_code, output

from haptic_device.process import ending_with_us
from haptic_device.realtime import shared_memory
from haptic_display.run.processes import parameter_text

MODULES = {
    "haptic_driver": "haptic_device.nodes.driver",
    "haptic_loopback": "haptic_device.nodes.loopback",
    "haptic_simulation": "haptic_sim.node.simulation",
}
BESIDE = {"haptic_recorder": "haptic_device.nodes.recorder", "haptic_relay": "haptic_sim.node.network_emulator"}
"""Nodes that take no part in the exchange."""
BRIDGE = {"haptic_bridge": "haptic_device.nodes.bridge"}
"""In place of the loopback, where there is a device on a line."""
SLOW = {
    "servo__rate": 1000.0,
    "publish__rate": 100.0,
    "coupling__stiffness": 400.0,
    "coupling__damping": 1.0,
    "coupling__rotational_stiffness": 1.0,
    "coupling__rotational_damping": 0.001,
}
"""Of a driver in a test of what it says and refuses: slower, it leaves more of the processors to the others; and soft,
for gains that the device's damping does not bear with a servo that is milliseconds late are refused."""
CUT = "device_watchdog"
STEADY = {"motor_watchdog": 2.0}  # [s] of a loopback whose servo may be held up by whatever else the machine does
PATIENT = {"fault__silence": 1.0, "fault__unattended": 0.0}  # of a driver whose device and Python may be
BEARS = {"haptic_loopback": STEADY, "haptic_driver": PATIENT}
"""What nodes are started with if a test does not say otherwise: no fault only because a process stood still."""
DISPLAY = {
    "haptic_loopback": {"motion__name": "follow"},
    "haptic_driver": {"engage__time": 0.05, "exchange__fade": 0.05, **SLOW},
    "haptic_simulation": {"scene": "free_space"},
}
"""The one that tests share which only ask it something."""
HOLDING = {"passivity.control": False}  # of one whose walls still push after a stall: else they let go for its energy


def command(name, namespace="/haptic", renamed=(), **given):
    """Command line of a node; parameters with `__` for a dot, and what it BEARS; renamed: topics as old:=new."""
    given = BEARS.get(name, {}) | given
    words = [w for key, value in given.items() for w in ("-p", f"{key.replace('__', '.')}:={parameter_text(value)}")]
    rules = [word for rule in renamed for word in ("-r", rule)]
    module = (MODULES | BESIDE | BRIDGE)[name]
    return [sys.executable, "-m", module, "--ros-args", "-r", f"__ns:={namespace}", *rules, *words]


def refusal_of(process):
    """The last line that a node said when it refused to start."""
    said = output(process)[1]
    assert process.returncode == 1, said
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


def caught(process):
    """The signals that a process has handlers for; none of one that has ended."""
    with open(f"/proc/{process.pid}/status") as status:
        mask = next((int(line.split()[1], 16) for line in status if line.startswith("SigCgt")), 0)
    return {number for number in signal.Signals if mask >> (number - 1) & 1}


def loaded(process, library):
    """Whether a process has loaded a shared library of this package."""
    return f"/{library}/" in Path(f"/proc/{process.pid}/maps").read_text()


def page_path(namespace="/haptic"):
    return shared_memory.FOLDER / shared_memory.file_name(os.environ["ROS_DOMAIN_ID"], namespace)


def _strange(name, level=0, **values):
    """The bytes of a status as no node of ours says it."""
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(level=bytes([level]), name=name, message="[/x] [bold", values=pairs)
    return bytes(serialize_message(DiagnosticArray(status=[status])))


STRANGE = (
    b"",
    b"\xff" * 40,
    _strange("cut short")[:-9],
    _strange("no text").replace(b"no text", b"no\xfftext"),
    _strange("seven", 7),
    _strange("all bits", 255),
    _strange("[/x]", **{"[/x]": "[/x]"}),
    _strange(
        "haptic_driver",
        fault="overheated",
        state="[/x]",
        missed="[/x]",
        age_ms_p50="",
        exchange_answered="many",
        exchange_sent="",
        realtime="[/x]",
        physical_damping="[/x], 2",
        rate_hz="",
    ),
    _strange(
        "haptic_simulation",
        **{
            "result.insertion_fraction": "all of it",
            "result.[/x]": "",
            "refused.x": "often",
            "tool_port_energy": "",
            "max_contact_force": "[/x]",
            "max_penetration": "",
        },
    ),
)
"""Serialized messages of /diagnostics that are broken, or foreign and named as ours."""


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
    words = np.fromfile(page_path(namespace), np.int64)[shared_memory.SERVO_FIRST :][: shared_memory.SERVO_WORDS]
    return Write(int(words[1]), int(words[2]), int(words[4]), words[5:].view(np.float64).tolist())


class Nodes:
    """Processes by name; every one of them has ended when the context is left."""

    def __init__(self, logs: Path):
        self._logs, self.running, self._count = logs, {}, 0

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        with contextlib.ExitStack() as stack:
            for name in self.running:
                stack.callback(self.end, name)

    def start(self, name, **given):
        """Starts a node; its process, with the path of its `log`."""
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
        try:
            exit_code(process, process.log.read_text)
        finally:
            process.kill()
            process.wait()
        assert "Traceback" not in process.log.read_text(), process.log.read_text()
        return process.returncode
