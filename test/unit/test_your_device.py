# SPDX-License-Identifier: Apache-2.0
"""docs/how_to/connect_a_device.md: the description and the link that it shows are taken as they stand."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from codec_host import MS, Host
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_device.link import codec as c

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/how_to/connect_a_device.md").read_text(encoding="utf-8")


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


def reply(counts):
    body = b"P" + counts.to_bytes(4, "little", signed=True)
    return body + bytes([np.bitwise_xor.reduce(np.frombuffer(body, np.uint8))])


def request(milliamperes):
    return b"F" + milliamperes.to_bytes(2, "little", signed=True)


def asking(one_axis):
    host = Host(one_axis)
    host.state = one_axis.state.copy()
    return host


@pytest.fixture
def board(one_axis):
    """A host of the board, which has answered once."""
    return answering(one_axis)


def answering(one_axis):
    host = asking(one_axis)
    assert host.open() == request(0) and not host.state[c.READY]
    assert host.hear(reply(5), after=MS) == [] and host.state[c.READY]
    return host


def test_the_description_of_the_page_is_one(tmp_path):
    (tmp_path / "mine.yaml").write_text(block("yaml"), encoding="utf-8")
    assert load_device(tmp_path / "mine.yaml").link.type == "serial"
    assert load_device("own_device").link.type == "shared_memory"


def test_the_answer_to_the_request_at_the_deadline_is_its_sample_which_is_never_before_it(one_axis):
    for counts in (0, -1, 2**31 - 1, -(2**31)):
        board = answering(one_axis)
        assert board.write(0.5) == board.due(after=MS) == request(500)
        at = board.now
        assert board.hear(reply(123), after=1000) == []  # of the command
        assert board.hear(reply(counts), after=3000) == [(at + 2000, 0, (counts, 0, 0), at)]
        board.command[2] = at + 2 * MS
        board.due(after=MS)
        assert board.hear(reply(3), after=MS) == [(at + 2 * MS, 0, (3, 0, 0), at + 2 * MS)]


def test_without_a_servo_a_sample_comes_each_idle_event(board):
    assert board.idle(after=MS) == request(0)
    assert board.hear(reply(7), after=4000) == [(board.now - 2000, 0, (7, 0, 0), 0)]


def test_the_motor_value_is_held_within_what_the_board_stands(one_axis):
    for motor, sent in ((5.0, 5000), (5.001, 5000), (-5.001, -5000), (1e308, 5000), (-0.25, -250)):
        board = answering(one_axis)
        assert board.write(motor) == board.due(after=MS) == request(sent)
        assert board.cut(after=MS) == request(0)
        assert board.due() == b""  # one deadline at a time


def test_answers_that_do_not_come_are_given_up_and_counted(board):
    board.write(0.5)
    assert board.idle(after=20 * MS) == b"" and board.state[c.READY]  # still waited for
    assert board.idle(after=1) == request(500) and not board.state[c.READY]
    assert board.state[c.LOST] == 1


def test_the_delay_is_from_the_servos_write_to_the_middle_of_its_exchange(board):
    board.write(0.5)
    board.hear(reply(1), after=400_000)
    assert board.state[c.DELAY] == 200_000 and board.state[c.ROUND_TRIP] == 400_000


@given(noise=st.binary(max_size=40), cut=st.integers(0, 5))
def test_whatever_comes_before_it_an_answer_that_is_whole_is_found(one_axis, noise, cut):
    board, noise = asking(one_axis), noise.replace(b"P", b"Q")
    board.open()
    board.hear(noise + reply(77)[:cut], after=MS)
    assert not board.state[c.READY]
    board.command[2] = board.now + MS
    assert board.due(after=MS) == request(0)
    told = board.hear(noise + reply(1) + reply(-77), after=MS)
    assert told == [(board.now - MS // 2, 0, (-77, 0, 0), board.now - MS)]


@given(counts=st.integers(-(2**31), 2**31 - 1), at=st.integers(0, 47))
def test_an_answer_with_one_bit_changed_is_refused(one_axis, counts, at):
    board, changed = asking(one_axis), bytearray(reply(counts))
    board.open()
    changed[at // 8] ^= 1 << at % 8
    board.hear(bytes(changed) + bytes(6), after=MS)
    assert board.state[c.REFUSED] > 0 and not board.state[c.READY]
