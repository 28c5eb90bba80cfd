# SPDX-License-Identifier: Apache-2.0
"""moteus drives on an fdcanusb: `link: {type: moteus, port: …, ids: [1]}`, one drive for each axis.

The motor unit is N m at the output shaft. A count is 10⁻⁵ revolutions of it, 100000 a turn: positions are asked for as
int32, so that they are whole numbers.

Each request to a drive is the torque to be fed forward, in position mode without position and gains, and a query of
mode, position, temperature and fault. It is sent when the servo has written, and again at the deadline, where the
answers are the sample; zero torque, at the end, asks for no answer.

A drive that has not heard a command for the time `watchdog` goes into a mode that it leaves only when it is stopped, as
it leaves a fault. It is stopped by a command that is not engaged and wants no torque.
"""

import functools
from typing import Annotated

import numpy as np
from pydantic import Field

from haptic_device.jit import njit
from haptic_device.link import fdcanusb, request_timing
from haptic_device.link.codec import (
    ANSWER,
    AXES,
    COMMAND,
    COUNTS,
    CUT,
    DEADLINE,
    DUE,
    IDLE,
    KIND,
    LATCHED,
    LOST,
    NO_TEMPERATURE,
    OPENED,
    READY,
    REFUSED,
    SAMPLE,
    SESSIONS,
    STATUS,
    TEMPERATURE,
    WATCHDOG,
    Codec,
    decoder,
    encoder,
)
from haptic_device.link_registry import SerialOptions
from haptic_device.refusal import Unit

MOST_ID = 126  # 127 is all drives at once
REPLY = 0x8000  # of an address: an answer is wanted
INT8, INT16, INT32, FLOAT = range(4)  # as the protocol numbers what a value is
VALUE_BYTES = (1, 2, 4, 4)
WRITE, READ, TELL, ERROR = 0x00, 0x10, 0x20, 0x30  # subframes
MODE, POSITION, TEMPERATURE_READ, FAULT = 0x00, 0x01, 0x0E, 0x0F  # registers that are read
TARGET_FIRST, TARGET_COUNT, TIME_LIMIT = 0x20, 6, 0x27  # target, its rate, torque, two gains, most torque; watchdog
STOPPED, BROKEN_DOWN, BY_POSITION, TIMED_OUT = 0, 1, 10, 11  # modes
ENCODER_FAULT, HOT_FAULT, ANGLE_FAULT, PLACE_FAULT = 35, 38, 42, 43
NO_INT32, NO_INT8 = -(2**31), -128  # what is not known
CUT_OFF, HOT, BROKEN, CLAMPED = 2, 8, 32, 128  # bits of status

ANSWERED_WITHIN = 20_000_000  # [ns]; also how long the line has to be quiet before drives are asked anew
UNASKED = 20_000_000  # [ns] without a command after which the drives are watched all the same
MOST_LINE = 256  # bytes

# words of the state, three for what each axis has
FIRST = request_timing.END
(
    IS_OPEN,
    WAIT,  # [ns] time before which drives are not asked
    ASKED_FOR,
    ANSWERED,  # bit of each axis whose answer has come
    REQUEST_DEADLINE,
    LAST_COMMAND,
    IS_CLAMPED,
    IS_CALM,  # 1: the last command is not engaged and wants no torque
    IS_NEW,  # 1: the line was opened, and drives have not all answered
    SKIPPING,  # 1: in a line that is too long
    TIME_BITS,  # watchdog [s], float64 bits
    BYTES,  # scratch: one float32
) = range(FIRST, FIRST + 12)
IDS, TORQUES, LIMITS, MODES, FAULTS, TEMPERATURES, PLACES = range(FIRST + 12, FIRST + 33, 3)
DATA = FIRST + 33  # scratch: the 64 bytes of a CAN FD frame
STATE = DATA + 8

NOTHING_ASKED, FOR_EFFECT, FOR_SAMPLE, FOR_LOOK = range(4)


