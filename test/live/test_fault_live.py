# SPDX-License-Identifier: Apache-2.0
"""Faults of running nodes: by the hand, by a device in the test's hands, and by a Python that stands still."""

import contextlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from ear import Ear
from live_nodes import DISPLAY, command, page_path
from walls import ERROR, build, press, provoke

from haptic_device.realtime import clock, shared_memory

NODES = {name: DISPLAY[name] for name in ("haptic_loopback", "haptic_driver")}
SPACE = "/hands"
WARN = 1
COUNTS = 200000.0  # per metre, of the device `desktop`
# Told by SIGUSR1 it waits for a line in a C call that keeps the interpreter to itself.
STANDING_STILL = """
import ctypes, os, signal, sys
def hold(*_):
    os.write(1, b"held\\n")
    ctypes.PyDLL(None).read(0, ctypes.create_string_buffer(8), 8)
    os.write(1, b"free\\n")
signal.signal(signal.SIGUSR1, hold)
from haptic_device.nodes.driver import main
sys.exit(main())
"""
BY_THE_HAND = {  # fault: live settings, where it is enabled, and the ways from there [m]
    "velocity": ({}, -0.008, (0.115,)),
    "position": ({}, 0.07, (0.12,)),
    "saturation": ({"fault.saturation": 0.05}, 0.0, (-0.03, -0.06, -0.09)),
    "duty": ({"fault.duty_time": 0.1, "fault.duty": 0.1}, 0.0, (-0.06,)),
}


@pytest.mark.realtime
@pytest.mark.parametrize("name", BY_THE_HAND)
def test_a_hand_that_goes_too_fast_too_far_or_too_hard_is_a_fault(display, name):
    settings, begin, ways = BY_THE_HAND[name]
    build(display)

    def go():
        for parameter, value in settings.items():
            assert display.set(parameter, value) == (True, "")
        display.go_to(begin)
        display.truth(lambda truth: abs(truth.velocity[0]) < 1e-3, what="the handle is still")
        display.cleared()
        display.engaged()
        for way in ways:
            display.go_to(way)

    provoke(display, name, go)


@pytest.fixture
def held(display, nodes, start):
    """(ear, hold, free) of an engaged driver that presses the wall; its Python stands still between these two."""
    nodes.lack("haptic_driver")
    words = command("haptic_driver", **NODES["haptic_driver"] | {"fault__unattended": 3.0})
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    driver = start([sys.executable, "-c", STANDING_STILL, *words[3:]], **pipes)

    def hold():
        driver.send_signal(signal.SIGUSR1)
        assert driver.stdout.readline() == "held\n"

    def free():
        driver.stdin.write("go on\n")
        driver.stdin.flush()
        assert driver.stdout.readline() == "free\n"

    display.as_started(NODES["haptic_driver"])
    press(build(display))
    return display, hold, free


def test_while_python_stands_still_the_servo_goes_on_stops_itself_when_that_takes_too_long_and_both_is_said(held):
    ear, hold, free = held
    stalls, began = ear.said["haptic_driver: stall"], time.monotonic()
    told, begin = len(stalls), len(ear.truths)
    hold()
    stood = time.monotonic()
    ear.truth(lambda truth: not ear.motor(truth).any(), what="the motor is off")  # while Python still stands
    stood = time.monotonic() - stood
    pushed = [ear.motor(truth)[0] > 4.9 for truth in ear.truths[begin:] if ear.time(truth) > began]
    assert sum(pushed) > 20 and pushed == sorted(pushed, reverse=True)  # it held on, and then let go for good
    free()
    said = ear.news("haptic_driver", lambda level, message, values: values["fault"], what="a fault")
    assert said[:2] == (ERROR, "fault unattended")
    said = ear.until(
        lambda: next((said for said in stalls[told:] if float(said[2]["value"]) >= stood), None), "the stall is told"
    )
    assert said[0] >= WARN and said[1].endswith(" s")


@pytest.fixture
def hands(ros_domain):
    """A device behind the page that says what the test wants it to say."""
    page = shared_memory.SharedMemory(page_path(SPACE).name, shared_memory.DEVICE)
    told, over = {"x": 0.0, "drag": 0.0, "motor": 0.0}, threading.Event()

    def serve():
        inbox, outbox = np.zeros(shared_memory.SERVO_WORDS, np.int64), np.zeros(shared_memory.DEVICE_WORDS, np.int64)
        scratch = clock.scratch()
        while not over.wait(0.0003):
            shared_memory.read_servo(page.words, inbox)
            now, told["motor"] = int(clock.now_ns(scratch)), float(inbox.view(np.float64)[5])
            latched = inbox[2] if abs(int(inbox[2]) - now) < 100_000_000 else now
            counts, drag = np.array([COUNTS * told["x"], 0.0, 0.0]), np.array([told["drag"], 0.0, 0.0])
            shared_memory.write_device(page.words, outbox, 1, latched, 0, now, counts, drag, 0, 0)

    serving = threading.Thread(target=serve)
    serving.start()
    yield told
    over.set()
    serving.join()
    page.close()


@pytest.mark.realtime
def test_an_encoder_that_jumps_and_a_sensor_that_says_no_number_are_faults(hands, start, ros_domain):
    start(command("haptic_driver", SPACE, **NODES["haptic_driver"]))
    with contextlib.closing(Ear(ros_domain, SPACE)) as ear:
        for entry, value, name in (("x", 0.1, "encoder_jump"), ("drag", float("nan"), "not_a_number")):
            ear.until(lambda: ear.trigger("reset")[0] and ear.trigger("enable")[0], "enabled")
            ear.news("haptic_driver", lambda level, message, values: values["state"] == "engaged", what="it is engaged")
            hands[entry] = value
            said = ear.news("haptic_driver", lambda level, message, values: values["fault"], what=name)
            assert said[:2] == (ERROR, f"fault {name}") and hands["motor"] == 0.0
            hands["drag"] = 0.0
