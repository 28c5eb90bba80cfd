# SPDX-License-Identifier: Apache-2.0
"""Counters of fewer bits than an int64, which wrap."""

from haptic_device.jit import kernel


@kernel
def unwrap(count, before, bits):
    """The count nearest to `before` that reads as `count` in a counter of this many bits (1…63).

    It is right if the counter has moved less than half its range since; half the range is taken as backwards.
    """
    half, mask = 1 << (bits - 1), (1 << bits) - 1
    return before + ((count - before + half) & mask) - half
