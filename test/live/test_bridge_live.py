# SPDX-License-Identifier: Apache-2.0
"""The bridge between a driver and the reference device, over a cable that can be pulled out: whatever ends, the motor
is zero when the device's watchdog is over, by the device's own log and clock."""

import contextlib
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from growing_log import GrowingLog
from in_process import haptic
from live_nodes import HOLDING, Nodes
from waiting import LIMIT, exit_code, until

from haptic_device.description import load_device
from haptic_device.message_fields import AXES
from haptic_device.nodes import messages
from haptic_device.parameters import LOOPBACK
from haptic_device.process import ending_with_us
from haptic_sim.supervision import reference_device

CABLE = Path(__file__).resolve().parents[1] / "cable.py"
DEVICES = {"udp": "reference_udp", "serial": "reference_pty"}
WATCHDOG = 15_000_000  # [ns] of device and bridge
WALL = {"wall__normals": [1.0, 0.0], "wall__offsets": [0.0], "wall__stiffness": [1000.0], "wall__damping": [0.0]}
SOFT = {"coupling__stiffness": 100.0, "coupling__damping": 0.1, "coupling__rotational_stiffness": 0.1, **HOLDING}
DRIVER = {"servo__rate": 500.0, "publish__rate": 100.0, "engage__time": 0.05, "fault__silence": 0.2, **WALL, **SOFT}
HAND = {"motion.name": "follow", "motion.start": (0.02, 0.0, 0.0)}
FREE, PRESSED, PUSH = 0.02, -0.005, 2.0  # [m] off the wall and in it; [N] that show it
WARN, ERROR = 1, 2
COMMAND, CHANGE = 1, 4  # how many words such a line of the device's log has


class Program:
    """A program beside the nodes, which is told what to do by lines."""

    def __init__(self, *words):
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(ending_with_us([*map(str, words)]), stdin=pipe, stdout=pipe, text=True)
        self.line = self.process.stdout.readline().strip()

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def told(self, order="tell"):
        """What it answers."""
        self.say(order)
        return json.loads(self.process.stdout.readline())

    def end(self):
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        with contextlib.suppress(BrokenPipeError):
            self.process.communicate()


