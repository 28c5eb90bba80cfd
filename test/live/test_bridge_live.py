# SPDX-License-Identifier: Apache-2.0
"""The bridge between a driver and the reference device as processes, on a line that can be pulled out: what ends,
comes back or stands still is said, and works again. What the motor does meanwhile is judged in lock-step.
"""

import contextlib
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from in_process import haptic
from live_nodes import HOLDING, Nodes
from waiting import exit_code, until

from haptic_device.description import load_device
from haptic_device.parameters import LOOPBACK
from haptic_device.process import ending_with_us
from haptic_sim.supervision import reference_device

CABLE = Path(__file__).resolve().parents[1] / "cable.py"
DEVICES = {"udp": "reference_udp", "serial": "reference_pty"}
WALL = {"wall__normals": [1.0, 0.0], "wall__offsets": [0.0], "wall__stiffness": [1000.0], "wall__damping": [0.0]}
SOFT = {"coupling__stiffness": 100.0, "coupling__damping": 0.1, "coupling__rotational_stiffness": 0.1, **HOLDING}
DRIVER = {"servo__rate": 500.0, "publish__rate": 100.0, "engage__time": 0.05, "fault__silence": 0.2, **WALL, **SOFT}
HAND = {"motion.name": "follow", "motion.start": (0.02, 0.0, 0.0)}
FREE, PRESSED, PUSH = 0.02, -0.005, 2.0  # [m] off the wall and in it; [N] that show it
WARN, ERROR = 1, 2
CHANGE = 4  # how many words such a line of the device's log has


class Program:
    """A program beside the nodes, which is told what to do by lines."""

    def __init__(self, *words):
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(ending_with_us([*map(str, words)]), stdin=pipe, stdout=pipe, text=True)
        self.line = self.process.stdout.readline().strip()

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def order(self, order):
        """Says it, and waits until it is done."""
        self.say(order)
        self.process.stdout.readline()

    def end(self):
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        with contextlib.suppress(BrokenPipeError):
            self.process.communicate()


class Rig:
    """Device, bridge and driver, and a cable on a serial line: a wall that the hand presses the handle into."""

    def __init__(self, kind, folder, nodes, ear):
        self.kind, self.ear, self._folder, self._nodes = kind, ear, folder, nodes
        self._config, self._starts, self._where = folder / "config", 0, folder / "device"
        described = load_device(DEVICES[kind])
        hand = {parameter.name: parameter.default for parameter in LOOPBACK} | HAND
        self._config.write_text(reference_device.config_of(described, hand))
        self.device, self.cable, self._port = None, None, 0
        self.start_device()
        if kind == "serial":
            self._port = folder / "line"
            self.cable = Program(sys.executable, CABLE, self._port, self._where)
        self.start("haptic_bridge")
        self.start("haptic_driver")

    def start_device(self):
        """A device at the place where the one before it was."""
        self._starts += 1
        self._log = log = self._folder / f"motor{self._starts}"
        line = ("--udp", self._port) if self.kind == "udp" else ("--pty", self._where)
        words = (reference_device.compiled(), "--config", self._config, "--log", log, *line)
        self.device = Program(*words)
        if self.kind == "udp":
            self._port = int(self.device.line.split()[1])

    def start(self, name):
        """A node that has ended, or never ran."""
        given = {"device": DEVICES[self.kind]} | (DRIVER if name == "haptic_driver" else {"port": str(self._port)})
        self._nodes.running.pop(name, None)
        self._nodes.start(name, **given)

    def signal(self, name, number):
        self._nodes.running[name].send_signal(number)

    def ended(self, name):
        """The exit code of a node, when it has ended."""
        process = self._nodes.running[name]
        return exit_code(process, process.log.read_text)

    @property
    def address(self):
        """Where the device is, as the bridge says it."""
        return f"UDP 127.0.0.1:{self._port}" if self.kind == "udp" else str(self._port)

    def motor(self):
        """Force on x [N] of each change that the device has logged."""
        changes = [line.split() for line in self._log.read_text().splitlines()]
        return [float(change[1]) for change in changes if len(change) == CHANGE]

    def falls(self, *names):
        """Waits until the driver is in one of these faults."""
        said = self.ear.said["haptic_driver"]
        self.ear.until(lambda: said[-1][2]["fault"] in names, f"the fault {names}")

    def bridge_says(self, level, message):
        said = self.ear.said["haptic_bridge"]
        until(lambda: said[-1][:2] == (level, message), f"the bridge says {message}", self.ear.look, lambda: said[-1])

    def counted(self, name):
        """A counter of the bridge, as it says it from now on."""
        return int(self.ear.news("haptic_bridge", lambda level, message, values: name in values)[2][name])

    def serves(self):
        """All works: the bridge says so, and the driver is in no fault that a reset does not clear."""
        self.bridge_says(0, "serving")
        self.ear.cleared()

    def close(self):
        self.device.end()
        if self.cable is not None:
            self.cable.end()


