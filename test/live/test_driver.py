# SPDX-License-Identifier: Apache-2.0
"""haptic_driver alive, on a loopback in another process: what it is asked, when it enables, who takes whose place."""

import os
import signal
import subprocess
import time

import pytest
from lifecycle_msgs.msg import State
from live_nodes import CUT, DISPLAY, SLOW, command, last_write, refusal_of
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from walls import ERROR, build, press, provoke

from haptic_device.message_fields import AXES
from haptic_device.nodes import messages
from haptic_device.nodes.ros_parameters import MOST_AT_ONCE
from haptic_device.recording.layouts import JointLayout
from haptic_display.service_requests import get_parameters

DRIVER = DISPLAY["haptic_driver"]
NODES = {name: DISPLAY[name] for name in ("haptic_loopback", "haptic_driver")}
WARN = 1


@pytest.fixture
def display(display):
    return build(display)


def test_a_change_of_state_is_told_by_itself_and_not_with_the_figures_of_each_half_second(display):
    told = display.alone["haptic_driver"]
    place = len(told)

    def alone(*states):
        """Whether one of these states was told after the one before it."""
        nonlocal place
        found = next((k for k in range(place, len(told)) if told[k]["state"] in states), None)
        place = place if found is None else found + 1
        return found is not None

    for name, states in 2 * [("enable", ["engaging", "engaged"]), ("estop", ["fault"]), ("reset", ["idle"])]:
        assert display.trigger(name)[0]
        display.until(lambda states=states: alone(*states), f"{states} told by itself")


def test_as_many_parameters_as_are_taken_at_once_are_set_and_of_one_more_none_is(display):
    def at_once(value, count):
        entries = [Parameter("fault.duty", value=value).to_parameter_msg()] * count
        request = SetParametersAtomically.Request(parameters=entries)
        return display.ask("haptic_driver/set_parameters_atomically", request).result

    assert at_once(0.5, MOST_AT_ONCE).successful
    refused = at_once(0.25, MOST_AT_ONCE + 1)
    assert refused.reason == f"{MOST_AT_ONCE + 1} parameters in one request; at most {MOST_AT_ONCE} are taken"
    assert display.told(get_parameters("haptic_driver", ["fault.duty"])) == (True, {"fault.duty": 0.5})


def test_handle_encoder_and_motor_of_one_tick_bear_the_same_stamp(display):
    layout, heard = JointLayout(AXES, "haptic_base_link"), {"encoder": set(), "motor": set()}

    def hear(topic, stamps):
        def note(data):
            stamps.add(layout.unpack(data).stamp_ns)

        return display.hear(topic, note, messages.STREAM, raw=True)

    listening = [hear(topic, stamps) for topic, stamps in heard.items()]
    display.hear_handles()
    display.until(
        lambda: {sample.stamp_ns for sample in display.handles}.intersection(*heard.values()), "one stamp on all three"
    )
    display.hear_handles(False)
    for one in listening:
        display.forget(one)


def test_a_second_driver_and_a_second_device_are_refused_and_the_first_go_on(display, start):
    second = {"servo": "haptic_driver", "device": "haptic_loopback"}
    started = {role: start(command(name), stderr=subprocess.PIPE) for role, name in second.items()}
    for role, process in started.items():
        said = refusal_of(process)
        assert said.startswith(f"{second[role]}: page ") and f"is held by another {role}; stop it" in said
    ended = time.monotonic()
    display.truth(lambda truth: display.time(truth) > ended, what="the first one goes on")
    display.engaged()


def test_a_margin_about_theta_that_is_used_up_is_told_though_the_plane_has_some_left(display):
    def used_up(level, message, values):
        return float(values["value"]) < 0.0

    assert display.set("passivity.policy", "off") == (True, "")
    assert display.set("coupling.rotational_stiffness", 100.0) == (True, "")
    display.news("haptic_driver: margin_theta", used_up, what="the margin about theta is used up")
    level, message, _ = display.said["haptic_driver: margin_theta"][-1]
    assert level == ERROR and message.endswith(" N m s/rad")


def test_a_stopped_servo_loses_its_motor_when_the_watchdog_is_over_and_finds_that_out_when_it_goes_on(display, nodes):
    press(display)
    process = nodes.running["haptic_driver"]
    os.kill(process.pid, signal.SIGSTOP)
    try:
        display.truth(lambda truth: not display.motor(truth).any(), what="the motor is off")
        display.motor_off_after(last_write().over)
    finally:
        os.kill(process.pid, signal.SIGCONT)
    provoke(display, CUT, lambda: None)


def test_a_killed_device_is_a_fault_and_a_new_one_works_after_a_reset(display, nodes):
    display.engaged()
    nodes.end("haptic_loopback", signal.SIGKILL)
    assert display.trigger("reset")[0]  # which does not help
    display.news("haptic_driver", lambda level, message, values: message == "fault device_silent", what="device_silent")
    began = time.monotonic()
    nodes.start("haptic_loopback", **NODES["haptic_loopback"])
    display.truth(lambda truth: display.time(truth) > began, what="the new device's handle")
    display.cleared()
    press(display)


def by_itself(ear, nodes, **given):
    """Starts the driver anew; what it first reports when it is not idle though nobody enabled it."""
    nodes.lack("haptic_driver")
    heard = ear.said["haptic_driver"]
    begin, ticks = len(heard), int(heard[-1][2]["ticks"])
    nodes.start("haptic_driver", auto_enable=True, **given, **DRIVER)

    def enabled():
        told = [values for _, _, values in heard[begin:]]
        new = next((k for k, values in enumerate(told) if int(values["ticks"]) < ticks), len(told))
        return next((values for values in told[new:] if values["state"] != "idle"), None)

    return ear.until(enabled, "enabled by itself")


def test_a_driver_enables_by_itself_without_a_tool_when_it_has_waited_and_with_one_when_it_answers(display, nodes):
    values = by_itself(display, nodes, auto_enable_wait=0.7)
    assert values["exchange_answered"] == "0"
    assert (int(values["ticks"]) + int(values["missed"])) / SLOW["servo__rate"] > 0.7  # the servo's own time
    nodes.have("haptic_simulation", scene="free_space")
    values = by_itself(display, nodes, auto_enable_wait=600.0)
    assert int(values["exchange_answered"]) > 0 and values["fault"] == ""
    nodes.lack("haptic_simulation")


def test_an_estop_latches_even_before_the_device_is_there(nodes, ear):
    def absent(level, message, values):
        return message.startswith("no device")

    nodes.lack(*list(nodes.running))
    nodes.start("haptic_driver", auto_enable=True, **DRIVER)
    assert ear.news("haptic_driver", absent, what="it misses its device")[0] == WARN
    ear.until(lambda: ear.state("haptic_driver") == State.PRIMARY_STATE_ACTIVE, "it is active")
    assert ear.trigger("enable") == (False, "the servo does not run: no device, or the node is not active")
    assert ear.trigger("estop") == (True, "e-stop latched for the device that is not there yet")
    nodes.start("haptic_loopback", **NODES["haptic_loopback"])
    said = ear.news("haptic_driver", lambda level, message, values: values["fault"], what="a fault")
    assert said[:2] == (ERROR, "fault estop") and said[2]["state"] == "fault"
    assert ear.trigger("reset")[0] and ear.trigger("enable") == (True, "enabled")
