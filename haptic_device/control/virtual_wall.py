# SPDX-License-Identifier: Apache-2.0
"""Half-plane wall at the handle: unilateral spring and damper (Colgate, Stanley & Brown 1995, section 3)."""

import math

from haptic_device.control.virtual_coupling import spring_force, spring_store
from haptic_device.jit import kernel


@kernel
def wall_depth(normal_x, normal_y, offset, x, y):
    """Depth of the handle in the wall [m]; negative is the distance to it. The free side is n·p > offset."""
    return offset - (normal_x * x + normal_y * y)


@kernel
def wall_force(stiffness, damping, depth, depth_rate):
    """Force on the handle along the wall's normal [N], never negative: a wall pushes, it does not pull.

    u = K depth + B depth_rate inside (eq. 2), clamped at zero so that the damper does not hold the leaving handle.
    """
    if depth <= 0.0:
        return 0.0
    # the damper alone would hold the leaving handle
    return max(0.0, stiffness * depth + damping * depth_rate)


@kernel
def wall_limit(limits, axes, normal_x, normal_y):
    """Largest force of a wall's spring along its normal [N]: by itself it is within the limits (3) of all axes."""
    limit = limits[0] / abs(normal_x) if normal_x != 0.0 else math.inf
    # a device of one axis has no other limit
    return limits[1] / abs(normal_y) if axes > 1.0 and abs(normal_y) * limit > limits[1] else limit


@kernel
def stored(settings, j, depth):
    """Energy in the clamped spring of wall j at this depth [J]: a function of depth, so its force is a gradient."""
    wall = settings.wall
    if depth <= 0.0:
        return 0.0
    return spring_store(
        wall.stiffness[j], wall_limit(settings.coupling.limit, settings.axes, wall.x[j], wall.y[j]), depth
    )


@kernel
def share_left(walls):
    """Share 0…1 of all walls that has not been let go of."""
    return max(0.0, 1.0 - walls.release - walls.yielded)


@kernel
def measure_depths(wall, walls, handle):
    """Depth of the handle in each wall, once a tick."""
    for i in range(int(wall.count)):
        walls.depth[i] = wall_depth(wall.x[i], wall.y[i], wall.offset[i], handle[0], handle[1])


@kernel
def push(settings, walls, hold, output):
    """Sum of all walls' forces on the handle, x and y, less the share of the walls that is released.

    output.force_walls is what they want; hold.wall_springs has their springs, each clamped along its normal, and
    hold.wall_dampers what their dampers do beside those.
    """
    wall, left = settings.wall, share_left(walls)  # what has been let go of pushes no more
    for i in range(2):
        hold.wall_springs[i] = hold.wall_dampers[i] = 0.0
    for i in range(int(wall.count)):
        if walls.depth[i] <= 0.0:
            continue
        nx, ny = wall.x[i], wall.y[i]
        rate = -(nx * output.velocity[0] + ny * output.velocity[1])
        force = wall_force(wall.stiffness[i], wall.damping[i], walls.depth[i], rate)
        limit = wall_limit(settings.coupling.limit, settings.axes, nx, ny)
        spring = left * spring_force(wall.stiffness[i], limit, walls.depth[i])
        damper = max(-spring, left * wall.damping[i] * rate)
        output.force_walls[0] += nx * left * force
        output.force_walls[1] += ny * left * force
        hold.wall_springs[0] += nx * spring
        hold.wall_springs[1] += ny * spring
        hold.wall_dampers[0] += nx * damper
        hold.wall_dampers[1] += ny * damper
