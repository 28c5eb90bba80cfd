# SPDX-License-Identifier: Apache-2.0
"""haptic_driver alive, on a loopback in another process: what it is asked, what it refuses, how it can end."""

import math
import os
import signal
import subprocess
import time

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import Ear, Nodes, command, held_up, last_heartbeat, page_path, refusal_of

from haptic_device.law import exchange, fault
from haptic_device.node import driver, wire
from haptic_device.runtime import loopback

pytestmark = pytest.mark.live

WALL = {"wall__normals": [1.0, 0.0], "wall__offsets": [-0.01], "wall__stiffness": [4000.0], "wall__damping": [0.0]}
DRIVER = {"engage__time": 0.05, "exchange__fade": 0.05, **WALL}
WARN, ERROR = 1, 2


@pytest.fixture(scope="module")
def nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        nodes.start("haptic_loopback", motion__name="follow")
        nodes.start("haptic_driver", **DRIVER)
        yield nodes


@pytest.fixture(scope="module")
def ear(ros_domain):
    ear = Ear(ros_domain)
    yield ear
    ear.close()


@pytest.fixture
def display(nodes, ear):
    """The ear, with both nodes running, no fault, motor off, the hand at the middle."""
    ear.until(lambda: ear.truths and ear.said.get("haptic_driver"))
    ear.go_to(0.0)
    ear.truth(lambda truth: abs(truth.velocity[:3]).max() < 1e-3)
    ear.until(lambda: ear.trigger("reset")[0])
    assert ear.trigger("disable") == (True, "motor zero")
    return ear


def engage(ear):
    success, message = ear.trigger("enable")
    assert success, message
    ear.news("haptic_driver", lambda level, message, values: values["state"] == "engaged")


def press(ear):
    """Has the hand press the wall until the motor holds more than 5 N against it."""
    engage(ear)
    ear.go_to(-0.025)
    return ear.truth(lambda truth: ear.motor(truth)[0] > 5.0)


def test_without_a_simulation_the_handle_moves_in_free_space_and_diagnostics_say_so(display):
    engage(display)
    level, message, values = display.said["haptic_driver"][-1]
    assert level == WARN and message == "no simulation: the handle is in free space"
    display.go_to(0.03)
    moved = display.truth(lambda truth: abs(truth.position[0] - 0.03) < 1e-3)
    assert display.motor(moved).tolist() == [0.0, 0.0, 0.0]
    assert values["state"] == "engaged" and int(values["ticks"]) > 0


def test_enabling_and_disabling_let_the_force_come_and_go(display):
    press(display)
    assert display.trigger("disable") == (True, "motor zero")
    display.truth(lambda truth: not display.motor(truth).any())


def test_an_estop_latches_until_it_is_reset(display):
    press(display)
    assert display.trigger("estop") == (True, "e-stop latched, motor zero")
    display.truth(lambda truth: not display.motor(truth).any())
    level, message, values = display.news("haptic_driver", lambda level, message, values: values["fault"])
    assert (level, message, values["state"]) == (ERROR, "fault estop", "fault")
    assert display.trigger("enable") == (False, "fault estop is latched; call ~/reset first")
    assert display.trigger("reset")[0]
    display.go_to(0.0)
    assert display.trigger("enable") == (True, "enabled")


def test_a_change_of_state_is_told_at_once_not_with_the_next_half_second(display):
    delays = []
    for name, state in 2 * [("enable", "engaged"), ("estop", "fault"), ("reset", "idle")]:
        assert display.trigger(name)[0]
        began = time.monotonic()
        display.until(lambda state=state: display.said["haptic_driver"][-1][2]["state"] == state)
        delays.append(time.monotonic() - began)
    assert sorted(delays)[3] < 0.12 + held_up()


