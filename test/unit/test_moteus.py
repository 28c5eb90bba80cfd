# SPDX-License-Identifier: Apache-2.0
"""The link to moteus drives: its lines, what a drive's answer is worth, and that the last torque is none."""

import math
import struct

import codec_host
import pytest
from codec_host import MS, Host
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from haptic_device.config.description import load_device
from haptic_device.control import passivity
from haptic_device.link import codec, moteus

QUERY = bytes.fromhex("1100 1901 120e".replace(" ", ""))
STOP = bytes.fromhex("010000")


def made(ids=(1,), motor_limit=2.0, motor_constant=1.0, watchdog=0.1):
    options = moteus.Options(port="/dev/none", ids=ids, watchdog=watchdog)
    return moteus.codec(options, codec_host.device(len(ids), motor_limit, motor_constant))


def line(address, data, length):
    """What sends these bytes, filled up to this length."""
    return b"can send %04x %s BF\n" % (address, data.ljust(length, b"\x50").hex().upper().encode())


def torque(value, most=2.0, watchdog=0.1):
    """Position mode, no position, velocity 0, this torque, no gains, the most torque, the time limit."""
    nowhere = bytes.fromhex("0000c07f")
    target = nowhere + struct.pack("<fffff", 0.0, value, 0.0, 0.0, most)
    return bytes([0x01, 0x00, 10, 0x0C, 6, 0x20]) + target + bytes([0x0D, 0x27]) + struct.pack("<f", watchdog)


def request(value, name=1, **given):
    return line(0x8000 | name, torque(value, **given) + QUERY, 48)


def look(name=1):
    return line(0x8000 | name, QUERY, 6)


def no_torque(name=1, **given):
    return line(name, torque(0.0, **given), 48)


def reply(place=0, mode=10, temperature=25, fault=0, name=1):
    """The adapter's and a drive's lines after a request."""
    data = struct.pack("<BBbBBiBBbb", 0x21, 0, mode, 0x29, 1, place, 0x22, 0x0E, temperature, fault)
    return b"OK\r\n" + heard(data, name)


def heard(data, name=1):
    return b"rcv %x %s E B F\r\n" % (name << 8, data.ljust(16, b"\x50").hex().upper().encode())


def opened(**given):
    host = Host(made(**given))
    host.open()
    for name in given.get("ids", (1,)):
        host.hear(reply(name=name, mode=0))
    assert host.state[codec.READY]
    return host


