# SPDX-License-Identifier: Apache-2.0
"""Frames of the link protocol (docs/reference/link_protocol.md) as bytes: header, CRC-32, COBS, little-endian numbers.

Buffers are uint8 arrays. Integers are handed over as int64; what does not fit a field loses its upper bits.
"""

import numpy as np

from haptic_device.jit import kernel, njit

VERSION = 1
HELLO, GREETING, COMMAND, SAMPLE, CLOCK, CLOCK_ANSWER, TARGET, TRUTH = range(1, 9)
PAYLOADS = 0, 0, 72, 24, 52, 8, 24, 24, 160  # bytes, by kind
HEADER, CRC = 16, 4
LONGEST = HEADER + max(PAYLOADS) + CRC
LONGEST_CODED = LONGEST + 1  # by COBS: a byte more for each 254; without the 0 that ends it
FLAGS, SESSION, SEQUENCE, ANSWERS = 2, 4, 8, 12  # offsets in the header
WRONG = -1
U32 = 0xFFFFFFFF


def _remainder(byte):
    for _ in range(8):
        byte = byte >> 1 ^ (0xEDB88320 if byte & 1 else 0)
    return byte


_REMAINDERS = np.array([_remainder(byte) for byte in range(256)], np.int64)


@kernel
def crc32(data, count):
    """CRC-32 of the first `count` bytes, as zlib's."""
    crc = np.int64(U32)
    for i in range(count):
        crc = crc >> 8 ^ _REMAINDERS[(crc ^ np.int64(data[i])) & 0xFF]
    return crc ^ U32


@kernel
def cobs_encode(data, count, coded):
    """The first `count` bytes of data by COBS into `coded`, without the 0 that ends them; returns how many they are.

    coded has room for count + count // 254 + 1 bytes. Its first byte of each block says after how many comes the next.
    """
    start, end = 0, 1
    for i in range(count):
        if data[i] != 0:
            coded[end] = data[i]
            end += 1
        if data[i] == 0 or (end - start == 255 and i + 1 < count):
            coded[start] = end - start
            start, end = end, end + 1
    coded[start] = end - start
    return end


@kernel
def cobs_decode(coded, first, count, data):
    """What the `count` bytes of `coded` from `first` on stand for, into data; returns how many bytes, or WRONG.

    WRONG: there is a 0 in them, a block ends beyond them, they are none, or data has no room.
    """
    here, end, done = first, first + count, 0
    while here < end:
        block = np.int64(coded[here])
        after = here + block
        if block == 0 or after > end or done + block - 1 > data.size:
            return WRONG
        for i in range(here + 1, after):
            if coded[i] == 0:
                return WRONG
            data[done] = coded[i]
            done += 1
        here = after
        if block < 255 and here < end:
            if done == data.size:
                return WRONG
            data[done] = 0
            done += 1
    return done if count > 0 else WRONG


@njit
def get_u16(data, at):
    return np.int64(data[at : at + 2].view(np.uint16)[0])


@njit
def get_i16(data, at):
    return np.int64(data[at : at + 2].view(np.int16)[0])


@njit
def get_u32(data, at):
    return np.int64(data[at : at + 4].view(np.uint32)[0])


@njit
def get_i32(data, at):
    return np.int64(data[at : at + 4].view(np.int32)[0])


@njit
def get_i64(data, at):
    return data[at : at + 8].view(np.int64)[0]


@njit
def get_f32(data, at):
    return np.float64(data[at : at + 4].view(np.float32)[0])


@njit
def get_f64(data, at):
    return data[at : at + 8].view(np.float64)[0]


@njit
def put_u16(data, at, value):
    data[at : at + 2].view(np.uint16)[0] = value


@njit
def put_u32(data, at, value):
    data[at : at + 4].view(np.uint32)[0] = value


@njit
def put_i64(data, at, value):
    data[at : at + 8].view(np.int64)[0] = value


@njit
def put_f32(data, at, value):
    """Returns whether the value is finite as a float32."""
    data[at : at + 4].view(np.float32)[0] = value
    return np.isfinite(data[at : at + 4].view(np.float32)[0])


@njit
def put_f64(data, at, value):
    data[at : at + 8].view(np.float64)[0] = value


@njit
def seal(data, kind, flags, session, sequence):
    """Header and CRC around a payload that is there already, or has no bytes; returns the bytes of the frame."""
    data[0], data[1] = VERSION, kind
    put_u16(data, FLAGS, flags)
    put_u32(data, SESSION, session)
    put_u32(data, SEQUENCE, sequence)
    put_u32(data, ANSWERS, 0)
    end = HEADER + PAYLOADS[kind]
    put_u32(data, end, crc32(data, end))
    return end + CRC


@kernel
def kind_of(data, count):
    """Kind of the frame that these `count` bytes are, or WRONG: length, version, kind or CRC are not of a frame."""
    if count < HEADER + CRC or data[0] != VERSION or not HELLO <= data[1] <= TRUTH:
        return WRONG
    kind = np.int64(data[1])
    end = HEADER + PAYLOADS[kind]
    return kind if count == end + CRC and get_u32(data, end) == crc32(data, end) else WRONG


@kernel
def newer(sequence, last):
    """Whether a sequence comes after the last one, in 32 bits that wrap."""
    return 0 < (sequence - last) & U32 < 1 << 31
