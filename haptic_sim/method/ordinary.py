# SPDX-License-Identifier: Apache-2.0
"""An ordinary exchange as one kernel, for a tool in closed form behind a port of energy (haptic_sim/at_once.py).

What Port.take, Simulation.exchange, Modulated and Port.answer do, in the same order to the last bit, for the next
sample of the same session with the same gains, in time. Whatever else comes is none of its business.
"""

import numpy as np

from haptic_device.jit import kernel, njit
from haptic_device.law import exchange, port
from haptic_sim.method.closed_form import advance_drawn

HEAD = 4  # bytes of a message before those that alignment counts from
SECOND = 1_000_000_000
LARGEST_WHOLE = 2.0**53 - 1.0
SAME = (exchange.LAYOUT, exchange.SESSION, *range(exchange.METHOD, exchange.GAIN_0 + 4))  # of the tail, in a session

STATE = np.dtype(
    [(name, "i8") for name in ("lent", "axes", "stamp", "remainder", "sub_step", "most", "exchanges", "sub_steps")]
    + [(name, "f8") for name in ("session", "answers", "known", "budget", "returned", "supplied", "contacts", "force")]
    + [(name, "f8", (3,)) for name in ("position", "velocity", "home", "place", "rate", "pull", "push")]
    + [(name, "f8", (3,)) for name in ("stiffness", "damping", "mass", "gravity", "low", "high")]
    + [("first", "i8", (3,)), ("touched", "i8"), ("axis", "f8", (2,)), ("tail", "f8", (len(exchange.TAIL),))]
)
"""What the simulation's objects lend, in their words and units; times [ns]; first: of a message's three arrays of
numbers, counted in numbers behind the head; tail: of the last sample taken; axis: of the walls, in the plane."""


@kernel
def answer(data, inbox, fixed, outbox, state, rules, drawn):
    """Fills in the outbox; False, with nothing changed, for a sample that is not an ordinary one."""
    own = state[0]
    if own.lent == 0 or data.size != inbox.size:
        return False
    for k in range(data.size):
        inbox[k] = data[k]
    for k in range(HEAD):
        if inbox[k] != outbox[k]:
            return False
    words = inbox[HEAD:].view(np.uint64)
    for k in range(words.size):
        if words[k] & fixed[1, k] != fixed[0, k]:
            return False
    asked, said = inbox[HEAD:].view(np.float64), outbox[HEAD:].view(np.float64)
    stamp = np.int64(inbox[HEAD : HEAD + 4].view(np.int32)[0]) * SECOND
    stamp += np.int64(inbox[HEAD + 4 : HEAD + 8].view(np.uint32)[0])
    passed = stamp - own.stamp
    if not 0 <= passed <= own.most or not _is_ordinary(own, asked):
        return False
    for k in range(HEAD, HEAD + 8):
        outbox[k] = inbox[k]
    _advance(own, asked, passed, rules, drawn)
    own.stamp = stamp
    _say(own, said)
    return True


@njit
def _is_ordinary(own, asked):
    """Whether a sample is the next of the session, as the one before, and made of numbers within their limits."""
    axes = int(own.axes)
    for block in range(3):
        for i in range(axes):
            if not abs(asked[own.first[block] + i]) <= exchange.LIMIT:
                return False
    first = own.first[0] + axes
    for k in range(own.tail.size):
        if not abs(asked[first + k]) <= LARGEST_WHOLE:
            return False
    for k in SAME:
        if asked[first + k] != own.tail[k]:
            return False
    return asked[first + exchange.SEQUENCE] > own.tail[exchange.SEQUENCE]


@njit
def _advance(own, asked, passed, rules, drawn):
    """As Simulation.exchange and Modulated have it."""
    axes = int(own.axes)
    for k in range(own.tail.size):
        own.tail[k] = asked[own.first[0] + axes + k]
    energy = own.tail[exchange.ENERGY]
    drawn[port.TANK] += max(0.0, energy - own.known)
    own.known = max(own.known, energy)
    start = _turned(own, _three(own.position)), _turned(own, _three(own.velocity))
    for i in range(3):
        own.position[i] = asked[own.first[0] + i] if i < axes else own.home[i]
        own.velocity[i] = asked[own.first[1] + i] if i < axes else 0.0
    end = _turned(own, _three(own.position)), _turned(own, _three(own.velocity))
    count = (passed + own.remainder) // own.sub_step
    own.remainder = (passed + own.remainder) % own.sub_step
    own.exchanges, own.sub_steps = own.exchanges + 1, own.sub_steps + count
    if count > 0:
        gains = _three(own.stiffness), _three(own.damping)
        settings = _three(own.mass), _three(own.gravity), _three(own.low), _three(own.high), own.sub_step / SECOND
        place, rate, pull, push, supplied, most, taken = advance_drawn(
            rules, drawn, _three(own.place), _three(own.rate), *start, *end, *gains, *settings, count
        )
        for i in range(3):
            own.place[i], own.rate[i], own.pull[i], own.push[i] = place[i], rate[i], pull[i], push[i]
        own.supplied, own.contacts = own.supplied + supplied, own.contacts + taken
        own.force, own.touched = max(own.force, most), 1 if most > 0.0 else 0
    else:
        own.touched = 1 if own.push[0] != 0.0 or own.push[1] != 0.0 else 0
    over = max(0.0, drawn[port.TANK] - own.budget)
    drawn[port.TANK] -= over
    own.returned += over


@njit
def _say(own, said):
    """Writes the numbers of the answer, as Port.answer has it."""
    axes, first = int(own.axes), own.first[0] + int(own.axes)
    vectors = _plane(own, own.place), _plane(own, own.rate), _plane(own, own.pull)
    for block in range(3):
        for i in range(axes):
            said[own.first[block] + i] = vectors[block][i]
    own.answers += 1.0
    for k in range(own.tail.size):
        said[first + k] = own.tail[k]
    said[first + exchange.SESSION], said[first + exchange.SEQUENCE] = own.session, own.answers
    said[first + exchange.ANSWERED_SESSION] = own.tail[exchange.SESSION]
    said[first + exchange.ANSWERED] = own.tail[exchange.SEQUENCE]
    said[first + exchange.CONTACT] = float(own.touched)
    said[first + exchange.ENERGY] = own.returned


@njit
def _three(vector):
    return vector[0], vector[1], vector[2]


@njit
def _turned(own, vector):
    x, y, theta = vector
    return own.axis[0] * x + own.axis[1] * y, own.axis[0] * y - own.axis[1] * x, theta


@njit
def _plane(own, vector):
    u, w, theta = _three(vector)
    return own.axis[0] * u - own.axis[1] * w, own.axis[1] * u + own.axis[0] * w, theta
