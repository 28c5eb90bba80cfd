# SPDX-License-Identifier: Apache-2.0
"""docs/how_to/connect_a_device.md: the description and the link that it shows are taken as they stand."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_device.link import codec as c

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/how_to/connect_a_device.md").read_text(encoding="utf-8")
MS = 1_000_000  # [ns]


def block(language):
    [text] = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return text


@pytest.fixture(scope="module")
def one_axis(tmp_path_factory):
    """The codec of the link that the page shows."""
    folder = tmp_path_factory.mktemp("link")
    (folder / "one_axis.py").write_text(block("python"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as here:
        here.syspath_prepend(folder)
        module = importlib.import_module("one_axis")
        yield module.codec(module.Options(port="/dev/ttyUSB0"), load_device("own_device"))
        del sys.modules["one_axis"]


class Board:
    """A codec and what it says; answers are made by the test."""

    def __init__(self, codec):
        self.codec, self.state, self.answer = codec, codec.state.copy(), np.zeros(c.ANSWER, np.int64)

    def tell(self, event, now, motor=0.0, deadline=0):
        """Bytes that go out at this event."""
        command, outgoing = np.zeros(8, np.int64), np.zeros(c.ROOM, np.uint8)
        command[:5] = 7, now, deadline, MS, 1
        command[5:6].view(np.float64)[0] = motor
        count = self.codec.encode(self.state, event, now, command, outgoing)
        return bytes(outgoing[:count])

    def hear(self, content, now):
        """Samples that come of these bytes: (latched, deadline, counts); what is left is waited on."""
        incoming, samples = np.frombuffer(content, np.uint8).copy(), []
        while incoming.size:
            self.answer[c.KIND] = c.NOTHING
            done = self.codec.decode(self.state, incoming, incoming.size, now, self.answer)
            if self.answer[c.KIND] == c.SAMPLE:
                samples.append(tuple(int(self.answer[word]) for word in (c.LATCHED, c.DEADLINE, c.COUNTS)))
            if done == 0:
                break
            incoming = incoming[done:].copy()
        return samples


def reply(counts):
    body = b"P" + counts.to_bytes(4, "little", signed=True)
    return body + bytes([np.bitwise_xor.reduce(np.frombuffer(body, np.uint8))])


def request(milliamperes):
    return b"F" + milliamperes.to_bytes(2, "little", signed=True)


def answering(one_axis):
    """A board that has answered once."""
    board = Board(one_axis)
    assert board.tell(c.OPENED, 1 * MS) == request(0)
    assert not board.state[c.READY]
    assert board.hear(reply(5), 2 * MS) == []
    assert board.state[c.READY]
    return board


@pytest.fixture
def board(one_axis):
    return answering(one_axis)


def test_the_description_of_the_page_is_one(tmp_path):
    (tmp_path / "mine.yaml").write_text(block("yaml"), encoding="utf-8")
    assert load_device(tmp_path / "mine.yaml").link.type == "serial"
    assert load_device("own_device").link.type == "shared_memory"


def test_the_answer_to_the_request_at_the_deadline_is_its_sample_which_is_never_before_it(one_axis):
    for counts in (0, -1, 2**31 - 1, -(2**31)):
        board = answering(one_axis)
        assert board.tell(c.COMMAND, 10 * MS, 0.5, 11 * MS) == request(500)
        assert board.tell(c.DUE, 11 * MS, 0.5, 11 * MS) == request(500)
        assert board.hear(reply(123), 11 * MS + 1000) == []  # of the command
        assert board.hear(reply(counts), 11 * MS + 4000) == [(11 * MS + 2000, 11 * MS, counts)]
        board.tell(c.DUE, 12 * MS, deadline=13 * MS)
        assert board.hear(reply(3), 13 * MS) == [(13 * MS, 13 * MS, 3)]


def test_without_a_servo_a_sample_comes_each_idle_event(board):
    assert board.tell(c.IDLE, 10 * MS) == request(0)
    assert board.hear(reply(7), 10 * MS + 4000) == [(10 * MS + 2000, 0, 7)]


def test_the_motor_value_is_held_within_what_the_board_stands(one_axis):
    for motor, sent in ((5.0, 5000), (5.001, 5000), (-5.001, -5000), (1e308, 5000), (-0.25, -250)):
        board = answering(one_axis)
        assert board.tell(c.COMMAND, 10 * MS, motor) == request(sent)
        assert board.tell(c.DUE, 11 * MS, deadline=11 * MS) == request(sent)
        assert board.tell(c.CUT, 12 * MS, motor) == request(0)
        assert board.tell(c.DUE, 12 * MS, motor) == b""  # one deadline at a time


def test_answers_that_do_not_come_are_given_up_and_counted(board):
    board.tell(c.COMMAND, 10 * MS, 0.5)
    assert board.tell(c.IDLE, 30 * MS) == b"" and board.state[c.READY]  # 20 ms: still waited for
    assert board.tell(c.IDLE, 30 * MS + 1) == request(500) and not board.state[c.READY]
    assert board.state[c.LOST] == 1


def test_the_delay_is_from_the_servos_write_to_the_middle_of_its_exchange(board):
    board.tell(c.COMMAND, 10 * MS, 0.5)
    board.hear(reply(1), 10 * MS + 400_000)
    assert board.state[c.DELAY] == 200_000 and board.state[c.ROUND_TRIP] == 400_000


@given(noise=st.binary(max_size=40), cut=st.integers(0, 5))
def test_whatever_comes_before_it_an_answer_that_is_whole_is_found(one_axis, noise, cut):
    board = Board(one_axis)
    board.tell(c.OPENED, MS)
    board.hear(noise.replace(b"P", b"Q") + reply(77)[:cut], 2 * MS)
    assert not board.state[c.READY]
    assert board.tell(c.DUE, 3 * MS, deadline=3 * MS) == request(0)
    assert board.hear(noise.replace(b"P", b"Q") + reply(1) + reply(-77), 4 * MS) == [(3 * MS + MS // 2, 3 * MS, -77)]


@given(counts=st.integers(-(2**31), 2**31 - 1), at=st.integers(0, 47))
def test_an_answer_with_one_bit_changed_is_refused(one_axis, counts, at):
    board = Board(one_axis)
    board.tell(c.OPENED, MS)
    changed = bytearray(reply(counts))
    changed[at // 8] ^= 1 << at % 8
    board.hear(bytes(changed) + bytes(6), 2 * MS)
    assert board.state[c.REFUSED] > 0 and not board.state[c.READY]
