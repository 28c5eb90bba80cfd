# SPDX-License-Identifier: Apache-2.0
"""What a moteus drive is told and asked, and what it answers, as bytes of a CAN FD frame.

`data` is the bytes of a frame (uint8, 64). Each of its subframes writes, reads or tells registers in a row.
"""

import numpy as np

from haptic_device.jit import njit
from haptic_device.link import fdcanusb, frame

INT8, INT16, INT32, FLOAT = range(4)  # as the protocol numbers what a value is
VALUE_BYTES = (1, 2, 4, 4)
WRITE, READ, TELL = 0x00, 0x10, 0x20  # subframes
MODE, POSITION, TEMPERATURE, FAULT = 0x00, 0x01, 0x0E, 0x0F  # registers that are read
TARGET_FIRST, TARGET_COUNT, TIME_LIMIT = 0x20, 6, 0x27  # target, its rate, torque, two gains, most torque; watchdog
STOPPED, BROKEN_DOWN, BY_POSITION, TIMED_OUT = 0, 1, 10, 11  # modes
NO_INT32, NO_INT8 = -(2**31), -128  # what is not known


@njit
def put_torque(data, torque, most, watchdog):
    """Position mode without a position and without gains: this torque, at most so much [N m], for so long [s].

    Returns the number of bytes.
    """
    data[0], data[1], data[2] = WRITE | INT8 << 2 | 1, MODE, BY_POSITION
    data[3], data[4], data[5] = WRITE | FLOAT << 2, TARGET_COUNT, TARGET_FIRST
    frame.put_f32(data, 6, np.nan)
    frame.put_f32(data, 10, 0.0)
    frame.put_f32(data, 14, torque)
    frame.put_f32(data, 18, 0.0)
    frame.put_f32(data, 22, 0.0)
    frame.put_f32(data, 26, most)
    data[30], data[31] = WRITE | FLOAT << 2 | 1, TIME_LIMIT
    frame.put_f32(data, 32, watchdog)
    return 36


@njit
def put_stop(data):
    """Motor off, and out of a fault; returns the number of bytes."""
    data[0], data[1], data[2] = WRITE | INT8 << 2 | 1, MODE, STOPPED
    return 3


@njit
def put_query(data, at):
    """The question for mode, position, temperature and fault, from `at` on; returns the number of bytes then put."""
    data[at], data[at + 1] = READ | INT8 << 2 | 1, MODE
    data[at + 2], data[at + 3] = READ | INT32 << 2 | 1, POSITION
    data[at + 4], data[at + 5] = READ | INT8 << 2 | 2, TEMPERATURE  # and what follows, the fault
    return at + 6


@njit
def _number(data, at, size):
    """Little-endian whole number with a sign."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[at + i]) << 8 * i
    return value - (value >> 8 * size - 1 << 8 * size)


@njit
def _subframe(data, at, length):
    """Kind of value, number of values and the first one's place of a subframe that tells; −1 values if it is none."""
    head, count = np.int64(data[at]), np.int64(data[at]) & 3
    at += 1
    if count == 0 and at < length:
        count = np.int64(data[at])
        at += 1
    kind = head >> 2 & 3
    whole = head & 0xF0 == TELL and at + 1 + count * VALUE_BYTES[kind] <= length
    return kind, count if whole else np.int64(-1), at + 1


@njit
def answer(data, length):
    """(whether mode and position are told as asked for, mode, position, temperature, fault) of the first bytes."""
    mode, position, temperature, fault = np.int64(0), np.int64(0), np.int64(NO_INT8), np.int64(0)
    at, said = 0, 0
    while at < length:
        if data[at] == fdcanusb.PADDING:
            at += 1
            continue
        kind, count, first = _subframe(data, at, length)
        if count < 0:
            return False, mode, position, temperature, fault
        at, lowest = first, np.int64(data[first - 1])
        for register in range(lowest, lowest + count):
            value = _number(data, at, VALUE_BYTES[kind])
            at += VALUE_BYTES[kind]
            if register == MODE and kind == INT8:
                mode, said = value, said | 1
            elif register == POSITION and kind == INT32 and value != NO_INT32:
                position, said = value, said | 2
            elif register == TEMPERATURE and kind == INT8:
                temperature = value
            elif register == FAULT and kind == INT8:
                fault = value
    return said == 3, mode, position, temperature, fault