def test_softer_gains_are_taken_while_it_runs_and_told_to_the_simulation(display):
    display.hear_handles()
    for stiffness in (500.0, 400.0):
        assert display.set("coupling.stiffness", stiffness) == (True, "")
        display.handles.clear()
        names = wire.exchange_names(3)
        told = names.index("stiffness")
        display.until(lambda: display.handles and display.handles[-1].position[told] == stiffness)  # noqa: B023
        gains = [display.handles[-1].position[names.index(name)] for name in exchange.TAIL[exchange.GAIN_0:][:4]]
        assert display.handles[-1].position[names.index("gains_hash")] == exchange.gains_hash(*gains)
    display.hear_handles(False)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("coupling.stiffness", 1e6, ["coupling.stiffness"]),
        ("coupling.stiffness", math.nan, ["coupling.stiffness"]),
        ("wall.stiffness", [90000.0], ["wall.stiffness 90000 N/m", "needs b >", "the device has 3", "at most"]),
        ("wall.stiffness", [1.0, 2.0], ["wall.stiffness has 2 numbers; 1 walls need 1"]),
        ("wall.damping", [math.nan], ["wall.damping[0] is nan"]),
        ("servo.rate", 1000.0, ["read-only"]),
        ("passivity.policy", "sometimes", ["passivity.policy is 'sometimes'", "enforce"]),
    ],
)
def test_a_wrong_live_value_is_refused_with_its_reason(display, name, value, words):
    accepted, reason = display.set(name, value)
    assert not accepted and "\n" not in reason
    assert all(word in reason for word in words), reason


def test_foreign_tool_messages_move_nothing_are_refused_and_counted_by_reason(display):
    engage(display)
    layout, count = wire.JointLayout(wire.exchange_names(3)), len(wire.exchange_names(3))
    still, wild = [0.0] * count, [math.nan] * count
    tail = dict.fromkeys(exchange.TAIL, 1.0) | {"layout_version": exchange.LAYOUT_VERSION}
    tail["exchange_method"] = float(exchange.PSPM)
    messages = [
        layout.pack(0, wild, still, still),
        layout.pack(0, [0.05, 0.05, 0.5, *tail.values()], still, still),
        wire.JointLayout(wire.exchange_names(2)).pack(0, *[[0.0] * (count - 1)] * 3),
        layout.template[:-3],
    ]
    reasons = "refused.NaN or out of range", "refused.answers another session", "refused.other axis names or size"
    begin, asked = len(display.said["haptic_driver"]), 0.0

    def counted():
        nonlocal asked
        if time.monotonic() > asked + 0.02:
            display.tool.publish(messages[len(display.truths) % len(messages)])
            asked = time.monotonic()
        return all(reason in display.last()["haptic_driver"][2] for reason in reasons)

    display.until(counted)
    values = display.last()["haptic_driver"][2]
    assert values["exchange_answered"] == "0" and values["state"] == "engaged" and values["fault"] == ""
    assert not display.motor(display.truths[-1]).any()
    assert len(display.said["haptic_driver"]) > begin


def test_a_second_driver_of_the_same_device_is_refused(display, start):
    second = start(command("haptic_driver"), stderr=subprocess.PIPE)
    said = refusal_of(second)
    assert said.startswith("haptic_driver: page ") and said.endswith("is held by another servo; stop it, or use "
                                                                     "another namespace")  # fmt: skip
    engage(display)


