# SPDX-License-Identifier: Apache-2.0
"""Which of the other's samples driver and simulation accept, and that nothing else gets through."""

import math
import struct
from random import Random

import numpy as np
import pytest
from examples import few
from handle_samples import GAINS, HOME, Recording, handle
from hypothesis import given
from hypothesis import strategies as st

from fault_injection.flood import mutated
from haptic_device.config.parameters import EXCHANGE_METHODS
from haptic_device.control import exchange_samples as law
from haptic_device.control import records
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.realtime import clock, exchange_step, servo_loop
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.recording.layouts import JointLayout
from haptic_sim.exchange.endpoint import DEVICE_SILENCE_NS, ExchangeEndpoint

SESSION, SEQUENCE, PEER = 1234567.0, 500.0, 777.0
NOW = 10**12  # [ns]


class Driver:
    """The driver's side of the exchange with its memory, without any middleware."""

    silence = exchange_step.SILENCE

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

    refused = property(lambda self: self.watch[exchange_step.REFUSED :][: len(law.REFUSALS)].tolist())

    @property
    def heard(self):
        """All numbers of the newest sample that was accepted, if there is one."""
        if not self.mail.words.any():
            return np.zeros(0)
        tool = self.mail.get()[0]
        return np.concatenate([tool.position, tool.velocity, tool.effort, [tool.energy, tool.contact, tool.answered]])

    def message(self, number=SEQUENCE, session=PEER, position=(0.01, 0.02, 0.03), speed=0.2, first="x", **tail):
        entries = dict.fromkeys(TAIL, 0.0)
        entries |= {"layout_version": law.LAYOUT_VERSION, "session": session, "sequence": 9.0, "answered": number}
        entries |= {"answered_session": SESSION, "gains_hash": law.gains_hash(*GAINS), "energy": 0.5, "contact": 1.0}
        entries |= tail
        still, axes = [0.0] * len(TAIL), self.axes
        layout = JointLayout((first, *exchange_names(axes)[1:]))
        return layout.pack(
            5_000_000_007, [*position[:axes], *entries.values()], [*[speed] * axes, *still], [*[3.0] * axes, *still]
        )


class Simulation:
    """The simulation's side of the exchange, with a simulation that answers all alike."""

    silence = DEVICE_SILENCE_NS

    def __init__(self, axes=3):
        self.axes, self.end = axes, ExchangeEndpoint(Recording(), HOME)
        self.layout = JointLayout(exchange_names(axes))

    def hear(self, data, now=NOW):
        before = self.refused
        if self.end.answer([data], now) is not None:
            return law.ACCEPTED
        return int(np.flatnonzero(np.array(self.refused) - before)[0])

    refused = property(lambda self: [0, *self.end.refused.values()])

    @property
    def heard(self):
        asked = [[*one.position, *one.velocity, *one.gains, one.energy] for one in self.end.simulation.asked]
        return np.array(asked[-1] if asked else [])

    def message(self, number=SEQUENCE, session=PEER, **given):
        return handle(number, session, self.axes, **given)


def test_a_method_has_the_number_that_bags_have_of_it_and_one_that_is_no_more_has_a_name_still():
    assert law.METHODS == {"direct": 0, "pspm": 2, "local": 3} and tuple(law.METHODS) == EXCHANGE_METHODS
    assert [law.name_of(number) for number in (1, 2, 9)] == ["wave", "pspm", "number 9"]


SIDES = pytest.mark.parametrize("side", [Driver, Simulation])
ABOVE = math.nextafter(law.LIMIT, math.inf)
REFUSED = [
    ({"position": (math.nan, 0.0, 0.0)}, law.NOT_FINITE),
    ({"position": (0.0, ABOVE, 0.0)}, law.NOT_FINITE),
    ({"speed": -math.inf}, law.NOT_FINITE),
    ({"energy": math.nan}, law.NOT_FINITE),
    ({"stiffness": ABOVE}, law.NOT_FINITE),
    ({"rotational_damping": -1e-9}, law.NOT_FINITE),
    ({"session": 0.0}, law.NOT_FINITE),
    ({"session": math.nan}, law.NOT_FINITE),
    ({"sequence": -1.0}, law.NOT_FINITE),
    ({"layout_version": law.LAYOUT_VERSION + 1.0}, law.OTHER_LAYOUT),
    ({"exchange_method": 1.0}, law.OTHER_METHOD),
    ({"exchange_method": 99.0}, law.OTHER_METHOD),
    ({"gains_hash": math.nextafter(law.gains_hash(*GAINS), 0.0)}, law.OTHER_GAINS),
]
FOREIGN = [{"answered_session": SESSION + 1.0}, *({"answered": SEQUENCE + more} for more in (1.0, -0.5, -SEQUENCE))]
"""Answers to what this driver has not asked."""


