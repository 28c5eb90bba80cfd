# SPDX-License-Identifier: Apache-2.0
"""Which tool samples the device's side of the exchange accepts, and that nothing else gets through."""

import math
import struct
from random import Random

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import exchange_samples as law
from haptic_device.control import records
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.realtime import clock, exchange_step, servo_loop
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.recording.layouts import JointLayout

SESSION, SEQUENCE, PEER, GAINS = 1234567.0, 500.0, 777.0, (2000.0, 2.0, 2.0, 0.002)
NOW, SILENCE = 10**12, exchange_step.SILENCE


class Side:
    """The driver's side of the exchange with its memory, without any middleware."""

    def __init__(self, axes=3, sequence=SEQUENCE):
        self.axes, self.layout = axes, JointLayout(exchange_names(axes))
        self.frame = exchange_step.make_frame(
            self.layout.template, self.layout.fixed, self.layout.offsets, self.layout.count
        )
        self.state, self.watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
        self.state["session"], self.state["sequence"], self.state["axes"] = SESSION, sequence, axes
        self.gains, self.tool = np.zeros(1, law.COUPLING_GAINS), np.zeros(1, servo_loop.TOOL)
        self.gains["hash"] = law.gains_hash(*GAINS)
        self.mail = SeqLock(servo_loop.TOOL)

    def hear(self, data, now=NOW):
        """Verdict on a message's bytes; as many as fit are copied, as the receiving loop does."""
        size = min(len(data), self.frame.incoming.size)
        self.frame.incoming[:size] = np.frombuffer(data, np.uint8, size)
        return exchange_step.take_in(
            self.frame, len(data), self.state[0], self.watch, self.gains[0], self.tool, self.mail.words, now
        )

    def refused(self):
        return {
            law.REFUSALS[i]: int(n) for i, n in enumerate(self.watch[exchange_step.REFUSED :][: len(law.REFUSALS)]) if n
        }

    def tool_message(self, position=(0.01, 0.02, 0.03), velocity=(0.1, 0.2, 0.3), effort=(1.0, 2.0, 3.0), **tail):
        entries = dict.fromkeys(TAIL, 0.0)
        entries |= {"layout_version": law.LAYOUT_VERSION, "session": PEER, "sequence": 9.0, "answered": SEQUENCE}
        entries |= {"answered_session": SESSION, "gains_hash": law.gains_hash(*GAINS), "energy": 0.5, "contact": 1.0}
        entries |= tail
        still = [0.0] * len(entries)
        arrays = (
            [*position[: self.axes], *entries.values()],
            [*velocity[: self.axes], *still],
            [*effort[: self.axes], *still],
        )
        return self.layout.pack(5_000_000_007, *arrays)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_an_answer_becomes_the_tool_sample_that_counts(axes):
    side = Side(axes)
    side.state["sent"][0, int(SEQUENCE) % exchange_step.REMEMBERED] = 424242
    assert side.hear(side.tool_message()) == law.ACCEPTED
    tool = side.mail.get()[0]
    assert tool.position[:axes].tolist() == [0.01, 0.02, 0.03][:axes] and tool.position[axes:].tolist() == [0.0] * (
        3 - axes
    )
    assert tool.velocity[:axes].tolist() == [0.1, 0.2, 0.3][:axes]
    assert tool.effort[:axes].tolist() == [1.0, 2.0, 3.0][:axes]
    assert (tool.session, tool.sequence, tool.answered, tool.sent) == (PEER, 9.0, SEQUENCE, 424242.0)
    assert (tool.contact, tool.energy, tool.handle_sequence) == (1.0, 0.5, SEQUENCE)
    assert side.watch[exchange_step.ANSWERED] == 1 and side.refused() == {}


