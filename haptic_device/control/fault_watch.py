# SPDX-License-Identifier: Apache-2.0
"""What latches a fault in a tick, and what clears it."""

from haptic_device.control import enable_state, faults
from haptic_device.jit import inlined, kernel


@inlined
def latch(fault, code):
    """Latches this code if it is one and no other was first."""
    if code != faults.NONE and fault.code == faults.NONE:
        fault.code = code


@kernel
def watch(settings, fault, enable, motion, sensors):
    """Latches the first fault that command, device and motors show; a new count of resets clears the last one."""
    command, status, limits = int(sensors.command), int(sensors.device_status), settings.fault
    resets = command // enable_state.RESET
    # a count, not a flag: a reset that is given twice clears once each
    if resets != fault.resets:
        fault.resets, fault.code, fault.saturated = resets, faults.NONE, 0.0
    if command & enable_state.ESTOP:
        latch(fault, faults.ESTOP)
    if status & faults.BUTTON:
        latch(fault, faults.DEVICE_ESTOP)
    if status & faults.CLOCK:  # before silence, which a clock that was set makes too
        latch(fault, faults.DEVICE_CLOCK)
    # by its time, or by counts that stay the same
    if max((sensors.deadline - sensors.latched) * 1e-9, motion.stale_ticks * settings.period) > limits.silence:
        latch(fault, faults.DEVICE_SILENT)
    if status & faults.BROKEN_ENCODER:
        latch(fault, faults.DEVICE_ENCODER)
    if status & faults.HOT:
        latch(fault, faults.DEVICE_HOT)
    # a handle may be led on and off its switch while nothing can push it; enabling on it is refused before any force
    if status & faults.END_SWITCH and command & (enable_state.ENABLE | enable_state.CLUTCH) == enable_state.ENABLE:
        latch(fault, faults.DEVICE_LIMIT)
    if status & faults.WATCHDOG and enable.ramp > 0.0:
        latch(fault, faults.DEVICE_WATCHDOG)
    if fault.saturated > limits.saturation:
        latch(fault, faults.SATURATION)
    if command & enable_state.UNATTENDED:
        latch(fault, faults.UNATTENDED)
    if max(fault.thermal_load[0], fault.thermal_load[1], fault.thermal_load[2]) > limits.duty * limits.duty:
        latch(fault, faults.DUTY)


@kernel
def motion_fault(position, velocity, low, high, velocity_limit, displacement, elapsed):
    """Fault code of one axis' motion, NONE if it is fine; device units, positions measured from the zero."""
    if not (abs(position) < 1e6 and abs(velocity) < 1e9):
        return faults.NOT_A_NUMBER
    # twice the limit, so that a fast hand is a VELOCITY and only a broken encoder a jump
    if abs(displacement) > 2.0 * velocity_limit * elapsed and elapsed > 0.0:
        return faults.ENCODER_JUMP
    if position < low or position > high:
        return faults.POSITION
    if abs(velocity) > velocity_limit:
        return faults.VELOCITY
    return faults.NONE
