# SPDX-License-Identifier: Apache-2.0
"""The force that is sent, into motor units; and how warm that makes a motor."""

from haptic_device.control import damping_compensation, faults, linkage
from haptic_device.control.records import AXES
from haptic_device.jit import kernel, njit


@kernel
def limits(settings, enable, hold):
    """Most that all rows together may do in the world [N | N m], on its way to what is set by the slew.

    The operator's limit, and what the motor has beside gravity compensation.
    """
    for i in range(AXES):
        reach, wanted = settings.exchange.slew[i] * settings.period, settings.coupling.limit[i]
        slow = min(hold.limit[i] + reach, max(hold.limit[i] - reach, wanted))
        hold.limit[i] = slow if enable.ramp > 0.0 else wanted


@kernel
def command(settings, enable, fault, hold, account, output):
    """Fills in the output's force on the handle and motor: what the account sends, measured cancellation, and gravity.

    A motor that is wanted to do more than it has is said, whatever acts.
    """
    device, joints = settings.hardware, int(settings.port.joints)
    saturated = joints > 0 and _command_joints(settings, fault, hold, account, output)
    for i in range(joints, AXES):
        there = 1.0 if i < settings.axes and fault.code == faults.NONE else 0.0
        output.force_gravity[i] = device.gravity[i] if output.engage > 0.0 else 0.0
        lifted, limit = output.engage * output.force_gravity[i], settings.force.limit[i]
        measured = settings.cancellation.source == damping_compensation.MEASURED
        beside = output.engage * output.force_cancellation[i] if measured else 0.0
        room = hold.limit[i]
        force = account.force[i] + min(room - account.force[i], max(-room - account.force[i], beside))
        force = there * (to_device_force(force, device.scale[i]) + lifted)
        total = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        total = output.engage * min(limit, max(-limit, total))
        wanted = to_device_force(total, device.scale[i]) + lifted
        saturated |= i < settings.axes and abs(wanted) > device.motor_limit[i]
        cut = account.force[i] != account.was[i] or abs(force) > device.motor_limit[i]
        hold.limited[i] = 1.0 if cut else 0.0
        # the motor's limit, at the device
        output.force_on_handle[i] = min(device.motor_limit[i], max(-device.motor_limit[i], force))
        output.motor[i] = output.force_on_handle[i] * device.motor_per_force[i]
    # a motor that wants more than it has for long is no display any more
    fault.saturated = fault.saturated + settings.period if saturated else 0.0
    output.state, output.fault = enable.state, fault.code
    _heat(settings, fault, output)


@njit
def _command_joints(settings, fault, hold, account, output):
    """The same of a linkage's joints: torques, and the force that they make at the device's handle.

    Returns whether a motor is wanted to do more than it has.
    """
    device, joints, wanted = settings.hardware, int(settings.port.joints), account.own
    for i in range(AXES):
        limit = settings.force.limit[i]
        total = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        wanted[i] = output.engage * min(limit, max(-limit, total))
    linkage.to_joints(account.jacobian, wanted)
    saturated = False
    for i in range(joints):
        saturated |= abs(wanted[i]) > device.motor_limit[i]
        hold.limited[i] = 1.0 if account.force[i] != account.was[i] else 0.0
        output.torque[i] = account.force[i] if fault.code == faults.NONE else 0.0
        output.motor[i] = output.torque[i] * device.motor_per_force[i]
    force = linkage.to_handle(account.jacobian, settings.port.joints, output.torque)
    for i in range(2):
        output.force_on_handle[i] = to_device_force(force[i], device.scale[i])
    return saturated


@kernel
def to_device_force(force, scale):
    """Force the motor makes for this force on the handle in the world.

    f_device · v_device = f_world · v_world, so that a world stiffness K is felt as scale² K.
    """
    return scale * force


@njit
def _heat(settings, fault, output):
    """Thermal load of each motor after this tick's force."""
    for i in range(int(settings.axes)):
        force = output.torque[i] if i < settings.port.joints else output.force_on_handle[i]
        share = force / settings.hardware.motor_limit[i]
        fault.thermal_load[i] = thermal_load(fault.thermal_load[i], share, settings.fault.duty_kept)
        output.thermal_load[i] = fault.thermal_load[i]


@kernel
def thermal_load(load, share, kept):
    """Thermal load of a motor (i²t) after a tick's force, as a share of what it reaches at its limit.

    Heat goes with the square of the current and leaves by one time constant τ: dw/dt = (share² − w)/τ, exact for a
    share of the limit held over T with kept = exp(−T/τ). A force of fault.duty times the limit heats to fault.duty².
    """
    return share * share + (load - share * share) * kept
