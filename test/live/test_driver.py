# SPDX-License-Identifier: Apache-2.0
"""haptic_driver alive, on a loopback in another process: what it is asked, what it refuses, how it can end."""

import math
import os
import signal
import subprocess
import sys
import time

import pytest
from lifecycle_msgs.msg import State, Transition
from live_nodes import (
    CUT,
    DISPLAY,
    HOLDING,
    SLOW,
    command,
    last_write,
    page_path,
    refusal_of,
)
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python

from haptic_device.control import exchange_samples, faults
from haptic_device.message_fields import AXES, TAIL, exchange_names
from haptic_device.nodes import messages
from haptic_device.nodes.ros_parameters import MOST_AT_ONCE
from haptic_device.parameters import DRIVER as PARAMETERS
from haptic_device.recording.layouts import JointLayout
from haptic_sim.service_requests import get_parameters, set_parameters

WALL = {"wall.normals": [1.0, 0.0], "wall.offsets": [-0.01], "wall.stiffness": [2000.0], "wall.damping": [0.0]}
WALL |= HOLDING
DRIVER = DISPLAY["haptic_driver"]
NODES = {name: DISPLAY[name] for name in ("haptic_loopback", "haptic_driver")}
WARN, ERROR = 1, 2


@pytest.fixture
def display(display):
    """The display with a wall that pushes on after a stall."""
    answer = display.told(set_parameters("haptic_driver", WALL))
    assert answer[0], answer
    return display


def press(ear):
    """Has the hand press the wall until the motor holds more than 5 N against it."""

    ear.go_to(0.0)
    ear.engaged()
    ear.go_to(-0.025)
    ear.truth(lambda truth: ear.motor(truth)[0] > 5.0, what="the motor holds 5 N")


def provoke(ear, name, act):
    """Does act(), which ends in this fault: told, latched, and the motor off."""
    begin = len(ear.said["haptic_driver"])

    def told():
        return next((said for said in ear.said["haptic_driver"][begin:] if said[2]["fault"] == name), None)

    act()
    level, message, values = ear.until(told, f"the fault {name}")
    assert (level, message, values["state"]) == (ERROR, f"fault {name}", "fault")
    ear.motor_off_after(time.monotonic())
    assert ear.trigger("enable") == (False, f"fault {name} is latched; call ~/reset first")


def plain(value):
    """A number, or a list of them, out of a ParameterValue."""
    found = parameter_value_to_python(value)
    return found if isinstance(found, float) else list(found)


def test_what_a_test_leaves_behind_the_next_one_does_not_find(display, nodes):
    live = [parameter for parameter in PARAMETERS if parameter.live]
    assert display.set("clutch.open", True) == display.set("coupling.stiffness", 400.0) == (True, "")
    display.go_to(0.05)
    assert display.trigger("estop")[0]
    display.as_started(nodes.running["haptic_driver"].given)
    found = display.told(get_parameters("haptic_driver", [parameter.name for parameter in live]))[1]
    assert found == {one.name: DRIVER.get(one.name.replace(".", "__"), one.default) for one in live}
    truth = display.truth(lambda truth: True)
    assert abs(truth.position[:6]).max() < 1e-3 and not display.motor(truth).any()
    said = display.news("haptic_driver", lambda level, message, values: True)[2]
    assert (said["state"], said["fault"]) == ("idle", "")


def test_without_a_simulation_the_handle_moves_in_free_space_and_diagnostics_say_so(display):
    level, message, values = display.engaged()
    assert level == WARN and "no simulation: the handle is in free space" in message
    _, message, _ = display.news("haptic_driver", lambda level, message, values: values["withheld"] == "no_tool")
    assert message.startswith("force withheld for ") and "; start haptic_simulation" in message
    assert int(values["ticks"]) > 0
    begin = len(display.truths)
    display.go_to(0.03)
    display.truth(lambda truth: abs(truth.position[0] - 0.03) < 1e-3, what="the handle is at 30 mm")
    assert not any(display.motor(truth).any() for truth in display.truths[begin:])


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