class Options(SerialOptions):
    """ids of the drives of x, y, theta on the bus; watchdog: time without commands after which a drive gives up [s]."""

    ids: Annotated[tuple[Annotated[int, Field(ge=1, le=MOST_ID, strict=True)], ...], Field(min_length=1, max_length=3)]
    watchdog: Annotated[float, Field(ge=0.02, le=1.0, allow_inf_nan=False, strict=True), Unit("s")] = 0.1


def codec(options, device) -> Codec:
    """The codec for this device description. Raises ValueError unless each axis has a drive of its own."""
    axes = len(device.axes)
    if len(options.ids) != axes:
        raise ValueError(f"ids are {len(options.ids)}; the device has {axes} axes, each with a drive of its own")
    if len(set(options.ids)) != axes:
        raise ValueError(f"ids are {', '.join(map(str, options.ids))}; each drive has its own id")
    state = np.zeros(STATE, np.int64)
    reals = state.view(np.float64)
    state[TEMPERATURE], state[AXES], state[WATCHDOG] = NO_TEMPERATURE, axes, round(options.watchdog * 1e9)
    state[IDS : IDS + axes], reals[TIME_BITS] = options.ids, options.watchdog
    reals[LIMITS : LIMITS + axes] = [axis.motor_limit / axis.motor_constant for axis in device.axes]
    return Codec(state, *compiled(), asks=True)


@njit
def _put_float(state, at, value):
    state[BYTES : BYTES + 1].view(np.float32)[0] = value
    data = state[DATA : DATA + 8].view(np.uint8)
    data[at : at + 4] = state[BYTES : BYTES + 1].view(np.uint8)[:4]
    return at + 4


@njit
def _put_torque(state, axis):
    """Position mode without a position and without gains, and the torque held; returns the number of bytes."""
    data, reals = state[DATA : DATA + 8].view(np.uint8), state.view(np.float64)
    data[0], data[1], data[2] = WRITE | INT8 << 2 | 1, MODE, BY_POSITION
    data[3], data[4], data[5] = WRITE | FLOAT << 2, TARGET_COUNT, TARGET_FIRST
    at = _put_float(state, 6, np.nan)
    at = _put_float(state, at, 0.0)
    at = _put_float(state, at, reals[TORQUES + axis])
    at = _put_float(state, at, 0.0)
    at = _put_float(state, at, 0.0)
    at = _put_float(state, at, reals[LIMITS + axis])
    data[at], data[at + 1] = WRITE | FLOAT << 2 | 1, TIME_LIMIT
    return _put_float(state, at + 2, reals[TIME_BITS])


@njit
def _put_stop(state):
    data = state[DATA : DATA + 8].view(np.uint8)
    data[0], data[1], data[2] = WRITE | INT8 << 2 | 1, MODE, STOPPED
    return 3


@njit
def _put_query(state, at):
    data = state[DATA : DATA + 8].view(np.uint8)
    data[at], data[at + 1] = READ | INT8 << 2 | 1, MODE
    data[at + 2], data[at + 3] = READ | INT32 << 2 | 1, POSITION
    data[at + 4], data[at + 5] = READ | INT8 << 2 | 2, TEMPERATURE_READ  # and what follows, the fault
    return at + 6


@njit
def _ask(state, now, wanted, outgoing, at):
    """A request to each drive; with FOR_LOOK it is left as it is."""
    data = state[DATA : DATA + 8].view(np.uint8)
    for axis in range(state[AXES]):
        given_up = state[MODES + axis] == BROKEN_DOWN or state[MODES + axis] == TIMED_OUT
        length = 0
        if wanted != FOR_LOOK:
            length = _put_stop(state) if given_up and state[IS_CALM] else _put_torque(state, axis)
        length = _put_query(state, length)
        at = fdcanusb.put_line(REPLY | state[IDS + axis], data, length, outgoing, at)
    state[ASKED_FOR], state[ANSWERED] = wanted, 0
    if wanted == FOR_LOOK:
        state[request_timing.SENT], state[request_timing.CARRIED] = now, 0
    else:
        request_timing.asked(state, now)
    return at


@njit
def _zero(state):
    state[TORQUES] = state[TORQUES + 1] = state[TORQUES + 2] = 0
    state[request_timing.UNSENT] = state[IS_CLAMPED] = 0


