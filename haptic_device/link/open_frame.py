# SPDX-License-Identifier: Apache-2.0
"""The host's side of the link protocol (docs/link_protocol.md): the codec of both open links, serial and UDP.

A new line, and one on which nothing came for SILENCE, begins a session: a random number, a hello each HELLO_AGAIN
until the device greets, then questions for its clock (clock_fit.py). The link is ready when these make a fit. Each
frame that may be answered is remembered with its times; a sample counts for a deadline only by what it echoes.

The delay is the worst time from a write to its effect, which fades towards the present by a thousandth with each
command, and the clock's error. A sample that nobody asked for is placed by the fitted clock: not after now, and before
the newest deadline that is announced, until that is answered or two periods past. One that would then not be newer
than the sample before is dropped.
"""

import functools
import secrets

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import clock_fit, codec, counter, frame

HELLO_AGAIN = 50_000_000  # [ns]
SILENCE = 100_000_000  # [ns]
ASK_FIRST, ASK_LATER, ASKS_FIRST = 10_000_000, 20_000_000, 10  # [ns] between questions; how many are asked at first
SLACK = 2_500_000  # [ns] by which a time may be early: half of what lies between two looks (IDLE)
PERIOD, LONGEST_PERIOD = 1_000_000, 10_000_000  # [ns] of a cut before any command; that a device may have
PERIODS_AWAITED = 2
OLDEST = 1_000_000_000  # [ns] that an answer's times may be away
AHEAD = 10_000_000  # [ns] beyond now in which no sample can be
FADING = 1000  # commands
STATUS_BITS = 2 | 4 | 8 | 16 | 32 | 128
ENGAGED, MOTION_DONE, DRIVEN = 1, 1, 2  # flags
EXCHANGES = 15  # round trips, of which ROUND_TRIP is the median

# words of the state
RANDOM, SESSION, SENT, TAKEN, GREETED, HEARD, SAID, ASKED, BITS = range(codec.OWN, codec.OWN + 9)
LATCHED, AWAITED, AWAITED_UNTIL, HELD_FOR, WORST = range(codec.OWN + 9, codec.OWN + 14)
NUMBER, ANSWERED, DUE_AT = range(codec.OWN + 14, codec.OWN + 17)  # commands that came due; the last answered; its time
COUNTS = codec.OWN + 17
FIT = COUNTS + 3
ROUNDS = FIT + clock_fit.WORDS
SENT_FRAMES = ROUNDS + EXCHANGES  # those that may be answered, by sequence; five words each
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


@functools.cache
def datagrams():
    """encode and decode of one frame a datagram; compiled where there is such a link."""
    return codec.encoder(_encode_datagram), codec.decoder(_decode_datagram)


@functools.cache
def streams():
    """encode and decode of frames by COBS on a stream of bytes; compiled where there is such a link."""
    return codec.encoder(_encode_stream), codec.decoder(_decode_stream)


def _encode_datagram(state, event, now, command, outgoing):
    return _say(state, event, now, command, outgoing)


def _encode_stream(state, event, now, command, outgoing):
    plain = np.empty(frame.LONGEST, np.uint8)
    count = _say(state, event, now, command, plain)
    if count == 0:
        return 0
    start = 1 if plain[1] == frame.HELLO else 0  # whatever came before on the line is ended
    outgoing[0] = 0
    end = start + frame.cobs_encode(plain, count, outgoing[start:])
    outgoing[end] = 0
    return end + 1


def _decode_datagram(state, incoming, count, now, answer):
    _hear(state, incoming, count, now, answer)
    return count


def _decode_stream(state, incoming, count, now, answer):
    answer[codec.KIND] = codec.NOTHING
    first = 0
    while first < count and incoming[first] == 0:
        first += 1
    end = first
    while end < count and incoming[end] != 0:
        end += 1
    if end == count and end - first <= frame.LONGEST_CODED:
        return first  # more have to come
    plain = np.empty(frame.LONGEST, np.uint8)
    length = frame.cobs_decode(incoming, first, end - first, plain)
    _hear(state, plain, length, now, answer)
    return min(end + 1, count)


@njit
def _say(state, event, now, command, data):
    """The frame that an event asks for, into data; returns its bytes, 0 for none."""
    if event == codec.OPENED:
        return _forget(state, now, data)
    if event == codec.IDLE:
        return _look(state, now, data)
    if event == codec.TARGET:
        return _target(state, command, data)
    if event == codec.COMMAND:
        _prepare(state, command, data)
        return _command(state, now, command[1], command[2], command[3], command[4], data)
    if event == codec.CUT:
        _no_motor(data)
        period = min(LONGEST_PERIOD, max(state[codec.PERIOD_LEAST], state[HELD_FOR]))
        return _command(state, now, now, now + period, period, 0, data)
    return 0