class Rig:
    """Device, cable, bridge and driver: a wall that the hand presses the handle into."""

    def __init__(self, kind, folder, nodes, ear):
        self.kind, self.ear, self._folder, self._nodes = kind, ear, folder, nodes
        self._config, self._starts, self._where = folder / "config", 0, folder / "device"
        described = load_device(DEVICES[kind])
        hand = {parameter.name: parameter.default for parameter in LOOPBACK} | HAND
        self._config.write_text(reference_device.config_of(described, hand))
        self.device, self._port = None, 0
        self.start_device()
        ends = ("udp", 0, self._port) if kind == "udp" else ("serial", folder / "line", self._where)
        self.cable = Program(sys.executable, CABLE, *ends)
        self.start("haptic_bridge")
        self.start("haptic_driver")

    def start_device(self):
        """A device at the place where the one before it was."""
        self._starts += 1
        log = self._folder / f"motor{self._starts}"
        self._log = GrowingLog(log, len)
        line = ("--udp", self._port) if self.kind == "udp" else ("--pty", self._where)
        words = (reference_device.compiled(), "--config", self._config, "--log", log, *line)
        self.device = Program(*words)
        if self.kind == "udp":
            self._port = int(self.device.line.split()[1])

    def start(self, name):
        """A node that has ended, or never ran."""
        given = {"device": DEVICES[self.kind]} | (DRIVER if name == "haptic_driver" else {"port": self.cable.line})
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
        return f"UDP 127.0.0.1:{self.cable.line}" if self.kind == "udp" else self.cable.line

    def motor(self):
        """(time [ns], force on x [N]) of each change that the device has logged."""
        changes = [line.split() for line in self._log.lines(CHANGE)]
        return [(int(time), float(force)) for time, force, *_ in changes]

    def commands(self):
        """When each command began to act [ns], as the device has logged it: the line may lose what it is told."""
        return list(map(int, self._log.lines(COMMAND)))

    def pushes(self):
        changes = self._log.lines(CHANGE)
        return bool(changes) and float(changes[-1].split()[1]) > PUSH

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

    def press(self):
        """The handle in the wall and the motor against it. Where a busy machine lets the device cut it, once more."""
        end = time.monotonic() + LIMIT
        self._heal()
        while not self._pressed():
            assert time.monotonic() < end, self.ear.last()

    def _heal(self):
        """All that runs goes on, and all runs: a test that failed may have left it otherwise."""
        for order in ("pass", "open"):
            self.cable.told(order)
        self.device.process.send_signal(signal.SIGCONT)
        if self.device.process.poll() is not None:
            self.start_device()
        for name in ("haptic_bridge", "haptic_driver"):
            self.signal(name, signal.SIGCONT)
            if self._nodes.running[name].poll() is not None:
                self.start(name)

    def _pressed(self):
        ear = self.ear
        ear.go_to(FREE)
        ear.cleared()
        begin = len(ear.said.setdefault("haptic_driver", []))
        ear.trigger("enable")
        state = ear.until(lambda: _state(ear.said["haptic_driver"][begin:], "engaged", "fault"), "it is engaged")
        if state == "fault":
            return False
        begin, into = len(ear.said["haptic_driver"]), messages.JointState(name=list(AXES), position=[PRESSED, 0.0, 0.0])

        def over():
            ear.target.publish(into)  # again and again: the first ones are lost where a bridge is new
            return self.pushes() or _state(ear.said["haptic_driver"][begin:], "fault")

        ear.until(over, "the wall is pressed")
        return self.pushes()

    def judge(self):
        """Waits until the device has no command any more; judges that its motor was cut in time. What the
        cable has seen."""
        seen = self.ear.until(lambda: (told := self.cable.told())["cut"] and told, "the device's own watchdog has cut")
        changes = self.motor()
        zero = changes[-1]
        assert zero[1] == 0.0, changes[-3:]
        last = max(time for time in self.commands() if time < zero[0])
        assert zero[0] - last <= WATCHDOG
        assert 0 < seen["pushed"] < zero[0]
        return seen

    def close(self):
        self.cable.end()
        self.device.end()


def _state(said, *states):
    return next((values["state"] for _, _, values in said if values["state"] in states), None)


