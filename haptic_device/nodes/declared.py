# SPDX-License-Identifier: Apache-2.0
"""The parameters of the device's nodes, gathered; readable without ROS."""

from haptic_device import parameters
from haptic_device.nodes import diagnostics, recorder_parameters
from haptic_device.parameter import Parameter

COMMON = (
    Parameter("device", "desktop", "", "device description: a file, or a name in config/devices"),
    Parameter("autostart", True, "", "configure and activate by itself"),
    Parameter("realtime", "prefer", "", "SCHED_FIFO, locked memory, timer slack", choices=("require", "prefer", "off")),
)
DRIVER = (
    *COMMON,
    *parameters.OPERATING_POINT,
    Parameter("auto_enable", False, "", "enable as soon as the device answers, as if ~/enable had been called"),
    Parameter("auto_enable_wait", 0.0, "s", "longest that auto_enable waits for a tool's first answer", 0.0, 600.0),
    Parameter(
        "exchange.path", "rcl", "", "rcl: without python; rclpy: its supported interface", choices=("rcl", "rclpy")
    ),
    Parameter("publish.rate", 500.0, "Hz", "encoder and motor", 1.0, 1000.0),
    Parameter("publish.pose_rate", 100.0, "Hz", "wrench and pose", 1.0, 1000.0),
    Parameter("publish.trace", True, "", "publish every tick in blocks on trace"),
    *diagnostics.parameters(diagnostics.DRIVER),
)
LOOPBACK = (
    *COMMON,
    *parameters.OPERATOR,
    Parameter("motor_watchdog", 0.015, "s", "time without a write after which the motor is cut", 1e-3, 10.0),
    Parameter("publish.rate", 500.0, "Hz", "operator/state", 1.0, 1000.0),
    *diagnostics.parameters(diagnostics.LOOPBACK),
)
NODES = {"haptic_driver": DRIVER, "haptic_loopback": LOOPBACK, "haptic_recorder": recorder_parameters.PARAMETERS}