@njit
def _forget(state, now, data):
    """Forgets the device, with all that it told; totals stay, and the time of the last sample."""
    state[codec.TEMPERATURE], state[BITS], state[HELD_FOR] = codec.NO_TEMPERATURE, 32, PERIOD
    for word in (codec.PERIOD_LEAST, codec.WATCHDOG, codec.AXES, codec.FIRMWARE, codec.SIMULATED, codec.ROUND_TRIP):
        state[word] = 0
    state[COUNTS : COUNTS + 3] = 0
    state[ROUNDS : ROUNDS + EXCHANGES] = 0
    return _begin(state, now, data)


@njit
def _begin(state, now, data):
    """Begins a session with a number that no frame on the line has yet; returns the bytes of its hello."""
    if state[NUMBER] > state[ANSWERED] + 1:  # the last one may still be on its way
        state[codec.LOST] += state[NUMBER] - state[ANSWERED] - 1
    word = state[RANDOM]  # xorshift (Marsaglia 2003) in 32 bits, which never comes to 0
    word ^= word << 13 & frame.U32
    word ^= word >> 17
    word ^= word << 5 & frame.U32
    state[RANDOM] = state[SESSION] = word
    for word in (SENT, TAKEN, GREETED, ASKED, AWAITED, WORST, NUMBER, ANSWERED, DUE_AT):
        state[word] = 0
    for word in (codec.READY, codec.DELAY, codec.DELAY_MEAN, codec.CLOCK_ERROR, codec.SKEW):
        state[word] = 0
    for i in range(REMEMBERED):
        state[SENT_FRAMES + i * EACH + KEY] = NOBODY
    clock_fit.restart(state[FIT : FIT + clock_fit.WORDS])
    state[SAID] = now
    return _send(state, frame.HELLO, 0, data)


@njit
def _send(state, kind, flags, data):
    """Makes a frame of the payload in data; returns its bytes."""
    state[SENT] = (state[SENT] + 1) & frame.U32
    return frame.seal(data, kind, flags, state[SESSION], state[SENT])


@njit
def _remember(state, host_deadline, device_deadline, written, number):
    """Keeps what the next frame is sent for, until it is answered or REMEMBERED frames later."""
    sequence = (state[SENT] + 1) & frame.U32
    at = SENT_FRAMES + (sequence & REMEMBERED - 1) * EACH
    state[at + KEY], state[at + HOST_DEADLINE], state[at + DEVICE_DEADLINE] = sequence, host_deadline, device_deadline
    state[at + WRITTEN], state[at + OWN_NUMBER] = written, number


@njit
def _look(state, now, data):
    """What is due by time: a hello, a question, or nothing."""
    if state[SESSION] == 0 or (state[GREETED] != 0 and now - state[HEARD] > SILENCE):
        return _begin(state, now, data)
    since = now - state[SAID] + SLACK
    if state[GREETED] == 0:
        if since < HELLO_AGAIN:
            return 0
        state[SAID] = now
        return _send(state, frame.HELLO, 0, data)
    if since < (ASK_FIRST if state[ASKED] < ASKS_FIRST else ASK_LATER):
        return 0
    state[SAID], state[ASKED] = now, state[ASKED] + 1
    _remember(state, 0, 0, now, 0)
    frame.put_i64(data, frame.HEADER, now)
    return _send(state, frame.CLOCK, 0, data)


@njit
def _target(state, command, data):
    """Where the hand of a simulated device goes; nothing if it is another, or the target is not a number."""
    reals = command.view(np.float64)
    if state[GREETED] == 0 or state[codec.SIMULATED] == 0:
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
    state[HELD_FOR] = command[3]


@njit
def _command(state, now, written, deadline, period, engaged, data):
    """A command of the motor values in data, if the device is ready for it."""
    if state[codec.READY] == 0:
        return 0
    if state[DUE_AT] != 0 and state[DUE_AT] <= now:
        state[NUMBER] += 1  # else this one takes the place of the one before, which then has no sample
    elif state[NUMBER] == 0:
        state[NUMBER] = 1
    announced = clock_fit.to_device(state[FIT : FIT + clock_fit.WORDS], deadline)
    state[DUE_AT] = state[AWAITED] = deadline
    state[AWAITED_UNTIL] = deadline + PERIODS_AWAITED * period
    _remember(state, deadline, announced, written, state[NUMBER])
    frame.put_i64(data, frame.HEADER, announced)
    frame.put_u32(data, frame.HEADER + 8, period)
    return _send(state, frame.COMMAND, ENGAGED if engaged != 0 else 0, data)