def test_softer_gains_are_taken_while_it_runs_and_told_to_the_simulation(display):
    display.hear_handles()
    for stiffness in (500.0, 400.0):
        assert display.set("coupling.stiffness", stiffness) == (True, "")
        display.handles.clear()
        names = exchange_names(3)
        told = names.index("stiffness")
        display.until(
            lambda: display.handles and display.handles[-1].position[told] == stiffness,  # noqa: B023
            f"a handle sample with {stiffness} N/m",
        )
        gains = [display.handles[-1].position[names.index(name)] for name in TAIL[exchange_samples.GAIN_0 :][:4]]
        assert display.handles[-1].position[names.index("gains_hash")] == exchange_samples.gains_hash(*gains)
    display.hear_handles(False)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("wall.stiffness", [90000.0], ["wall.stiffness 90000 N/m", "needs b >", "the device has 3", "allowed under"]),
        ("wall.stiffness", [1.0, 2.0], ["wall.stiffness has 2 numbers; 1 walls (wall.offsets) need 1"]),
        ("servo.rate", 1000.0, ["read-only"]),
    ],
)
def test_a_wrong_live_value_is_refused_with_its_reason(display, name, value, words):
    accepted, reason = display.set(name, value)
    assert not accepted and "\n" not in reason
    assert all(word in reason for word in words), reason


def test_of_a_request_at_once_with_one_refused_gain_none_is_in_force_and_the_servo_keeps_its_gains(display):
    assert display.set("coupling.stiffness", 400.0) == (True, "")
    wishes = {"coupling.stiffness": 300.0, "wall.offsets": [-0.02], "wall.stiffness": [90000.0]}
    entries = [Parameter(name, value=value).to_parameter_msg() for name, value in wishes.items()]
    request = SetParametersAtomically.Request(parameters=entries)
    result = display.ask("haptic_driver/set_parameters_atomically", request).result
    assert not result.successful and "wall.stiffness 90000 N/m" in result.reason
    asked = GetParameters.Request(names=list(wishes))
    found = display.ask("haptic_driver/get_parameters", asked).values
    kept = {
        "coupling.stiffness": 400.0,
        "wall.offsets": WALL["wall.offsets"],
        "wall.stiffness": WALL["wall.stiffness"],
    }
    assert dict(zip(wishes, map(plain, found), strict=True)) == kept
    display.hear_handles()
    display.handles.clear()
    told = exchange_names(3).index("stiffness")
    display.until(lambda: len(display.handles) > 20, "handle samples after the refusal")
    assert {handle.position[told] for handle in display.handles} == {400.0}
    display.hear_handles(False)


@pytest.mark.parametrize("count", [MOST_AT_ONCE, MOST_AT_ONCE + 1])
def test_as_many_parameters_as_are_taken_at_once_are_set_and_one_more_are_refused_all(display, count):
    value = 0.25 if count > MOST_AT_ONCE else 0.5
    entry = Parameter("fault.duty", value=value).to_parameter_msg()
    each = display.ask("haptic_driver/set_parameters", SetParameters.Request(parameters=[entry] * count))
    wish = SetParametersAtomically.Request(parameters=[entry] * count)
    once = display.ask("haptic_driver/set_parameters_atomically", wish)
    reason = "" if value == 0.5 else f"{count} parameters in one request; at most {MOST_AT_ONCE} are taken"
    assert [(result.successful, result.reason) for result in each.results] == [(not reason, reason)] * count
    assert (once.result.successful, once.result.reason) == (not reason, reason)
    asked = display.ask("haptic_driver/get_parameters", GetParameters.Request(names=["fault.duty"]))
    assert asked.values[0].double_value != 0.25


def test_handle_encoder_and_motor_of_one_tick_bear_the_same_stamp(display):
    layout, heard = JointLayout(AXES, "haptic_base_link"), {"encoder": set(), "motor": set()}

    def hear(topic, stamps):
        def note(data):
            stamps.add(layout.unpack(data).stamp_ns)

        return display.node.create_subscription(messages.JointState, topic, note, messages.STREAM, raw=True)

    listening = [hear(topic, stamps) for topic, stamps in heard.items()]
    display.hear_handles()
    display.until(
        lambda: {sample.stamp_ns for sample in display.handles}.intersection(*heard.values()), "one stamp on all three"
    )
    display.hear_handles(False)
    for one in listening:
        display.node.destroy_subscription(one)