@pytest.fixture(scope="module", params=list(DEVICES))
def rig(request, ros_domain, nodes, ear, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    with Nodes(folder) as own:
        rig = Rig(request.param, folder, own, ear)
        try:
            yield rig
        finally:
            rig.close()


ENDINGS = [("udp", signal.SIGKILL), ("udp", signal.SIGTERM), ("udp", signal.SIGHUP)]
ENDINGS += [("serial", signal.SIGKILL), ("serial", signal.SIGINT)]


@pytest.mark.parametrize("rig, number", ENDINGS, indirect=["rig"])
def test_a_driver_that_ends_leaves_the_motor_at_zero(rig, number):
    rig.press()
    rig.signal("haptic_driver", number)
    seen = rig.judge()
    assert not any(seen["motors"])  # the bridge took it back
    assert rig.ended("haptic_driver") == (-number if number == signal.SIGKILL else 0)
    assert rig.motor()[-1][1] == 0.0


def test_a_driver_that_is_stopped_pushes_nobody_when_it_goes_on(rig):
    rig.press()
    rig.signal("haptic_driver", signal.SIGSTOP)
    assert not any(rig.judge()["motors"])
    changes = rig.motor()
    rig.signal("haptic_driver", signal.SIGCONT)
    rig.falls("device_watchdog", "device_silent")
    assert rig.motor() == changes


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_bridge_that_ends_leaves_the_motor_at_zero_and_the_driver_works_with_the_next_one(rig, number):
    rig.press()
    rig.signal("haptic_bridge", number)
    seen = rig.judge()
    rig.falls("device_silent")
    if number == signal.SIGTERM:
        assert not any(seen["motors"]) and rig.ended("haptic_bridge") == 0
    else:
        assert any(seen["motors"]) and rig.ended("haptic_bridge") == -number  # nobody could: the device cut alone
    rig.press()


def test_a_bridge_that_is_stopped_pushes_nobody_when_it_goes_on(rig):
    rig.press()
    rig.signal("haptic_bridge", signal.SIGSTOP)
    seen = rig.judge()
    assert any(seen["motors"])
    rig.falls("device_silent")
    changes = rig.motor()
    rig.signal("haptic_bridge", signal.SIGCONT)
    until(lambda: rig.cable.told()["commanded"] > seen["commanded"], "the bridge speaks again")
    assert not any(rig.cable.told()["motors"]) and rig.motor() == changes


def test_where_nothing_passes_any_more_the_device_cuts_by_itself_and_afterwards_all_works_again(rig):
    before = rig.counted("sessions")
    rig.press()
    rig.cable.told("hold")
    seen = rig.judge()
    assert any(seen["motors"])
    rig.falls("device_silent")
    rig.bridge_says(WARN, f"no device answers on {rig.address}")
    changes = rig.motor()
    rig.cable.told("pass")
    rig.bridge_says(0, "serving")
    assert rig.motor() == changes and rig.counted("sessions") > before
    rig.press()


@pytest.mark.parametrize("rig", ["serial"], indirect=True)
def test_a_line_that_is_unplugged_and_plugged_in_again_is_opened_again_at_the_same_path(rig):
    before = rig.counted("sessions"), rig.counted("reopened")
    rig.press()
    rig.cable.told("close")
    rig.judge()
    rig.falls("device_silent")
    rig.bridge_says(ERROR, f"port {rig.cable.line} cannot be opened: No such file or directory")
    rig.cable.told("open")
    rig.bridge_says(0, "serving")
    assert rig.counted("sessions") > before[0] and rig.counted("reopened") == before[1] + 1
    rig.press()


def test_a_device_that_dies_is_said_and_one_that_is_started_in_its_place_works_after_a_reset(rig):
    before = rig.counted("sessions"), rig.counted("reopened")
    rig.press()
    rig.device.end()
    rig.falls("device_silent")
    if rig.kind == "udp":
        rig.bridge_says(WARN, f"no device answers on {rig.address}")
    else:
        rig.bridge_says(ERROR, f"port {rig.address} cannot be opened: No such file or directory")
    rig.start_device()
    rig.bridge_says(0, "serving")
    assert rig.motor() == []
    assert rig.counted("sessions") > before[0] and rig.counted("reopened") == before[1] + (rig.kind == "serial")
    rig.press()


def test_a_device_that_stands_still_is_said_and_pushes_nobody_when_it_goes_on(rig):
    rig.press()
    rig.device.process.send_signal(signal.SIGSTOP)
    rig.falls("device_silent")
    rig.bridge_says(WARN, f"no device answers on {rig.address}")
    rig.device.process.send_signal(signal.SIGCONT)
    rig.bridge_says(0, "serving")
    assert rig.motor()[-1][1] == 0.0
    rig.press()


def test_the_button_of_the_device_is_a_fault_that_no_reset_clears_while_it_is_pressed(rig):
    rig.press()
    rig.device.say("estop 1")
    rig.falls("device_estop")
    assert rig.motor()[-1][1] == 0.0
    again = "fault device_estop is latched again: its cause is still there"
    assert rig.ear.trigger("reset") == (False, again)
    rig.device.say("estop 0")
    rig.press()


@pytest.mark.parametrize("rig", ["udp"], indirect=True)
def test_a_device_behind_a_bridge_is_shown(rig, ros_domain):
    rig.bridge_says(0, "serving")
    ended = haptic("device", "show", "--domain", ros_domain, "--json")
    shown = json.loads(ended.stdout)
    assert ended.returncode == 0 and shown["device"] == ["reference_udp", ""]
    assert shown["status of the device"][0] in ("none", "motors cut by its watchdog")
