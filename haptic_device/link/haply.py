# SPDX-License-Identifier: Apache-2.0
"""A Haply 2DIY of generation 2 or 3 on USB: `link: {type: haply, port: …}`.

The description's `joints` are its motors 1 and 2. The motor unit is N m, a count is one of the board's encoder counts,
as `count = degrees · resolution / 360` of the angle that the board tells (4880 a turn on generation 3, 10752 on 2).

The board only answers: each request carries both torques, each answer both angles. There is no framing, no check and no
clock. So the motor value is sent when the servo has written it, and again at the deadline, where the answer is the
sample. The board sets its angles when it is set up, which is each time the line is opened: the arms must lie in their
rest pose then.

It holds the last torque for ever, and waits up to a second for the rest of a frame, with the motors on. So frames are
written whole, and none before the last one is answered; only CUT is. Where an answer fails to come or makes no sense,
zero torque is sent at once, which harms no frame that it might complete: all its bytes make floats of nearly nothing.
Then the line has to be quiet before the board is asked anew, with zero. If that is not answered either it may be out of
step: after a silence that is longer than it waits for a frame it is reset and set up anew, with the angles that were
known last in place of the rest pose. How far the arms have moved meanwhile nobody knows: bit 5 of the status says so,
with the motors at zero, until a command comes that is not engaged and wants none.
"""

import functools
from typing import Literal

import numpy as np

from haptic_device.config.link_registry import SerialOptions
from haptic_device.jit import njit
from haptic_device.link import codec as c
from haptic_device.link import request_timing

DEVICE = 5  # the board's number for a 2DIY
RESET, SET_UP, WRITE = 0, 1, 2  # first bytes of frames
FRAME, REPLY = 10, 9  # bytes of a request and of its answer
TORQUE_LIMIT = 0.123  # [N m] that the motors stand
MOST_DEGREES = 1e5  # no arm turns so far
BROKEN, CLAMPED = 32, 128  # bits of status

SETTLE = 20_000_000  # [ns] that a reset and a setup take, amply
ANSWERED_WITHIN = 20_000_000  # [ns]; also how long the line has to be quiet before the board is asked anew
BOARD_GIVES_UP = 1_100_000_000  # [ns] after which it waits no longer for the rest of a frame
UNASKED = 20_000_000  # [ns] without a command after which the joints are watched all the same
MOST_OWED = 8  # requests ahead of their answers, at the end

SERVES = {  # generation: encoder counts a turn, rest pose [deg] and direction (1: counter-clockwise) of joints 1, 2
    2: (10752, (241.0, -61.0), (1, 0)),
    3: (4880, (168.0, 12.0), (1, 1)),
}

SETUP_BYTES = 26
OFFSETS = (10, 18)  # of the setup's bytes: where the angles stand, by port
FIRST = request_timing.END
(
    PHASE,
    WAIT,  # [ns] time before which nothing more is sent
    QUIET,  # [ns] how long the line has to be quiet
    OWED,  # answers that have not come
    ASKED_FOR,
    REQUEST_DEADLINE,
    LAST_COMMAND,
    IS_CLAMPED,
    IS_SHIFTED,  # 1: set up anew, and no command has come since that lets the motors on
    STOP_DUE,  # 1: zero torque is to be sent before all else
    IS_NEW,  # 1: set up, and not answered yet
    KNOWN,  # 1: an answer has come since the line was opened
    RESOLUTION,
    BYTES,  # scratch: two float32
) = range(FIRST, FIRST + 14)
TORQUES, LIMITS, LAST_COUNTS = range(FIRST + 14, FIRST + 20, 2)  # of joints 1, 2; float64 bits, but for the counts
SETUP = FIRST + 20  # the setup's bytes, in four words
STATE = SETUP + 4

CLOSED, WAS_RESET, WAS_SET_UP, ASKING, SILENT = range(5)  # phases
FOR_NOTHING, FOR_EFFECT, FOR_SAMPLE, FOR_LOOK = range(4)  # what the answer is wanted for


class Options(SerialOptions):
    """generation: 3, of plastic, or 2, with the metal plate."""

    generation: Literal[2, 3] = 3