@njit
def _hear(state, data, count, now, answer):
    """Takes a frame in, if it is one that may come now; answer says what it was."""
    answer[codec.KIND] = codec.NOTHING
    kind = frame.kind_of(data, count)
    if kind == frame.WRONG or not _expected(state, data):
        state[codec.REFUSED] += 1
        return
    if state[GREETED] == 0 and kind != frame.GREETING:
        return  # the greeting is lost, and hello will be said again, or still on its way
    if not _content(state, kind, data, now, answer):
        state[codec.REFUSED] += 1
        return
    state[TAKEN], state[HEARD] = frame.get_u32(data, frame.SEQUENCE), now
    fit = state[FIT : FIT + clock_fit.WORDS]
    state[codec.READY] = 1 if state[GREETED] != 0 and clock_fit.known(fit) else 0


@njit
def _expected(state, data):
    """Whether session and sequence are those of a frame that may come now."""
    if state[SESSION] == 0 or frame.get_u32(data, frame.SESSION) != state[SESSION]:
        return False
    return frame.newer(frame.get_u32(data, frame.SEQUENCE), state[TAKEN])


@njit
def _content(state, kind, data, now, answer):
    """Takes the content of a frame; False if it is none that a device may send."""
    if kind == frame.GREETING:
        return _greeting(state, data, now)
    if kind == frame.SAMPLE:
        return _sample(state, data, now, answer)
    if kind == frame.CLOCK_ANSWER:
        return _clock_answer(state, data, now)
    return kind == frame.TRUTH and state[codec.SIMULATED] != 0 and _truth(state, data, answer)


@njit
def _greeting(state, data, now):
    """What the device says of itself."""
    at = frame.HEADER + 24
    firmware, axes = frame.get_u32(data, at), frame.get_u32(data, at + 4)
    least, watchdog = frame.get_u32(data, at + 32), frame.get_u32(data, at + 36)
    bits, features = frame.get_u32(data, at + 40), frame.get_u32(data, at + 44)
    for i in range(6):  # counts per unit, and largest motor values
        value = frame.get_f32(data, at + 8 + 4 * i)
        if not (np.isfinite(value) and value >= 0.0):
            return False
    if not 1 <= axes <= 3 or not 1 <= least <= LONGEST_PERIOD or watchdog == 0 or (bits != 16 and bits != 32):
        return False
    if state[GREETED] == 0:
        state[codec.SESSIONS] += 1
        state[SAID] = now - ASK_FIRST
    state[GREETED], state[BITS] = 1, bits
    state[codec.FIRMWARE], state[codec.AXES], state[codec.SIMULATED] = firmware, axes, features & 1
    state[codec.PERIOD_LEAST], state[codec.WATCHDOG] = least, watchdog
    return True


@njit
def _asked(state, answers):
    """Where the frame of this sequence is remembered; NOBODY if it is not, or was answered."""
    at = SENT_FRAMES + (answers & REMEMBERED - 1) * EACH
    return at if state[at + KEY] == answers else NOBODY


@njit
def _clock_answer(state, data, now):
    """Takes an answer into the fit of the clock."""
    at = _asked(state, frame.get_u32(data, frame.ANSWERS))
    asked, came = frame.get_i64(data, frame.HEADER), frame.get_i64(data, frame.HEADER + 8)
    went = frame.get_i64(data, frame.HEADER + 16)
    if at == NOBODY or state[at + HOST_DEADLINE] != 0 or state[at + WRITTEN] != asked:
        return False
    fit = state[FIT : FIT + clock_fit.WORDS]
    if clock_fit.answer(fit, asked, came, went, now) == clock_fit.REFUSED:
        return False
    state[at + KEY] = NOBODY
    state[codec.CLOCK_STEPS], state[codec.CLOCK_ERROR] = fit[clock_fit.STEPS], clock_fit.error(fit)
    state[codec.SKEW] = np.int64(round(clock_fit.skew(fit) * 1e9))
    _round_trip(state, now - asked - (went - came))
    return True


@njit
def _round_trip(state, time):
    """Puts a round trip among the last EXCHANGES, and tells their median."""
    rounds = state[ROUNDS : ROUNDS + EXCHANGES]
    for i in range(EXCHANGES - 1, 0, -1):
        rounds[i] = rounds[i - 1]
    rounds[0], there = max(1, time), 0  # 0: none yet
    while there < EXCHANGES and rounds[there] != 0:
        there += 1
    for i in range(there):
        less, more = 0, 0
        for j in range(there):
            less += rounds[j] < rounds[i]
            more += rounds[j] > rounds[i]
        if less <= there // 2 and more <= (there - 1) // 2:
            state[codec.ROUND_TRIP] = rounds[i]