ABOVE = math.nextafter(law.LIMIT, math.inf)
REFUSED = [
    ({"position": (math.nan, 0.0, 0.0)}, law.NOT_FINITE),
    ({"velocity": (0.0, math.inf, 0.0)}, law.NOT_FINITE),
    ({"effort": (0.0, 0.0, -math.inf)}, law.NOT_FINITE),
    ({"position": (0.0, ABOVE, 0.0)}, law.NOT_FINITE),
    ({"velocity": (0.0, 0.0, -ABOVE)}, law.NOT_FINITE),
    ({"energy": math.nan}, law.NOT_FINITE),
    ({"stiffness": ABOVE}, law.NOT_FINITE),
    ({"rotational_damping": -1e-9}, law.NOT_FINITE),
    ({"session": 0.0}, law.NOT_FINITE),
    ({"sequence": -1.0}, law.NOT_FINITE),
    ({"layout_version": law.LAYOUT_VERSION + 1.0}, law.OTHER_LAYOUT),
    ({"exchange_method": 1.0}, law.OTHER_METHOD),
    ({"answered_session": SESSION + 1.0}, law.NOT_MINE),
    ({"answered": SEQUENCE + 1.0}, law.NOT_MINE),
    ({"answered": 0.0}, law.NOT_MINE),
    ({"answered": SEQUENCE - 0.5}, law.NOT_MINE),
    ({"gains_hash": math.nextafter(law.gains_hash(*GAINS), 0.0)}, law.OTHER_GAINS),
]


@pytest.mark.parametrize(("change", "verdict"), REFUSED)
def test_a_message_that_cannot_be_an_answer_is_refused_for_its_reason_and_moves_nothing(change, verdict):
    side = Side()
    assert side.hear(side.tool_message(**change)) == verdict
    assert side.refused() == {law.REFUSALS[verdict]: 1}
    assert not side.mail.words.any()
    assert side.hear(side.tool_message()) == law.ACCEPTED


def test_the_largest_numbers_are_accepted():
    side = Side()
    ends = (law.LIMIT, -law.LIMIT, law.LIMIT)
    assert side.hear(side.tool_message(position=ends, velocity=ends, effort=ends)) == law.ACCEPTED


def test_late_and_repeated_answers_are_refused_and_newer_ones_taken():
    side = Side()
    verdicts = [side.hear(side.tool_message(answered=number)) for number in (490.0, 490.0, 489.0, 491.0, 500.0)]
    assert verdicts == [law.ACCEPTED, law.OLD, law.OLD, law.ACCEPTED, law.ACCEPTED]


def test_an_answer_to_a_sample_whose_time_is_forgotten_is_late():
    side = Side(sequence=10_000.0)
    oldest = 10_000.0 - exchange_step.REMEMBERED
    assert side.hear(side.tool_message(answered=oldest)) == law.OLD
    assert side.hear(side.tool_message(answered=oldest + 1.0)) == law.ACCEPTED


def test_a_second_simulation_is_heard_only_after_the_first_has_been_silent():
    side = Side()
    assert side.hear(side.tool_message(answered=490.0)) == law.ACCEPTED
    other = side.tool_message(session=PEER + 1.0, answered=495.0)
    assert side.hear(other, NOW + SILENCE - 1) == law.SECOND_SENDER
    assert side.hear(side.tool_message(answered=491.0), NOW + SILENCE - 1) == law.ACCEPTED
    assert side.hear(other, NOW + 2 * SILENCE - 2) == law.SECOND_SENDER
    assert side.hear(other, NOW + 2 * SILENCE - 1) == law.ACCEPTED
    assert side.hear(side.tool_message(answered=496.0), NOW + 2 * SILENCE) == law.SECOND_SENDER


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_foreign_bytes_names_and_sizes_are_refused(axes):
    side = Side(axes)
    good = side.tool_message()
    names = JointLayout(("z", *exchange_names(axes)[1:])).pack(0, *[[0.0] * side.layout.count] * 3)
    other = Side(axes % 3 + 1).tool_message()
    big_endian = b"\x00\x00" + good[2:]
    for data in (b"", b"\0", good[:-1], good + b"\0", names, other, big_endian, bytes(len(good)), b"\xff" * 70_000):
        assert side.hear(data) == law.OTHER_NAMES
    assert side.refused() == {"other axis names or size": 9}
    assert side.hear(good) == law.ACCEPTED


def test_the_padding_of_another_sender_does_not_matter():
    side = Side()
    data = bytearray(side.tool_message())
    varying = set(range(4, 12)) | {offset + i for offset in side.layout.offsets for i in range(8 * side.layout.count)}
    padding = [i for i in range(len(data)) if not side.layout.fixed[i] and i not in varying]
    assert padding
    for i in padding:
        data[i] = 0xA5
    assert side.hear(bytes(data)) == law.ACCEPTED


@given(st.lists(st.floats(0.0, 1e5), min_size=4, max_size=4), st.integers(0, 3))
def test_gains_that_differ_have_another_hash_and_equal_ones_the_same(gains, which):
    assert law.gains_hash(*gains) == law.gains_hash(*gains)
    others = [gain + 0.25 * (i == which) for i, gain in enumerate(gains)]
    assert law.gains_hash(*others) != law.gains_hash(*gains)