def codec(options, device) -> c.Codec:
    """The codec for this device description. Raises ValueError unless it is five bars, and nothing else."""
    if device.kinematics.type != "five_bar" or len(device.axes) != 2:
        given = f"kinematics is {device.kinematics.type}, axes are {', '.join(axis.name for axis in device.axes)}"
        raise ValueError(f"{given}; a Haply 2DIY is a five_bar with x and y")
    state = np.zeros(STATE, np.int64)
    state[c.TEMPERATURE], state[c.AXES] = c.NO_TEMPERATURE, 2
    state[RESOLUTION] = SERVES[options.generation][0]
    limits = [min(TORQUE_LIMIT, joint.torque_limit / joint.torque_constant) for joint in device.joints]
    state.view(np.float64)[LIMITS : LIMITS + 2] = limits
    state[SETUP:].view(np.uint8)[:SETUP_BYTES] = np.frombuffer(setup_bytes(options.generation), np.uint8)
    return c.Codec(state, *compiled(), asks=True)


def setup_bytes(generation: int) -> bytes:
    """What tells the board its motors, encoders, their directions and rest pose, by its ports: port 1 has motor 2."""
    resolution, rest, directions = SERVES[generation]
    ports = (1, 0)
    turns = bytes([0b11, *(directions[joint] for joint in ports)])  # both ports are used
    encoders = np.array([(rest[joint], resolution) for joint in ports], "<f4").tobytes()
    return bytes([SET_UP, DEVICE]) + turns + turns + bytes(2) + encoders


@njit
def _ask(state, now, wanted, outgoing, at):
    """Puts the frame with the torques held; returns the number of bytes then put."""
    reals = state.view(np.float64)
    outgoing[at], outgoing[at + 1] = WRITE, DEVICE
    floats = state[BYTES : BYTES + 1].view(np.float32)
    floats[0], floats[1] = reals[TORQUES + 1], reals[TORQUES]  # by port
    outgoing[at + 2 : at + FRAME] = state[BYTES : BYTES + 1].view(np.uint8)
    state[OWED] += 1
    state[ASKED_FOR] = wanted
    request_timing.asked(state, now)
    return at + FRAME


@njit
def _zero(state):
    state[TORQUES] = state[TORQUES + 1] = 0
    state[request_timing.UNSENT] = state[IS_CLAMPED] = 0


@njit
def _reset(state, now, outgoing):
    outgoing[0], outgoing[1] = RESET, 0
    state[PHASE], state[WAIT] = WAS_RESET, now + SETTLE
    return 2


@njit
def _set_up(state, now, outgoing):
    """With the rest pose when the line is new, else with the counts that were known last."""
    outgoing[:SETUP_BYTES] = state[SETUP : SETUP + 4].view(np.uint8)[:SETUP_BYTES]
    for port in range(2 * state[KNOWN]):
        count = state[LAST_COUNTS + 1 - port]
        within = count + 0.25 * np.sign(count)  # a count's angle, whether the board rounds it or cuts it off
        state[BYTES : BYTES + 1].view(np.float32)[0] = within * 360.0 / state[RESOLUTION]
        outgoing[OFFSETS[port] : OFFSETS[port] + 4] = state[BYTES : BYTES + 1].view(np.uint8)[:4]
    state[PHASE], state[WAIT] = WAS_SET_UP, now + SETTLE
    state[IS_NEW], state[IS_SHIFTED] = 1, np.int64(state[KNOWN] != 0 or state[c.SESSIONS] > 0)
    return SETUP_BYTES


@njit
def _fall_silent(state, now, quiet):
    """What the board says now cannot be told apart: motors off, and no more asking for `quiet` ns without a byte."""
    state[c.LOST] += state[ASKED_FOR] == FOR_SAMPLE and state[OWED] > 0
    state[c.READY] = state[OWED] = 0
    state[PHASE], state[QUIET], state[WAIT] = SILENT, quiet, now + quiet
    state[STOP_DUE] = 1


@njit
def _hold(state, command):
    """Takes the torques of a command, within limits; zero for both if one of them is no number."""
    reals, wanted = state.view(np.float64), command.view(np.float64)
    _zero(state)
    request_timing.held(state, command[1])
    if not (np.isfinite(wanted[5]) and np.isfinite(wanted[6])):
        state[c.REFUSED] += 1
        return
    if state[IS_SHIFTED]:
        state[IS_SHIFTED] = command[4] != 0 or wanted[5] != 0.0 or wanted[6] != 0.0
        return
    for i in range(2):
        limit = reals[LIMITS + i]
        reals[TORQUES + i] = min(limit, max(-limit, wanted[5 + i]))
        state[IS_CLAMPED] |= abs(wanted[5 + i]) > limit


@njit
def _cut(state, now, outgoing):
    """Zero torque at once, whatever is awaited; sets the board up first where that has not been done."""
    _zero(state)
    state[STOP_DUE] = 0
    if state[PHASE] == CLOSED or state[OWED] >= MOST_OWED:
        return 0
    at = _set_up(state, now, outgoing) if state[PHASE] == WAS_RESET else 0
    if state[PHASE] != ASKING:
        state[WAIT] = now + max(SETTLE, state[QUIET])
    return _ask(state, now, FOR_NOTHING, outgoing, at)


