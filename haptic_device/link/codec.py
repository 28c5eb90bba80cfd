# SPDX-License-Identifier: Apache-2.0
"""What a device on a line is to the bridge: a codec, which turns events into bytes and bytes into samples.

A codec is its state and two compiled functions of the signatures below; the loop of the bridge (bridge_loop) calls them
by address, so that one compiled loop runs any codec. A link is a module with `Options`, what the description may say of
it, `compiled()`, its two functions, and `codec(options, device)`, its Codec; config/link_registry has its line.

* encode(state, event, now, command, outgoing) → number of bytes put into outgoing (uint8, ROOM) to be sent now, or 0.
  now: [ns of CLOCK_MONOTONIC]. command: the words of the servo's last write (realtime/shared_memory: session, written,
  next deadline, period, engaged, motor 3 as float64 bits), in the host's clock; with TARGET its last three words are
  the target (float64 bits, device units); with other events it is the last write, zeros before the first.
* decode(state, incoming, count, now, answer) → number of bytes of incoming (uint8, the first `count` are there) that
  are done with; 0: more have to come. answer[KIND] says what they were: NOTHING, SAMPLE or TRUTH. Called again while it
  consumes. A datagram is given alone, and what it leaves is dropped.

Events, also while READY is 0: OPENED, the line is new: forget the device, say hello. COMMAND, the servo has written.
DUE, the deadline that it announced has come: a device that only answers requests is asked now. CUT: motor zero, the
servo is silent or ends; sent several times at an end, so that it is the last word. IDLE: each 5 ms, with a servo and
without. TARGET: where a simulated device's hand goes.

All times of an answer are the host's. Counts are unwrapped. SAMPLE: LATCHED is never before the deadline that the
sample is of, and newer than that of the sample before. STATUS of NOTHING: what counts though no sample is told, bits of
one that is dropped, and CLOCK where what has come proves that the device's clock is not what the codec takes it for.
"""

from typing import NamedTuple

import numpy as np
from numba import types

from haptic_device.jit import kernel, njit
from haptic_device.realtime import shared_memory

OPENED, COMMAND, DUE, CUT, IDLE, TARGET = range(6)  # events
NOTHING, SAMPLE, TRUTH = range(3)  # kinds of answers

# words of an answer; DRAG and TRUTH_FIRST: float64 bits
KIND, LATCHED, STATUS, COUNTS, DRAG, DEADLINE = 0, 1, 2, 3, 6, 9  # DEADLINE: host's, that the sample answers; 0: none
STAMP_ERROR = 10  # [ns] half-width of what is not known of LATCHED
TRUTH_FIRST, TRUTH_WORDS = 11, 22  # fields of device/simulated_device.TRUTH in their order
ANSWER = 33
CLOCK = shared_memory.CLOCK  # bit of a status

# words of the state that any codec keeps, for the loop and the node; its own begin at OWN
READY = 0  # 1: a device answers and commands can be sent
DELAY = 1  # [ns] from the servo's write to the motor's effect, 99 % or the worst lately
CLOCK_ERROR = 2  # [ns] half-width of what is not known of the device's clock; its average is counted in DELAY
SKEW = 3  # [parts per 10⁹] of the device's clock against the host's
ROUND_TRIP = 4  # [ns] median of the last exchanges
REFUSED = 5  # frames dropped: wrong CRC, length, version, session, sequence, content
LOST = 6  # deadlines of commands whose samples never came
SESSIONS = 7  # greetings of new sessions
TEMPERATURE = 8  # [0.1 °C], NO_TEMPERATURE: not measured
PERIOD_LEAST, WATCHDOG, AXES, FIRMWARE = 9, 10, 11, 12  # what the device says of itself, times in ns; 0: unknown
CLOCK_STEPS = 13  # steps of the device's clock that were found
SIMULATED = 14  # 1: it takes targets and tells truths
DELAY_MEAN = 15  # [ns] from the servo's write to the motor's effect, on average
TOLD = 16  # counts per unit and largest motor values of x, y, theta, as the device tells them, float64 bits; 0: unknown
CLOCK_TROUBLE = 22  # clock_fit's FINE, DRIFT, STEP or JITTER: why samples are not good enough
CLOCK_STEPPED, CLOCK_STEPPED_AT = 23, 24  # size of the last step that was found, and when [ns]
CLOCK_AVERAGE = 25  # [ns] CLOCK_ERROR on average
OWN = 32
NO_TEMPERATURE = -32768
ROOM = 1024  # bytes of outgoing

WORDS, BYTES, WORD = types.int64[::1], types.uint8[::1], types.int64
ENCODE = WORD(WORDS, WORD, WORD, WORDS, BYTES)
DECODE = WORD(WORDS, BYTES, WORD, WORD, WORDS)


class Codec(NamedTuple):
    """state: int64 array, the codec's memory; asks: whether it wants DUE; datagram: whether each read is one frame."""

    state: np.ndarray
    encode: object
    decode: object
    asks: bool = False
    datagram: bool = False


@njit
def averaged(mean, value):
    """An average that forgets, with this value in it; 0: there was none before."""
    return mean + (value - mean) // 64 if mean else value


def encoder(function):
    """A function compiled as `encode`."""
    return kernel(ENCODE)(function)


def decoder(function):
    """A function compiled as `decode`."""
    return kernel(DECODE)(function)