@njit
def _sample(state, data, now, answer):
    """Takes a sample; it is told if it is newer than the one before."""
    deadline, sampled = frame.get_i64(data, frame.HEADER), frame.get_i64(data, frame.HEADER + 8)
    answers, late = frame.get_u32(data, frame.ANSWERS), sampled - deadline
    if not 0 <= late <= OLDEST or not _plain(state, data):
        return False
    fit = state[FIT : FIT + clock_fit.WORDS]
    if answers != 0:
        at = _asked(state, answers)
        if at == NOBODY or state[at + HOST_DEADLINE] == 0 or state[at + DEVICE_DEADLINE] != deadline:
            return False
        own, latched = state[at + HOST_DEADLINE], state[at + HOST_DEADLINE] + late
        if latched > now + AHEAD:
            return False
        latched = max(latched, state[LATCHED] + 1)
        _answered(state, at, frame.get_i64(data, frame.HEADER + 16))
    else:
        if not clock_fit.known(fit):
            return True
        own, latched = 0, clock_fit.to_host(fit, sampled)
        if not now - OLDEST <= latched <= now + AHEAD:
            return False
        latched = min(latched, now)
        if state[AWAITED] != 0 and now < state[AWAITED_UNTIL]:
            latched = min(latched, state[AWAITED] - 1)
        if latched <= state[LATCHED]:
            return True
    state[LATCHED] = latched
    _tell(state, data, answer)
    answer[codec.LATCHED], answer[codec.DEADLINE] = latched, own
    return True


@njit
def _plain(state, data):
    """Whether a sample's counts and forces are such as the device can have."""
    for i in range(3):
        count = frame.get_i32(data, frame.HEADER + 24 + 4 * i)
        if state[BITS] == 16 and not -(1 << 15) <= count < 1 << 15:
            return False
        if not np.isfinite(frame.get_f32(data, frame.HEADER + 40 + 4 * i)):
            return False
    return True


@njit
def _answered(state, at, applied):
    """Notes that a command has its sample: those before it have none, and how long it took to act."""
    written, number = state[at + WRITTEN], state[at + OWN_NUMBER]
    if state[AWAITED] == state[at + HOST_DEADLINE]:
        state[AWAITED] = 0
    if number > state[ANSWERED]:
        state[codec.LOST] += number - state[ANSWERED] - 1
        state[ANSWERED] = number
    state[at + KEY] = NOBODY
    delay = clock_fit.to_host(state[FIT : FIT + clock_fit.WORDS], applied) - written
    if applied != 0 and abs(delay) < OLDEST:
        state[WORST] = max(delay, state[WORST] - (state[WORST] - delay) // FADING, 0)
        state[codec.DELAY] = state[WORST] + state[codec.CLOCK_ERROR]
        state[codec.DELAY_MEAN] = codec.averaged(state[codec.DELAY_MEAN], delay)


@njit
def _tell(state, data, answer):
    """A sample's content, into the answer."""
    drag = answer.view(np.float64)
    answer[codec.KIND], answer[codec.STATUS] = codec.SAMPLE, frame.get_u16(data, frame.FLAGS) & STATUS_BITS
    for i in range(3):
        if i < state[codec.AXES]:
            count = frame.get_i32(data, frame.HEADER + 24 + 4 * i)
            state[COUNTS + i] = counter.unwrap(count, state[COUNTS + i], state[BITS])
        answer[codec.COUNTS + i] = state[COUNTS + i]
        drag[codec.DRAG + i] = frame.get_f32(data, frame.HEADER + 40 + 4 * i)
    state[codec.TEMPERATURE] = frame.get_i16(data, frame.HEADER + 36)


@njit
def _truth(state, data, answer):
    """What a simulated device tells of its hand; its time by the host's clock, so not before that is known."""
    fit, reals, first = state[FIT : FIT + clock_fit.WORDS], answer.view(np.float64), codec.TRUTH_FIRST
    for i in range(19):
        value = frame.get_f64(data, frame.HEADER + 8 + 8 * i)
        if not np.isfinite(value):
            return False
        reals[first + i if i < 18 else first + 19] = value
    if not clock_fit.known(fit):
        return True
    flags = frame.get_u16(data, frame.FLAGS)
    reals[first + 18] = clock_fit.to_host(fit, frame.get_i64(data, frame.HEADER)) * 1e-9
    reals[first + 20], reals[first + 21] = float(flags & MOTION_DONE), float((flags & DRIVEN) // DRIVEN)
    answer[codec.KIND] = codec.TRUTH
    return True
