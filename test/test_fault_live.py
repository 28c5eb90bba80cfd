# SPDX-License-Identifier: Apache-2.0
"""Faults that no true device makes and no loopback provokes: a device in the test's hands, and a stalled python."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from live_nodes import Ear, command, held_up

from haptic_device.runtime import clock, page
from haptic_device.runtime.process import die_with_parent

pytestmark = pytest.mark.live

SPACE = "/hands"
WALL = {"wall__normals": [1.0, 0.0], "wall__offsets": [0.0], "wall__stiffness": [1000.0], "wall__damping": [0.0]}
SOFT = {"coupling__stiffness": 100.0, "coupling__damping": 0.1, "coupling__rotational_stiffness": 0.1}
GIVEN = {"servo__rate": 500.0, "fault__silence": 1.0, "fault__unattended": 1.5, "engage__time": 0.05, **WALL, **SOFT}
HELD = "lambda *_: ctypes.PyDLL(None).usleep({})"  # a C call that keeps the interpreter to itself
STALLING = f"""
import ctypes, signal, sys
signal.signal(signal.SIGUSR1, {HELD.format(600_000)})
signal.signal(signal.SIGUSR2, {HELD.format(2_500_000)})
from haptic_device.node.driver import main
sys.exit(main())
"""
ERROR = 2
COUNTS = 200000.0  # per metre, of the device `desktop`


class Hands:
    """A device behind the page that says whatever the test wants it to say."""

    def __init__(self):
        self.page = page.Page(page.page_name(os.environ["ROS_DOMAIN_ID"], SPACE), page.DEVICE)
        self.x, self.drag, self.written, self.motor, self._stop = 0.0, 0.0, 0, 0.0, False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self):
        inbox, outbox = np.zeros(page.SERVO_WORDS, np.int64), np.zeros(page.DEVICE_WORDS, np.int64)
        scratch = clock.scratch()
        while not self._stop:
            page.read_servo(self.page.words, inbox)
            now = int(clock.now_ns(scratch))
            self.written, self.motor = int(inbox[1]), float(inbox.view(np.float64)[5])
            latched = inbox[2] if abs(int(inbox[2]) - now) < 100_000_000 else now
            counts, drag = np.array([COUNTS * self.x, 0.0, 0.0]), np.array([self.drag, 0.0, 0.0])
            page.write_device(self.page.words, outbox, 1, latched, 0, now, counts, drag)
            time.sleep(0.0003)

    def press(self):
        """Goes 5 mm into the wall, slowly; the motor answers with 5 N."""
        for self.x in np.linspace(0.0, -0.005, 100):
            time.sleep(0.002)

    def close(self):
        self._stop = True
        self._thread.join()
        self.page.close()


@pytest.fixture(scope="module")
def ear(ros_domain):
    ear = Ear(ros_domain, SPACE)
    yield ear
    ear.close()


@pytest.fixture(scope="module")
def driver(ros_domain, tmp_path_factory):
    words = command("haptic_driver", SPACE, **GIVEN)
    own = os.getpid()
    with open(tmp_path_factory.mktemp("driver") / "log", "w") as log:
        words, end = [sys.executable, "-c", STALLING, *words[3:]], lambda: die_with_parent(own)
        process = subprocess.Popen(words, stdout=log, stderr=log, preexec_fn=end)
    yield process
    process.send_signal(signal.SIGINT)
    assert process.wait(20.0) == 0


@pytest.fixture(scope="module")
def hands(ros_domain):
    hands = Hands()
    yield hands
    hands.close()


@pytest.fixture
def pressing(hands, driver, ear):
    """The device in the hands, engaged and pressing the wall with 5 N."""
    hands.drag = hands.x = 0.0
    ear.until(lambda: ear.said.get("haptic_driver"))
    ear.until(lambda: ear.trigger("reset")[0] and ear.trigger("enable")[0])  # going back to 0 may latch once more
    ear.news("haptic_driver", lambda level, message, values: values["state"] == "engaged")
    hands.press()
    ear.until(lambda: hands.motor > 4.9)
    return hands


def latched(ear, hands, name):
    said = ear.news("haptic_driver", lambda level, message, values: values["fault"])
    assert said[:2] == (ERROR, f"fault {name}") and hands.motor == 0.0


def test_an_encoder_that_jumps_is_a_fault(pressing, ear):
    pressing.x += 0.1
    latched(ear, pressing, "encoder_jump")


def test_a_sensor_that_says_no_number_is_a_fault(pressing, ear):
    pressing.drag = float("nan")
    latched(ear, pressing, "not_a_number")


def test_while_python_stands_still_the_servo_goes_on_and_afterwards_that_is_said(pressing, driver, ear):
    begin = len(ear.said.get("haptic_driver: stall", []))
    driver.send_signal(signal.SIGUSR1)
    told, longest, last = time.monotonic(), 0, pressing.written
    while time.monotonic() < told + 0.4:
        longest, last = max(longest, pressing.written - last), pressing.written
        assert pressing.motor > 4.9
        time.sleep(0.001)
    assert longest * 1e-9 < 0.2 + held_up()
    heard = ear.said["haptic_driver: stall"]
    said = ear.until(lambda: next((said for said in heard[begin:] if float(said[2]["value"]) > 0.5), None))
    assert said[0] >= 1 and said[1].endswith(" s")
    assert ear.last()["haptic_driver"][2]["fault"] == ""


def test_a_servo_that_nobody_could_stop_for_too_long_stops_itself(pressing, driver, ear):
    driver.send_signal(signal.SIGUSR2)
    told, heard = time.monotonic(), len(ear.said["haptic_driver"])
    while pressing.motor != 0.0:
        assert time.monotonic() < told + 2.4 + held_up()
        time.sleep(0.001)
    assert len(ear.said["haptic_driver"]) == heard
    latched(ear, pressing, "unattended")
