# SPDX-License-Identifier: Apache-2.0
"""Encoder counts to position, and positions to velocity."""

from haptic_device.kernel import kernel
from haptic_device.parameter import Parameter

PARAMETERS = (
    Parameter(
        "velocity.lag", 0.0, "s", "time constant of the velocity estimate; 0 is the plain difference", 0.0, 0.1, True
    ),
)


@kernel
def position_of(counts, position_per_count, zero):
    """Device position [m | rad] of encoder counts; position_per_count carries the sign of the axis."""
    return counts * position_per_count - zero


@kernel
def velocity_of(previous, displacement, elapsed, lag):
    """Velocity [m/s | rad/s] from the displacement over the elapsed time between two latched samples.

    Backward difference (Colgate 1995, eq. 2) behind a first-order lag solved by backward Euler; lag = 0 is the
    difference itself. elapsed = 0: there is no new sample, the previous estimate stays.
    """
    if elapsed <= 0.0:
        return previous
    return (lag * previous + displacement) / (lag + elapsed)
