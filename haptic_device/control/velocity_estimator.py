# SPDX-License-Identifier: Apache-2.0
"""Encoder counts to position, and positions to velocity."""

from haptic_device.config.parameters import KEPT
from haptic_device.jit import kernel, njit

BACKWARD_DIFFERENCE, LOWPASS, ADAPTIVE_WINDOW = range(3)


@njit
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
    # lag · (v⁺ − v) + T v⁺ = Δx
    return (lag * previous + displacement) / (lag + elapsed)


@njit
def adaptive_velocity(times, errors, positions, newest, count, longest, step):
    """End-fit first-order adaptive window (Janabi-Sharifi, Hayward & Chen 2000) [m/s | rad/s].

    times [s], what they may be wrong by either way (errors) [s] and positions are rings of KEPT samples, `newest` the
    index of the last, `count` how many there are. A window lasted as long as its ends allow. The
    longest window is taken on whose end-to-end line every sample lies within one encoder step: long at rest, where
    the difference of two samples would be a step over T, short where the motion turns.
    """
    velocity = 0.0
    for window in range(1, min(longest, count - 1) + 1):
        oldest = (newest - window) % KEPT
        span = times[newest] - times[oldest]
        if span <= 0.0:
            break
        # through both ends of the window
        way = positions[newest] - positions[oldest]
        if not _on_line(times, positions, newest, window, way / span, step):
            break
        velocity = way / (span + errors[newest] + errors[oldest])
    return velocity


@njit
def _on_line(times, positions, newest, window, slope, step):
    for back in range(1, window):
        index = (newest - back) % KEPT
        line = positions[newest] - slope * (times[newest] - times[index])
        if abs(positions[index] - line) > step:
            return False
    return True