def test_foreign_tool_messages_move_nothing_are_refused_and_counted_by_reason(display):
    layout, count = JointLayout(exchange_names(3)), len(exchange_names(3))
    still, wild = [0.0] * count, [math.nan] * count
    tail = dict.fromkeys(TAIL, 1.0) | {"layout_version": exchange_samples.LAYOUT_VERSION}
    tail["exchange_method"] = float(exchange_samples.PSPM)
    samples = [
        layout.pack(0, wild, still, still),
        layout.pack(0, [0.05, 0.05, 0.5, *tail.values()], still, still),
        JointLayout(exchange_names(2)).pack(0, *[[0.0] * (count - 1)] * 3),
        layout.template[:-3],
    ]
    reasons = "refused.NaN or out of range", "refused.answers another session", "refused.other axis names or size"
    begin, asked, turn = len(display.said["haptic_driver"]), 0.0, 0

    def counted():
        """The first report of all three while the display is engaged."""
        nonlocal asked, turn
        if time.monotonic() > asked + 0.02:
            display.tool.publish(samples[turn % len(samples)])
            asked, turn = time.monotonic(), turn + 1
        heard = [values for _, _, values in display.said["haptic_driver"][begin:] if values["state"] == "engaged"]
        return next((values for values in heard if all(reason in values for reason in reasons)), None)

    moved = len(display.truths)
    display.engaged()
    values = display.until(counted, f"engaged, and counted: {reasons}")
    assert values["exchange_answered"] == "0" and values["fault"] == ""
    assert not any(display.motor(truth).any() for truth in display.truths[moved:])


def test_a_second_driver_of_the_same_device_is_refused(display, start):
    second = start(command("haptic_driver"), stderr=subprocess.PIPE)
    said = refusal_of(second)
    assert said.startswith("haptic_driver: page ") and said.endswith(
        "is held by another servo; stop it, or use another namespace"
    )
    display.engaged()


def test_deactivation_zeroes_the_motor_before_it_answers_and_it_can_be_activated_again(display):
    press(display)
    display.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    last = last_write()
    assert last.engaged == 0 and last.motor == [0.0, 0.0, 0.0]
    display.motor_off_after(max(last.written, last.deadline) * 1e-9)
    success, message = display.trigger("enable")
    assert not success and message == "the servo does not run: no device, or the node is not active"
    display.change("haptic_driver", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    display.cleared()
    press(display)


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


def test_a_handle_that_is_too_fast_is_a_fault(display):
    def fling():
        display.go_to(-0.008)
        display.truth(lambda truth: abs(truth.velocity[0]) < 1e-3, what="the handle is still")
        display.cleared()
        display.engaged()
        display.go_to(0.115)

    provoke(display, "velocity", fling)


def test_a_handle_beyond_its_workspace_is_a_fault(display):
    def leave():
        display.go_to(0.07)
        display.truth(lambda truth: abs(truth.velocity[0]) < 1e-3, what="the handle is still")
        display.cleared()
        display.engaged()
        display.go_to(0.12)

    provoke(display, "position", leave)


def test_a_motor_too_long_at_its_limit_is_a_fault(display):
    assert display.set("fault.saturation", 0.05) == (True, "")

    def push():
        for x in (0.0, -0.02, -0.04, -0.06):
            display.go_to(x)
            if x == 0.0:
                display.engaged()

    provoke(display, "saturation", push)


def test_a_motor_that_grows_too_warm_is_a_fault(display):
    assert display.set("fault.duty_time", 0.1) == (True, "")

    def hold():
        display.go_to(0.0)
        display.engaged()
        display.go_to(-0.025)

    def cool(level, message, values):
        return float(values["value"]) < 5e-3

    display.news("haptic_driver: thermal_load", cool, what="the motor has cooled")
    assert display.set("fault.duty", 0.1) == (True, "")
    provoke(display, "duty", hold)


def test_a_margin_about_theta_that_is_used_up_is_told_though_the_plane_has_some_left(display):
    def used_up(level, message, values):
        return float(values["value"]) < 0.0

    assert display.set("passivity.policy", "off") == (True, "")
    assert display.set("coupling.rotational_stiffness", 100.0) == (True, "")
    display.news("haptic_driver: margin_theta", used_up, what="the margin about theta is used up")
    level, message, _ = display.said["haptic_driver: margin_theta"][-1]
    assert level == ERROR and message.endswith(" N m s/rad")


def test_the_faults_above_are_all_but_those_that_test_fault_live_provokes_and_those_of_the_device_s_own_word():
    live = {"estop", "device_watchdog", "device_silent", "velocity", "position", "saturation", "duty"}
    told = {"device_estop", "device_hot", "device_limit", "device_encoder"}
    assert {entry.name for entry in faults.TABLE} - live - told == {"not_a_number", "encoder_jump", "unattended"}


def exchanging(ear):
    """Waits until the handle moves freely with the tool that follows it through the exchange."""
    heard = ear.said["haptic_driver"]
    ear.go_to(0.0)
    if heard[-1][2]["state"] != "engaged":
        ear.engaged()
    begin = len(heard)
    ear.go_to(0.005)

    def follows():
        there = abs(ear.truths[-1].position[0] - 0.005) < 5e-4
        return there and any(
            values["state"] == "engaged" and int(values["exchange_answered"]) > 0 and "no simulation" not in message
            for _, message, values in heard[begin:]
        )

    ear.until(follows, "the handle is at 5 mm with its tool")


def test_on_librcl_the_driver_exchanges_samples_with_a_simulation_that_came_later(display, nodes):
    nodes.start("haptic_simulation", scene="free_space")
    display.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 0, what="an answer")
    exchanging(display)


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


