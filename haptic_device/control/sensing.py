# SPDX-License-Identifier: Apache-2.0
"""Encoder counts to the handle's position and velocity: the first stage of a tick."""

import math

from haptic_device.control import damping_compensation, enable_state, fault_watch, faults, linkage, velocity_estimator
from haptic_device.jit import kernel, njit


@kernel
def sense(settings, motion, samples, compensation, fault, sensors, output):
    """Fills in motion and samples, and the output's position and velocity; latches what is wrong with the motion.

    Counts that change without a newer time move nothing: their way counts when such a time has come. Where the times
    have an error the handle took as long as they allow (docs/theory/passivity.md): velocities are never too great.
    """
    # between two samples, not two deadlines: backward difference by the device's own time
    motion.elapsed = (sensors.latched - motion.sample_time) * 1e-9 if motion.started else 0.0
    _keep_time(motion, samples, sensors)
    opening = (int(sensors.command) & enable_state.CLUTCH) != 0
    # under an open clutch the device moves and the handle does not; its way until the clutch opened is the handle's
    opened, motion.clutched = opening and motion.clutched > 0.0, 1.0 if opening else 0.0
    device, joints = settings.hardware, int(settings.port.joints)
    if joints > 0:
        _sense_joints(settings, motion, samples, fault, sensors, joints)
    motion.unfaded = linkage.share_near_singular(_sense_handle(settings, motion, fault, output)) if joints > 0 else 1.0
    for i in range(int(settings.axes)):
        before, jump, velocity = motion.device_position[i], 0.0, motion.device_velocity[i]
        position = before
        if i < joints:  # known by now, and a jump is a joint's
            before -= motion.moved[i]
        else:
            position, jump, velocity = _sense_drive(settings, motion, samples, sensors, i, before, velocity)
            motion.moved[i] = jump
        low, high, limit = device.position_low[i], device.position_high[i], device.velocity_limit[i]
        fault_watch.latch(fault, _motion_fault(motion, position, velocity, low, high, limit, jump))
        if opened:  # the handle stays where it is in the world
            world = to_world(before, device.scale[i], motion.clutch_offset[i])
            motion.clutch_offset[i] = clutched_offset(world, position, device.scale[i])
        output.position[i] = to_world(position, device.scale[i], motion.clutch_offset[i])
        output.velocity[i] = 0.0 if opened else device.scale[i] * velocity
        motion.device_position[i], motion.device_velocity[i] = position, velocity
        fault_watch.latch(
            fault, damping_compensation.filter_drag(settings, compensation, i, sensors.drag[i], motion.elapsed)
        )
    for i in range(motion.handle.size):
        motion.handle[i] = output.position[i]
    if motion.stale_ticks == 0.0:
        motion.sample_time, motion.sample_error = sensors.latched, sensors.stamp_error
    motion.started = 1.0


@kernel
def to_world(device_position, scale, offset):
    """World position of the handle; offset is what the clutch has collected. motor.to_device_force conserves power."""
    return scale * device_position + offset


@kernel
def clutched_offset(world_position, device_position, scale):
    """Offset that keeps the handle where it is in the world while the device moves under an open clutch."""
    # of x_world = scale · x_device + offset
    return world_position - scale * device_position


@njit
def _keep_time(motion, samples, sensors):
    """A new sample's place in the history, and how well the time since the one before is known."""
    fresh = motion.elapsed > 0.0 or not motion.started
    motion.stale_ticks = 0.0 if fresh else motion.stale_ticks + 1.0
    motion.unsure = (motion.sample_error + sensors.stamp_error) * 1e-9 if motion.started else 0.0
    if fresh:
        samples.count += 1.0
        newest = int(samples.count) % velocity_estimator.KEPT
        samples.times[newest], samples.errors[newest] = sensors.latched * 1e-9, sensors.stamp_error * 1e-9


@njit
def _sense_joints(settings, motion, samples, fault, sensors, joints):
    """Angles and speeds of a linkage's joints; a jump is a joint's."""
    for i in range(joints):
        angle, turned, speed = _sense_drive(
            settings, motion, samples, sensors, i, motion.joint[i], motion.joint_velocity[i]
        )
        found = _motion_fault(motion, angle, speed, -math.inf, math.inf, settings.port.fastest[i], turned)
        fault_watch.latch(fault, found)
        motion.joint[i], motion.turned[i], motion.joint_velocity[i] = angle, turned, speed


@njit
def _sense_handle(settings, motion, fault, output):
    """Handle of a linkage at its joints; one that cannot be there, or is assembled another way, stays where it was.

    Returns how far it is from a singular pose (config/kinematics).
    """
    x, y, xa, xb, ya, yb, c = linkage.pose(settings.linkage, motion.joint[0], motion.joint[1])
    place, jacobian = motion.device_position, motion.jacobian
    if c > 0.0:
        motion.moved[0], motion.moved[1] = (x - place[0], y - place[1]) if motion.started else (0.0, 0.0)
        place[0], place[1] = x, y
        jacobian[0, 0], jacobian[0, 1], jacobian[1, 0], jacobian[1, 1] = xa, xb, ya, yb
    else:
        fault_watch.latch(fault, faults.UNREACHABLE)
        motion.moved[0] = motion.moved[1] = 0.0
    velocity = linkage.motion_of(jacobian, motion.joint_velocity)
    motion.device_velocity[0], motion.device_velocity[1] = velocity
    for i in range(2):
        output.joint[i] = motion.joint[i]
    return c


@njit
def _sense_drive(settings, motion, samples, sensors, i, before, velocity):
    """Position of drive i, how far it moved, and its velocity; before, velocity: the last ones."""
    device = settings.hardware
    seen = velocity_estimator.position_of(sensors.counts[i], device.position_per_count[i], device.zero[i])
    before = before if motion.started else seen
    position = before if motion.stale_ticks > 0.0 else seen
    moved = position - before
    return position, moved, _velocity(settings, motion, samples, i, position, velocity, moved)


@njit
def _velocity(settings, motion, samples, i, position, before, moved):
    """Velocity of drive i by the estimator that is set; before: the last one."""
    history = samples.x if i == 0 else (samples.y if i == 1 else samples.theta)
    newest = int(samples.count) % velocity_estimator.KEPT
    history[newest] = position
    chosen = settings.velocity
    if chosen.estimator == velocity_estimator.ADAPTIVE_WINDOW:
        count = int(min(samples.count, velocity_estimator.KEPT))
        step = 1.01 * abs(settings.hardware.position_per_count[i])  # an end-fit line passes through quantized ends
        return velocity_estimator.adaptive_velocity(
            samples.times, samples.errors, history, newest, count, int(chosen.window), step
        )
    lag = chosen.lag if chosen.estimator == velocity_estimator.LOWPASS else 0.0
    longest = motion.elapsed + motion.unsure if motion.elapsed > 0.0 else 0.0
    return velocity_estimator.velocity_of(before, moved, longest, lag)


@njit
def _motion_fault(motion, position, velocity, low, high, limit, moved):
    longest = motion.elapsed + motion.unsure if motion.elapsed > 0.0 else 0.0
    return fault_watch.motion_fault(position, velocity, low, high, limit, moved, longest)
