# SPDX-License-Identifier: Apache-2.0
"""Faults that no true device makes and no loopback provokes: a device in the test's hands, and a stalled python."""

import itertools
import os
import select
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from ear import Ear
from live_nodes import HOLDING, command
from waiting import exit_code, until

from haptic_device.process import ending_with_us
from haptic_device.realtime import clock, shared_memory

SPACE = "/hands"
WALL = {"wall__normals": [1.0, 0.0], "wall__offsets": [0.0], "wall__stiffness": [1000.0], "wall__damping": [0.0]}
SOFT = {"coupling__stiffness": 100.0, "coupling__damping": 0.1, "coupling__rotational_stiffness": 0.1, **HOLDING}
GIVEN = {"servo__rate": 500.0, "fault__silence": 1.0, "fault__unattended": 3.0, "engage__time": 0.05, **WALL, **SOFT}
STANDING_STILL = """
import ctypes, os, signal, sys, time
given, taken = int(sys.argv.pop(1)), int(sys.argv.pop(1))

def hold(*_):
    os.write(given, b"held")
    ctypes.PyDLL(None).read(taken, ctypes.create_string_buffer(1), 1)  # a C call that keeps the interpreter to itself
    os.write(given, b"free")

def wait(*_):
    os.write(given, b"held")
    os.read(taken, 1)  # the main thread alone stands still: its executor serves nothing
    os.write(given, b"free")

signal.signal(signal.SIGUSR1, hold)
signal.signal(signal.SIGUSR2, wait)
from haptic_device.nodes.driver import main
sys.exit(main())
"""
WARN, ERROR = 1, 2
STEP = 2e-5  # [m] that the handle goes in a tick
COUNTS = 200000.0  # per metre, of the device `desktop`


class Driver:
    """A driver whose Python, or its main thread alone, stands still from hold() to free()."""

    def __init__(self, log):
        (self._heard, given), (taken, self._word) = os.pipe(), os.pipe()
        words = [sys.executable, "-c", STANDING_STILL, given, taken, *command("haptic_driver", SPACE, **GIVEN)[3:]]
        with open(log, "w") as file:
            self._process = subprocess.Popen(ending_with_us(words), stdout=file, stderr=file, pass_fds=(given, taken))
        os.close(given)
        os.close(taken)
        self.held = False

    def hold(self, what=signal.SIGUSR1):
        """Returns when its Python stands still; SIGUSR2: its main thread."""
        self._process.send_signal(what)
        self._hear(b"held")
        self.held = True

    def free(self):
        """Returns when it goes on."""
        self.held = False
        os.write(self._word, b"x")
        self._hear(b"free")

    def _hear(self, word):
        until(lambda: select.select([self._heard], [], [], 0.0)[0], f"the word {word} of the driver")
        assert os.read(self._heard, 4) == word

    def close(self):
        """Ends it; its exit code."""
        if self.held:
            os.write(self._word, b"x")
        self._process.send_signal(signal.SIGINT)
        try:
            return exit_code(self._process)
        finally:
            self._process.kill()
            os.close(self._heard)
            os.close(self._word)


class Hands:
    """A device behind the page that says whatever the test wants it to say."""

    def __init__(self):
        self.page = shared_memory.SharedMemory(
            shared_memory.file_name(os.environ["ROS_DOMAIN_ID"], SPACE), shared_memory.DEVICE
        )
        self.x, self.goal, self.drag, self.motor, self._stop = 0.0, 0.0, 0.0, 0.0, False
        self.writes = [(0, 0.0)]  # of the servo that were seen: when [ns], motor
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self):
        inbox, outbox = np.zeros(shared_memory.SERVO_WORDS, np.int64), np.zeros(shared_memory.DEVICE_WORDS, np.int64)
        scratch = clock.scratch()
        while not self._stop:
            shared_memory.read_servo(self.page.words, inbox)
            now = int(clock.now_ns(scratch))
            self.motor = float(inbox.view(np.float64)[5])
            if inbox[1] != self.writes[-1][0]:
                self.writes.append((int(inbox[1]), self.motor))
                self.x += max(-STEP, min(STEP, self.goal - self.x))
            latched = inbox[2] if abs(int(inbox[2]) - now) < 100_000_000 else now
            counts, drag = np.array([COUNTS * self.x, 0.0, 0.0]), np.array([self.drag, 0.0, 0.0])
            shared_memory.write_device(self.page.words, outbox, 1, latched, 0, now, counts, drag, 0)
            time.sleep(0.0003)

    def press(self):
        """Goes 5 mm into the wall, slowly by the servo's own time; the motor answers with 5 N."""
        self.goal = -0.005

    def close(self):
        self._stop = True
        self._thread.join(60.0)
        assert not self._thread.is_alive()
        self.page.close()


