# SPDX-License-Identifier: Apache-2.0
"""The sum of all forces, limited, into motor units; what a motor held; and how warm that makes it."""

import math

from haptic_device.control import enable_state, faults, kinematics
from haptic_device.jit import kernel, njit


@kernel
def command(settings, enable, fault, hold, output):
    """Fills in the output's force on the handle and motor; a sum that is not finite is a fault, and every fault zero.

    The sum is limited in the world, then gravity compensation is added, then the motor's own limit holds.
    """
    device, saturated = settings.hardware, False
    for i in range(output.motor.size):
        total = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        total += output.force_passivity[i]
        if not abs(total) < math.inf:  # before any limit, which would make a force of it
            faults.latch(fault, faults.NOT_A_NUMBER)
        # the operator's limit, in the world
        limit = settings.force.limit[i]
        force = kinematics.to_device_force(output.engage * min(limit, max(-limit, total)), device.scale[i])
        output.force_gravity[i] = device.gravity[i] if output.engage > 0.0 else 0.0
        force += output.engage * output.force_gravity[i]
        saturated |= i < settings.axes and abs(force) > device.motor_limit[i]
        hold.limited[i] = abs(total) > limit or abs(force) > device.motor_limit[i]
        hold.mixed[i] = hold.limited[i] and total != output.force_coupling[i]
        # the motor's limit, at the device
        output.force_on_handle[i] = min(device.motor_limit[i], max(-device.motor_limit[i], force))
    if fault.code != faults.NONE:
        output.engage = enable.ramp = 0.0
        enable.state = enable_state.FAULT
    for i in range(output.motor.size):
        if fault.code != faults.NONE or i >= settings.axes:
            output.force_on_handle[i] = 0.0
        output.motor[i] = output.force_on_handle[i] * device.motor_per_force[i]
    # a motor that wants more than it has for long is no display any more
    fault.saturated = fault.saturated + settings.period if saturated else 0.0
    output.state, output.fault = enable.state, fault.code
    _heat(settings, fault, output)


@njit
def _heat(settings, fault, output):
    """Thermal load of each motor after this tick's force."""
    for i in range(int(settings.axes)):
        share = output.force_on_handle[i] / settings.hardware.motor_limit[i]
        fault.thermal_load[i] = thermal_load(fault.thermal_load[i], share, settings.fault.duty_kept)
        output.warmth[i] = fault.thermal_load[i]


@kernel
def thermal_load(load, share, kept):
    """Thermal load of a motor (i²t) after a tick's force, as a share of what it reaches at its limit.

    Heat goes with the square of the current and leaves by one time constant τ: dw/dt = (share² − w)/τ, exact for a
    share of the limit held over T with kept = exp(−T/τ). A force of fault.duty times the limit heats to fault.duty².
    """
    return share * share + (load - share * share) * kept
