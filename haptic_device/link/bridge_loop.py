# SPDX-License-Identifier: Apache-2.0
"""The loop of the bridge: serves the device page from a device on a line, without the interpreter.

As the simulated device does, it takes the servo's write, has the motor value sent at once, and writes the sample of the
announced deadline when that has come. A servo that is silent for the watchdog's time is cut off: its motor value is
taken back. Where the line is lost the page gets no more samples, and the loop waits for another descriptor.

`serve` asks the clock and waits; what it does at a time is `turn`, and `last_word` at its end, which take that time.
"""

import functools
from typing import NamedTuple

import numpy as np
from numba import types

from haptic_device.jit import kernel, njit
from haptic_device.link import codec, line
from haptic_device.realtime import atomic, clock, futex, seqlock, servo_writes, shared_memory

# words of control; FD: of the line, −1: none; the loop writes that where the line is lost
STOP, FD, RUN_ON, TRIPS, REFUSED, WATCHDOG, DRIVEN, UNSENT, PASSED, ASKS, DATAGRAM = range(11)
CONTROLS = 16
FREE_STEP = 1_000_000  # [ns] between samples that an idle device is asked for
IDLE_STEP = 5_000_000  # [ns] between IDLE events
SPIN = 20_000  # [ns] that the servo's write is looked for without a pause: to sleep takes longer
PAUSE = 15_000  # [ns] between looks for it after that; a shorter one is none, and keeps the core from kernel threads
LAST_WORDS, LAST_STEP = 5, 2_000_000  # CUT events at an end, and the time between them [ns]
QUIET = 50_000_000  # [ns] without samples after a new session, whose counts may be others: to the servo a silence

MEMORY = np.dtype(
    [(name, "i8") for name in ("turn", "driven", "holding", "heartbeat", "announced", "period", "asked", "latest")]
    + [(name, "i8") for name in ("descriptor", "have", "idle", "target_turn", "session", "quiet", "spin")]
)
"""What the loop keeps. announced: the deadline that counts now, asked: the next one that a device which only answers is
asked for, spin: up to when nothing is waited for [ns]; have: bytes of incoming that are not done with."""


class Buffers(NamedTuple):
    """Arrays of the loop. taken: the last write that counts, with zero motor values where it was taken back."""

    inbox: np.ndarray
    taken: np.ndarray
    answer: np.ndarray
    block: np.ndarray
    target: np.ndarray
    incoming: np.ndarray
    outgoing: np.ndarray


_WORDS = types.int64[::1]


def serve(encode, decode, state, words, control, truth_mail, target_mail, session):
    """Serves the page `words` until control[STOP]; every way out takes the motor back.

    encode, decode, state: of the codec. truth_mail, target_mail: sequence locks, of the truths that a simulated device
    tells (written) and of the target of its hand, 3 float64 in device units (read).

    Counts into control: RUN_ON (deadlines without a write), TRIPS (of the watchdog, a servo that ended well not
    counted), REFUSED (writes of nonsense), UNSENT (frames that the line did not take), PASSED (samples).
    """
    scratch, memory, room = np.zeros(3, np.int64), np.zeros(1, MEMORY), buffers()
    m = memory[0]
    begin(words, target_mail, clock.now_ns(scratch), m, room)
    while atomic.load(control, STOP) == 0:
        came = receive(control, m, room)
        now = clock.now_ns(scratch)
        turn(encode, decode, state, words, control, truth_mail, target_mail, session, came, now, m, room)
        if came <= 0 and now >= m.spin:
            line.wait(m.descriptor, next_look(control, now, m), now, scratch)
    for _ in range(LAST_WORDS):
        came = receive(control, m, room)
        now = clock.now_ns(scratch)
        last_word(encode, decode, state, words, control, truth_mail, session, came, now, m, room)
        line.wait(-1, now + LAST_STEP, now, scratch)
    control[DRIVEN] = 0


@functools.cache
def compiled():
    """`serve`, compiled for codecs given as function pointers: any codec runs the same cached machine code."""
    functions = types.FunctionType(codec.ENCODE), types.FunctionType(codec.DECODE)
    return kernel(types.void(*functions, *[_WORDS] * 5, types.int64))(serve)


