# SPDX-License-Identifier: Apache-2.0
"""Faults: latched reasons why the motor is off. The table below is the only one; documents are made from it."""

from typing import NamedTuple

from haptic_device.kernel import kernel
from haptic_device.parameter import Parameter

NONE, ESTOP, DEVICE_SILENT, NOT_A_NUMBER, ENCODER_JUMP, POSITION, VELOCITY, SATURATION, DEVICE_WATCHDOG = range(9)


class Fault(NamedTuple):
    """code: as in the trace; cause: what latched it; clear: how a person clears it."""

    code: int
    name: str
    cause: str
    clear: str


TABLE = (
    Fault(ESTOP, "estop", "the e-stop service was called", "~/reset, then ~/enable"),
    Fault(DEVICE_SILENT, "device_silent", "the device answered no tick for fault.silence", "start the device, ~/reset"),
    Fault(NOT_A_NUMBER, "not_a_number", "a force or an input was not finite", "~/reset; report it"),
    Fault(
        ENCODER_JUMP,
        "encoder_jump",
        "the position changed faster than twice the velocity limit",
        "check the encoder, ~/reset",
    ),
    Fault(POSITION, "position", "the handle left the workspace of the device description", "move it back, ~/reset"),
    Fault(VELOCITY, "velocity", "the handle was faster than the device's velocity limit", "~/reset"),
    Fault(SATURATION, "saturation", "a motor was at its limit for longer than fault.saturation", "~/reset"),
    Fault(DEVICE_WATCHDOG, "device_watchdog", "the device had cut the motor: the servo was silent too long", "~/reset"),
)

PARAMETERS = (
    Parameter(
        "fault.silence", 0.02, "s", "time without an answer of the device that latches device_silent", 0.001, 1.0
    ),
    Parameter("fault.saturation", 1.0, "s", "time at the motor limit that latches saturation", 0.01, 60.0, True),
)


def name_of(code):
    """Name of a fault code; "" for none."""
    return next((fault.name for fault in TABLE if fault.code == code), "")


@kernel
def motion_fault(position, velocity, low, high, velocity_limit, displacement, elapsed):
    """Fault code of one axis' motion, NONE if it is fine; device units, positions measured from the zero."""
    if not (abs(position) < 1e6 and abs(velocity) < 1e9):
        return NOT_A_NUMBER
    if abs(displacement) > 2.0 * velocity_limit * elapsed and elapsed > 0.0:
        return ENCODER_JUMP
    if position < low or position > high:
        return POSITION
    if abs(velocity) > velocity_limit:
        return VELOCITY
    return NONE
