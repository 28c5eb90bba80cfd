# SPDX-License-Identifier: Apache-2.0
"""Times of a device that only answers requests: when a motor value acts, when a sample was taken, how long it takes.

Such a device tells no time. It is taken to act, and to sample, half way between the request's sending and its answer;
the worst delay is that of an action as late as the answer.
The words are of a codec's state, from OWN on; the codec's own begin at END.
"""

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import codec

MEDIAN_OF, WORST_OF = 31, 255  # the last times that are kept
SENT = codec.OWN  # [ns] when the last request was sent
WRITTEN = codec.OWN + 1  # [ns] when the servo wrote the motor values that are held
UNSENT = codec.OWN + 2  # 1: no request has taken them to the device
CARRIED = codec.OWN + 3  # [ns] WRITTEN of those that the last request took there first; 0: it took none
LAST_LATCHED = codec.OWN + 4  # [ns]
ROUND_TRIPS = codec.OWN + 5  # how many have been noted, and the last ones [ns]
DELAYS = ROUND_TRIPS + 1 + MEDIAN_OF
END = DELAYS + 1 + WORST_OF


@njit
def held(state, written):
    """New motor values, written by the servo at this time [ns], are to be sent."""
    state[WRITTEN], state[UNSENT] = written, 1


@njit
def asked(state, now):
    """A request with the motor values is sent now [ns]."""
    state[SENT] = now
    state[CARRIED] = state[WRITTEN] if state[UNSENT] else 0
    state[UNSENT] = 0


@njit
def answered(state, now):
    """Its answer is there [ns]: brings the state's median of round trips and worst delay up to date."""
    _note(state, ROUND_TRIPS, MEDIAN_OF, now - state[SENT])
    state[codec.CLOCK_ERROR] = (now - state[SENT]) // 2  # what half way may be wrong by
    state[codec.ROUND_TRIP] = _median(state, ROUND_TRIPS, MEDIAN_OF)
    if state[CARRIED]:
        _note(state, DELAYS, WORST_OF, now - state[CARRIED])
        state[codec.DELAY_MEAN] = codec.averaged(state[codec.DELAY_MEAN], _middle(state, now) - state[CARRIED])
        state[codec.DELAY] = _worst(state, DELAYS, WORST_OF)


@njit
def latched(state, deadline, now, answer):
    """Time of the sample in an answer that is there now [ns], and its error: not before its deadline, nor the last one.

    The sample was taken between request and answer.
    """
    at = max(state[LAST_LATCHED], deadline, _middle(state, now))
    state[LAST_LATCHED] = answer[codec.LATCHED] = at
    answer[codec.STAMP_ERROR] = max(abs(now - at), abs(at - state[SENT]))


@njit
def _middle(state, now):
    return state[SENT] + (now - state[SENT]) // 2


@njit
def _note(state, first, size, value):
    """Takes the place of the oldest."""
    state[first + 1 + state[first] % size] = value
    state[first] += 1


@njit
def _worst(state, first, size):
    longest = np.int64(0)
    for i in range(min(state[first], size)):
        longest = max(longest, state[first + 1 + i])
    return longest


@njit
def _median(state, first, size):
    noted = min(state[first], size)
    for i in range(noted):
        middle, shorter, equal = state[first + 1 + i], 0, 0
        for j in range(noted):
            shorter += state[first + 1 + j] < middle
            equal += state[first + 1 + j] == middle
        if shorter <= noted // 2 < shorter + equal:
            return middle
    return np.int64(0)
