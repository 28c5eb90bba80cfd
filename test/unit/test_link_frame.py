# SPDX-License-Identifier: Apache-2.0
"""Bytes of frames: CRC-32 is zlib's, COBS comes back and has no zero, counters unwrap the shortest way."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_device import LENGTHS, packed, stuffed, unstuffed

from haptic_device.link import counter, frame

RUNS = st.lists(st.integers(0, 300), max_size=4).map(lambda runs: b"\0".join(b"x" * run for run in runs))
DATA = st.binary(max_size=700) | RUNS


def array(data):
    return np.frombuffer(bytes(data), np.uint8).copy()


def decoded(coded, room=2000):
    data = np.zeros(room, np.uint8)
    count = frame.cobs_decode(array(coded), 0, len(coded), data)
    return bytes(data[:count]) if count >= 0 else None


@given(DATA)
def test_the_crc_is_that_of_zlib(data):
    assert frame.crc32(array(data), len(data)) == zlib.crc32(data)


def test_the_crc_of_the_page():
    assert frame.crc32(array(b"123456789"), 9) == 0xCBF43926


@given(DATA)
def test_cobs_has_no_zero_is_as_the_paper_says_and_comes_back(data):
    coded = np.zeros(len(data) + len(data) // 254 + 1, np.uint8)
    count = frame.cobs_encode(array(data), len(data), coded)
    coded = bytes(coded[:count])
    assert 0 not in coded and unstuffed(coded) == data
    assert decoded(coded) == data


@given(DATA)
def test_cobs_of_another_coder_is_decoded(data):
    assert decoded(stuffed(data)[:-1]) == data


@pytest.mark.parametrize(
    ("data", "coded"),
    [
        (b"", b"\x01"),
        (b"\0", b"\x01\x01"),
        (b"\0\0", b"\x01\x01\x01"),
        (b"\x11\x22\0\x33", b"\x03\x11\x22\x02\x33"),
        (bytes(range(1, 255)), b"\xff" + bytes(range(1, 255))),
        (bytes(range(1, 256)), b"\xff" + bytes(range(1, 255)) + b"\x02\xff"),
        (bytes(range(0, 255)), b"\x01\xff" + bytes(range(1, 255))),
    ],
)
def test_cobs_examples(data, coded):
    room = np.zeros(300, np.uint8)
    assert bytes(room[: frame.cobs_encode(array(data), len(data), room)]) == coded
    assert decoded(coded) == data


@pytest.mark.parametrize("coded", [b"", b"\0", b"\x03\x11", b"\x02\0", b"\x01\0\x01"])
def test_what_is_not_cobs_is_told(coded):
    assert decoded(coded) is None


@given(st.binary(max_size=400), st.integers(0, 200))
def test_bytes_by_chance_are_decoded_within_the_room_or_not_at_all(coded, room):
    data = decoded(coded, room)
    assert data is None or (len(data) <= room and data == unstuffed(coded))


def test_a_frame_that_fills_the_room_is_decoded_and_one_byte_more_is_not():
    assert decoded(stuffed(b"\0" * 20)[:-1], 20) == b"\0" * 20
    assert decoded(stuffed(b"\0" * 21)[:-1], 20) is None
    assert decoded(stuffed(b"x" * 20)[:-1], 20) == b"x" * 20
    assert decoded(stuffed(b"x" * 21)[:-1], 20) is None


@pytest.mark.parametrize(("kind", "length"), LENGTHS.items())
def test_each_kind_is_known_by_its_own_length_only(kind, length):
    whole = packed(kind, 7, 1, bytes(length - 20))
    assert frame.kind_of(array(whole), length) == kind
    for wrong in (length - 1, length + 1):
        assert frame.kind_of(array(packed(kind, 7, 1, bytes(wrong - 20 if wrong >= 20 else 0))[:wrong]), wrong) == -1
    assert frame.kind_of(array(packed(kind, 7, 1, bytes(length - 20), version=2)), length) == -1


@pytest.mark.parametrize("kind", [0, 9, 255])
def test_other_kinds_are_no_frames(kind):
    assert frame.kind_of(array(packed(kind, 7, 1)), 20) == -1


@given(st.integers(0, 71 * 8 + 7))
def test_one_changed_bit_is_found(bit):
    data = bytearray(packed(4, 7, 1, bytes(52)))
    data[bit // 8] ^= 1 << bit % 8
    assert frame.kind_of(array(data), len(data)) == -1


@pytest.mark.parametrize("last", [0, 1, 2**31, 2**32 - 1])
def test_a_sequence_is_newer_up_to_half_of_all(last):
    for ahead, newer in ((0, False), (1, True), (2**31 - 1, True), (2**31, False), (2**32 - 1, False)):
        assert frame.newer((last + ahead) % 2**32, last) == newer


@given(st.integers(-(2**60), 2**60), st.integers(-(2**15), 2**15 - 1), st.sampled_from((16, 32)))
def test_a_counter_that_moves_less_than_half_its_range_is_unwrapped(before, moved, bits):
    raw = (before + moved + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)
    assert counter.unwrap(raw, before, bits) == before + moved


def test_half_of_the_range_counts_as_backwards_and_one_less_as_forwards():
    assert counter.unwrap(2**15 - 1, 0, 16) == 2**15 - 1
    assert counter.unwrap(-(2**15), 0, 16) == -(2**15)
    assert counter.unwrap(-(2**15), 1, 16) == 2**15