@njit
def _get_going(state, now, outgoing):
    """What comes before the first answer, or after a failure: each step when its wait is over."""
    if state[STOP_DUE]:
        return _cut(state, now, outgoing)
    if now < state[WAIT]:
        return 0
    if state[PHASE] == WAS_RESET:
        return _set_up(state, now, outgoing)
    if state[PHASE] == SILENT and state[QUIET] == BOARD_GIVES_UP:
        return _reset(state, now, outgoing)
    _zero(state)
    state[PHASE], state[OWED] = ASKING, 0
    return _ask(state, now, FOR_NOTHING, outgoing, 0)


@njit
def _open(state, now, outgoing):
    _zero(state)
    state[c.READY] = state[OWED] = state[KNOWN] = state[QUIET] = state[STOP_DUE] = 0
    state[LAST_COMMAND] = now
    return _reset(state, now, outgoing)


def _encode(state, event, now, command, outgoing):
    if event == c.OPENED:
        return _open(state, now, outgoing)
    if event == c.CUT:
        return _cut(state, now, outgoing)
    if state[PHASE] == CLOSED:
        return 0
    if event == c.COMMAND:
        state[LAST_COMMAND] = now
        _hold(state, command)
    if state[PHASE] == ASKING and state[OWED] > 0 and now - state[request_timing.SENT] > ANSWERED_WITHIN:
        _fall_silent(state, now, ANSWERED_WITHIN if state[c.READY] else BOARD_GIVES_UP)
    if state[PHASE] != ASKING or state[OWED] > 0:
        return _get_going(state, now, outgoing) if state[PHASE] != ASKING else 0
    if event == c.DUE:
        state[REQUEST_DEADLINE] = command[2]
        return _ask(state, now, FOR_SAMPLE, outgoing, 0)
    if event == c.COMMAND or (event == c.IDLE and state[request_timing.UNSENT]):
        return _ask(state, now, FOR_EFFECT, outgoing, 0)
    if event == c.IDLE and now - state[LAST_COMMAND] > UNASKED:
        return _ask(state, now, FOR_LOOK, outgoing, 0)
    return 0


@njit
def _refuse(state, now, count):
    state[c.REFUSED] += 1
    _fall_silent(state, now, ANSWERED_WITHIN)
    return count


def _decode(state, incoming, count, now, answer):
    answer[: c.ANSWER] = 0
    if state[PHASE] != ASKING:
        if state[PHASE] == SILENT:
            state[WAIT] = max(state[WAIT], now + state[QUIET])
        return count
    if state[OWED] == 0:
        return _refuse(state, now, count)
    if count < REPLY:
        return 0
    if incoming[0] != DEVICE:
        return _refuse(state, now, count)
    state[BYTES : BYTES + 1].view(np.uint8)[:] = incoming[1:REPLY]
    degrees = state[BYTES : BYTES + 1].view(np.float32)
    for i in range(2):
        if not abs(degrees[i]) <= MOST_DEGREES:  # nor is a NaN
            return _refuse(state, now, count)
    state[OWED] -= 1
    if state[OWED] == 0:
        _take(state, now, degrees, answer)
    return REPLY


@njit
def _take(state, now, degrees, answer):
    """The answer to the last request."""
    for i in range(2):
        state[LAST_COUNTS + i] = np.int64(np.rint(np.float64(degrees[1 - i]) * state[RESOLUTION] / 360.0))
    state[c.SESSIONS] += state[IS_NEW]
    state[IS_NEW] = 0
    state[c.READY] = state[KNOWN] = 1
    request_timing.answered(state, now)
    if state[ASKED_FOR] == FOR_SAMPLE or state[ASKED_FOR] == FOR_LOOK:
        _tell(state, now, answer)


@njit
def _tell(state, now, answer):
    deadline = state[REQUEST_DEADLINE] if state[ASKED_FOR] == FOR_SAMPLE else 0
    answer[c.KIND] = c.SAMPLE
    request_timing.latched(state, deadline, now, answer)
    answer[c.DEADLINE] = deadline
    answer[c.STATUS] = CLAMPED * state[IS_CLAMPED] + BROKEN * state[IS_SHIFTED]
    for i in range(2):
        answer[c.COUNTS + i] = state[LAST_COUNTS + i]


@functools.cache
def compiled():
    """encode and decode; compiled where there is such a link."""
    return c.encoder(_encode), c.decoder(_decode)