@pytest.fixture(scope="module")
def ear(ros_domain):
    ear = Ear(ros_domain, SPACE)
    yield ear
    ear.close()


@pytest.fixture(scope="module")
def driver(ros_domain, tmp_path_factory):
    driver = Driver(tmp_path_factory.mktemp("driver") / "log")
    yield driver
    assert driver.close() == 0


@pytest.fixture(scope="module")
def hands(ros_domain):
    hands = Hands()
    yield hands
    hands.close()


def press(hands, ear):
    """The device in the hands, engaged and pressing the wall with 5 N."""

    ear.until(lambda: ear.said.get("haptic_driver"), "the driver says something")
    hands.drag = hands.goal = hands.x = 0.0
    seen = len(hands.writes)
    ear.until(lambda: len(hands.writes) > seen + 3, "the servo has seen that")  # 0 may be a jump away, which is a fault
    ear.until(lambda: ear.trigger("reset")[0] and ear.trigger("enable")[0], "enabled")
    ear.news("haptic_driver", lambda level, message, values: values["state"] == "engaged", what="it is engaged")
    hands.press()
    ear.until(lambda: hands.motor > 4.9, "5 N")


def provoke(hands, ear, name, act):
    """Presses the wall and does act(), which ends in this fault: told, and the motor off."""
    begin = len(ear.said.setdefault("haptic_driver", []))

    press(hands, ear)
    act()

    def told():
        return next((said for said in ear.said["haptic_driver"][begin:] if said[2]["fault"] == name), None)

    assert ear.until(told, f"the fault {name}")[:2] == (ERROR, f"fault {name}")
    ear.until(lambda: hands.motor == 0.0, "the motor is off")


def test_an_encoder_that_jumps_is_a_fault(hands, driver, ear):
    def jump():
        hands.goal = hands.x = 0.1

    provoke(hands, ear, "encoder_jump", jump)


def test_a_sensor_that_says_no_number_is_a_fault(hands, driver, ear):
    def fail():
        hands.drag = float("nan")

    provoke(hands, ear, "not_a_number", fail)


def test_while_python_stands_still_the_servo_goes_on_and_afterwards_that_is_said(hands, driver, ear):
    press(hands, ear)
    begin = len(ear.said["haptic_driver: stall"])
    driver.hold()
    held, seen = time.monotonic(), len(hands.writes)
    until(lambda: len(hands.writes) >= seen + 20, "20 writes of the servo")
    until(lambda: time.monotonic() > held + 0.5, "half a second")
    stood = time.monotonic() - held
    written = [(when, motor) for when, motor in hands.writes[seen:]]
    driver.free()
    assert min(motor for _, motor in written[:20]) > 4.9
    assert all(later > before for (before, _), (later, _) in itertools.pairwise(written))
    heard = ear.said["haptic_driver: stall"]
    said = ear.until(
        lambda: next((said for said in heard[begin:] if float(said[2]["value"]) >= stood), None), "the stall is told"
    )
    assert said[0] >= WARN and said[1].endswith(" s")


def test_an_estop_is_answered_with_the_motor_at_zero_while_the_driver_serves_nothing_else(hands, driver, ear):
    press(hands, ear)
    driver.hold(signal.SIGUSR2)
    try:
        assert ear.trigger("estop") == (True, "e-stop latched, motor zero")
        ear.until(lambda: hands.motor == 0.0, "the motor is off")
    finally:
        driver.free()
    assert ear.news("haptic_driver", lambda level, message, values: values["fault"])[1] == "fault estop"


def test_a_servo_that_nobody_could_stop_for_too_long_stops_itself(hands, driver, ear):
    press(hands, ear)
    driver.hold()
    seen = len(hands.writes)
    until(lambda: hands.motor == 0.0, "the motor is off")  # while python still stands
    pushed = [when for when, motor in hands.writes[seen:] if motor > 4.9]
    stopped = next(when for when, motor in hands.writes[seen:] if motor == 0.0)
    assert pushed and max(pushed) < stopped
    driver.free()
    said = ear.news("haptic_driver", lambda level, message, values: values["fault"], what="a fault")
    assert said[:2] == (ERROR, "fault unattended") and hands.motor == 0.0
