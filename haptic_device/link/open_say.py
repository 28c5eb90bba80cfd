# SPDX-License-Identifier: Apache-2.0
"""What the host says on an open link (docs/reference/link_protocol.md): the frame that an event of the codec asks for.

A new line, and one on which nothing came for SILENCE, begins a session: a random number, a hello each HELLO_AGAIN
until the device greets, then questions for its clock (clock_fit.py); where an answer was left out, the next soon.
"""

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import clock_fit, codec, frame
from haptic_device.link import open_state as s

HELLO_AGAIN = 50_000_000  # [ns]
SILENCE = 100_000_000  # [ns]
ASKS_FIRST, ASK_LATER = 10, 20_000_000  # questions that are asked quickly; between those after them [ns]
SLACK = 2_500_000  # [ns] by which a time may be early: half of what lies between two looks (IDLE)
PERIOD = 1_000_000  # [ns] of a cut before any command
PERIODS_AWAITED = 2
ENGAGED = 1  # flag of a command


@njit
def say(state, event, now, command, data):
    """The frame that an event asks for, into data; returns its bytes, 0 for none."""
    if event == codec.OPENED:
        return _forget(state, now, data)
    if event == codec.IDLE:
        return _look(state, now, data)
    if event == codec.TARGET:
        return _target(state, command, data)
    if event == codec.COMMAND:
        _prepare(state, command, data)
        return _command(state, command[1], command[2], command[3], command[4], data)
    if event == codec.CUT:
        _no_motor(data)
        period = min(s.LONGEST_PERIOD, max(state[codec.PERIOD_LEAST], state[s.HELD_FOR]))
        return _command(state, now, now + period, period, 0, data)
    return 0


@njit
def _forget(state, now, data):
    """Forgets the device, with all that it told; totals stay, and the time of the last sample."""
    state[codec.TEMPERATURE], state[s.BITS], state[s.HELD_FOR] = codec.NO_TEMPERATURE, 32, PERIOD
    for word in (codec.PERIOD_LEAST, codec.WATCHDOG, codec.AXES, codec.FIRMWARE, codec.SIMULATED, codec.ROUND_TRIP):
        state[word] = 0
    state[s.COUNTS : s.COUNTS + 3] = 0
    state[s.ROUNDS : s.ROUNDS + s.ROUND_TRIPS] = 0
    return _begin(state, now, data)


@njit
def _begin(state, now, data):
    """Begins a session with a number that no frame on the line has yet; returns the bytes of its hello."""
    if state[s.NUMBER] > state[s.ANSWERED] + 1:  # the last one may still be on its way
        state[codec.LOST] += state[s.NUMBER] - state[s.ANSWERED] - 1
    word = state[s.RANDOM]  # xorshift (Marsaglia 2003) in 32 bits, which never comes to 0
    word ^= word << 13 & frame.U32
    word ^= word >> 17
    word ^= word << 5 & frame.U32
    state[s.RANDOM] = state[s.SESSION] = word
    for word in (s.SENT, s.TAKEN, s.GREETED, s.ASKED, s.AWAITED, s.WORST, s.NUMBER, s.ANSWERED, s.UNSURE):
        state[word] = 0
    for word in (codec.READY, codec.DELAY, codec.DELAY_MEAN, codec.CLOCK_ERROR, codec.CLOCK_TROUBLE, codec.SKEW):
        state[word] = 0
    state[codec.CLOCK_AVERAGE] = 0
    state[s.SAMPLED] = -clock_fit.FARTHEST  # none yet
    for i in range(s.REMEMBERED):
        state[s.SENT_FRAMES + i * s.EACH + s.KEY] = s.NOBODY
    clock_fit.restart(s.fit_of(state))
    state[s.SAID] = now
    return _send(state, frame.HELLO, 0, data)


@njit
def _send(state, kind, flags, data):
    """Makes a frame of the payload in data; returns its bytes."""
    state[s.SENT] = (state[s.SENT] + 1) & frame.U32
    return frame.seal(data, kind, flags, state[s.SESSION], state[s.SENT])


@njit
def _look(state, now, data):
    """What is due by time: a hello, a question, or nothing."""
    if state[s.SESSION] == 0 or (state[s.GREETED] != 0 and now - state[s.HEARD] > SILENCE):
        return _begin(state, now, data)
    since = now - state[s.SAID] + SLACK
    if state[s.GREETED] == 0:
        if since < HELLO_AGAIN:
            return 0
        state[s.SAID] = now
        return _send(state, frame.HELLO, 0, data)
    state[codec.CLOCK_ERROR] = clock_fit.error(s.fit_of(state), now)
    if since < (s.ASK_FIRST if state[s.ASKED] < ASKS_FIRST or state[s.UNSURE] != 0 else ASK_LATER):
        return 0
    state[s.SAID], state[s.ASKED] = now, state[s.ASKED] + 1
    s.remember(state, 0, 0, now, 0)
    frame.put_i64(data, frame.HEADER, now)
    return _send(state, frame.CLOCK, 0, data)


@njit
def _target(state, command, data):
    """Where the hand of a simulated device goes; nothing if it is another, or the target is not a number."""
    reals = command.view(np.float64)
    if state[s.GREETED] == 0 or state[codec.SIMULATED] == 0:
        return 0
    for i in range(3):
        if not np.isfinite(reals[5 + i]):
            return 0
        frame.put_f64(data, frame.HEADER + 8 * i, reals[5 + i])
    return _send(state, frame.TARGET, 0, data)


@njit
def _no_motor(data):
    for i in range(3):
        frame.put_f32(data, frame.HEADER + 12 + 4 * i, 0.0)


@njit
def _prepare(state, command, data):
    """The motor values of a write; all are zero if one is not finite as a float32."""
    reals, finite = command.view(np.float64), True
    for i in range(3):
        value = reals[5 + i] if i < state[codec.AXES] else 0.0
        finite = frame.put_f32(data, frame.HEADER + 12 + 4 * i, value) and finite
    if not finite:
        _no_motor(data)
    state[s.HELD_FOR] = command[3]


@njit
def _command(state, written, deadline, period, engaged, data):
    """A command of the motor values in data, if the device is ready for it."""
    if state[codec.READY] == 0:
        return 0
    state[s.NUMBER] += 1
    announced = clock_fit.to_device(s.fit_of(state), deadline)
    state[s.AWAITED], state[s.AWAITED_UNTIL] = deadline, deadline + PERIODS_AWAITED * period
    s.remember(state, deadline, announced, written, state[s.NUMBER])
    frame.put_i64(data, frame.HEADER, announced)
    frame.put_u32(data, frame.HEADER + 8, period)
    return _send(state, frame.COMMAND, ENGAGED if engaged != 0 else 0, data)