@SIDES
def test_a_message_that_cannot_be_meant_is_refused_for_its_reason_and_moves_nothing(side):
    for change, verdict in REFUSED + [(change, law.NOT_MINE) for change in FOREIGN if side is Driver]:
        one = side()
        if "sequence" in change and side is Simulation:
            assert one.hear(one.message(-1.0)) == verdict
        else:
            assert one.hear(one.message(**change)) == verdict, change
        assert one.refused[verdict] == sum(one.refused) == 1
        assert one.heard.size == 0
        assert one.hear(one.message()) == law.ACCEPTED


@SIDES
def test_the_largest_numbers_are_accepted_and_the_padding_of_another_sender_does_not_matter(side):
    one, ends = side(), (law.LIMIT, -law.LIMIT, law.LIMIT)
    assert one.hear(one.message(490.0, position=ends, speed=-law.LIMIT)) == law.ACCEPTED
    data, layout = bytearray(one.message()), JointLayout(exchange_names(3))
    varying = set(range(4, 12)) | {offset + i for offset in layout.offsets for i in range(8 * layout.count)}
    padding = [i for i in range(len(data)) if not layout.fixed[i] and i not in varying]
    assert padding
    for i in padding:
        data[i] = 0xA5
    assert one.hear(bytes(data)) == law.ACCEPTED


@SIDES
def test_late_and_repeated_messages_are_refused_and_newer_ones_taken(side):
    one = side()
    verdicts = [one.hear(one.message(number)) for number in (490.0, 490.0, 489.0, 491.0, 500.0)]
    assert verdicts == [law.ACCEPTED, law.OLD, law.OLD, law.ACCEPTED, law.ACCEPTED]


@SIDES
def test_a_second_sender_is_heard_only_after_the_first_has_been_silent(side):
    one = side()
    assert one.hear(one.message(490.0)) == law.ACCEPTED
    other = one.message(495.0, PEER + 1.0)
    assert one.hear(other, NOW + one.silence - 1) == law.SECOND_SENDER
    assert one.hear(one.message(491.0), NOW + one.silence - 1) == law.ACCEPTED
    assert one.hear(other, NOW + 2 * one.silence - 2) == law.SECOND_SENDER
    assert one.hear(other, NOW + 2 * one.silence - 1) == law.ACCEPTED
    assert one.hear(one.message(496.0), NOW + 2 * one.silence) == law.SECOND_SENDER


@SIDES
@pytest.mark.parametrize("axes", [1, 3])
def test_foreign_bytes_names_and_sizes_are_refused(side, axes):
    one = side(axes)
    good = one.message()
    foreign = [b"", b"\0", good[:-1], good + b"\0", one.message(first="z"), b"\x00\x00" + good[2:], bytes(len(good))]
    foreign += [b"\xff" * 70_000] + ([side(2).message()] if side is Driver else [])
    for data in foreign:
        assert one.hear(data) == law.OTHER_NAMES
    assert one.refused[law.OTHER_NAMES] == sum(one.refused) == len(foreign)
    assert one.hear(good) == law.ACCEPTED


@few(20)
@given(st.integers(0, 2**32), st.sampled_from([1, 2, 3]), st.sampled_from([Driver, Simulation]))
def test_thousands_of_mutated_messages_let_nothing_through_that_breaks_a_limit(seed, axes, side):
    """500 in each example: bytes turned, blocks replaced, messages cut or grown, and numbers that are none."""
    one, accepted, dice = side(axes), 0, Random(seed)
    good, wild = one.message(), [math.nan, math.inf, -1.0, 0.5, 1.0000001e6, 1e300, 5e-324, 2.0**53]
    reals = [offset + 8 * i for offset in one.layout.offsets for i in range(one.layout.count)]
    for turn in range(500):
        data = bytearray(good)
        struct.pack_into("<d", data, dice.choice(reals), dice.choice(wild))
        if one.hear(bytes(data) if turn % 2 else mutated(good, dice), NOW + turn * one.silence) == law.ACCEPTED:
            assert np.isfinite(one.heard).all() and np.abs(one.heard[:9]).max() <= law.LIMIT
            accepted, one = accepted + 1, side(axes)  # for which all is new
    assert 0 < accepted < 400


