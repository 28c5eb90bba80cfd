# SPDX-License-Identifier: Apache-2.0
"""The link to a Haply 2DIY: its bytes, who waits for whom, and that nothing on the line leaves the motors on."""

import math
import struct

import codec_host
import numpy as np
import pytest
from codec_host import MS, Host
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from haptic_device.config.description import load_device
from haptic_device.link import codec, haply

ZERO = bytes.fromhex("02050000000000000000")
SETUPS = {
    3: "01 05 03 01 01 03 01 01 00 00 00 00 40 41 00 80 98 45 00 00 28 43 00 80 98 45",
    2: "01 05 03 00 01 03 00 01 00 00 00 00 74 c2 00 00 28 46 00 00 71 43 00 00 28 46",
}
RESOLUTIONS = {3: 4880, 2: 10752}
RESET = bytes(2)
COUNTS = 2277, 163  # of the rest pose of generation 3


def made(generation=3, motor_limit=1000.0, motor_constant=1.0):
    options = haply.Options(port="/dev/none", generation=generation)
    return haply.codec(options, codec_host.five_bars(motor_limit, motor_constant))


def request(first, second):
    """The frame with these torques of motors 1 and 2 [N m]."""
    return struct.pack("<BBff", 2, 5, second, first)


def reply(counts=COUNTS, resolution=4880):
    """The answer of a board with these counts of joints 1 and 2."""
    return struct.pack("<Bff", 5, *(np.float32(360.0 / resolution) * np.float32(count) for count in reversed(counts)))


def opened(**given):
    """A host that has set its board up, to which it has answered."""
    host = Host(made(**given))
    host.open()
    host.idle(after=20 * MS)
    assert host.idle(after=20 * MS) == ZERO
    assert host.hear(reply(), after=MS) == [] and host.state[codec.READY]
    return host


@pytest.mark.parametrize("generation", [2, 3])
def test_the_board_is_reset_set_up_and_asked_with_no_torque_each_when_the_one_before_had_time(generation):
    host = Host(made(generation))
    assert host.idle() == host.due() == host.write(0.1, 0.1) == host.cut() == b""
    assert host.open() == RESET
    assert host.hear(reply() + b"x") == []  # what it says before it is asked is nothing
    assert host.idle(after=20 * MS - 1) == b""
    assert host.idle(after=1) == bytes.fromhex(SETUPS[generation])
    assert host.hear(b"y") == [] and host.write(0.1, 0.1, after=20 * MS - 1) == b""
    assert host.idle(after=1) == ZERO and not host.state[codec.READY]
    assert host.hear(reply()) == []
    assert host.state[codec.READY] and host.state[codec.SESSIONS] == 1 and host.state[codec.REFUSED] == 0


def turn(host, *torques, counts=COUNTS, **how):
    """A command that is answered, and its deadline; what was sent, and the sample."""
    sent = host.write(*torques, **how)
    host.hear(reply())
    host.due(after=MS)
    (sample,) = host.hear(reply(counts))
    return sent, sample


@pytest.mark.parametrize("known", [(-1000, 321), (2277, -5), (-14640, 14639)])
def test_a_board_that_does_not_answer_then_either_is_set_up_with_the_angles_known_last_and_says_so(known):
    host = opened()
    turn(host, 0.1, 0.1, counts=known)
    assert host.write(0.1, 0.1)
    assert host.idle(after=20 * MS + 1) == host.idle(after=20 * MS) == host.idle(after=20 * MS + 1) == ZERO
    assert host.idle(after=1100 * MS - 1) == b""
    assert host.idle(after=1) == RESET
    setup = host.idle(after=20 * MS)
    assert setup[:10] == bytes.fromhex(SETUPS[3])[:10]
    second, resolution, first, same = struct.unpack("<ffff", setup[10:])
    assert resolution == same == 4880
    for counts in (math.trunc, round):  # either way that a board may take an angle
        assert (counts(first * 4880 / 360), counts(second * 4880 / 360)) == known
    assert host.idle(after=20 * MS) == ZERO
    host.hear(reply(known))
    assert host.state[codec.SESSIONS] == 2
    for engaged, torques in ((1, (0.1, 0.1)), (1, (0.0, 0.0)), (0, (0.1, 0.0))):
        sent, sample = turn(host, *torques, engaged=engaged)
        assert (sent, sample.status) == (ZERO, 32)
    assert host.write(0.0, 0.0, engaged=0) == ZERO
    host.hear(reply())
    sent, sample = turn(host, 0.1, 0.1)
    assert (sent, sample.status) == (request(0.1, 0.1), 0)


