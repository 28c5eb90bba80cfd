# SPDX-License-Identifier: Apache-2.0
"""The sum of all forces, limited, into motor units; what a motor held; and how warm that makes it."""

import math

from haptic_device.control import enable_state, fault_watch, faults
from haptic_device.jit import kernel, njit


@kernel
def command(settings, enable, fault, hold, output):
    """Fills in the output's force on the handle and motor; a sum that is not finite is a fault, and every fault zero.

    What acts is limited in the world, then gravity compensation is added. The operator's limit and the motor's own hold
    for whatever comes of that; a motor that is wanted to do more than it has is said, whatever acts.
    """
    device, saturated = settings.hardware, False
    for i in range(output.motor.size):
        total = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        total += output.force_passivity[i]
        if not abs(total) < math.inf:  # before any limit, which would make a force of it
            fault_watch.latch(fault, faults.NOT_A_NUMBER)
    damped = _walls_damped(settings, hold)
    for i in range(output.motor.size):
        acting = _acting(settings, hold, output, i, damped)
        total = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        total += output.force_passivity[i]
        output.force_gravity[i] = device.gravity[i] if output.engage > 0.0 else 0.0
        wanted = _at_device(settings, output, i, total)
        force = _at_device(settings, output, i, acting)
        saturated |= i < settings.axes and abs(wanted) > device.motor_limit[i]
        hold.limited[i] = hold.rest_share[i] < 1.0 or abs(force) > device.motor_limit[i]
        # the motor's limit, at the device
        output.force_on_handle[i] = min(device.motor_limit[i], max(-device.motor_limit[i], force))
    if fault.code != faults.NONE:
        output.engage = enable.ramp = 0.0
        enable.state = enable_state.FAULT
    for i in range(output.motor.size):
        if fault.code != faults.NONE or i >= settings.axes:
            output.force_on_handle[i] = hold.coupling[i] = hold.walls[i] = hold.clipped[i] = 0.0
            hold.rest_share[i] = 0.0
        output.motor[i] = output.force_on_handle[i] * device.motor_per_force[i]
    # a motor that wants more than it has for long is no display any more
    fault.saturated = fault.saturated + settings.period if saturated else 0.0
    output.state, output.fault = enable.state, fault.code
    _heat(settings, fault, output)


@njit
def _at_device(settings, output, i, force):
    """A force in the world [N | N m], within the operator's limit, as the motor makes it, with gravity compensation."""
    limit = settings.force.limit[i]
    limited = to_device_force(output.engage * min(limit, max(-limit, force)), settings.hardware.scale[i])
    return limited + output.engage * output.force_gravity[i]


@kernel
def to_device_force(force, scale):
    """Force the motor makes for this force on the handle in the world.

    f_device · v_device = f_world · v_world, so that a world stiffness K is felt as scale² K.
    """
    return scale * force


@njit
def _springs(settings, hold, i):
    """Force of all springs on axis i within the limit; the coupling's is within it by itself and stays whole."""
    limit = settings.coupling.limit[i]
    return min(limit, max(-limit, hold.coupling_spring[i] + hold.wall_springs[i]))


@njit
def _walls_damped(settings, hold):
    """Largest share of the walls' dampers, as one vector, that fits beside the springs: so they stay dampers."""
    share = 1.0
    for i in range(min(2, int(settings.axes)) if settings.wall.count > 0.0 else 0):
        share = min(share, _share(_springs(settings, hold, i), hold.wall_dampers[i], settings.coupling.limit[i]))
    return share


@njit
def _share(known, more, limit):
    """Largest share 0…1 of `more` with which known + share · more is within ±limit, as `known` is."""
    # rounding may put `known` beyond the limit
    room = max(0.0, limit - known if more > 0.0 else limit + known)
    return room / abs(more) if abs(more) > room else 1.0


@njit
def _acting(settings, hold, output, i, damped):
    """Force on axis i in the world that acts once forces are whole: springs, the walls' dampers, all other dampers.

    Those others are one per axis, so each axis may have a share of its own.
    """
    springs, pulled = _springs(settings, hold, i), hold.coupling_spring[i]
    rest = output.force_coupling[i] - pulled + output.force_cancellation[i] + output.force_passivity[i]
    acting = springs + damped * hold.wall_dampers[i]
    share = _share(acting, rest, settings.coupling.limit[i])
    coupled = pulled + share * (output.force_coupling[i] - pulled)
    hold.rest_share[i] = share
    hold.coupling[i] = to_device_force(output.engage * coupled, settings.hardware.scale[i])
    hold.walls[i] = output.engage * (acting - pulled)
    beyond = pulled + hold.wall_springs[i] - springs
    # a wall at its own limit is there but for rounding
    hold.clipped[i] = output.engage * beyond if abs(beyond) > 1e-12 * settings.coupling.limit[i] else 0.0
    return acting + share * rest


@njit
def _heat(settings, fault, output):
    """Thermal load of each motor after this tick's force."""
    for i in range(int(settings.axes)):
        share = output.force_on_handle[i] / settings.hardware.motor_limit[i]
        fault.thermal_load[i] = thermal_load(fault.thermal_load[i], share, settings.fault.duty_kept)
        output.thermal_load[i] = fault.thermal_load[i]


@kernel
def thermal_load(load, share, kept):
    """Thermal load of a motor (i²t) after a tick's force, as a share of what it reaches at its limit.

    Heat goes with the square of the current and leaves by one time constant τ: dw/dt = (share² − w)/τ, exact for a
    share of the limit held over T with kept = exp(−T/τ). A force of fault.duty times the limit heats to fault.duty².
    """
    return share * share + (load - share * share) * kept