@njit
def buffers():
    return Buffers(
        np.zeros(shared_memory.SERVO_WORDS, np.int64),
        np.zeros(shared_memory.SERVO_WORDS, np.int64),
        np.zeros(codec.ANSWER, np.int64),
        np.zeros(shared_memory.DEVICE_WORDS, np.int64),
        np.zeros(3, np.int64),
        np.zeros(4096, np.uint8),
        np.zeros(codec.ROOM, np.uint8),
    )


@njit
def begin(words, target_mail, now, m, room):
    """The memory of a loop that begins now [ns]: what has been written before is not taken."""
    m.turn, m.target_turn = shared_memory.read_servo(words, room.inbox), atomic.load(target_mail, 0)
    m.descriptor, m.period = -1, FREE_STEP
    m.announced = m.asked = m.idle = now


@njit
def receive(control, m, room):
    """Reads what has come, one datagram at most; returns the number of bytes, or line.LOST."""
    if m.descriptor < 0:
        return 0
    return line.receive(m.descriptor, room.incoming, m.have, control[DATAGRAM] != 0)


@njit
def turn(encode, decode, state, words, control, truth_mail, target_mail, session, came, now, m, room):
    """All that is to be done now [ns]; `came`: new bytes of the device in room.incoming, or line.LOST."""
    if atomic.load(control, FD) != m.descriptor:
        m.descriptor, m.have, came = atomic.load(control, FD), 0, 0
        _tell(encode, state, codec.OPENED, now, m, room, control)
    if _hear(decode, state, words, control, truth_mail, session, came, now, m, room):
        m.spin = now + SPIN
    _heed(encode, state, words, control, now, m, room)
    _look_after(encode, state, control, target_mail, now, m, room)


@njit
def last_word(encode, decode, state, words, control, truth_mail, session, came, now, m, room):
    """Says once more that the motor is zero, at an end."""
    _hear(decode, state, words, control, truth_mail, session, came, now, m, room)
    _take_back(room)
    _tell(encode, state, codec.CUT, now, m, room, control)


@njit
def _heed(encode, state, words, control, now, m, room):
    """The servo: takes its write, or sees that it is late or silent."""
    written, inbox = shared_memory.read_servo(words, room.inbox), room.inbox
    if written >= 0 and written != m.turn:
        m.turn = written
        if not servo_writes.sensible(inbox, now, control[WATCHDOG]):
            control[REFUSED] += 1
            return
        for i in range(inbox.size):
            room.taken[i] = inbox[i]
        m.driven, m.holding = 1, servo_writes.holds(inbox)
        m.heartbeat, m.announced, m.period = inbox[1], inbox[2], inbox[3]
        m.asked = m.announced
        _tell(encode, state, codec.COMMAND, now, m, room, control)
    elif m.driven and now - m.heartbeat > control[WATCHDOG]:
        m.driven, m.period = 0, FREE_STEP
        control[TRIPS] += m.holding
        _take_back(room)
        _tell(encode, state, codec.CUT, now, m, room, control)
    elif m.driven and now >= m.announced + m.period:
        m.announced += m.period
        control[RUN_ON] += 1
    control[DRIVEN] = m.driven


