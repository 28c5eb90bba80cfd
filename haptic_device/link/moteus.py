# SPDX-License-Identifier: Apache-2.0
"""moteus drives on an fdcanusb: `link: {type: moteus, port: …, ids: [1]}`, one drive for each axis, or joint.

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

from haptic_device.config.drives import drives
from haptic_device.config.link_registry import SerialOptions
from haptic_device.config.refusal import Unit
from haptic_device.jit import njit
from haptic_device.link import codec as c
from haptic_device.link import fdcanusb, moteus_frame, request_timing

MOST_ID = 126  # 127 is all drives at once
REPLY = 0x8000  # of an address: an answer is wanted
ENCODER_FAULT, HOT_FAULT, ANGLE_FAULT, PLACE_FAULT = 35, 38, 42, 43
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
    TIME_LIMIT,  # [s], float64 bits
) = range(FIRST, FIRST + 11)
IDS, TORQUES, LIMITS, MODES, FAULTS, TEMPERATURES, PLACES = range(FIRST + 11, FIRST + 32, 3)
DATA = FIRST + 32  # scratch: the 64 bytes of a CAN FD frame
STATE = DATA + 8

NOTHING_ASKED, FOR_EFFECT, FOR_SAMPLE, FOR_LOOK = range(4)


class Options(SerialOptions):
    """ids of the drives of x, y (or joints), theta; watchdog: time without commands until a drive gives up [s]."""

    ids: Annotated[tuple[Annotated[int, Field(ge=1, le=MOST_ID, strict=True)], ...], Field(min_length=1, max_length=3)]
    watchdog: Annotated[float, Field(ge=0.02, le=1.0, allow_inf_nan=False, strict=True), Unit("s")] = 0.1


def codec(options, device) -> c.Codec:
    """The codec for this device description. Raises ValueError unless each axis has a drive of its own."""
    axes = len(device.axes)
    if len(options.ids) != axes:
        raise ValueError(f"ids are {len(options.ids)}; the device has {axes} axes, each with a drive of its own")
    if len(set(options.ids)) != axes:
        raise ValueError(f"ids are {', '.join(map(str, options.ids))}; each drive has its own id")
    state = np.zeros(STATE, np.int64)
    reals = state.view(np.float64)
    state[c.TEMPERATURE], state[c.AXES], state[c.WATCHDOG] = c.NO_TEMPERATURE, axes, round(options.watchdog * 1e9)
    state[IDS : IDS + axes], reals[TIME_LIMIT] = options.ids, options.watchdog
    reals[LIMITS : LIMITS + axes] = [drive.most for drive in drives(device)]
    return c.Codec(state, *compiled(), asks=True)


@njit
def _put_torque(state, axis):
    """The torque held; returns the number of bytes."""
    data, reals = state[DATA : DATA + 8].view(np.uint8), state.view(np.float64)
    return moteus_frame.put_torque(data, reals[TORQUES + axis], reals[LIMITS + axis], reals[TIME_LIMIT])


@njit
def _ask(state, now, wanted, outgoing, at):
    """A request to each drive; with FOR_LOOK it is left as it is."""
    data = state[DATA : DATA + 8].view(np.uint8)
    for axis in range(state[c.AXES]):
        given_up = state[MODES + axis] == moteus_frame.BROKEN_DOWN or state[MODES + axis] == moteus_frame.TIMED_OUT
        length = 0
        if wanted != FOR_LOOK:
            length = moteus_frame.put_stop(data) if given_up and state[IS_CALM] else _put_torque(state, axis)
        length = moteus_frame.put_query(data, length)
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
    for axis in range(state[c.AXES] * state[IS_OPEN]):
        at = fdcanusb.put_line(state[IDS + axis], data, _put_torque(state, axis), outgoing, at)
    return at


@njit
def _hold(state, command):
    """Takes the torques of a command, within limits; zero for all if one of them is no number."""
    reals, wanted = state.view(np.float64), command.view(np.float64)
    _zero(state)
    request_timing.held(state, command[1])
    state[IS_CALM] = command[4] == 0
    for axis in range(state[c.AXES]):
        limit = reals[LIMITS + axis]
        if not np.isfinite(wanted[5 + axis]):
            _zero(state)
            request_timing.held(state, command[1])
            state[c.REFUSED] += 1
            state[IS_CALM] = 0
            return
        reals[TORQUES + axis] = min(limit, max(-limit, wanted[5 + axis]))
        state[IS_CLAMPED] |= abs(wanted[5 + axis]) > limit
        state[IS_CALM] &= wanted[5 + axis] == 0.0


@njit
def _open(state, now, outgoing):
    """Ends what a former user may have left of a line, and asks who is there."""
    _zero(state)
    state[c.READY] = state[WAIT] = state[SKIPPING] = state[IS_CALM] = 0
    state[IS_OPEN] = state[IS_NEW] = 1
    state[LAST_COMMAND] = now
    state[MODES : MODES + 3] = moteus_frame.STOPPED
    outgoing[0] = fdcanusb.NEWLINE
    return _ask(state, now, FOR_LOOK, outgoing, 1)


@njit
def _give_up_waiting(state, now, outgoing):
    """An answer has not come; which request the next one belongs to cannot be told before all is quiet."""
    wanted = state[ASKED_FOR]
    state[c.LOST] += wanted == FOR_SAMPLE
    state[c.READY], state[ASKED_FOR], state[WAIT] = 0, NOTHING_ASKED, now + ANSWERED_WITHIN
    return 0 if wanted == FOR_LOOK else _cut(state, outgoing)


def _encode(state, event, now, command, outgoing):
    if event == c.OPENED:
        return _open(state, now, outgoing)
    if event == c.CUT:
        return _cut(state, outgoing)
    if not state[IS_OPEN]:
        return 0
    if event == c.COMMAND:
        state[LAST_COMMAND] = now
        _hold(state, command)
    waits = state[ASKED_FOR] != NOTHING_ASKED
    if waits or now < state[WAIT]:
        late = waits and now - state[request_timing.SENT] > ANSWERED_WITHIN
        return _give_up_waiting(state, now, outgoing) if late else 0
    if event == c.DUE:
        state[REQUEST_DEADLINE] = command[2]
        return _ask(state, now, FOR_SAMPLE, outgoing, 0)
    if event == c.COMMAND or (event == c.IDLE and state[request_timing.UNSENT]):
        return _ask(state, now, FOR_EFFECT, outgoing, 0)
    if event == c.IDLE and now - state[LAST_COMMAND] > UNASKED:
        return _ask(state, now, FOR_LOOK, outgoing, 0)
    return 0


@njit
def _axis_of(state, address):
    """The axis whose drive sends from this address to us; −1 if none."""
    for axis in range(state[c.AXES]):
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
    data = state[DATA : DATA + 8].view(np.uint8)
    length = fdcanusb.unpack(incoming, first + 1, second, data)
    whole, mode, place, temperature, fault = moteus_frame.answer(data, length)
    if not whole:
        return False
    state[MODES + axis], state[PLACES + axis], state[FAULTS + axis] = mode, place, fault
    state[TEMPERATURES + axis] = temperature
    state[ANSWERED] |= 1 << axis
    return True


def _decode(state, incoming, count, now, answer):
    answer[: c.ANSWER] = 0
    if now < state[WAIT]:
        state[WAIT] = now + ANSWERED_WITHIN
    end = fdcanusb.line_end(incoming, count)
    if end < 0 and count <= MOST_LINE:
        return 0
    if end < 0 or end > MOST_LINE or state[SKIPPING]:
        state[c.REFUSED] += not state[SKIPPING]
        state[SKIPPING] = end < 0
        return count if end < 0 else end + 1
    if fdcanusb.begins(incoming, end, b"rcv "):
        if not _hear(state, incoming, end):
            state[c.REFUSED] += 1
        elif state[ANSWERED] == (1 << state[c.AXES]) - 1:
            _take(state, now, answer)
    elif end > 0 and not (end == 2 and fdcanusb.begins(incoming, end, b"OK")):
        state[c.REFUSED] += 1
    return end + 1


@njit
def _take(state, now, answer):
    """All drives have answered."""
    wanted, deadline = state[ASKED_FOR], state[REQUEST_DEADLINE]
    state[ASKED_FOR] = NOTHING_ASKED
    state[c.SESSIONS] += state[IS_NEW]
    state[IS_NEW], state[c.READY] = 0, 1
    request_timing.answered(state, now)
    _warm(state)
    if wanted == FOR_EFFECT:
        return
    deadline = deadline if wanted == FOR_SAMPLE else 0
    answer[c.KIND] = c.SAMPLE
    request_timing.latched(state, deadline, now, answer)
    answer[c.DEADLINE], answer[c.STATUS] = deadline, _status(state)
    for axis in range(state[c.AXES]):
        answer[c.COUNTS + axis] = state[PLACES + axis]


@njit
def _warm(state):
    state[c.TEMPERATURE] = c.NO_TEMPERATURE
    for axis in range(state[c.AXES]):
        if state[TEMPERATURES + axis] != moteus_frame.NO_INT8:
            state[c.TEMPERATURE] = max(state[c.TEMPERATURE], 10 * state[TEMPERATURES + axis])


@njit
def _status(state):
    status = CLAMPED * state[IS_CLAMPED]
    for axis in range(state[c.AXES]):
        fault = state[FAULTS + axis]
        if state[MODES + axis] == moteus_frame.TIMED_OUT:
            status |= CUT_OFF
        elif state[MODES + axis] == moteus_frame.BROKEN_DOWN:
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
    return c.encoder(_encode), c.decoder(_decode)
