# SPDX-License-Identifier: Apache-2.0
"""Virtual coupling between handle and tool (Colgate, Stanley & Brown 1995, Figs 6 and 7)."""

import math

from haptic_device.jit import kernel


@kernel
def spring_force(stiffness, limit, stretch):
    """Force of the coupling's spring on the handle along one axis [N | N m]; the tool receives the opposite.

    stretch = tool − handle [m | rad]. Never beyond what the motor can hold: a clamped spring. A stretch that is not
    finite is no force but not a number.
    """
    force = stiffness * stretch
    if abs(force) <= limit:
        return force
    return math.copysign(limit, force) if abs(force) < math.inf else math.nan


@kernel
def spring_store(stiffness, limit, stretch):
    """Energy in the clamped spring [J], the integral of spring_force: quadratic up to the limit, straight beyond."""
    force = stiffness * abs(stretch)
    if force <= limit:
        return 0.5 * force * abs(stretch)
    # ∫ limit ds beyond the corner at limit/K
    return limit * (abs(stretch) - 0.5 * limit / stiffness)


@kernel
def pull(settings, hold, output):
    """Force of the virtual coupling on the handle, faded; its spring gives no more than the motor can hold.

    hold.coupling_spring has the spring's part.
    """
    gains = settings.coupling
    for i in range(int(settings.axes)):
        stretch = output.coupling_position[i] - output.position[i]
        rate = output.coupling_velocity[i] - output.velocity[i]
        force = spring_force(gains.stiffness[i], gains.limit[i], stretch)
        hold.coupling_spring[i] = output.exchange_fade * force if output.exchange_fade > 0.0 else 0.0
        # backward Euler of both: the velocities are those of this tick
        force += gains.damping[i] * rate
        output.force_coupling[i] = output.exchange_fade * force if output.exchange_fade > 0.0 else 0.0
