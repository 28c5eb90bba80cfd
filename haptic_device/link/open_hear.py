# SPDX-License-Identifier: Apache-2.0
"""What the host hears on an open link (docs/reference/link_protocol.md): frames taken or refused, and what they tell.

The link is ready when answers make a fit of the device's clock. A sample counts for a deadline only by what it echoes,
and one that would be later than it came is refused. One that nobody asked for is placed by the fitted clock. It is
dropped if it would be after now, or not before the newest deadline that is announced, until that is answered or two
periods past. So is every one that is not newer than the sample before.

A sample that was latched before the one before it, or after now by more than the clock's error, proves that the clock
has been set. That is told at once: the answers to questions would tell it when the servo has given up.

The delay is the worst time from a write to its effect, which fades towards the present by a thousandth with each
command, and the clock's average error.
"""

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import clock_fit, codec, counter, frame
from haptic_device.link import open_state as s

OLDEST = 1_000_000_000  # [ns] that an answer's times may be away
MOST_DRAG = 1000.0  # [N, N m] that a damper can feel
FADING = 1000  # commands
STATUS_BITS = 2 | 4 | 8 | 16 | 32 | 128
MOTION_DONE, DRIVEN = 1, 2  # flags of a truth


@njit
def hear(state, data, count, now, answer):
    """Takes a frame in, if it is one that may come now; answer says what it was."""
    answer[codec.KIND], answer[codec.STATUS] = codec.NOTHING, 0
    kind = frame.kind_of(data, count)
    if kind == frame.WRONG or not _expected(state, data):
        state[codec.REFUSED] += 1
        return
    if state[s.GREETED] == 0 and kind != frame.GREETING:
        return  # the greeting is lost, and hello will be said again, or still on its way
    if not _content(state, kind, data, now, answer):
        state[codec.REFUSED] += 1
        return
    state[s.TAKEN], state[s.HEARD] = frame.get_u32(data, frame.SEQUENCE), now
    fit = s.fit_of(state)
    state[codec.READY] = 1 if state[s.GREETED] != 0 and clock_fit.known(fit) else 0


@njit
def _expected(state, data):
    """Whether session and sequence are those of a frame that may come now."""
    if state[s.SESSION] == 0 or frame.get_u32(data, frame.SESSION) != state[s.SESSION]:
        return False
    return frame.newer(frame.get_u32(data, frame.SEQUENCE), state[s.TAKEN])


@njit
def _content(state, kind, data, now, answer):
    """Takes the content of a frame; False if it is none that a device may send."""
    if kind == frame.GREETING:
        return _greeting(state, data, now)
    if kind == frame.SAMPLE:
        return _sample(state, data, now, answer)
    if kind == frame.CLOCK_ANSWER:
        return _clock_answer(state, data, now, answer)
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
    if not 1 <= axes <= 3 or not 1 <= least <= s.LONGEST_PERIOD or watchdog == 0 or (bits != 16 and bits != 32):
        return False
    for i in range(6):
        state.view(np.float64)[codec.TOLD + i] = frame.get_f32(data, at + 8 + 4 * i)
    if state[s.GREETED] == 0:
        state[codec.SESSIONS] += 1
        state[s.SAID] = now - s.ASK_FIRST
    state[s.GREETED], state[s.BITS] = 1, bits
    state[codec.FIRMWARE], state[codec.AXES], state[codec.SIMULATED] = firmware, axes, features & 1
    state[codec.PERIOD_LEAST], state[codec.WATCHDOG] = least, watchdog
    return True


@njit
def _clock_answer(state, data, now, answer):
    """Takes an answer into the fit of the clock, and tells where that is in trouble."""
    at = s.asked(state, frame.get_u32(data, frame.ANSWERS))
    asked, came = frame.get_i64(data, frame.HEADER), frame.get_i64(data, frame.HEADER + 8)
    went = frame.get_i64(data, frame.HEADER + 16)
    if at == s.NOBODY or state[at + s.HOST_DEADLINE] != 0 or state[at + s.WRITTEN] != asked:
        return False
    fit = s.fit_of(state)
    taken = clock_fit.answer(fit, asked, came, went, now)
    if taken == clock_fit.REFUSED:
        return False
    state[at + s.KEY], state[s.UNSURE] = s.NOBODY, taken == clock_fit.LEFT_OUT
    if fit[clock_fit.STEPS] != state[codec.CLOCK_STEPS]:
        state[codec.CLOCK_STEPPED], state[codec.CLOCK_STEPPED_AT] = fit[clock_fit.STEPPED], now
    state[codec.CLOCK_STEPS], state[codec.CLOCK_ERROR] = fit[clock_fit.STEPS], clock_fit.error(fit, now)
    state[codec.CLOCK_TROUBLE], average = clock_fit.trouble(fit), fit.view(np.float64)[clock_fit.MEAN]
    state[codec.CLOCK_AVERAGE] = np.int64(average)
    answer[codec.STATUS] = codec.CLOCK if state[codec.CLOCK_TROUBLE] != 0 else 0
    state[codec.SKEW] = np.int64(round(clock_fit.skew(fit) * 1e9))
    _round_trip(state, now - asked - (went - came))
    return True