def change(ear, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return ear.ask("haptic_driver/change_state", ChangeState, request).success


def test_deactivation_zeroes_the_motor_before_it_answers_and_it_can_be_activated_again(display):
    press(display)
    assert change(display, Transition.TRANSITION_DEACTIVATE)
    answered = time.monotonic()
    display.truth(lambda truth: display.time(truth) > answered + 0.03)
    driven = [display.time(truth) for truth in display.truths if display.motor(truth).any()]
    assert max(driven) < answered + 2 * loopback.FREE_STEP * 1e-9
    success, message = display.trigger("enable")
    assert not success and message == "the servo does not run: no device, or the node is not active"
    assert change(display, Transition.TRANSITION_ACTIVATE)
    display.go_to(0.0)
    press(display)


def latched(ear, name):
    """Waits for this fault, and that the motor is off."""
    level, message, _ = ear.news("haptic_driver", lambda level, message, values: values["fault"])
    assert (level, message) == (ERROR, f"fault {name}")
    assert not ear.motor(ear.truth(lambda truth: True)).any()
    assert ear.trigger("enable") == (False, f"fault {name} is latched; call ~/reset first")


def test_a_stopped_servo_loses_its_motor_and_finds_that_out_when_it_goes_on(display, nodes):
    press(display)
    process = nodes.running["haptic_driver"]
    os.kill(process.pid, signal.SIGSTOP)
    try:
        display.truth(lambda truth: not display.motor(truth).any())
        last = last_heartbeat()
        display.truth(lambda truth: display.time(truth) > last + 0.03)
    finally:
        os.kill(process.pid, signal.SIGCONT)
    driven = [display.time(truth) for truth in display.truths if display.motor(truth).any()]
    assert last - 1.0 < max(driven) < last + 0.02
    latched(display, "device_watchdog")


def test_a_silent_device_is_a_fault(display, nodes):
    press(display)
    device = nodes.running["haptic_loopback"]
    os.kill(device.pid, signal.SIGSTOP)
    try:
        said = display.news("haptic_driver", lambda level, message, values: values["fault"])
        assert said[:2] == (ERROR, "fault device_silent")
    finally:
        os.kill(device.pid, signal.SIGCONT)
    latched(display, "device_silent")


def test_a_handle_that_is_too_fast_is_a_fault(display):
    engage(display)
    display.go_to(0.1)
    display.go_to(0.0)
    display.until(lambda: display.trigger("reset")[0])
    display.go_to(-0.008)
    engage(display)
    display.go_to(0.115)
    latched(display, "velocity")


def test_a_handle_beyond_its_workspace_is_a_fault(display):
    for x in (0.04, 0.07):
        display.go_to(x)
        display.truth(lambda truth: abs(truth.velocity[0]) < 1e-3)
    display.until(lambda: display.trigger("reset")[0])
    engage(display)
    display.go_to(0.12)
    latched(display, "position")


def test_a_motor_too_long_at_its_limit_is_a_fault(display):
    assert display.set("fault.saturation", 0.05) == (True, "")
    engage(display)
    for x in (-0.02, -0.04, -0.06):
        display.go_to(x)
    latched(display, "saturation")


def test_a_motor_that_grows_too_warm_is_a_fault(display):
    assert display.set("fault.duty_time", 0.1) == (True, "")
    display.news("haptic_driver: warmth", lambda level, message, values: float(values["value"]) < 5e-3)  # cooled
    try:
        assert display.set("fault.duty", 0.1) == (True, "")
        engage(display)
        display.go_to(-0.025)
        latched(display, "duty")
    finally:
        assert display.set("fault.duty", 1.0) == (True, "")


def test_the_faults_above_are_all_but_those_that_test_fault_live_provokes():
    live = {"estop", "device_watchdog", "device_silent", "velocity", "position", "saturation", "duty"}
    assert {entry.name for entry in fault.TABLE} - live == {"not_a_number", "encoder_jump", "unattended"}


def exchanging(ear):
    """Waits until the tool follows the handle through the exchange."""
    ear.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 300)
    engage(ear)
    ear.go_to(0.005)
    ear.truth(lambda truth: abs(truth.position[0] - 0.005) < 5e-4)
    _, message, values = ear.news("haptic_driver", lambda level, message, values: True)
    assert values["fault"] == "" and values["state"] == "engaged" and "no simulation" not in message


def test_on_librcl_the_driver_exchanges_samples_with_a_simulation_that_came_later(display, nodes):
    nodes.start("haptic_simulation", scene="free_space")
    exchanging(display)


def test_a_killed_driver_leaves_the_motor_at_zero_within_20_ms_and_a_new_one_works_on_rclpy_too(display, nodes):
    press(display)
    nodes.end("haptic_driver", signal.SIGKILL)
    last = last_heartbeat()
    display.truth(lambda truth: display.time(truth) > last + 0.03)
    driven = [display.time(truth) for truth in display.truths if display.motor(truth).any()]
    assert last - 1.0 < max(driven) < last + 0.02
    assert page_path().exists()
    display.said.pop("haptic_driver")
    nodes.start("haptic_driver", exchange__path="rclpy", **DRIVER)
    display.go_to(0.0)
    display.until(lambda: "haptic_driver" in display.said)
    exchanging(display)


def test_a_killed_device_is_a_fault_and_a_new_one_works_after_a_reset(display, nodes):
    engage(display)
    nodes.end("haptic_loopback", signal.SIGKILL)
    display.news("haptic_driver", lambda level, message, values: message == "fault device_silent")
    nodes.start("haptic_loopback", motion__name="follow", motion__start=[0.02, 0.0, 0.0])
    display.truth(lambda truth: abs(truth.position[0] - 0.02) < 1e-3)
    assert display.trigger("reset")[0]
    press(display)