def test_a_killed_drivers_motor_is_cut_when_the_watchdog_is_over_by_the_plants_own_time(display, nodes):
    press(display)
    assert nodes.end("haptic_driver", signal.SIGKILL) == -signal.SIGKILL
    display.motor_off_after(last_write().over)
    assert page_path().exists()


def by_itself(heard, begin):
    """The first report of a new driver, whose ticks begin anew, in which it is not idle though nobody enabled it."""
    ticks = int(heard[begin - 1][2]["ticks"])
    told = [values for _, _, values in heard[begin:]]
    new = next((k for k, values in enumerate(told) if int(values["ticks"]) < ticks), len(told))
    return next((values for values in told[new:] if values["state"] != "idle"), None)


def test_a_driver_that_waits_for_a_tool_enables_by_itself_when_it_answers(nodes, ear):
    heard = ear.said["haptic_driver"]
    begin = len(heard)
    ear.go_to(0.0)
    nodes.start("haptic_driver", auto_enable=True, auto_enable_wait=600.0, **DRIVER)
    values = ear.until(lambda: by_itself(heard, begin), "enabled by itself")
    assert int(values["exchange_answered"]) > 0
    assert values["fault"] == ""
    exchanging(ear)


def test_a_driver_that_waited_long_enough_for_a_tool_enables_by_itself_without_one(nodes, ear):
    assert nodes.end("haptic_simulation", signal.SIGTERM) == 0
    assert nodes.end("haptic_driver", signal.SIGTERM) == 0
    heard, begin = ear.said["haptic_driver"], len(ear.said["haptic_driver"])
    nodes.start("haptic_driver", auto_enable=True, auto_enable_wait=0.7, **DRIVER)
    values = ear.until(lambda: by_itself(heard, begin), "enabled by itself")
    assert values["exchange_answered"] == "0"
    assert (int(values["ticks"]) + int(values["missed"])) / SLOW["servo__rate"] > 0.7  # the servo's own time


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


def test_signals_end_both_well_and_the_last_one_out_removes_the_page(nodes, ear):
    assert ear.told(set_parameters("haptic_driver", WALL))[0]
    press(ear)
    assert nodes.end("haptic_driver", signal.SIGTERM) == 0
    last = last_write()
    assert last.engaged == 0 and last.motor == [0.0, 0.0, 0.0]
    assert page_path().exists()
    assert nodes.end("haptic_loopback", signal.SIGINT) == 0
    assert not page_path().exists()


NO_ROOM = """
import sys
from haptic_device.realtime import exchange_loop

def none():
    raise MemoryError("no room for incoming messages")

exchange_loop.incoming_buffer = none
from haptic_device.nodes.driver import main
sys.exit(main())
"""


def test_an_exchange_that_cannot_begin_is_a_refused_activation_is_not_waited_for_and_leaves_no_page(start):
    words = [sys.executable, "-c", NO_ROOM, *command("haptic_driver", "/wrong")[3:]]
    said = refusal_of(start(words, stderr=subprocess.PIPE))
    assert said == "haptic_driver: the exchange cannot begin: MemoryError: no room for incoming messages"
    assert not page_path("/wrong").exists()
