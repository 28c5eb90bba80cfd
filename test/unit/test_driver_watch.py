# SPDX-License-Identifier: Apache-2.0
"""A driver's node in this process: what it does by itself beside its commands, and which gains it takes."""

from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from lockstep_systems import device, values
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from haptic_device.control import controller_config, enable_state, faults, gain_check, records
from haptic_device.control.withheld import WithheldTime
from haptic_device.nodes import driver as module
from haptic_device.nodes.fault_detail import LatchedFault
from haptic_device.realtime import servo_loop
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.servo_thread import ServoThread

BEYOND = {
    "wall.normals": [0.0, 1.0],
    "wall.offsets": [0.0],
    "wall.stiffness": [7000.0],
    "wall.damping": [0.05],
    "coupling.stiffness": 0.0,
    "coupling.damping": 0.0,
}
ALONE = ["-p", "auto_enable:=true", "-p", "auto_enable_wait:=600.0"]


class Driver(module.DriverNode):
    """Its timers are called by the test."""

    def __init__(self):
        self.due, self.said = {}, []
        super().__init__()

    def create_timer(self, period, callback, **more):
        self.due[period] = callback

    def get_logger(self):
        return SimpleNamespace(info=lambda words: None, warning=self.said.append, error=lambda words: None)


@pytest.fixture
def driver(ros_domain, monkeypatch):
    commands = SimpleNamespace(running=True, start=lambda: None, stop=lambda: None, answers={})

    def services(node, answers, overruled):
        commands.answers.update(answers)
        return commands

    monkeypatch.setattr(module, "ServiceThread", services)
    rclpy.init(args=["--ros-args", *ALONE], domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    node = Driver()
    node.commands = commands
    yield node
    node.destroy_node()
    rclpy.shutdown()


def serve(driver, **given):
    """Gives it a servo whose last row says an e-stop, and what it needs to report that."""
    row = np.zeros(1, records.TRACE_ROW).view(np.recarray)[0]
    row.state, row.fault = enable_state.FAULT, faults.ESTOP
    driver.device, driver.servo = (
        device(),
        SimpleNamespace(
            running=True,
            realtime="",
            row=SimpleNamespace(get=lambda: [row]),
            control=np.zeros(servo_loop.CONTROLS, np.int64),
            ring=SimpleNamespace(dropped=0),
            **given,
        ),
    )
    driver.telemetry = SimpleNamespace(percentiles=lambda: np.zeros((4, 4)), cpu=0.0, window=lambda: 0.0, skipped=0)
    driver.telemetry.withheld, driver.telemetry.latched = WithheldTime(), LatchedFault()
    driver.exchange = SimpleNamespace(
        refusals=dict, refused_contacts=dict, sent=0, answered=0, round_trips=lambda: np.zeros(2)
    )
    driver.judged = gain_check.judge(controller_config.settings_from(driver.device, driver.values)[0], 0.0)
    driver.report = module.DriverDiagnostics(driver)


def test_a_driver_whose_commands_nobody_hears_any_more_attends_no_longer_and_takes_no_new_enable_back(driver):
    """Here the row is still as it was before a reset and the enable after it."""
    attended, orders = [], []
    serve(driver, attend=lambda: attended.append(True), order=lambda **flags: orders.append(flags))
    for driver.commands.running in (True, False):
        driver.due[module.WATCH_PERIOD]()
    assert attended == [True] and orders == []


@pytest.mark.parametrize("policy", ["enforce", "warn", "off"])
def test_gains_beyond_the_damping_are_refused_said_or_taken_as_the_policy_wants(driver, policy):
    driver.hardware, driver.device = NullDevice(), device(0.8)
    given = {name.replace(".", "__"): value for name, value in BEYOND.items()}
    sentence = gain_check.refusal(controller_config.settings_from(driver.device, values("haptic_driver", **given))[0])
    assert sentence.startswith("wall.stiffness 7000 N/m ") and sentence.endswith(" allowed under 6000 N/m")
    answer = driver.set_parameters_atomically(
        [Parameter(name, value=value) for name, value in {**BEYOND, "passivity.policy": policy}.items()]
    )
    assert (answer.successful, answer.reason) == ((False, sentence) if policy == "enforce" else (True, ""))
    assert driver.said == [sentence] * (policy == "warn")
    assert (driver.values["wall.stiffness"] == (7000.0,)) == (policy != "enforce")


class Waiting(ServoThread):
    """A servo whose next tick has always been done: its row bears the last command, and a fault from an e-stop on."""

    def __init__(self):
        given = values("haptic_driver")
        super().__init__(NullDevice(), controller_config.settings_from(device(damping=3.0), given), None, "off")
        self.control[servo_loop.RUNNING] = 1

    def order(self, **flags):
        super().order(**flags)
        self._tick()

    def reset(self):
        super().reset()
        self._tick()

    def _tick(self):
        row = np.zeros(1, records.TRACE_ROW)
        row["command"], row["fault"] = self.command, faults.ESTOP if self.command & enable_state.ESTOP else faults.NONE
        self.row.put(row)


@pytest.fixture
def waiting(driver):
    """A driver that waits for a tool to enable by itself; its servo runs."""
    serve(driver)
    driver.servo, driver.report = Waiting(), SimpleNamespace(say=lambda row: None, fault_detail=lambda row: "")
    return driver


def call(driver, name):
    """(success, message) of a service."""
    answer = driver.commands.answers[f"~/{name}"](Trigger.Request(), Trigger.Response())
    return answer.success, answer.message


def enabled_when_a_tool_answers(driver):
    """Whether it is, by itself; the driver watches before and after."""
    driver.due[module.WATCH_PERIOD]()
    assert not driver.servo.command & enable_state.ENABLE
    driver.exchange.answered = 1
    driver.due[module.WATCH_PERIOD]()
    return bool(driver.servo.command & enable_state.ENABLE)


COMMANDS = ([], ["disable"], ["reset"], ["estop"], ["estop", "reset"])


@pytest.mark.parametrize("commands", COMMANDS, ids=" ".join)
def test_a_driver_left_alone_enables_by_itself_when_a_tool_answers_and_overrules_no_disable_stop_or_reset(
    waiting, commands
):
    waiting.due[module.WATCH_PERIOD]()
    assert all(call(waiting, name)[0] for name in commands)
    assert enabled_when_a_tool_answers(waiting) == (not commands)
    assert bool(waiting.servo.command & enable_state.ESTOP) == (commands == ["estop"])
    if "reset" in commands:
        assert call(waiting, "enable") == (True, "enabled") and waiting.servo.command & enable_state.ENABLE


BEFORE_IT_RUNS = {
    ("disable", True): "motor zero: the servo does not run",
    ("disable", False): "motor zero: the servo does not run",
    ("estop", True): "e-stop latched for the device that is not there yet",
    ("estop", False): "e-stop latched for when the node is active again",
}


@pytest.mark.parametrize(("name", "active"), BEFORE_IT_RUNS)
def test_who_disables_or_stops_before_the_servo_runs_is_told_the_truth_and_not_overruled(waiting, name, active):
    servo, waiting.servo = waiting.servo, waiting.servo if active else None
    servo.control[servo_loop.RUNNING] = 0
    assert call(waiting, name) == (True, BEFORE_IT_RUNS[name, active])
    waiting.servo, servo.control[servo_loop.RUNNING] = servo, 1
    assert not enabled_when_a_tool_answers(waiting)


def test_what_does_not_come_to_the_servo_is_refused_before_it_runs_and_leaves_it_to_enable_by_itself(waiting):
    waiting.servo.control[servo_loop.RUNNING] = 0
    refused = (False, "the servo does not run: no device, or the node is not active")
    assert [call(waiting, name) for name in ("reset", "enable")] == [refused] * 2
    waiting.servo.control[servo_loop.RUNNING] = 1
    assert enabled_when_a_tool_answers(waiting)


def test_a_disable_in_the_middle_of_enabling_by_itself_comes_before_or_after_it(waiting):
    """Here it comes when the watch has seen the tool, and has not ordered yet."""
    seen = waiting._met
    waiting._met = lambda now: seen(now) and call(waiting, "disable")[0]
    assert not enabled_when_a_tool_answers(waiting)
