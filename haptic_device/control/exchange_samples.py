# SPDX-License-Identifier: Apache-2.0
"""What driver and simulation tell each other, and which of the other's samples a side accepts.

A sample is a vector of 3 n numbers, n = axes + tail: the `position`, `velocity` and `effort` arrays of one JointState
behind each other. The axes carry the port; each entry of TAIL (message_fields.py) has one number, in its position slot.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_device.jit import kernel
from haptic_device.message_fields import TAIL

LAYOUT_VERSION = 1
LAYOUT, SESSION, SEQUENCE, ANSWERED_SESSION, ANSWERED, METHOD, GAINS, GAIN_0 = range(8)
COUPLING_GAINS = np.dtype([(name, "f8") for name in TAIL[GAIN_0 : GAIN_0 + 4]] + [("hash", "f8")])
CONTACT, ENERGY = TAIL.index("contact"), TAIL.index("energy")
DIRECT, WAVE, PSPM, LOCAL = range(4)
LIMIT = 1e6  # [m, rad, m/s, N …] nothing real exceeds it; a sample beyond it is noise

ACCEPTED, NOT_FINITE, OTHER_LAYOUT, NOT_MINE, OLD, OTHER_METHOD, OTHER_GAINS, SECOND_SENDER, OTHER_NAMES = range(9)
REFUSALS = (
    "accepted",
    "NaN or out of range",
    "other layout version",
    "answers another session",
    "late or repeated",
    "other exchange method",
    "other coupling gains",
    "second publisher",
    "other axis names or size",
)


class Peer(NamedTuple):
    """What this side knows of the other when a sample comes in; times [ns] of this side's monotonic clock."""

    session: float  # of the other's run, 0 = none yet
    answered: float  # highest own sequence the other has answered
    accepted_ns: int


@kernel
def is_modulated(method):
    """Whether the set position of the coupling's spring is moved as a tank of energy pays for it."""
    return method in (PSPM, LOCAL)


@kernel
def gains_hash(stiffness, damping, rotational_stiffness, rotational_damping):
    """One number that differs when the gains do (a fixed linear mix, exact for equal inputs)."""
    return (
        stiffness + math.pi * damping + math.e * 1e3 * rotational_stiffness + math.sqrt(2.0) * 1e3 * rotational_damping
    )


@kernel
def judge_tool(sample, axes, peer, own_session, own_sequence, method, gains, now_ns, silence_ns):
    """ACCEPTED, or why the driver refuses this tool sample.

    sample: 3 n vector (see top). A second sender is accepted only after the first has been silent for silence_ns.
    """
    tail = sample[axes:]
    for value in sample:
        if not abs(value) < 1e15:
            return NOT_FINITE
    count = sample.size // 3
    for block in range(3):
        for axis in range(axes):
            if abs(sample[block * count + axis]) > LIMIT:
                return NOT_FINITE
    if tail[SESSION] < 1.0 or tail[SEQUENCE] < 1.0:
        return NOT_FINITE
    if tail[LAYOUT] != LAYOUT_VERSION:
        return OTHER_LAYOUT
    if tail[METHOD] != method:
        return OTHER_METHOD
    answered = tail[ANSWERED]
    if tail[ANSWERED_SESSION] != own_session or not 1.0 <= answered <= own_sequence or answered != math.floor(answered):
        return NOT_MINE
    if tail[SESSION] != peer.session and peer.session != 0.0 and now_ns - peer.accepted_ns < silence_ns:
        return SECOND_SENDER
    if answered <= peer.answered:
        return OLD
    if tail[GAINS] != gains:
        return OTHER_GAINS
    return ACCEPTED


@kernel
def fade_factor(factor, age, period, hold, fade):
    """Next factor 0…1 on the coupling for a tool sample of this age [s]; age < 0: there is none.

    Full up to hold, falling linearly over fade; it returns no faster than over fade, so that a rejoining tool does
    not kick.
    """
    allowed = 0.0 if age < 0.0 else min(1.0, max(0.0, 1.0 - (age - hold) / fade))
    return min(allowed, factor + period / fade)


@kernel
def believed(claimed, known, sent, returned):
    """Energy [J] that a sample brings: what it claims above what is known, at most what was sent and is still away."""
    return max(0.0, min(claimed - known, sent - returned))
