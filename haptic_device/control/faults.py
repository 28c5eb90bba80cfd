# SPDX-License-Identifier: Apache-2.0
"""Faults: latched reasons why the motor is off. The table below is the only one; documents are made from it."""

from typing import NamedTuple

from haptic_device.control import enable_state
from haptic_device.jit import inlined, kernel

NONE, ESTOP, DEVICE_SILENT, NOT_A_NUMBER, ENCODER_JUMP, POSITION, VELOCITY, SATURATION, DEVICE_WATCHDOG = range(9)
DUTY, UNATTENDED, DEVICE_ESTOP, DEVICE_HOT, DEVICE_LIMIT, DEVICE_ENCODER, DEVICE_CLOCK = range(9, 16)
# bits of device_status: the sample is of this deadline; the device's watchdog has cut the motor; its e-stop button is
# pressed; it is too hot; an end switch is reached; an encoder is broken by its own check; its clock is not good enough,
# as the bridge finds; the motor value was clamped
FRESH, WATCHDOG, BUTTON, HOT, END_SWITCH, BROKEN_ENCODER, CLOCK, CLAMPED = 1, 2, 4, 8, 16, 32, 64, 128
CUT = WATCHDOG | BUTTON | HOT | BROKEN_ENCODER  # with any of these the device's motors are at zero
DEVICE_BITS = CUT | END_SWITCH | CLOCK | CLAMPED  # those that a device sets
THIS_TICK = "zero in the tick that finds it"
BUSY = "end other programs that keep the machine busy"
DEVICE = "check the device and the line from it: its power, its cable, its program"
WAY_THERE = "check the line to the device: its cable, its network, how busy its machine is"
BY_DEVICE = "zero: cut by the device by itself, and kept so"


class Fault(NamedTuple):
    """code: as in the trace; title: for people; cause: what latched it; number: how much, by the fields of
    haptic_device/nodes/fault_detail.py; motor: what it does; first: what a person does before a reset, "" if nothing.
    """

    code: int
    name: str
    title: str
    cause: str
    number: str
    motor: str
    first: str


TABLE = (
    Fault(
        ESTOP,
        "estop",
        "Emergency stop",
        "a person or a program pressed stop",
        "",
        "zero in the tick that takes the command",
        "",
    ),
    Fault(
        DEVICE_SILENT,
        "device_silent",
        "Device does not answer",
        "the device did not answer for longer than fault.silence",
        "no answer for {time} s; the limit is {limit} s",
        "zero in the tick that finds it; a device without writes cuts it by itself",
        f"{DEVICE}; with a simulated device {BUSY}",
    ),
    Fault(
        NOT_A_NUMBER,
        "not_a_number",
        "Not a number",
        "a position or a force was not finite",
        "the {what} along {axis} was {value}",
        THIS_TICK,
        "keep the recording and report it",
    ),
    Fault(
        ENCODER_JUMP,
        "encoder_jump",
        "Encoder jump",
        "the position changed faster than twice the velocity limit",
        "{axis} moved by {value} {unit} in {time} ms; the limit is {limit} {unit}",
        THIS_TICK,
        "check the encoder and its cable",
    ),
    Fault(
        POSITION,
        "position",
        "Handle outside the workspace",
        "the handle left the workspace of the device",
        "the handle was at {axis} = {value} {unit}; the workspace ends at {limit} {unit}",
        THIS_TICK,
        "lead the handle back into the workspace",
    ),
    Fault(
        VELOCITY,
        "velocity",
        "Handle too fast",
        "the handle was faster than the device's velocity limit",
        "{value} {unit}/s along {axis}; the limit is {limit} {unit}/s",
        THIS_TICK,
        "hold the handle still",
    ),
    Fault(
        SATURATION,
        "saturation",
        "Motor at its limit for too long",
        "more than a motor's limit was wanted for longer than fault.saturation",
        "{value} {force} wanted along {axis} for {time} s; the limit is {limit} {force}",
        "zero in the next tick",
        "lead the handle out of the walls and to the tool",
    ),
    Fault(
        DEVICE_WATCHDOG,
        "device_watchdog",
        "Device cut its motor",
        "the device heard nothing from the servo for too long",
        "no command for {time} s",
        "zero: cut by the device when its watchdog was over (15 ms by default), and kept so",
        f"{BUSY}; {WAY_THERE}",
    ),
    Fault(
        DUTY,
        "duty",
        "Motor too warm",
        "a motor's thermal load rose above fault.duty",
        "a load of {value} of the limit of {axis}; fault.duty is {limit}",
        "zero in the next tick",
        "let the motor cool",
    ),
    Fault(
        UNATTENDED,
        "unattended",
        "Driver stood still",
        "the thread that serves the driver, or the one that hears its commands, stood still for fault.unattended",
        "the limit is {limit} s",
        THIS_TICK,
        BUSY,
    ),
    Fault(
        DEVICE_ESTOP,
        "device_estop",
        "Emergency-stop button of the device",
        "the emergency-stop button of the device was pressed",
        "",
        BY_DEVICE,
        "release the button",
    ),
    Fault(
        DEVICE_HOT,
        "device_hot",
        "Device too hot",
        "the device was too hot and cut its motors",
        "",
        BY_DEVICE,
        "let the device cool",
    ),
    Fault(
        DEVICE_LIMIT,
        "device_limit",
        "End switch reached",
        "an end switch of the device was reached while the display was enabled, with forces or waiting for them",
        "the handle was at {place}",
        THIS_TICK,
        "lead the handle off the switch",
    ),
    Fault(
        DEVICE_ENCODER,
        "device_encoder",
        "Encoder broken",
        "an encoder was broken by the device's own check",
        "",
        BY_DEVICE,
        "check the encoder and its cable",
    ),
    Fault(
        DEVICE_CLOCK,
        "device_clock",
        "Clock of the device",
        "the device's clock drifted, was set, or could not be told exactly enough to know when a sample was latched",
        "",
        THIS_TICK,
        "read what haptic_bridge says of the clock; link_protocol.md says how exact it must be",
    ),
)
SIMULATED, LINE, SERVO = "simulated", "line", "servo"
AT = {
    (DEVICE_SILENT, SIMULATED): ("no sample of haptic_loopback for {time} s; the limit is {limit} s", BUSY),
    (DEVICE_SILENT, LINE): (
        "no sample came over the line from the device for {time} s; the limit is {limit} s",
        DEVICE,
    ),
    (DEVICE_WATCHDOG, SERVO): ("the servo gave no command for {time} s", BUSY),
    (DEVICE_WATCHDOG, LINE): ("no command came over the line to the device for {time} s; the servo gave it", WAY_THERE),
}
"""(number, first) of a fault whose place is known: the simulated device, the line or the servo."""
NAMES = frozenset(fault.name for fault in TABLE)