def test_an_answer_becomes_the_tool_sample_that_counts():
    for axes in (1, 3):
        side = Driver(axes)
        side.state["sent"][0, int(SEQUENCE) % exchange_step.REMEMBERED] = 424242
        assert side.hear(side.message()) == law.ACCEPTED
        tool, rest = side.mail.get()[0], [0.0] * (3 - axes)
        assert tool.position.tolist() == [0.01, 0.02, 0.03][:axes] + rest
        assert tool.velocity.tolist() == [0.2] * axes + rest and tool.effort.tolist() == [3.0] * axes + rest
        assert (tool.session, tool.sequence, tool.answered, tool.sent) == (PEER, 9.0, SEQUENCE, 424242.0)
        assert (tool.contact, tool.energy, tool.handle_sequence) == (1.0, 0.5, SEQUENCE)
        assert side.watch[exchange_step.ANSWERED] == 1


def test_an_answer_to_a_sample_whose_time_is_forgotten_is_late():
    side = Driver(sequence=10_000.0)
    oldest = 10_000.0 - exchange_step.REMEMBERED
    assert side.hear(side.message(oldest)) == law.OLD
    assert side.hear(side.message(oldest + 1.0)) == law.ACCEPTED


@given(st.lists(st.floats(0.0, 1e5), min_size=4, max_size=4), st.integers(0, 3))
def test_gains_that_differ_have_another_hash_and_equal_ones_the_same(gains, which):
    assert law.gains_hash(*gains) == law.gains_hash(*gains)
    others = [gain + 0.25 * (i == which) for i, gain in enumerate(gains)]
    assert law.gains_hash(*others) != law.gains_hash(*gains)


def test_a_handle_sample_carries_port_session_gains_and_the_time_it_was_latched():
    side, row, scratch = Driver(sequence=0.0), np.zeros(1, records.TRACE_ROW), clock.scratch()
    side.gains["stiffness"], side.gains["damping"], side.gains["limit"] = 2000.0, 2.0, (15.0, 14.0, 1.0)
    latched, side.state["clock_offset"] = 5_000_000_000, 7_000_000_123
    row["deadline"], row["position"], row["velocity"] = latched, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    row["exchange_effort"], row["tool_sequence"] = (7.0, 8.0, 9.0), 41.0
    exchange_step.compose_handle(side.frame, side.state[0], row[0], side.gains[0], scratch)
    sample = side.layout.unpack(side.frame.outgoing.tobytes())
    assert side.layout.matches(side.frame.outgoing.tobytes())
    assert sample.position[:3].tolist() == [1.0, 2.0, 3.0] and sample.velocity[:3].tolist() == [4.0, 5.0, 6.0]
    assert sample.effort[:3].tolist() == [7.0, 8.0, 9.0]
    limits = dict(zip(TAIL, sample.effort[3:], strict=True))
    assert [limits[name] for name in ("stiffness", "damping", "rotational_stiffness")] == [15.0, 14.0, 1.0]
    assert sum(limits.values()) == 30.0  # of the others nothing is said
    tail = dict(zip(TAIL, sample.position[3:], strict=True))
    assert (tail["session"], tail["sequence"], tail["answered"]) == (SESSION, 1.0, 41.0)
    assert (tail["layout_version"], tail["stiffness"], tail["damping"]) == (law.LAYOUT_VERSION, 2000.0, 2.0)
    assert tail["gains_hash"] == side.gains["hash"][0]
    assert side.state["sent"][0, 1] == latched
    assert sample.stamp_ns == 12_000_000_123


def test_each_row_of_the_servo_is_sent_once_and_nothing_before_it_has_run():
    side, row, scratch = Driver(sequence=0.0), np.zeros(1, records.TRACE_ROW), clock.scratch()
    rows, gains = SeqLock(records.TRACE_ROW), SeqLock(law.COUPLING_GAINS)
    arguments = side.frame, side.state, rows.words, gains.words, row, side.gains, scratch
    assert not exchange_step.next_handle(*arguments)
    for sent, deadline in enumerate((1_000_000, 1_250_000), 1):
        row["deadline"] = deadline
        rows.put(row)
        assert exchange_step.next_handle(*arguments) and not exchange_step.next_handle(*arguments)
        assert side.state["sequence"][0] == sent
