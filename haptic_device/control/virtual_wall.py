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
    return max(0.0, stiffness * depth + damping * depth_rate)


@kernel
def wall_store(stiffness, depth):
    """Energy in the wall's spring [J]."""
    return 0.5 * stiffness * max(0.0, depth) ** 2
