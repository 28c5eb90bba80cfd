# SPDX-License-Identifier: Apache-2.0
"""What the host keeps of a device on an open link (docs/reference/link_protocol.md): the words of the codec's state.

Each frame that may be answered is remembered with its times, until it is answered or REMEMBERED frames later.
"""

import secrets

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import clock_fit, codec, frame

ROUND_TRIPS = 15  # the last ones, of which codec.ROUND_TRIP is the median
ASK_FIRST = 10_000_000  # [ns] between the first questions for the clock
LONGEST_PERIOD = 10_000_000  # [ns] that a servo or a device may have

# words of the state
RANDOM, SESSION, SENT, TAKEN, GREETED, HEARD, SAID, ASKED, BITS = range(codec.OWN, codec.OWN + 9)
UNSURE = codec.OWN + 17  # 1: the last answer was left out
LATCHED, AWAITED, AWAITED_UNTIL, HELD_FOR, WORST = range(codec.OWN + 9, codec.OWN + 14)
NUMBER, ANSWERED = codec.OWN + 14, codec.OWN + 15  # commands of the session; the last answered
SAMPLED = codec.OWN + 16  # device's time of the last sample
COUNTS = codec.OWN + 18
FIT = COUNTS + 3
ROUNDS = FIT + clock_fit.WORDS
SENT_FRAMES = ROUNDS + ROUND_TRIPS  # those that may be answered, by sequence; five words each
REMEMBERED, EACH = 64, 5
WORDS = SENT_FRAMES + REMEMBERED * EACH
KEY, HOST_DEADLINE, DEVICE_DEADLINE, WRITTEN, OWN_NUMBER = range(EACH)
NOBODY = -1  # no sequence


def new_state() -> np.ndarray:
    """The state of a codec that has not met its device."""
    state = np.zeros(WORDS, np.int64)
    state[RANDOM] = secrets.randbelow(frame.U32) + 1
    state[codec.TEMPERATURE] = codec.NO_TEMPERATURE
    return state


@njit
def remember(state, host_deadline, device_deadline, written, number):
    """Keeps what the next frame is sent for, until it is answered or REMEMBERED frames later."""
    sequence = (state[SENT] + 1) & frame.U32
    at = SENT_FRAMES + (sequence & REMEMBERED - 1) * EACH
    state[at + KEY], state[at + HOST_DEADLINE], state[at + DEVICE_DEADLINE] = sequence, host_deadline, device_deadline
    state[at + WRITTEN], state[at + OWN_NUMBER] = written, number


@njit
def asked(state, answers):
    """Where the frame of this sequence is remembered; NOBODY if it is not, or was answered."""
    at = SENT_FRAMES + (answers & REMEMBERED - 1) * EACH
    return at if state[at + KEY] == answers else NOBODY


@njit
def fit_of(state):
    """The fit of the device's clock."""
    return state[FIT : FIT + clock_fit.WORDS]