@njit
def _cut(state, outgoing):
    """Zero torque for all drives, which are to say nothing."""
    _zero(state)
    data, at = state[DATA : DATA + 8].view(np.uint8), 0
    for axis in range(state[AXES] * state[IS_OPEN]):
        at = fdcanusb.put_line(state[IDS + axis], data, _put_torque(state, axis), outgoing, at)
    return at


@njit
def _hold(state, command):
    """Takes the torques of a command, within limits; zero for all if one of them is no number."""
    reals, wanted = state.view(np.float64), command.view(np.float64)
    _zero(state)
    request_timing.held(state, command[1])
    state[IS_CALM] = command[4] == 0
    for axis in range(state[AXES]):
        limit = reals[LIMITS + axis]
        if not np.isfinite(wanted[5 + axis]):
            _zero(state)
            request_timing.held(state, command[1])
            state[REFUSED] += 1
            state[IS_CALM] = 0
            return
        reals[TORQUES + axis] = min(limit, max(-limit, wanted[5 + axis]))
        state[IS_CLAMPED] |= abs(wanted[5 + axis]) > limit
        state[IS_CALM] &= wanted[5 + axis] == 0.0


@njit
def _open(state, now, outgoing):
    """Ends what a former user may have left of a line, and asks who is there."""
    _zero(state)
    state[READY] = state[WAIT] = state[SKIPPING] = state[IS_CALM] = 0
    state[IS_OPEN] = state[IS_NEW] = 1
    state[LAST_COMMAND] = now
    state[MODES : MODES + 3] = STOPPED
    outgoing[0] = fdcanusb.NEWLINE
    return _ask(state, now, FOR_LOOK, outgoing, 1)


@njit
def _give_up_waiting(state, now, outgoing):
    """An answer has not come; which request the next one belongs to cannot be told before all is quiet."""
    wanted = state[ASKED_FOR]
    state[LOST] += wanted == FOR_SAMPLE
    state[READY], state[ASKED_FOR], state[WAIT] = 0, NOTHING_ASKED, now + ANSWERED_WITHIN
    return 0 if wanted == FOR_LOOK else _cut(state, outgoing)


def _encode(state, event, now, command, outgoing):
    if event == OPENED:
        return _open(state, now, outgoing)
    if event == CUT:
        return _cut(state, outgoing)
    if not state[IS_OPEN]:
        return 0
    if event == COMMAND:
        state[LAST_COMMAND] = now
        _hold(state, command)
    waits = state[ASKED_FOR] != NOTHING_ASKED
    if waits or now < state[WAIT]:
        state[LOST] += event == DUE
        late = waits and now - state[request_timing.SENT] > ANSWERED_WITHIN
        return _give_up_waiting(state, now, outgoing) if late else 0
    if event == DUE:
        state[REQUEST_DEADLINE] = command[2]
        return _ask(state, now, FOR_SAMPLE, outgoing, 0)
    if event == COMMAND or (event == IDLE and state[request_timing.UNSENT]):
        return _ask(state, now, FOR_EFFECT, outgoing, 0)
    if event == IDLE and now - state[LAST_COMMAND] > UNASKED:
        return _ask(state, now, FOR_LOOK, outgoing, 0)
    return 0


