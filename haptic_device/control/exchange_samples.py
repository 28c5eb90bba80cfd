# SPDX-License-Identifier: Apache-2.0
"""What driver and simulation tell each other, and which of the other's samples a side accepts.

A sample is (3, n) numbers, n = axes + tail: the `position`, `velocity` and `effort` arrays of one JointState. The axes
carry the port; each entry of TAIL (message_fields.py) has one number, in its position slot. In a handle sample the
effort slots of the first three gains say the largest force of the coupling's spring on x, y and theta; 0: not said.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_device.jit import kernel, njit
from haptic_device.message_fields import TAIL

LAYOUT_VERSION = 1
LAYOUT, SESSION, SEQUENCE, ANSWERED_SESSION, ANSWERED, METHOD, GAINS, GAIN_0 = range(8)
COUPLING_GAINS = np.dtype(
    [(name, "f8") for name in (*TAIL[GAIN_0 : GAIN_0 + 4], "hash")] + [("limit", "f8", (3,))]  # of the spring, by axis
)
CONTACT, ENERGY = TAIL.index("contact"), TAIL.index("energy")
DIRECT, PSPM, LOCAL = 0, 2, 3
METHODS = {"direct": DIRECT, "pspm": PSPM, "local": LOCAL}
"""Each method's number in messages and bags; 1 is used up."""
LIMIT = 1e6  # [m, rad, m/s, N …] nothing real exceeds it; a sample beyond it is noise
LARGEST = 1e15  # of all other numbers; whole ones are exact up to there

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
    number: float  # highest accepted: own sequence that was answered, or its sequence in this session
    accepted_ns: int


def name_of(number):
    """Name of an exchange method, of a bag too that was made when there were others."""
    return {1: "wave", **{known: name for name, known in METHODS.items()}}.get(number, f"number {number:g}")


@kernel
def gains_hash(stiffness, damping, rotational_stiffness, rotational_damping):
    """One number that differs when the gains do (a fixed linear mix, exact for equal inputs)."""
    return (
        stiffness + math.pi * damping + math.e * 1e3 * rotational_stiffness + math.sqrt(2.0) * 1e3 * rotational_damping
    )


@kernel
def judge_tool(sample, axes, peer, own_session, own_sequence, method, gains, now_ns, silence_ns):
    """ACCEPTED, or why the driver refuses this tool sample."""
    tail = sample[0, axes:]
    verdict, answered = _judge_numbers(sample, axes, method), tail[ANSWERED]
    if verdict != ACCEPTED:
        return verdict
    if tail[ANSWERED_SESSION] != own_session or not 1.0 <= answered <= own_sequence or answered != math.floor(answered):
        return NOT_MINE
    verdict = _judge_turn(peer, tail[SESSION], answered, peer.number, now_ns, silence_ns)
    return OTHER_GAINS if verdict == ACCEPTED and tail[GAINS] != gains else verdict


@kernel
def judge_handle(sample, axes, peer, method, now_ns, silence_ns):
    """ACCEPTED, or why the simulation refuses this handle sample."""
    tail = sample[0, axes:]
    verdict = _judge_numbers(sample, axes, method)
    if verdict != ACCEPTED:
        return verdict
    if tail[GAINS] != gains_hash(tail[GAIN_0], tail[GAIN_0 + 1], tail[GAIN_0 + 2], tail[GAIN_0 + 3]):
        return OTHER_GAINS
    known = peer.number if tail[SESSION] == peer.session else 0.0  # its numbers begin anew with its session
    return _judge_turn(peer, tail[SESSION], tail[SEQUENCE], known, now_ns, silence_ns)


@njit
def _judge_numbers(sample, axes, method):
    """ACCEPTED, or why no side can mean these numbers. NaN fails any comparison, so the tests are for what is good."""
    tail = sample[0, axes:]
    for part in range(3):
        for axis in range(axes):
            if not abs(sample[part, axis]) <= LIMIT:
                return NOT_FINITE
    for value in tail:
        if not abs(value) < LARGEST:
            return NOT_FINITE
    if tail[LAYOUT] != LAYOUT_VERSION:
        return OTHER_LAYOUT
    for gain in tail[GAIN_0 : GAIN_0 + 4]:
        if not 0.0 <= gain <= LIMIT:
            return NOT_FINITE
    if tail[SESSION] < 1.0 or tail[SEQUENCE] < 1.0:
        return NOT_FINITE
    return ACCEPTED if tail[METHOD] == method else OTHER_METHOD


@njit
def _judge_turn(peer, session, number, known, now_ns, silence_ns):
    """Whether it is this sender's turn: a second one is heard once the first has been silent for silence_ns.

    Numbers only rise; known: the last one.
    """
    if session != peer.session and peer.session != 0.0 and now_ns - peer.accepted_ns < silence_ns:
        return SECOND_SENDER
    return ACCEPTED if number > known else OLD


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
