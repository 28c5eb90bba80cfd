# SPDX-License-Identifier: Apache-2.0
"""Between device and world: scaling and clutch, axis by axis, conserving power."""

from haptic_device.jit import kernel


@kernel
def to_world(device_position, scale, offset):
    """World position of the handle; offset is what the clutch has collected."""
    return scale * device_position + offset


@kernel
def to_device_force(force, scale):
    """Force the motor makes for this force on the handle in the world.

    f_device · v_device = f_world · v_world, so that a world stiffness K is felt as scale² K.
    """
    return scale * force


@kernel
def clutched_offset(world_position, device_position, scale):
    """Offset that keeps the handle where it is in the world while the device moves under an open clutch."""
    # of x_world = scale · x_device + offset
    return world_position - scale * device_position