@njit
def _number(data, at, size):
    """Little-endian whole number with a sign."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[at + i]) << 8 * i
    return value - (value >> 8 * size - 1 << 8 * size)


@njit
def _note_values(state, axis, length):
    """What the frame in the scratch says of an axis; False unless it is mode and position, as asked for."""
    data = state[DATA : DATA + 8].view(np.uint8)
    at, said, place = 0, 0, np.int64(0)
    mode = fault = np.int64(0)
    temperature = np.int64(NO_INT8)
    while at < length:
        head = np.int64(data[at])
        if head == fdcanusb.PADDING:
            at += 1
            continue
        kind, count, size = head >> 2 & 3, head & 3, VALUE_BYTES[head >> 2 & 3]
        at += 1
        if head & 0xF0 != TELL or (count == 0 and at >= length):
            return False
        if count == 0:
            count = np.int64(data[at])
            at += 1
        if at + 1 + count * size > length:
            return False
        first = np.int64(data[at])
        at += 1
        for register in range(first, first + count):
            value = _number(data, at, size)
            at += size
            if register == MODE and kind == INT8:
                mode, said = value, said | 1
            elif register == POSITION and kind == INT32 and value != NO_INT32:
                place, said = value, said | 2
            elif register == TEMPERATURE_READ and kind == INT8:
                temperature = value
            elif register == FAULT and kind == INT8:
                fault = value
    if said != 3:
        return False
    state[MODES + axis], state[PLACES + axis], state[FAULTS + axis] = mode, place, fault
    state[TEMPERATURES + axis] = temperature
    return True


@njit
def _axis_of(state, address):
    """The axis whose drive sends from this address to us; −1 if none."""
    for axis in range(state[AXES]):
        if address == state[IDS + axis] << 8:
            return axis
    return -1


@njit
def _hear(state, incoming, end):
    """A line that says `rcv`: True if it is an answer that is awaited."""
    first = fdcanusb.word_end(incoming, 4, end)
    second = fdcanusb.word_end(incoming, first + 1, end)
    axis = _axis_of(state, fdcanusb.address(incoming, 4, first))
    if axis < 0 or state[ASKED_FOR] == NOTHING_ASKED or state[ANSWERED] >> axis & 1:
        return False
    length = fdcanusb.unpack(incoming, first + 1, second, state[DATA : DATA + 8].view(np.uint8))
    if length < 0 or not _note_values(state, axis, length):
        return False
    state[ANSWERED] |= 1 << axis
    return True


def _decode(state, incoming, count, now, answer):
    answer[:ANSWER] = 0
    if now < state[WAIT]:
        state[WAIT] = now + ANSWERED_WITHIN
    end = fdcanusb.line_end(incoming, count)
    if end < 0 and count <= MOST_LINE:
        return 0
    if end < 0 or end > MOST_LINE or state[SKIPPING]:
        state[REFUSED] += not state[SKIPPING]
        state[SKIPPING] = end < 0
        return count if end < 0 else end + 1
    if fdcanusb.begins(incoming, end, b"rcv "):
        if not _hear(state, incoming, end):
            state[REFUSED] += 1
        elif state[ANSWERED] == (1 << state[AXES]) - 1:
            _take(state, now, answer)
    elif end > 0 and not (end == 2 and fdcanusb.begins(incoming, end, b"OK")):
        state[REFUSED] += 1
    return end + 1


@njit
def _take(state, now, answer):
    """All drives have answered."""
    wanted, deadline = state[ASKED_FOR], state[REQUEST_DEADLINE]
    state[ASKED_FOR] = NOTHING_ASKED
    state[SESSIONS] += state[IS_NEW]
    state[IS_NEW], state[READY] = 0, 1
    request_timing.answered(state, now)
    _warm(state)
    if wanted == FOR_EFFECT:
        return
    deadline = deadline if wanted == FOR_SAMPLE else 0
    answer[KIND], answer[LATCHED] = SAMPLE, request_timing.latched(state, deadline, now)
    answer[DEADLINE], answer[STATUS] = deadline, _status(state)
    for axis in range(state[AXES]):
        answer[COUNTS + axis] = state[PLACES + axis]


@njit
def _warm(state):
    state[TEMPERATURE] = NO_TEMPERATURE
    for axis in range(state[AXES]):
        if state[TEMPERATURES + axis] != NO_INT8:
            state[TEMPERATURE] = max(state[TEMPERATURE], 10 * state[TEMPERATURES + axis])


@njit
def _status(state):
    status = CLAMPED * state[IS_CLAMPED]
    for axis in range(state[AXES]):
        fault = state[FAULTS + axis]
        if state[MODES + axis] == TIMED_OUT:
            status |= CUT_OFF
        elif state[MODES + axis] == BROKEN_DOWN:
            if fault == HOT_FAULT:
                status |= HOT
            elif fault in (ENCODER_FAULT, ANGLE_FAULT, PLACE_FAULT):
                status |= BROKEN
            else:
                status |= CUT_OFF
    return status


@functools.cache
def compiled():
    """encode and decode; compiled where there is such a link."""
    return encoder(_encode), decoder(_decode)
