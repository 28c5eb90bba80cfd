# SPDX-License-Identifier: Apache-2.0
"""Bytes of frames, in Python and in the firmware: CRC-32 is zlib's, COBS comes back; counters unwrap."""

import ctypes
import zlib

import firmware_builds
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from link_frames import HEAD, LENGTHS, sealed, stuffed, unstuffed

from haptic_device.link import counter, frame

RUNS = st.lists(st.integers(0, 300), max_size=4).map(lambda runs: b"\0".join(b"x" * run for run in runs))
DATA = st.binary(max_size=700) | RUNS


def array(data):
    return np.frombuffer(bytes(data), np.uint8).copy()


class InPython:
    MOST = 700  # bytes that are coded

    crc = staticmethod(lambda data: frame.crc32(array(data), len(data)))

    @staticmethod
    def encode(data):
        coded = np.zeros(len(data) + len(data) // 254 + 1, np.uint8)
        return bytes(coded[: frame.cobs_encode(array(data), len(data), coded)])

    @staticmethod
    def decode(coded, room=2000):
        data = np.zeros(room, np.uint8)
        count = frame.cobs_decode(array(coded), 0, len(coded), data)
        return bytes(data[:count]) if count >= 0 else None


class InC:
    MOST = 254  # more than any frame has

    crc = staticmethod(lambda data: firmware_builds.ports().haptic_crc32(bytes(data), len(data)))

    @staticmethod
    def encode(data):
        coded = ctypes.create_string_buffer(300)
        count = firmware_builds.ports().haptic_cobs_encode(data, len(data), coded)
        return coded.raw[:count]

    @staticmethod
    def decode(coded):
        data = ctypes.create_string_buffer(2000)
        count = firmware_builds.ports().haptic_cobs_decode(coded, len(coded), data)
        return data.raw[:count] if count >= 0 else None


both = pytest.mark.parametrize("coder", [InPython, InC], ids=["python", "c"])


@both
@given(DATA)
def test_the_crc_is_that_of_zlib_and_the_one_of_the_page(coder, data):
    assert coder.crc(data) == zlib.crc32(data) and coder.crc(b"123456789") == 0xCBF43926


@both
@given(DATA)
def test_cobs_has_no_zero_is_as_another_coder_has_it_and_comes_back(coder, data):
    data = data[: coder.MOST]
    coded = coder.encode(data)
    assert 0 not in coded and unstuffed(coded) == data
    assert coder.decode(coded) == coder.decode(stuffed(data)[:-1]) == data


@both
def test_cobs_examples(coder):
    for data, coded in ((b"", b"\x01"), (b"\0\0", b"\x01\x01\x01"), (b"\x11\x22\0\x33", b"\x03\x11\x22\x02\x33")):
        assert coder.encode(data) == coded and coder.decode(coded) == data


@both
@given(
    st.binary(min_size=1, max_size=400) | st.lists(st.sampled_from([0, 1, 2, 3, 5, 254, 255]), min_size=1).map(bytes)
)
@example(coded=b"\x02\0")
@example(coded=b"\x03\x11\0")
@example(coded=b"\x03\x11")
def test_what_is_not_cobs_is_told(coder, coded):
    try:
        wanted = unstuffed(coded)
    except ValueError:
        wanted = None
    assert coder.decode(coded) == wanted


def test_a_frame_that_fills_the_room_is_decoded_and_one_byte_more_is_not():
    for byte in (b"\0", b"x"):
        assert InPython.decode(stuffed(byte * 20)[:-1], 20) == byte * 20
        assert InPython.decode(stuffed(byte * 21)[:-1], 20) is None


def test_each_kind_is_known_by_its_own_length_and_version_only():
    for kind, length in [*LENGTHS.items(), (0, 20), (9, 20), (255, 20)]:
        for version, count, known in ((1, length, kind in LENGTHS), (1, length + 1, False), (2, length, False)):
            data = array(sealed(HEAD.pack(version, kind, 0, 7, 1, 0) + bytes(count - 20)))
            assert frame.kind_of(data, count) == (kind if known else -1)
            assert frame.kind_of(data, count - 1) == -1


def test_a_sequence_is_newer_up_to_half_of_all():
    for last in (0, 1, 2**31, 2**32 - 1):
        for ahead, newer in ((0, False), (1, True), (2**31 - 1, True), (2**31, False), (2**32 - 1, False)):
            assert frame.newer((last + ahead) % 2**32, last) == newer


@given(st.integers(-(2**60), 2**60), st.integers(-(2**15), 2**15 - 1), st.sampled_from((16, 32)))
@example(0, -(2**15), 16)
@example(0, 2**15 - 1, 16)
def test_a_counter_that_moves_less_than_half_its_range_is_unwrapped(before, moved, bits):
    raw = (before + moved + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)
    assert counter.unwrap(raw, before, bits) == before + moved
