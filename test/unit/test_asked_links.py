# SPDX-License-Identifier: Apache-2.0
"""What all links have alike that ask their device and wait for its answer: a Haply's and that to moteus drives."""

import functools
import math

import codec_host
import pytest
import test_haply
import test_moteus
from codec_host import MS
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.link import codec


class Haply:
    LIMITS = (
        (1000.0, 1.0, 0.123),
        (0.7, 14.0, 0.7 / 14.0),
    )  # limit [N] and constant [N/(N m)] of a motor; the most [N m]
    OFF = test_haply.ZERO
    WIDEST = 1e5 * 4880 / 360  # counts
    opened, reply = test_haply.opened, test_haply.reply
    PIECES = st.binary(min_size=1, max_size=30) | st.sampled_from([reply(), reply((-7, 9))])

    request = staticmethod(lambda one, two, most=None: test_haply.request(one, two))
    anew = staticmethod(lambda one, two: test_haply.ZERO)  # a board tells nothing of its motors


class Moteus:
    LIMITS = (2.0, 1.0, 2.0), (10.0, 20.0, 0.5)
    OFF = test_moteus.no_torque(1) + test_moteus.no_torque(2)
    WIDEST = 2**31 - 1

    opened = staticmethod(functools.partial(test_moteus.opened, ids=(1, 2)))

    @staticmethod
    def request(one, two, most=2.0):
        return test_moteus.request(one, 1, most=most) + test_moteus.request(two, 2, most=most)

    anew = request

    @staticmethod
    def reply(counts=(0, 0)):
        return b"".join(test_moteus.reply(count, name=name) for name, count in enumerate(counts, 1))

    PIECES = st.binary(max_size=300) | st.sampled_from(
        [*test_moteus.BAD_LINES.values(), test_moteus.reply(3), test_moteus.reply(-9), b"rcv ", b"\r", b"\n"]
    )


links = pytest.mark.parametrize("link", [Haply, Moteus])


@links
def test_a_command_sends_its_torques_and_the_deadline_sends_them_again_and_brings_the_sample(link):
    host, sent = link.opened(), link.request(0.05, -0.02)
    assert host.write(0.05, -0.02) == sent
    assert host.hear(link.reply((1, 1)), after=MS // 2) == []
    assert host.due(after=MS // 2) == sent
    deadline = int(host.command[2])
    (sample,) = host.hear(link.reply((-100, 2000)), after=400_000)
    assert sample == (deadline + 200_000, 0, (-100, 2000, 0), deadline)


@links
@pytest.mark.parametrize("sign", [1, -1])
def test_a_torque_at_the_limit_is_sent_and_one_above_is_cut_down_and_told(link, sign):
    for limit, constant, most in link.LIMITS:
        host = link.opened(motor_limit=limit, motor_constant=constant)
        for wanted, status in ((most, 0), (math.nextafter(most, 9.0), 128)):
            for axis in range(2):
                torques, held = [0.01, 0.01], [0.01, 0.01]
                torques[axis], held[axis] = sign * wanted, sign * most
                assert host.write(*torques) == link.request(*held, most=most)
                host.hear(link.reply())
                host.due(after=MS)
                assert [sample.status for sample in host.hear(link.reply())] == [status]


@links
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_torque_that_is_no_number_switches_all_motors_off_and_is_counted(link, bad):
    for torques in ((bad, 0.1), (0.1, bad)):
        host = link.opened()
        assert host.write(*torques, engaged=0) == link.request(0.0, 0.0)
        assert host.state[codec.REFUSED] == 1


@links
def test_an_answer_missing_for_20_ms_switches_the_motors_off_and_the_device_is_asked_anew_when_all_is_quiet(link):
    host = link.opened()
    host.write(0.1, 0.1)
    host.hear(link.reply())
    host.due()
    assert host.idle(after=20 * MS) == b"" and host.state[codec.READY]
    assert host.write(0.1, 0.1, after=1) == link.OFF
    assert not host.state[codec.READY] and host.state[codec.LOST] == 1
    assert host.hear(link.reply(), after=10 * MS) == []  # it comes after all
    assert host.write(0.1, 0.1, after=20 * MS - 1) == b""
    assert host.write(0.1, 0.1, after=1) == link.anew(0.1, 0.1)
    host.hear(link.reply())
    assert host.state[codec.READY] and host.state[codec.SESSIONS] == 1
    assert host.write(0.1, 0.1) == link.request(0.1, 0.1)


@links
@given(st.data())
def test_random_bytes_never_end_in_a_sample_that_cannot_be(link, data):
    host = link.opened()
    for piece in data.draw(st.lists(link.PIECES, max_size=8)):
        host.write(0.1, 0.1, after=MS)
        samples = host.hear(piece)
        host.due(after=MS)
        for sample in samples + host.hear(piece[::-1] + link.reply((5, 5))):
            assert max(map(abs, sample.counts)) <= link.WIDEST and sample.counts[2] == 0


@links
@given(st.data(), st.lists(st.integers(0, 1000), max_size=12))
def test_where_the_stream_is_split_makes_no_difference(link, data, cuts):
    stream = b"".join(data.draw(st.lists(link.PIECES, max_size=8)))
    codec_host.hear_alike(link.opened(), link.opened(), stream, cuts)