@njit
def _round_trip(state, time):
    """Puts a round trip among the last s.ROUND_TRIPS, and tells their median."""
    rounds = state[s.ROUNDS : s.ROUNDS + s.ROUND_TRIPS]
    for i in range(s.ROUND_TRIPS - 1, 0, -1):
        rounds[i] = rounds[i - 1]
    rounds[0], there = max(1, time), 0  # 0: none yet
    while there < s.ROUND_TRIPS and rounds[there] != 0:
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
    step = _clock_was_set(state, sampled, now)
    if step != 0:
        answer[codec.STATUS] = codec.CLOCK
        if now - state[codec.CLOCK_STEPPED_AT] > OLDEST:  # else the answers may have told it better
            state[codec.CLOCK_STEPPED], state[codec.CLOCK_STEPPED_AT] = step, now
    if answers != 0:
        at = s.asked(state, answers)
        if at == s.NOBODY or state[at + s.HOST_DEADLINE] == 0 or state[at + s.DEVICE_DEADLINE] != deadline:
            return False
        own, latched = state[at + s.HOST_DEADLINE], state[at + s.HOST_DEADLINE] + late
        if latched > now:
            return False
        _answered(state, at, frame.get_i64(data, frame.HEADER + 16))
    else:
        if state[codec.READY] == 0:
            return True
        own, latched = 0, clock_fit.to_host(s.fit_of(state), sampled)
        if not now - OLDEST <= latched <= now + state[codec.CLOCK_ERROR]:
            return False
        awaited = state[s.AWAITED] != 0 and now < state[s.AWAITED_UNTIL]
        if latched > now or (awaited and latched >= state[s.AWAITED]):
            answer[codec.STATUS] |= frame.get_u16(data, frame.FLAGS) & STATUS_BITS  # what it says of the device counts
            return True
    state[s.SAMPLED] = sampled
    if latched <= state[s.LATCHED]:
        return True
    state[s.LATCHED] = latched
    _tell(state, data, answer)
    answer[codec.LATCHED], answer[codec.DEADLINE] = latched, own
    fit = s.fit_of(state)  # which may have moved since the deadline was announced
    answer[codec.STAMP_ERROR] = clock_fit.steady_error(fit, now) + abs(clock_fit.to_host(fit, sampled) - latched)
    return True


@njit
def _clock_was_set(state, sampled, now):
    """By how much the clock was set [ns], where a sample of this time of the device cannot come now; else 0."""
    if state[codec.READY] == 0:
        return 0
    fit = s.fit_of(state)
    ahead = clock_fit.to_host(fit, sampled) - now
    felt = ahead > clock_fit.error(fit, now) + np.int64(clock_fit.STEP_FELT)
    return ahead if felt or sampled < state[s.SAMPLED] else 0


@njit
def _plain(state, data):
    """Whether a sample's counts and forces are such as the device can have."""
    for i in range(3):
        count = frame.get_i32(data, frame.HEADER + 24 + 4 * i)
        if state[s.BITS] == 16 and not -(1 << 15) <= count < 1 << 15:
            return False
        if not abs(frame.get_f32(data, frame.HEADER + 40 + 4 * i)) <= MOST_DRAG:
            return False
    return True


@njit
def _answered(state, at, applied):
    """Notes that a command has its sample: those before it have none, and how long it took to act."""
    written, number = state[at + s.WRITTEN], state[at + s.OWN_NUMBER]
    if state[s.AWAITED] == state[at + s.HOST_DEADLINE]:
        state[s.AWAITED] = 0
    if number > state[s.ANSWERED]:
        state[codec.LOST] += number - state[s.ANSWERED] - 1
        state[s.ANSWERED] = number
    state[at + s.KEY] = s.NOBODY
    delay = clock_fit.to_host(s.fit_of(state), applied) - written
    if applied != 0 and -OLDEST < delay < OLDEST:
        state[s.WORST] = max(delay, state[s.WORST] - (state[s.WORST] - delay) // FADING, 0)
        state[codec.DELAY] = state[s.WORST] + state[codec.CLOCK_AVERAGE]
        state[codec.DELAY_MEAN] = codec.averaged(state[codec.DELAY_MEAN], delay)


@njit
def _tell(state, data, answer):
    """A sample's content, into the answer."""
    drag = answer.view(np.float64)
    answer[codec.KIND] = codec.SAMPLE
    answer[codec.STATUS] |= frame.get_u16(data, frame.FLAGS) & STATUS_BITS
    for i in range(3):
        if i < state[codec.AXES]:
            count = frame.get_i32(data, frame.HEADER + 24 + 4 * i)
            state[s.COUNTS + i] = counter.unwrap(count, state[s.COUNTS + i], state[s.BITS])
        answer[codec.COUNTS + i] = state[s.COUNTS + i]
        drag[codec.DRAG + i] = frame.get_f32(data, frame.HEADER + 40 + 4 * i)
    state[codec.TEMPERATURE] = frame.get_i16(data, frame.HEADER + 36)


@njit
def _truth(state, data, answer):
    """What a simulated device tells of its hand; its time by the host's clock, so not before that is known."""
    fit, reals, first = s.fit_of(state), answer.view(np.float64), codec.TRUTH_FIRST
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