def test_a_new_line_is_begun_by_ending_the_old_one_and_drives_are_left_as_they_are_until_a_command_comes():
    host = Host(made())
    assert host.idle() == host.due() == host.write(1.0) == host.cut() == b""
    assert host.open() == b"\n" + look()
    assert not host.state[codec.READY] and host.state[codec.SESSIONS] == 0
    (sample,) = host.hear(reply(7, mode=0), after=MS)
    assert sample == (host.now - MS // 2, 0, (7, 0, 0), 0)
    assert host.state[codec.READY] and host.state[codec.SESSIONS] == 1 and host.state[codec.REFUSED] == 0
    assert host.state[codec.AXES] == 1 and host.state[codec.WATCHDOG] == 100 * MS
    assert host.idle(after=20 * MS) == look()


def test_each_axis_has_its_drive_and_the_sample_is_there_when_all_have_answered_in_whatever_order():
    host = opened(ids=(3, 126, 1), watchdog=0.5)
    given = {"watchdog": 0.5}
    lines = [request(value, name, **given) for value, name in ((0.5, 3), (-0.25, 126), (1.0, 1))]
    assert host.write(0.5, -0.25, 1.0) == b"".join(lines)
    assert host.hear(reply(name=1) + reply(name=3) + reply(name=126)) == []
    host.due(after=MS)
    assert host.hear(reply(11, name=126) + reply(22, name=3)) == []
    assert [sample.counts for sample in host.hear(reply(33, name=1))] == [(22, 11, 33)]
    assert host.cut() == b"".join(no_torque(name, **given) for name in (3, 126, 1))


@pytest.mark.parametrize(
    "mode, fault, status",
    [(0, 0, 0), (10, 0, 0), (10, 99, 0), (11, 0, 2), (1, 38, 8), (1, 35, 32), (1, 42, 32), (1, 43, 32), (1, 34, 2)],
)
def test_status_is_of_the_drives_mode_and_fault(mode, fault, status):
    host = opened(ids=(1, 2))
    host.write(0.0, 0.0)
    host.hear(reply() + reply(name=2))
    host.due()
    (sample,) = host.hear(reply() + reply(mode=mode, fault=fault, name=2))
    assert sample.status == status


@pytest.mark.parametrize("mode", [1, 11])
def test_a_drive_that_gave_up_is_stopped_only_by_a_command_that_is_not_engaged_and_wants_no_torque(mode):
    host = opened()
    host.write(1.0)
    host.hear(reply(mode=mode))
    for engaged, value in ((1, 1.0), (1, 0.0), (0, 1.0)):
        assert host.write(value, engaged=engaged) == request(value)
        host.hear(reply(mode=mode))
    assert host.write(math.nan, engaged=0) == request(0.0)
    host.hear(reply(mode=mode))
    assert host.write(0.0, engaged=0) == line(0x8001, STOP + QUERY, 12)
    host.hear(reply(mode=0))
    assert host.write(0.0, engaged=0) == request(0.0)
    assert host.cut() == no_torque()


def watched(host):
    """The host, which has just asked its drives because no command came."""
    host.idle(after=20 * MS + 1)
    return host


@given(st.integers(-(2**31) + 1, 2**31 - 1))
def test_counts_are_the_positions_that_drives_tell(place):
    assert [sample.counts for sample in watched(opened()).hear(reply(place))] == [(place, 0, 0)]


PLACE, IN_MODE = struct.pack("<BBi", 0x29, 1, 5), struct.pack("<BBb", 0x21, 0, 10)
WHOLE = IN_MODE + PLACE
BAD_LINES = {
    "error": b"ERR unknown command\r\n",
    "another drive": heard(WHOLE, name=2),
    "for another host": b"rcv 101 %s E B F\r\n" % WHOLE.hex().encode(),
    "address too long": b"rcv 000000100 %s\r\n" % WHOLE.hex().encode(),
    "half a byte": b"rcv 100 %s5\r\n" % WHOLE.hex().encode(),
    "no digit": b"rcv 100 %sG0\r\n" % WHOLE.hex().encode(),
    "too long": b"rcv 100 %s\r\n" % (WHOLE + bytes(64)).hex().encode(),
    "no mode": heard(PLACE),
    "no position": heard(IN_MODE),
    "unknown position": heard(IN_MODE + struct.pack("<BBi", 0x29, 1, -(2**31))),
    "position as float": heard(IN_MODE + struct.pack("<BBf", 0x2D, 1, math.nan)),
    "read error": heard(bytes([0x31, 1, 2])),
    "cut short": b"rcv 100 %s\r\n" % WHOLE[:-1].hex().encode(),
    "long line": b"x" * 257 + b"\n",
}


def test_a_line_that_is_no_answer_is_refused_and_the_answer_after_it_is_taken():
    for what, data in BAD_LINES.items():
        host = watched(opened())
        assert host.hear(data) == [] and host.state[codec.REFUSED] == 1, what
        assert [sample.counts for sample in host.hear(reply(5))] == [(5, 0, 0)], what
        assert host.state[codec.REFUSED] == 1, what


def test_a_line_may_be_256_bytes_long_and_what_follows_in_a_longer_one_is_no_line_of_its_own():
    for length, taken in ((256, True), (257, False)):
        host = watched(opened())
        assert host.hear(heard(WHOLE).strip().ljust(length, b"x")) == []
        assert bool(host.hear(b"\n")) == taken
    host.hear(b"x" * 300)
    assert host.hear(heard(WHOLE)) == [] and host.state[codec.REFUSED] == 2
    assert [sample.counts for sample in host.hear(reply(5))] == [(5, 0, 0)]


def test_a_device_whose_axes_have_not_each_a_drive_is_refused_in_a_sentence():
    options = moteus.Options(port="/dev/none", ids=(1, 2))
    with pytest.raises(ValueError, match="^ids are 2; the device has 1 axes, each with a drive of its own$"):
        moteus.codec(options, codec_host.device(1))
    twice = moteus.Options(port="/dev/none", ids=(7, 7))
    with pytest.raises(ValueError, match="^ids are 7, 7; each drive has its own id$"):
        moteus.codec(twice, codec_host.device(2))


def test_options_out_of_bounds_are_refused_and_those_within_are_taken():
    whole = {"port": "/dev/none", "ids": (1,)}
    ids = ((0,), (1,)), ((127,), (126,)), ((), (1,)), ((1, 2, 3, 4), (1, 2, 3))
    watchdogs = (0.019, 0.02), (1.001, 1.0), (math.nan, 0.1)
    for key, bad, good in [*(("ids", *pair) for pair in ids), *(("watchdog", *pair) for pair in watchdogs)]:
        assert getattr(moteus.Options(**whole | {key: good}), key) == good
        with pytest.raises(ValidationError):
            moteus.Options(**whole | {key: bad})


def test_drives_of_a_linkage_give_what_its_joints_stand():
    one, two = (codec_host.five_bars(0.3, constant) for constant in (1.0, 2.0))
    for device, most in ((load_device("hapkit"), [0.025]), (one, [0.3, 0.3]), (two, [0.15, 0.15])):
        made = moteus.codec(moteus.Options(port="/dev/none", ids=tuple(range(1, len(most) + 1))), device)
        assert made.state.view(float)[moteus.LIMITS : moteus.LIMITS + len(most)].tolist() == most


def test_the_described_knob_carries_the_drivers_own_coupling_at_1_khz_with_1_ms_of_delay():
    options, device = codec_host.described("moteus_knob", moteus)
    assert moteus.codec(options, device).asks
    (axis,) = device.axes
    assert axis.counts_per_unit * 2 * math.pi * 0.05 == pytest.approx(100_000)
    assert passivity.least_damping(1000.0, 1.0, 1e-3, 1e-3, 1e-3) < axis.damping