def test_an_answer_that_makes_no_sense_is_refused_and_switches_the_motors_off_and_the_widest_that_does_is_taken():
    for wrong in (
        b"\x04" + reply()[1:],  # of another board
        struct.pack("<Bff", 5, math.nan, 12.0),
        struct.pack("<Bff", 5, 168.0, -math.inf),
        struct.pack("<Bff", 5, 12.0, np.nextafter(np.float32(1e5), np.float32(2e5))),
    ):
        host = opened()
        host.write(0.1, 0.1)
        host.hear(reply())
        host.due()
        assert host.hear(wrong + reply()) == []
        assert host.state[codec.REFUSED] == 1 and not host.state[codec.READY] and host.state[codec.LOST] == 1
        assert host.write(0.1, 0.1) == ZERO
        assert host.write(0.1, 0.1, after=20 * MS) == ZERO
        host.hear(reply())
        assert host.state[codec.READY]
    host.idle(after=20 * MS + 1)
    (sample,) = host.hear(struct.pack("<Bff", 5, -1e5, 1e5))
    assert sample.counts == (round(1e5 * 4880 / 360), -round(1e5 * 4880 / 360), 0)


def test_cut_is_zero_torque_at_any_moment_after_the_line_was_opened():
    host = Host(made())
    setup = bytes.fromhex(SETUPS[3])
    host.open()
    assert host.cut() == setup + ZERO  # a motor that somebody left on is not the board's before it is set up
    assert host.cut(after=MS) == ZERO
    host.hear(reply())
    assert host.idle(after=20 * MS) == ZERO
    host.hear(reply())
    host.write(0.1, 0.1)
    host.idle(after=20 * MS + 1)
    assert host.cut(after=10 * MS) == ZERO
    assert host.idle(after=20 * MS - 1) == b""  # its answer has to be over too
    assert host.idle(after=1) == ZERO


@given(st.integers(1, 8), st.binary(min_size=8, max_size=8))
def test_the_frame_of_zero_torque_completes_no_frame_to_a_torque_that_moves_anything(missing, torques):
    got = torques[: 8 - missing] + ZERO[:missing]
    for at, value in zip((0, 4), struct.unpack("<ff", got), strict=True):
        whole = 8 - missing >= at + 4
        assert whole or abs(value) < 1e-30


@pytest.mark.parametrize("generation", [2, 3])
@given(st.data())
def test_counts_are_exact_within_three_turns(generation, data):
    resolution = RESOLUTIONS[generation]
    far = st.integers(-3 * resolution, 3 * resolution)
    counts = data.draw(far), data.draw(far)
    host = opened(generation=generation)
    host.idle(after=20 * MS + 1)
    (sample,) = host.hear(reply(counts, resolution))
    assert sample.counts == (*counts, 0)


def test_delay_is_from_the_servos_write_to_the_answer_on_average_to_half_the_round_trip_and_the_worst_stays():
    host = opened()
    for trip in [300_000] * 20 + [900_000] + [300_000] * 20:
        host.write(0.0, 0.0)
        host.hear(reply(), after=trip)
    assert host.state[codec.DELAY] == 900_000 and host.state[codec.ROUND_TRIP] == 300_000
    assert 150_000 <= host.state[codec.DELAY_MEAN] < 160_000 and host.state[codec.CLOCK_ERROR] == 150_000
    host.due()
    host.write(0.01, 0.01)  # cannot be sent yet
    host.hear(reply(), after=MS)
    host.idle(after=MS)
    host.hear(reply(), after=2 * MS)
    assert host.state[codec.DELAY] == 4 * MS
    for _ in range(255):
        host.write(0.0, 0.0)
        host.hear(reply(), after=300_000)
    assert host.state[codec.DELAY] == 300_000


def test_a_device_that_is_not_five_bars_and_options_that_are_none_are_refused():
    for device, told in (
        (codec_host.device(2), "kinematics is cartesian, axes are x, y"),
        (load_device("serial_2r"), "kinematics is serial_2r, axes are x, y"),
        (codec_host.five_bars(theta=True), "kinematics is five_bar, axes are x, y, theta"),
    ):
        with pytest.raises(ValueError, match=f"^{told}; a Haply 2DIY is a five_bar with x and y$"):
            haply.codec(haply.Options(port="/dev/none"), device)
    for options in ({}, {"port": ""}, {"port": "a", "generation": 1}, {"port": "a", "speed": 3}):
        with pytest.raises(ValidationError):
            haply.Options(**options)


@pytest.mark.parametrize("generation, rest", [(2, (241.0, -61.0)), (3, (168.0, 12.0))])
def test_the_described_device_lies_at_rest_within_its_joints_limits_and_its_motors_stand_what_it_says(generation, rest):
    options, device = codec_host.described(f"haply_2diy_gen{generation}", haply, generation=generation)
    assert haply.codec(options, device).asks
    for joint, angle in zip(device.joints, rest, strict=True):
        count = round(angle * RESOLUTIONS[generation] / 360.0)
        at = joint.zero + joint.encoder_sign * count * joint.step
        assert at == pytest.approx(math.radians(angle), abs=1e-3) and joint.limits[0] < at < joint.limits[1]
        assert joint.limit == haply.TORQUE_LIMIT
    assert device.kinematics.pose(*map(math.radians, rest))[6] > 0.1  # far from singular
