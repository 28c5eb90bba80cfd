# SPDX-License-Identifier: Apache-2.0
"""Half-plane wall at the handle: unilateral spring and damper (Colgate, Stanley & Brown 1995, section 3)."""

import math

from haptic_device.jit import kernel


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
    """Largest force of a wall's spring along its normal [N]: by itself it is within the limits of all axes."""
    limit = limits[0] / abs(normal_x) if normal_x != 0.0 else math.inf
    # a device of one axis has no other limit
    return limits[1] / abs(normal_y) if axes > 1.0 and abs(normal_y) * limit > limits[1] else limit