def test_one_that_waits_for_a_tool_enables_by_itself_when_it_answers_or_was_waited_for_long_enough(display, nodes):
    assert nodes.end("haptic_simulation", signal.SIGTERM) == 0
    for patience, simulated in ((2.0, False), (60.0, True)):
        assert nodes.end("haptic_driver", signal.SIGTERM) == 0
        began = time.monotonic()
        nodes.start("haptic_driver", auto_enable=True, auto_enable_wait=patience, **DRIVER)
        display.news("haptic_driver", lambda level, message, values: values["state"] == "idle")
        if simulated:
            nodes.start("haptic_simulation", scene="free_space")
        display.news("haptic_driver", lambda level, message, values: values["state"] == "engaged")
        assert (time.monotonic() - began < patience) == simulated


def test_signals_end_both_in_time_and_the_last_one_out_removes_the_page(display, nodes):
    process = nodes.running["haptic_driver"]
    told = time.monotonic()
    assert nodes.end("haptic_driver", signal.SIGTERM) == 0
    assert time.monotonic() - told < 2.0 + held_up()
    assert page_path().exists() and "Traceback" not in process.log.read_text()
    assert nodes.end("haptic_loopback", signal.SIGINT) == 0
    assert not page_path().exists()


def test_an_estop_latches_even_before_the_device_is_there(nodes, ear):
    nodes.start("haptic_driver", auto_enable=True, **DRIVER)
    assert ear.news("haptic_driver", lambda level, message, values: message.startswith("no device"))[0] == WARN
    assert ear.trigger("enable") == (False, "the servo does not run: no device, or the node is not active")
    assert ear.trigger("estop") == (True, "e-stop latched for the device that is not there yet")
    nodes.start("haptic_loopback")
    said = ear.news("haptic_driver", lambda level, message, values: values["fault"])
    assert said[:2] == (ERROR, "fault estop") and said[2]["state"] == "fault"
    assert ear.trigger("reset")[0] and ear.trigger("enable") == (True, "enabled")


def test_a_closed_terminal_ends_both_as_well(nodes):
    assert nodes.end("haptic_loopback", signal.SIGHUP) == nodes.end("haptic_driver", signal.SIGHUP) == 0
    assert not page_path().exists()


YAML = {
    "misspelt": ({"coupling.stifness": "500.0"}, ["coupling.stifness is not", "coupling.stiffness?"]),
    "int for double": ({"coupling.stiffness": "500"}, ["coupling.stiffness is 500 (integer); write 500.0 N/m"]),
    "nan": ({"servo.rate": ".nan"}, ["servo.rate is nan; a finite number in Hz is needed"]),
    "too fast": ({"servo.rate": "10001.0"}, ["servo.rate is 10001.0 Hz; at most 10000.0 Hz is allowed"]),
    "too slow": ({"servo.rate": "499.0"}, ["servo.rate is 499.0 Hz; at least 500.0 Hz is needed"]),
    "choice": ({"exchange.path": "dds"}, ["exchange.path is 'dds'; it must be one of rcl, rclpy"]),
    "device": ({"device": "desktp"}, ["desktp is neither a file nor a name", "desktop"]),
    "beyond damping": ({"coupling.stiffness": "90000.0"}, ["coupling.stiffness 90000 N/m", "the device has 3"]),
    "walls": ({"wall.offsets": "[0.0]"}, ["wall.normals has 0 numbers; 1 walls need 2"]),
    "mixed list": ({"wall.offsets": "[0, 1.5]"}, ["ROS does not take these arguments", "same type"]),
    "no yaml": ({"coupling": "["}, ["ROS does not take these arguments"]),
}


@pytest.fixture
def handlers():
    """Signal handlers as they were, after a node's main has run in this process."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("name", YAML)
def test_a_wrong_file_ends_the_driver_with_one_sentence_and_exit_code_1(tmp_path, capfd, handlers, name):
    given, words = YAML[name]
    path = tmp_path / "wrong.yaml"
    lines = "".join(f"    {key}: {value}\n" for key, value in given.items())
    path.write_text(f"/**:\n  ros__parameters:\n    realtime: 'off'\n{lines}")
    assert driver.main(["--ros-args", "-r", "__ns:=/wrong", "--params-file", str(path)]) == 1
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("haptic_driver: ") and all(word in said for word in words), said
    assert not page_path("/wrong").exists()


def test_as_a_process_a_refused_driver_leaves_no_traceback_and_no_page(start):
    said = refusal_of(start(command("haptic_driver", "/wrong", device="desktp"), stderr=subprocess.PIPE))
    assert said.startswith("haptic_driver: ")
    assert not page_path("/wrong").exists()
