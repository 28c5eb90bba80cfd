# SPDX-License-Identifier: Apache-2.0
"""What ends a force: a person, a state, a fault, a signal, and the end of either side."""

import os
import signal
import subprocess
import sys
import time

import pytest
from lifecycle_msgs.msg import State, Transition
from live_nodes import DISPLAY, command, last_write, page_path
from waiting import exit_code
from walls import build, press, provoke

from haptic_device.message_fields import AXES
from haptic_device.nodes import messages

NODES = DISPLAY
NO_MOTOR = [0.0, 0.0, 0.0]
# Told by SIGUSR2 its main thread waits for a line: its executor serves nothing meanwhile.
HELD = """
import signal, sys
signal.signal(signal.SIGUSR2, lambda *_: (print("held", flush=True), sys.stdin.readline()))
from haptic_device.nodes.driver import main
sys.exit(main())
"""


@pytest.fixture
def display(display):
    return build(display)


def test_enabling_and_disabling_let_the_force_come_and_go(display):
    press(display)
    assert display.trigger("disable") == (True, "motor zero")
    display.motor_off_after(time.monotonic())


def test_an_estop_latches_until_it_is_reset(display):
    def stop():
        press(display)
        assert display.trigger("estop") == (True, "e-stop latched, motor zero")

    provoke(display, "estop", stop)
    assert display.trigger("reset")[0]
    display.go_to(0.0)
    assert display.trigger("enable") == (True, "enabled")


def test_deactivation_zeroes_the_motor_before_it_answers_and_it_can_be_activated_again(display):
    press(display)
    display.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    last = last_write()
    assert last.engaged == 0 and last.motor == NO_MOTOR
    display.motor_off_after(max(last.written, last.deadline) * 1e-9)
    assert display.trigger("enable") == (False, "the servo does not run: no device, or the node is not active")
    display.change("haptic_driver", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    display.cleared()
    press(display)


def test_a_silent_device_is_a_fault(display, nodes):
    device = nodes.running["haptic_loopback"]

    def fall_silent():
        press(display)
        os.kill(device.pid, signal.SIGSTOP)
        try:
            display.news("haptic_driver", lambda level, message, values: values["fault"], what="a fault")
        finally:
            os.kill(device.pid, signal.SIGCONT)

    provoke(display, "device_silent", fall_silent)


def test_a_killed_drivers_motor_is_cut_when_the_watchdog_is_over_by_the_plants_own_time(display, nodes):
    press(display)
    assert nodes.end("haptic_driver", signal.SIGKILL) == -signal.SIGKILL
    display.motor_off_after(last_write().over)
    assert page_path().exists()


def test_an_estop_is_answered_with_the_motor_at_zero_while_the_driver_serves_nothing_else_and_signals_end_both_well(
    nodes, ear, start
):
    nodes.lack("haptic_driver", "haptic_simulation")
    words = command("haptic_driver", **NODES["haptic_driver"])
    driver = start([sys.executable, "-c", HELD, *words[3:]], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    ear.as_started(NODES["haptic_driver"])
    press(build(ear))
    driver.send_signal(signal.SIGUSR2)
    assert driver.stdout.readline() == "held\n"
    assert ear.trigger("estop") == (True, "e-stop latched, motor zero")
    ear.motor_off_after(time.monotonic())
    driver.stdin.write("go on\n")
    driver.stdin.flush()
    assert ear.news("haptic_driver", lambda level, message, values: values["fault"])[1] == "fault estop"
    ear.cleared()
    press(ear)
    driver.send_signal(signal.SIGTERM)
    assert exit_code(driver) == 0
    last = last_write()
    assert last.engaged == 0 and last.motor == NO_MOTOR and page_path().exists()
    assert nodes.end("haptic_loopback", signal.SIGINT) == 0
    assert not page_path().exists()


def test_a_killed_loopback_leaves_a_stale_page_that_the_next_one_takes_over_and_says_so_and_a_script_takes_no_targets(
    ear, nodes
):
    def begun(**given):
        """The process of a new loopback, and the first truth that it tells."""
        began, process = time.monotonic(), nodes.start("haptic_loopback", **given)
        return process, ear.truth(lambda truth: ear.time(truth) > began, what="the new one serves")

    begun()
    nodes.end("haptic_loopback", signal.SIGKILL)
    assert page_path().exists()
    process, truth = begun(motion__name="hold", motion__start=[0.01, 0.02, 0.3])
    assert truth.position[:3] == pytest.approx([0.01, 0.02, 0.3], abs=1e-6)
    assert f"took over the stale page {page_path()}" in process.log.read_text()

    def refused(level, message, values):
        ear.target.publish(messages.JointState(name=list(AXES), position=[0.05, 0.0, 0.0]))
        return int(values["refused_targets"]) > 0

    ear.news("haptic_loopback", refused, what="targets are refused")
    assert ear.truths[-1].position[3:6] == pytest.approx([0.01, 0.02, 0.3], abs=1e-9)
