# SPDX-License-Identifier: Apache-2.0
"""Lines of text of an fdcanusb, an adapter to CAN FD: `can send ADDRESS DATA FLAGS` to it, `rcv ADDRESS DATA …` back.

ADDRESS and DATA are hexadecimal. `data` is the bytes of a frame, room for 64. `line` is bytes that have come, `end`
where the line ends in them, without what ends it.
"""

import numpy as np

from haptic_device.jit import njit

PADDING = 0x50  # what fills a frame up, and says nothing
NEWLINE, RETURN, SPACE = 10, 13, 32
NUMERAL, SMALL, CAPITAL = ord("0"), ord("a") - 10, ord("A") - 10  # letters of digits, less what they stand for


@njit
def _frame_length(length):
    """The next length that a CAN FD frame can have."""
    if length <= 8:
        return length
    if length <= 24:
        return (length + 3) // 4 * 4
    return (length + 15) // 16 * 16 if length > 32 else 32


@njit
def _put_hex(value, digits, outgoing, at, letters):
    for i in range(digits):
        digit = value >> 4 * (digits - 1 - i) & 15
        outgoing[at + i] = digit + (NUMERAL if digit < 10 else letters)
    return at + digits


@njit
def _put_text(text, outgoing, at):
    for i in range(len(text)):
        outgoing[at + i] = text[i]
    return at + len(text)


@njit
def put_line(address, data, length, outgoing, at):
    """Puts the line that sends the first `length` bytes of data; returns the number of bytes then put."""
    at = _put_text(b"can send ", outgoing, at)
    at = _put_hex(address, 4, outgoing, at, SMALL)
    outgoing[at] = SPACE
    at += 1
    for i in range(_frame_length(length)):
        at = _put_hex(np.int64(data[i]) if i < length else PADDING, 2, outgoing, at, CAPITAL)
    return _put_text(b" BF\n", outgoing, at)


@njit
def _digit(letter):
    """Value of a hexadecimal digit; −1 if it is none."""
    if NUMERAL <= letter < NUMERAL + 10:
        return letter - NUMERAL
    letter |= 32  # no capital
    return letter - SMALL if SMALL + 10 <= letter < SMALL + 16 else -1


@njit
def begins(line, end, text):
    """Whether a line begins with this text."""
    same = end >= len(text)
    for i in range(min(end, len(text))):
        same = same and line[i] == text[i]
    return same


@njit
def word_end(line, at, end):
    """Where the word ends that begins there."""
    while at < end and line[at] != SPACE:
        at += 1
    return at


@njit
def address(line, at, end):
    """Hexadecimal number in these places; −1 if it is none, or a longer one than an address."""
    value = -1 if end == at or end - at > 8 else 0
    for i in range(at, end):
        digit = _digit(np.int64(line[i]))
        if value < 0 or digit < 0:
            return -1
        value = value << 4 | digit
    return value


@njit
def unpack(line, at, end, data):
    """Fills data from the digits in these places; returns the number of bytes, −1 if that is no frame."""
    count = (end - at) // 2
    if (end - at) % 2 or count > 64:
        return -1
    for i in range(count):
        high, low = _digit(np.int64(line[at + 2 * i])), _digit(np.int64(line[at + 2 * i + 1]))
        if high < 0 or low < 0:
            return -1
        data[i] = high << 4 | low
    return count


@njit
def line_end(line, count):
    """Where the first line of `count` bytes ends; −1 if it does not yet."""
    for i in range(count):
        if line[i] == NEWLINE or line[i] == RETURN:
            return i
    return -1
