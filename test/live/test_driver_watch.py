# SPDX-License-Identifier: Apache-2.0
"""A driver's node in this process: what it does fifty times a second beside its commands, and which gains it takes."""

from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from lockstep_systems import device, values
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from haptic_device import controller_config, gain_check
from haptic_device.control import enable_state, faults, records
from haptic_device.nodes import driver as module
from haptic_device.realtime import servo_loop
from haptic_device.withheld_time import WithheldTime

BEYOND = {
    "wall.normals": [0.0, 1.0],
    "wall.offsets": [0.0],
    "wall.stiffness": [7000.0],
    "wall.damping": [0.05],
    "coupling.stiffness": 0.0,
    "coupling.damping": 0.0,
}


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
    commands = SimpleNamespace(running=True, start=lambda: None, stop=lambda: None)
    monkeypatch.setattr(module, "ServiceThread", lambda *words: commands)
    rclpy.init(domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
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
    driver.telemetry = SimpleNamespace(percentiles=lambda: np.zeros((4, 4)), cpu=0.0, window=lambda: 0.0)
    driver.telemetry.withheld = WithheldTime()
    driver.exchange = SimpleNamespace(
        refusals=dict, refused_contacts=dict, sent=0, answered=0, round_trips=lambda: np.zeros(2)
    )
    driver.report = module.DriverDiagnostics(driver)


@pytest.mark.parametrize("heard", [True, False])
def test_a_driver_whose_commands_nobody_hears_any_more_attends_no_longer(driver, heard):
    attended, driver.commands.running = [], heard
    serve(driver, attend=lambda: attended.append(True))
    driver.due[0.02]()
    assert attended == [True] * heard


def test_a_fault_that_was_reset_meanwhile_takes_no_new_enable_back(driver):
    """Here the row is still as it was before the reset and the enable after it."""
    orders = []
    serve(driver, attend=lambda: None, order=lambda **flags: orders.append(flags))
    driver.due[0.02]()
    assert orders == []


@pytest.mark.parametrize("policy", ["enforce", "warn", "off"])
def test_gains_beyond_the_damping_are_refused_said_or_taken_as_the_policy_wants(driver, policy):
    driver.hardware, driver.device = object(), device(0.8)
    given = {name.replace(".", "__"): value for name, value in BEYOND.items()}
    sentence = gain_check.refusal(controller_config.settings_from(driver.device, values("haptic_driver", **given))[0])
    assert sentence.startswith("wall.stiffness 7000 N/m ") and sentence.endswith(" at most 6000 N/m")
    answer = driver.set_parameters_atomically(
        [Parameter(name, value=value) for name, value in {**BEYOND, "passivity.policy": policy}.items()]
    )
    assert (answer.successful, answer.reason) == ((False, sentence) if policy == "enforce" else (True, ""))
    assert driver.said == [sentence] * (policy == "warn")
    assert (driver.values["wall.stiffness"] == (7000.0,)) == (policy != "enforce")