WILD = [math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 0.5, 1e6, 1.0000001e6, 1e15, 1e300, 5e-324, 2.0**53]


@few(30)
@given(st.integers(0, 2**32), st.sampled_from([1, 2, 3]))
def test_a_hundred_thousand_mutated_messages_let_nothing_through_that_breaks_a_limit(seed, axes):
    """1000 mutations in each of 100 examples: bytes flipped, numbers replaced, blocks moved, messages cut or joined."""
    side, random = Side(axes), Random(seed)
    good = side.tool_message()
    reals = [offset + 8 * i for offset in side.layout.offsets for i in range(side.layout.count)]
    for turn in range(1000):
        data = mutated(bytearray(good), reals, random)
        before = side.state["peer_answered"][0]
        if side.hear(bytes(data), NOW + turn * SILENCE) == law.ACCEPTED:
            tool = side.mail.get()[0]
            numbers = np.concatenate([tool.position, tool.velocity, tool.effort])
            assert np.all(np.abs(numbers) <= law.LIMIT) and np.all(numbers.reshape(3, 3)[:, axes:] == 0.0)
            assert math.isfinite(tool.energy) and math.isfinite(tool.contact) and tool.session >= 1.0
            assert before < tool.answered <= SEQUENCE and tool.answered == int(tool.answered)
            side.state["peer_answered"] = 0.0
    assert side.watch[exchange_step.ANSWERED] + sum(side.refused().values()) == 1000
    assert side.refused()


def mutated(data, reals, random):
    kind = random.randrange(5)
    if kind == 0:
        for _ in range(random.randrange(1, 4)):
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    elif kind == 1:
        struct.pack_into("<d", data, random.choice(reals), random.choice(WILD))
    elif kind == 2:
        struct.pack_into("<Q", data, random.choice(reals), random.getrandbits(64))
    elif kind == 3:
        one, other = random.choice(reals), random.choice(reals)
        data[one : one + 8], data[other : other + 8] = data[other : other + 8], data[one : one + 8]
    else:
        return data[: random.randrange(len(data))] + bytes(random.randrange(3))
    return data


def test_a_handle_sample_carries_port_session_gains_and_the_time_it_was_latched():
    side, row, scratch = Side(sequence=0.0), np.zeros(1, records.TRACE_ROW), clock.scratch()
    side.gains["stiffness"], side.gains["damping"] = 2000.0, 2.0
    latched, side.state["clock_offset"] = 5_000_000_000, 7_000_000_123
    row["deadline"], row["position"], row["velocity"] = latched, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    row["exchange_effort"], row["tool_sequence"] = (7.0, 8.0, 9.0), 41.0
    exchange_step.compose_handle(side.frame, side.state[0], row[0], side.gains[0], scratch)
    sample = side.layout.unpack(side.frame.outgoing.tobytes())
    assert side.layout.matches(side.frame.outgoing.tobytes())
    assert sample.position[:3].tolist() == [1.0, 2.0, 3.0] and sample.velocity[:3].tolist() == [4.0, 5.0, 6.0]
    assert sample.effort[:3].tolist() == [7.0, 8.0, 9.0]
    tail = dict(zip(TAIL, sample.position[3:], strict=True))
    assert (tail["session"], tail["sequence"], tail["answered"]) == (SESSION, 1.0, 41.0)
    assert (tail["layout_version"], tail["stiffness"], tail["damping"]) == (law.LAYOUT_VERSION, 2000.0, 2.0)
    assert tail["gains_hash"] == side.gains["hash"][0]
    assert side.state["sent"][0, 1] == latched
    assert sample.stamp_ns == 12_000_000_123


def test_each_row_of_the_servo_is_sent_once_and_nothing_before_it_has_run():
    side, row, scratch = Side(sequence=0.0), np.zeros(1, records.TRACE_ROW), clock.scratch()
    rows, gains = SeqLock(records.TRACE_ROW), SeqLock(law.COUPLING_GAINS)
    arguments = side.frame, side.state, rows.words, gains.words, row, side.gains, scratch
    assert not exchange_step.next_handle(*arguments)
    for sent, deadline in enumerate((1_000_000, 1_250_000), 1):
        row["deadline"] = deadline
        rows.put(row)
        assert exchange_step.next_handle(*arguments) and not exchange_step.next_handle(*arguments)
        assert side.state["sequence"][0] == sent
