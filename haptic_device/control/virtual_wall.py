# SPDX-License-Identifier: Apache-2.0
"""Half-plane wall at the handle: unilateral spring and damper (Colgate, Stanley & Brown 1995, section 3)."""

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
def wall_store(stiffness, depth):
    """Energy in the wall's spring [J]."""
    return 0.5 * stiffness * max(0.0, depth) ** 2


@kernel
def measure_depths(wall, walls, handle):
    """Depth of the handle in each wall, once a tick."""
    for i in range(int(wall.count)):
        walls.depth[i] = wall_depth(wall.x[i], wall.y[i], wall.offset[i], handle[0], handle[1])


@kernel
def push(wall, walls, output):
    """Sum of all walls' forces on the handle, x and y, less the share of the walls that is released."""
    for i in range(int(wall.count)):
        nx, ny = wall.x[i], wall.y[i]
        rate = -(nx * output.velocity[0] + ny * output.velocity[1])
        force = wall_force(wall.stiffness[i], wall.damping[i], walls.depth[i], rate)
        # what has been let go of pushes no more
        force *= 1.0 - walls.release
        output.force_walls[0] += nx * force
        output.force_walls[1] += ny * force