def name_of(code):
    """Name of a fault code; "" for none."""
    return next((fault.name for fault in TABLE if fault.code == code), "")


@inlined
def latch(fault, code):
    """Latches this code if it is one and no other was first."""
    if code != NONE and fault.code == NONE:
        fault.code = code


@kernel
def watch(settings, fault, enable, motion, sensors):
    """Latches the first fault that command, device and motors show; a new count of resets clears the last one."""
    command, status, limits = int(sensors.command), int(sensors.device_status), settings.fault
    resets = command // enable_state.RESET
    # a count, not a flag: a reset that is given twice clears once each
    if resets != fault.resets:
        fault.resets, fault.code, fault.saturated = resets, NONE, 0.0
    if command & enable_state.ESTOP:
        latch(fault, ESTOP)
    if status & BUTTON:
        latch(fault, DEVICE_ESTOP)
    if status & CLOCK:  # before silence, which a clock that was set makes too
        latch(fault, DEVICE_CLOCK)
    # by its time, or by counts that stay the same
    if max((sensors.deadline - sensors.latched) * 1e-9, motion.stale_ticks * settings.period) > limits.silence:
        latch(fault, DEVICE_SILENT)
    if status & BROKEN_ENCODER:
        latch(fault, DEVICE_ENCODER)
    if status & HOT:
        latch(fault, DEVICE_HOT)
    # a handle may be led on and off its switch while nothing can push it; enabling on it is refused before any force
    if status & END_SWITCH and command & (enable_state.ENABLE | enable_state.CLUTCH) == enable_state.ENABLE:
        latch(fault, DEVICE_LIMIT)
    if status & WATCHDOG and enable.ramp > 0.0:
        latch(fault, DEVICE_WATCHDOG)
    if fault.saturated > limits.saturation:
        latch(fault, SATURATION)
    if command & enable_state.UNATTENDED:
        latch(fault, UNATTENDED)
    if max(fault.thermal_load[0], fault.thermal_load[1], fault.thermal_load[2]) > limits.duty * limits.duty:
        latch(fault, DUTY)


@kernel
def motion_fault(position, velocity, low, high, velocity_limit, displacement, elapsed):
    """Fault code of one axis' motion, NONE if it is fine; device units, positions measured from the zero."""
    if not (abs(position) < 1e6 and abs(velocity) < 1e9):
        return NOT_A_NUMBER
    # twice the limit, so that a fast hand is a VELOCITY and only a broken encoder a jump
    if abs(displacement) > 2.0 * velocity_limit * elapsed and elapsed > 0.0:
        return ENCODER_JUMP
    if position < low or position > high:
        return POSITION
    if abs(velocity) > velocity_limit:
        return VELOCITY
    return NONE
