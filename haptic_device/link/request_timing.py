# SPDX-License-Identifier: Apache-2.0
"""How long requests take: the last times of a kind, in a codec's state, and their median and worst."""

import numpy as np

from haptic_device.jit import njit

MEDIAN_OF, WORST_OF = 31, 255
HEAD = 1  # word before the times: how many have been noted since the start


@njit
def note(state, first, size, value):
    """Takes the place of the oldest of `size` times [ns] behind the counter state[first]."""
    state[first + HEAD + state[first] % size] = value
    state[first] += 1


@njit
def worst(state, first, size):
    """Longest of the times noted [ns]; 0 before the first."""
    longest = np.int64(0)
    for i in range(min(state[first], size)):
        longest = max(longest, state[first + HEAD + i])
    return longest


@njit
def median(state, first, size):
    """The time [ns] that half of those noted are not longer than; 0 before the first."""
    noted = min(state[first], size)
    for i in range(noted):
        middle, shorter, equal = state[first + HEAD + i], 0, 0
        for j in range(noted):
            shorter += state[first + HEAD + j] < middle
            equal += state[first + HEAD + j] == middle
        if shorter <= noted // 2 < shorter + equal:
            return middle
    return np.int64(0)