@pytest.fixture(scope="module", params=list(DEVICES))
def rig(request, ros_domain, nodes, ear, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    with Nodes(folder) as own:
        rig = Rig(request.param, folder, own, ear)
        try:
            yield rig
        finally:
            rig.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_bridge_that_ends_is_a_silent_device_and_the_driver_works_with_the_next_one(rig, number):
    rig.serves()
    rig.signal("haptic_bridge", number)
    assert rig.ended("haptic_bridge") == (-number if number == signal.SIGKILL else 0)
    rig.falls("device_silent")
    rig.start("haptic_bridge")
    rig.serves()


@pytest.mark.parametrize("rig", ["serial"], indirect=True)
def test_a_line_that_is_unplugged_and_plugged_in_again_is_opened_again_at_the_same_path(rig):
    rig.serves()
    before = rig.counted("sessions"), rig.counted("reopened")
    rig.cable.order("close")
    rig.falls("device_silent")
    rig.bridge_says(ERROR, f"port {rig.address} cannot be opened: No such file or directory")
    rig.cable.order("open")
    rig.serves()
    assert rig.counted("sessions") > before[0] and rig.counted("reopened") == before[1] + 1


def test_a_device_that_dies_is_said_and_one_that_is_started_in_its_place_works_after_a_reset(rig):
    rig.serves()
    before = rig.counted("sessions"), rig.counted("reopened")
    rig.device.end()
    rig.falls("device_silent")
    if rig.kind == "udp":
        rig.bridge_says(WARN, f"no device answers on {rig.address}")
    else:
        rig.bridge_says(ERROR, f"port {rig.address} cannot be opened: No such file or directory")
    rig.start_device()
    rig.serves()
    assert rig.counted("sessions") > before[0] and rig.counted("reopened") == before[1] + (rig.kind == "serial")


def test_a_device_that_stands_still_is_said_and_serves_when_it_goes_on(rig):
    rig.serves()
    rig.device.process.send_signal(signal.SIGSTOP)
    rig.falls("device_silent")
    rig.bridge_says(WARN, f"no device answers on {rig.address}")
    rig.device.process.send_signal(signal.SIGCONT)
    rig.serves()


def test_the_button_of_the_device_is_a_fault_that_no_reset_clears_while_it_is_pressed(rig):
    rig.serves()
    rig.device.say("estop 1")
    rig.falls("device_estop")
    again = "fault device_estop is latched again: its cause is still there"
    assert rig.ear.trigger("reset") == (False, again)
    rig.device.say("estop 0")
    rig.serves()


@pytest.mark.parametrize("rig", ["udp"], indirect=True)
def test_a_device_behind_a_bridge_is_shown(rig, ros_domain):
    rig.serves()
    ended = haptic("device", "show", "--domain", ros_domain, "--json")
    shown = json.loads(ended.stdout)
    assert ended.returncode == 0 and shown["device"] == ["reference_udp", ""]
    assert shown["status of the device"][0] in ("none", "motors cut by its watchdog")


@pytest.mark.realtime
@pytest.mark.parametrize("rig", ["udp"], indirect=True)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_driver_that_ends_leaves_the_motor_that_it_pressed_at_zero(rig, number):
    rig.serves()
    rig.ear.go_to(FREE)
    rig.ear.engaged()
    rig.ear.go_to(PRESSED)
    until(lambda: rig.motor() and rig.motor()[-1] > PUSH, "the wall is pressed", rig.ear.look)
    rig.signal("haptic_driver", number)
    assert rig.ended("haptic_driver") == (-number if number == signal.SIGKILL else 0)
    until(lambda: rig.motor()[-1] == 0.0, "the motor is zero")
    rig.start("haptic_driver")