@njit
def _look_after(encode, state, control, target_mail, now, m, room):
    """What is to be said to the device when its time has come."""
    if control[ASKS] and m.driven and now >= m.asked:
        room.taken[2] = m.asked  # the deadline that it is asked for; where an answer is still out, a little later
        said = _tell(encode, state, codec.DUE, now, m, room, control)
        if said or now >= m.asked + m.period // 2:
            state[codec.LOST] += not said
            m.asked = max(m.asked + m.period, now + m.period // 2)
    if now >= m.idle:
        m.idle = now + IDLE_STEP
        _tell(encode, state, codec.IDLE, now, m, room, control)
    if atomic.load(target_mail, 0) != m.target_turn:
        m.target_turn = atomic.collect(target_mail, 0, seqlock.FIRST, room.target)
        if state[codec.SIMULATED] and m.target_turn >= 0:
            kept = room.taken.copy()
            for i in range(3):
                room.taken[5 + i] = room.target[i]
            _tell(encode, state, codec.TARGET, now, m, room, control)
            for i in range(kept.size):
                room.taken[i] = kept[i]


@njit
def _hear(decode, state, words, control, truth_mail, session, came, now, m, room):
    """The device: takes what has come. Returns whether there was the sample that the servo waits for."""
    if came == line.LOST:
        m.descriptor, state[codec.READY] = -1, 0
        atomic.store(control, FD, -1)
    if came <= 0:
        return False
    waited_for, used, have = False, np.int64(0), m.have + came
    while used < have:
        room.answer[codec.KIND], room.answer[codec.STATUS] = codec.NOTHING, 0
        done = decode(state, room.incoming[used:have], have - used, now, room.answer)
        if room.answer[codec.KIND] == codec.SAMPLE:
            waited_for |= _pass_on(state, words, control, session, now, m, room)
        elif room.answer[codec.KIND] == codec.NOTHING and room.answer[codec.STATUS] and m.latest > 0:
            # else the servo would only see that the device is silent
            room.block[2], room.block[3] = room.block[2] | room.answer[codec.STATUS], now
            atomic.publish(words, shared_memory.DEVICE_LOCK, shared_memory.DEVICE_FIRST, room.block)
        elif room.answer[codec.KIND] == codec.TRUTH:
            first = codec.TRUTH_FIRST
            atomic.publish(truth_mail, 0, seqlock.FIRST, room.answer[first : first + codec.TRUTH_WORDS])
        if done <= 0:
            break
        used += done
    if control[DATAGRAM] or have - used >= room.incoming.size:  # what is left of it is no frame
        used = have
    for i in range(have - used):
        room.incoming[i] = room.incoming[used + i]
    m.have = have - used
    return waited_for


@njit
def _pass_on(state, words, control, session, now, m, room):
    """Writes a sample into the page, if it is newer than the last. Returns whether the servo waits for it."""
    latched = room.answer[codec.LATCHED]
    if state[codec.SESSIONS] != m.session:
        m.session, m.quiet = state[codec.SESSIONS], now + QUIET
    if latched <= m.latest or now < m.quiet:
        return False
    m.latest, words[shared_memory.DEVICE_WATCHDOG] = latched, state[codec.WATCHDOG]
    control[PASSED] += 1
    status = room.answer[codec.STATUS] | (0 if m.driven else shared_memory.WATCHDOG)
    status |= codec.CLOCK if state[codec.CLOCK_TROUBLE] else 0
    counts, delay = room.answer[codec.COUNTS : codec.COUNTS + 3], state[codec.DELAY]
    drag, error = room.answer[codec.DRAG : codec.DRAG + 3].view(np.float64), room.answer[codec.STAMP_ERROR]
    shared_memory.write_device(words, room.block, session, latched, status, now, counts, drag, delay, error)
    futex.wake(words, shared_memory.DEVICE_LOCK)
    return m.driven and latched >= m.announced


@njit
def next_look(control, now, m):
    """When the servo or the device has to be looked after next [ns]; what the device sends is heard at once.

    The servo writes when it has the sample of its deadline, or has waited for half a period.
    """
    until = min(m.idle, now + FREE_STEP)
    if m.driven:
        due = m.announced if m.latest >= m.announced else m.announced + m.period // 2
        until = min(until, max(due, now + PAUSE))
    if control[ASKS] and m.driven:
        return min(until, m.asked if now < m.asked else now + PAUSE)
    return until


@njit
def _tell(encode, state, event, now, m, room, control):
    """Has the codec say this event, where there is a line. Returns whether it had something to say."""
    if m.descriptor < 0:
        return False
    count = encode(state, event, now, room.taken, room.outgoing)
    if count > 0 and not line.send(m.descriptor, room.outgoing, count):
        control[UNSENT] += 1
    return count > 0


@njit
def _take_back(room):
    """The motor value of the write that counts is zero from now on, and nobody is engaged."""
    for i in range(4, room.taken.size):
        room.taken[i] = 0
