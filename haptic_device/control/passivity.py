# SPDX-License-Identifier: Apache-2.0
"""The least damping that springs and dampers need in the servo (docs/theory/passivity.md)."""

import math

from haptic_device.jit import kernel


@kernel
def weights(least, most, ratio):
    """(n₀, n₁, g, κ) for forces that act from `least` to `most` periods after their sample.

    b ≥ n₀ T K + n₁ |B| is enough; g T K for each hold that a force may still act, and κ |B|, pay for what is on its
    way. Of all that the proof allows the best for |B| = ratio · T K.
    """
    whole = math.floor(most + 1e-9)
    if most - whole < 1e-9:
        most = whole
    late, oldest, top = 1.0 + most - least, math.ceil(most), most - whole
    top, best = top if top > 0.0 else 1.0, math.inf
    found = 0.5, 1.0, 0.5, 0.5
    for m in range(101 if top < 1.0 else 1):
        split = 1.0 + 0.01 * m  # α: how dampers are shared between the two ages of a force
        damp = math.sqrt(split * late)
        for n in range(117):
            g = 0.02 + 0.005 * n
            rest = 0.5 + 0.25 * most / g
            stiff = g * oldest + (rest * top / (1.0 - (1.0 - top) / split) if top < 1.0 or m == 0 else 0.0)
            if top < 1.0:
                stiff = max(stiff, g * (oldest - 1.0) + split * rest)
            if stiff + ratio * damp < best:
                best, found = stiff + ratio * damp, (stiff, damp, g, 0.5 * damp)
    return found


@kernel
def least_damping(stiffness, damping, period, most, least=0.0):
    """Physical damping b [N s/m] above which a wall or a coupling is passive: KT/2 + |B| on time (Colgate 1995, eq. 3).

    Forces that act `least` to `most` [s] after their sample need n₀ T K + n₁ |B| (weights). Compiled; the arguments are
    not checked.

    Args:
        stiffness: K ≥ 0 [N/m].
        damping: B of either sign [N s/m].
        period: T [s].
        most: how late the force acts at most [s].
        least: and at least [s].

    Examples:
        >>> from haptic_device.control.passivity import least_damping
        >>> round(least_damping(1000.0, 0.1, 0.001, 0.0), 12)  # KT/2 + |B|
        0.6
        >>> round(least_damping(1000.0, 0.0, 0.001, 0.001, 0.001), 12)  # one period late: KT (1/2 + 1)
        1.5
    """
    ratio = abs(damping) / (period * stiffness) if stiffness > 0.0 else 1e9
    n = weights(min(least, most) / period, most / period, ratio)
    return n[0] * period * stiffness + n[1] * abs(damping)


def largest_stiffness(physical_damping, damping, period, most, least=0.0):
    """Largest K [N/m] that `least_damping` allows; 0: none."""
    low, high = 0.0, 2.0 * physical_damping / period
    if least_damping(0.0, damping, period, most, least) >= physical_damping:
        return 0.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        fits = least_damping(middle, damping, period, most, least) <= physical_damping
        low, high = (middle, high) if fits else (low, middle)
    return high
