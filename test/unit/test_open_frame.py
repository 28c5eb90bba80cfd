# SPDX-License-Identifier: Apache-2.0
"""The host's side of the link protocol against a device that is written from its page."""

import math
import struct

import link_device
import link_frames as page
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from link_device import MS, Device, Host, acquainted, sample
from link_frames import COMMAND, HELLO, LENGTHS, PAYLOADS, SAMPLE, TRUTH, pack, stuffed, unpack, unstuffed

from haptic_device.device import simulated_device
from haptic_device.link import codec, open_serial, open_state, open_udp

BEGIN = 5_000_000 * MS
AHEAD = 10**15 + 7


def hosts():
    return Host(open_udp.codec(None, None))


def begun():
    """A host that has said hello, and its session."""
    host = hosts()
    return host, unpack(host.say(codec.OPENED, BEGIN)).session


def greeting(session, sequence=1, **told):
    return pack(page.GREETING, session, sequence, *link_device.greeting(**told))


def ready(**told):
    """A host and a device that have met, and what time it is."""
    host, device = hosts(), Device(AHEAD, **told)
    return host, device, acquainted(host, device, BEGIN)


def refuses(host, data, now):
    """Whether the host counts this as refused, tells nothing of it, and is otherwise as it was before, but for what it
    proves of the device's clock."""
    before = host.state.copy()
    before[codec.REFUSED] += 1
    nothing, proved = host.hear(data, now) is None, [codec.CLOCK_STEPPED, codec.CLOCK_STEPPED_AT]
    before[proved] = host.state[proved]
    return nothing and (host.state == before).all()


def asked(host, device, now):
    """A command on its way; what answers it, and the deadline in the device's clock."""
    frame = unpack(host.write(now, now + MS))
    return {"answers": frame.sequence}, frame.payload[0]


def answered(host, frame, now):
    """Whether this tells a sample."""
    answer = host.hear(frame, now)
    return answer is not None and answer[codec.KIND] == codec.SAMPLE


def exchanged(host, device, now):
    """A command and its sample; the answer, and the deadline."""
    deadline = now + MS
    device.hear(host.write(now, deadline, (0.1, 0.2, 0.0)), now + 30_000)
    told = [host.hear(reply, deadline + 100_000) for reply in device.run(deadline)]
    return [answer for answer in told if answer is not None][0], deadline


# the session


def test_hello_is_said_each_50_ms_in_a_session_of_its_own_until_the_device_greets():
    host, other = hosts(), hosts()
    sessions = {unpack(other.say(codec.IDLE, BEGIN)).session}  # a first look begins one too
    for _ in range(100):
        kind, flags, session, sequence, answers, payload = unpack(host.say(codec.OPENED, BEGIN))
        assert (kind, flags, sequence, answers, payload) == (HELLO, 0, 1, 0, ())
        sessions.add(session)
    assert len(sessions) == 101 and 0 not in sessions
    said = [(i * 5, host.say(codec.IDLE, BEGIN + i * 5 * MS)) for i in range(1, 41)]
    assert [time for time, data in said if data] == [50, 100, 150, 200]
    assert [unpack(data)[2:4] for _, data in said if data] == [(session, i) for i in (2, 3, 4, 5)]
    assert not host.write(BEGIN, BEGIN + MS) and not host.write(BEGIN, BEGIN + MS, event=codec.CUT)
    early = BEGIN + 200 * MS + 47_500_000  # half of what lies between two looks
    assert not host.say(codec.IDLE, early - 1) and host.say(codec.IDLE, early)


def test_what_the_device_says_of_itself_is_told_until_the_line_is_opened_anew():
    host, device, _ = ready(axes=3, bits=16, features=1, least=200_000, watchdog=20 * MS)
    words = codec.AXES, codec.FIRMWARE, codec.PERIOD_LEAST, codec.WATCHDOG, codec.SIMULATED, codec.READY
    assert [host.state[word] for word in words] == [3, 0x010203, 200_000, 20 * MS, 1, 1]
    assert host.state[codec.SESSIONS] == 1
    host.say(codec.OPENED, BEGIN)
    assert [host.state[word] for word in words] == [0] * 6


def test_a_greeting_of_nonsense_or_of_another_session_is_refused_and_one_within_the_bounds_taken():
    for wrong, right in (
        ({"axes": 0}, {"axes": 1}),
        ({"axes": 4}, {"axes": 3}),
        ({"bits": 24}, {"bits": 16}),
        ({"least": 0}, {"least": 1}),
        ({"least": 10 * MS + 1}, {"least": 10 * MS}),
        ({"watchdog": 0}, {"watchdog": 1}),
        ({"counts": (math.nan, 1, 1)}, {"counts": (0, 0, 0)}),
        ({"counts": (1, -1, 1)}, {"counts": (1, 1, 1)}),
        ({"largest": (1, math.inf, 1)}, {"largest": (1, 1e30, 1)}),
    ):
        host, session = begun()
        assert refuses(host, greeting(session, **wrong), BEGIN), wrong
        assert refuses(host, greeting(session ^ 1), BEGIN)
        host.hear(greeting(session, **right), BEGIN)
        assert (host.state[codec.REFUSED], host.state[codec.SESSIONS]) == (2, 1)


def test_a_frame_that_comes_twice_or_late_or_is_of_another_version_or_what_hosts_say_is_refused():
    host, device, now = ready(features=1)
    late, frame = truth(device, now), truth(device, now)
    assert host.hear(frame, now) is not None
    assert refuses(host, frame, now) and refuses(host, late, now)
    for kind in PAYLOADS:
        payload = struct.unpack(PAYLOADS[kind], bytes(LENGTHS[kind] - 20))
        version = 2 if kind in (page.GREETING, SAMPLE, page.CLOCK_ANSWER, TRUTH) else 1
        assert refuses(host, pack(kind, device.session, 2**30, *payload, version=version), now), kind


# commands


def test_a_command_has_the_deadline_in_the_clock_of_the_device_and_the_next_sequence():
    host, device, now = ready()
    kind, flags, session, sequence, answers, payload = unpack(host.write(now, now + MS, (0.25, -0.5, 0.75), 500_000))
    assert (kind, flags, session, answers) == (COMMAND, 1, device.session, 0)
    assert abs(payload[0] - device.clock(now + MS)) <= 1000
    assert payload[1:] == (500_000, 0.25, -0.5, 0.0)  # of two axes
    assert host.say(codec.DUE, now + MS) == b""  # a deadline asks for nothing
    following = [unpack(host.write(now, now + MS, engaged=0)) for _ in range(3)]
    assert [frame[1:4:2] for frame in following] == [(0, sequence + i) for i in (1, 2, 3)]
    for wrong in (math.nan, math.inf, -math.inf, 1e39):  # no float: none of them acts
        assert unpack(host.write(now, now + MS, (1.0, wrong, 0.0))).payload[2:] == (0, 0, 0)
    assert unpack(host.write(now, now + MS, (1.0, 3e38, 0.0))).payload[2:] == (1.0, np.float32(3e38), 0)


def test_a_cut_is_a_command_without_motor_and_not_engaged_of_a_period_that_the_device_takes():
    for written, told in ((None, 2 * MS), (MS, 2 * MS), (3 * MS, 3 * MS), (11 * MS, 10 * MS)):
        host, device, now = ready(least=2 * MS)
        if written:
            host.write(now, now + written, (1.0, 1.0, 1.0), written)
        kind, flags, _, _, _, payload = unpack(host.say(codec.CUT, now))
        assert (kind, flags, *payload[1:]) == (COMMAND, 0, told, 0, 0, 0)
        assert abs(payload[0] - device.clock(now + told)) <= 1000


# samples


@pytest.mark.parametrize("late", [0, 700_000])
def test_a_sample_is_of_its_deadline_and_as_late_as_it_says_and_all_that_it_has_is_told(late):
    host, device, now = ready()
    header, deadline = asked(host, device, now)
    assert host.state[codec.TEMPERATURE] == codec.NO_TEMPERATURE
    content = sample(deadline, deadline + late, 0, (5, -7, 9), -125, (0.5, -1.5, 2.0))
    answer = host.hear(device.frame(SAMPLE, content, flags=2 | 4 | 8 | 16 | 32 | 128, **header), now + 2 * MS)
    told = [answer[word] for word in (codec.KIND, codec.DEADLINE, codec.LATCHED, codec.STATUS)]
    assert told == [codec.SAMPLE, now + MS, now + MS + late, 190]
    assert list(answer[codec.COUNTS : codec.COUNTS + 3]) == [5, -7, 0]  # of two axes
    assert list(answer.view(np.float64)[codec.DRAG : codec.DRAG + 3]) == [0.5, -1.5, 2.0]
    assert host.state[codec.TEMPERATURE] == -125


def test_a_sample_that_does_not_echo_what_was_announced_or_cannot_be_is_refused_and_leaves_all_as_it_was():
    host, device, now = ready(bits=16)
    host.say(codec.IDLE, now + 20 * MS)
    header, deadline = asked(host, device, now)
    answers = header["answers"]
    for echo, latched, answer, wrong in (
        (deadline + 1, deadline + 1, answers, {}),  # not the deadline that was sent
        (deadline, deadline - 1, answers, {}),  # latched before it
        (deadline, deadline, answers + 1, {}),  # answers what was not asked
        (deadline, deadline, answers - 1, {}),  # answers a question for the clock
        (0, 0, answers - 1, {}),
        (deadline, deadline + MS + 1, answers, {}),  # has not been yet
        (deadline, deadline + 20 * MS, answers, {}),
        (-(2**63), 2**63 - 1, answers, {}),
        (2**63 - 1, -(2**63), 0, {}),
        (deadline + 100 * MS, deadline + 100 * MS, 0, {}),
        (deadline - 2_000 * MS, deadline - 2_000 * MS, 0, {}),
        (deadline, deadline, answers, {"drag": (math.inf, math.nan, 0)}),
        (deadline, deadline, answers, {"drag": (3e38, 0, 0)}),
        (deadline, deadline, answers, {"drag": (0, -1000.1, 0)}),
        (deadline, deadline, answers, {"counts": (2**15, 0, 0)}),  # of 16 bits
    ):
        frame = device.frame(SAMPLE, sample(echo, latched, **wrong), answers=answer)
        assert refuses(host, frame, now + 2 * MS), (echo, latched, answer, wrong)
    right = {"counts": (2**15 - 1, -(2**15), 0), "drag": (1000, 0, 0)}
    told = host.hear(device.frame(SAMPLE, sample(deadline, deadline + MS, **right), **header), now + 2 * MS)
    assert told[codec.LATCHED] == now + 2 * MS
    assert host.state[codec.DELAY] == 0  # the device has applied nothing yet
    again = device.frame(SAMPLE, sample(deadline, deadline + MS, **right), **header)
    assert refuses(host, again, now + 2 * MS)  # a second sample of one deadline


def test_a_sample_that_is_not_newer_than_the_one_before_is_dropped_and_none_is_moved():
    host, device, now = ready()
    first, deadline = asked(host, device, now)
    second, later = asked(host, device, now + MS)
    for header, echo, sampled, told in (
        (first, deadline, deadline + 2 * MS, now + 3 * MS),
        (second, later, later + MS, None),
        (second, later, later + MS, None),
    ):
        answer = host.hear(device.frame(SAMPLE, sample(echo, sampled), **header), now + 4 * MS)
        assert (None if answer is None else answer[codec.LATCHED]) == told
    assert host.state[codec.REFUSED] == 1 and host.state[codec.LOST] == 0
    answer, deadline = exchanged(host, device, now + 5 * MS)
    assert answer[codec.LATCHED] == answer[codec.DEADLINE] == deadline


@pytest.mark.parametrize("step", [200_000, -5 * MS, 1000 * MS, -1000 * MS])
def test_a_sample_that_the_clock_as_it_is_known_cannot_have_made_tells_that_it_was_set(step):
    host, device, now = ready()
    for i in range(1, 3):
        time = device.clock(now + i * MS)
        host.hear(device.frame(SAMPLE, sample(time, time)), now + i * MS + 30_000)
        assert host.answer[codec.STATUS] == 0
    device.ahead += step
    time = device.clock(now + 3 * MS)
    assert host.hear(device.frame(SAMPLE, sample(time, time)), now + 3 * MS + 30_000) is None
    assert host.answer[codec.STATUS] == codec.CLOCK


@pytest.mark.parametrize("bits", [16, 32])
def test_counters_that_wrap_are_unwrapped_also_in_the_next_session_of_the_line(bits):
    host, device, now = ready(bits=bits)
    where = 2 ** (bits - 1) - 100
    for count in (where - 2 ** (bits - 2), where, where + 200, where + 400):
        device.counts = [(count + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1), 0, 0]
        answer, deadline = exchanged(host, device, now)
        assert answer[codec.COUNTS] == count
        now = deadline + 300_000
    for event, known in ((codec.IDLE, count), (codec.OPENED, count - 2**bits)):  # of a new line nothing is known
        now = acquainted(host, device, now + 200 * MS, event)
        answer, now = exchanged(host, device, now)
        assert answer[codec.COUNTS] == known


def test_samples_that_nobody_asked_for_are_placed_by_the_clock_and_never_after_now():
    host, device, now = ready()

    def unasked(place):
        return host.hear(device.frame(SAMPLE, sample(place, place), flags=18), now)

    for _ in range(20):
        now += MS
        told = unasked(device.clock(now - 500))
        assert told[codec.DEADLINE] == 0 and told[codec.STATUS] == 18
        assert abs(told[codec.LATCHED] - now + 500) <= 1000 and told[codec.LATCHED] <= now
    error = int(host.state[codec.CLOCK_ERROR])
    assert unasked(device.clock(now + 1000)) is None and host.state[codec.REFUSED] == 0  # dropped
    assert unasked(device.clock(now + error + 1000)) is None and host.state[codec.REFUSED] == 1
    assert unasked(device.clock(now - 10))[codec.LATCHED] <= now


def test_a_sample_that_does_not_answer_is_fresh_for_a_deadline_only_two_periods_after_it():
    host, device, now = ready()
    asked(host, device, now)
    for after, fresh in ((2 * MS - 1, False), (2 * MS, True)):
        then, place = now + MS + after, device.clock(now + MS + after)
        told = host.hear(device.frame(SAMPLE, sample(place - 1000, place - 1000)), then)
        assert (told is not None and told[codec.LATCHED] >= now + MS) == fresh


def test_lost_are_the_commands_that_came_due_without_a_sample():
    host, device, now = ready()
    exchanged(host, device, now)
    for i in range(1, 4):
        host.write(now + i * 2 * MS, now + i * 2 * MS + MS)  # and never come
    assert host.state[codec.LOST] == 0
    exchanged(host, device, now + 8 * MS)
    assert host.state[codec.LOST] == 3


def test_delay_is_the_time_from_the_write_to_the_effect_and_fades():
    host, device, now = ready()
    delays = []
    for way in [30_000] * 3 + [400_000] + [30_000] * 300:
        deadline = now + MS
        device.hear(host.write(now, deadline), now + way)
        for reply in device.run(deadline):
            host.hear(reply, deadline + way)
        delays.append(host.state[codec.DELAY] - host.state[codec.CLOCK_ERROR])
        now = deadline + 500_000
        host.state[open_state.HEARD] = now
    assert abs(delays[2] - 30_000) <= 1000 and abs(delays[3] - 400_000) <= 1000
    assert all(later <= before for before, later in zip(delays[3:], delays[4:], strict=False))
    assert delays[-1] == pytest.approx(30_000 + 370_000 * math.exp(-0.3), abs=2000)
    assert host.state[codec.CLOCK_ERROR] >= 30_000  # half of the least round trip


def test_a_clock_answer_to_no_question_or_for_the_second_time_is_refused():
    host, device, now = ready()
    question = unpack(host.say(codec.IDLE, now + 20 * MS))
    [time] = question.payload
    for asked_at, refused in ((1, True), (-1, True), (0, False), (0, True)):
        content = time + asked_at, *[device.clock(time)] * 2
        assert (
            refuses(host, device.frame(page.CLOCK_ANSWER, content, answers=question.sequence), now + 21 * MS) == refused
        )


# truths


def truth(device, now, numbers=(0.0,) * 19, **header):
    return device.frame(TRUTH, (device.clock(now), *numbers), **header)


def test_truths_come_of_simulated_devices_with_their_fields_in_order():
    host, device, now = ready(features=1)
    numbers = [float(i) for i in range(1, 20)]
    for flags, told in ((0, (0, 0)), (1, (1, 0)), (2, (0, 1))):
        answer = host.hear(truth(device, now, numbers, flags=flags), now)
        assert answer[codec.KIND] == codec.TRUTH
        last = codec.TRUTH_FIRST + codec.TRUTH_WORDS
        said = answer[codec.TRUTH_FIRST : last].view(simulated_device.TRUTH)[0]
        assert [*said["position"], *said["velocity"], *said["operator_force"]] == numbers[:9]
        assert [*said["motor_force"], *said["target"], *said["target_velocity"]] == numbers[9:18]
        assert said["energy_given"] == 19.0 and (said["motion_done"], said["driven"]) == told
        assert said["time"] == pytest.approx(now * 1e-9, abs=1e-6)
    for place in range(19):
        assert refuses(host, truth(device, now, [math.nan if i == place else 0.0 for i in range(19)]), now)
    host, device, now = ready()
    assert refuses(host, truth(device, now), now)  # of a device that is none


# streams


def serial():
    """A codec of streams that has met a device, by way of what a datagram would have."""
    host, device = Host(open_serial.codec(None, None)), Device(AHEAD)
    now, sent = BEGIN, host.say(codec.OPENED, BEGIN)
    while not host.state[codec.READY]:
        for data in filter(None, sent.split(b"\0")):
            for reply in device.hear(unstuffed(data), now):
                host.hear(stuffed(reply), now)
        now += 5 * MS
        sent = host.say(codec.IDLE, now)
    return host, device, now


def test_bytes_without_a_zero_are_kept_up_to_the_longest_frame_and_then_dropped():
    host, _, now = serial()
    for count, done in ((181, 0), (182, 182)):
        incoming = np.ones(count, np.uint8)
        assert host.link.decode(host.state, incoming, count, now, host.answer) == done
    assert host.state[codec.REFUSED] == 1


@given(st.data())
@settings(max_examples=30, deadline=None)
def test_a_stream_in_pieces_with_zeros_and_rubbish_between_gives_each_frame(data):
    host, device, now = serial()
    stream = b""
    for i in range(8):
        time = device.clock(now + i * MS)
        frame = stuffed(device.frame(SAMPLE, sample(time, time, counts=(i + 1, 0, 0))))
        between = data.draw(st.binary(max_size=300) | st.just(b""))
        stream += b"\0" * data.draw(st.integers(0, 3)) + between + (b"\0" if between else b"") + frame
    kept, told = b"", []
    while stream:
        size = data.draw(st.integers(1, 200))
        kept, stream = kept + stream[:size], stream[size:]
        while kept:
            incoming = np.frombuffer(kept, np.uint8).copy()
            done = host.link.decode(host.state, incoming, len(kept), now + 10 * MS, host.answer)
            if host.answer[codec.KIND] == codec.SAMPLE:
                told.append(host.answer[codec.COUNTS])
            if done == 0:
                assert host.answer[codec.KIND] == codec.NOTHING
                break
            kept = kept[done:]
        assert len(kept) < 200
    assert told == list(range(1, 9))


# what is no frame


@pytest.mark.parametrize("stream", [False, True])
def test_of_thousands_of_frames_that_were_damaged_none_is_taken_and_each_is_counted(stream):
    """One to sixteen bytes changed, or cut short as well; on a stream the zero at the end stays."""
    host, device, now = serial() if stream else ready()
    data = host.write(now, now + MS)
    command = unpack(unstuffed(data[1:-1]) if stream else data)
    deadline = command.payload[0]
    whole = device.frame(SAMPLE, sample(deadline, deadline, counts=(1, 2, 3)), answers=command.sequence)
    whole, end = (stuffed(whole)[:-1], b"\0") if stream else (whole, b"")
    random, damaged = np.random.default_rng(0), set()
    for _ in range(3000):
        data = np.frombuffer(whole, np.uint8).copy()
        data[random.integers(0, len(data), random.integers(1, 17))] ^= random.integers(1, 256, dtype=np.uint8)
        damaged.add(bytes(data if random.random() < 0.9 else data[: random.integers(0, len(data))]))
    for data in damaged - {whole}:
        assert host.hear(data + end, now + 2 * MS) is None
    assert 0.98 * len(damaged) <= host.state[codec.REFUSED] <= len(damaged)
    assert answered(host, whole + end, now + 2 * MS)


def contents(kind):
    """Any payload of this kind."""
    return st.binary(min_size=LENGTHS[kind] - 20, max_size=LENGTHS[kind] - 20).map(
        lambda data: (kind, struct.unpack(PAYLOADS[kind], data))
    )


WHOLE = st.sampled_from(sorted(PAYLOADS)).flatmap(contents)


@given(st.lists(st.tuples(WHOLE, st.integers(0, 65535), st.integers(0, 70)), max_size=20))
@settings(deadline=None)
def test_whole_frames_of_any_content_give_only_finite_samples_in_time(frames):
    host, device, now = ready(features=1)
    host.write(now, now + MS)
    for (kind, payload), flags, answers in frames:
        answer = host.hear(device.frame(kind, payload, flags=flags, answers=answers), now + 2 * MS)
        if answer is not None:
            assert kind in (SAMPLE, TRUTH)
            assert np.isfinite(answer.view(np.float64)[codec.DRAG : codec.DRAG + 3]).all() or kind == TRUTH
            assert kind == TRUTH or answer[codec.LATCHED] <= now + 2 * MS


class Line(RuleBasedStateMachine):
    """A line that loses, doubles, reorders and damages frames; a servo that writes; a device that starts anew."""

    STRAY = 123_456  # counts that only strangers tell

    def __init__(self):
        super().__init__()
        self.host, self.device, self.now = ready()
        self.to_device, self.to_host = [], []
        self.announced, self.latched = [], -(2**63)  # (deadline, period, sequence, device's deadline)

    def send(self, data):
        if not data:
            return
        self.to_device.append(data)
        kind, _, session, sequence, _, payload = unpack(data)
        if kind == HELLO and sequence == 1:
            self.announced = []
        if kind == COMMAND:
            self.announced.append((*self.command, sequence, payload[0]))

    def give(self, data):
        """Gives a frame to the host, and judges what becomes of it."""
        answer = self.host.hear(data, self.now)
        if answer is None or answer[codec.KIND] != codec.SAMPLE:
            return
        _, _, session, _, answers, payload = unpack(data)
        latched, deadline = answer[codec.LATCHED], answer[codec.DEADLINE]
        assert self.latched < latched <= self.now, "times of samples never go back, and none has not been yet"
        self.latched = latched
        assert session == self.host.state[open_state.SESSION]
        assert answer[codec.COUNTS] == session & 0xFFFF, "counts are of this session"
        if deadline:
            assert (deadline, answers, payload[0]) in [(one[0], *one[2:]) for one in self.announced]
            assert latched >= deadline
        elif self.announced and self.now < self.announced[-1][0] + 2 * self.announced[-1][1]:
            answered = {int(one[codec.DEADLINE]) for one in self.host.heard}
            assert self.announced[-1][0] in answered or latched < self.announced[-1][0], "fresh only by an echo"

    def flow(self, kept):
        self.device.counts = [self.device.session & 0xFFFF] * 3
        self.to_host += self.device.run(self.now)
        if kept:
            while self.to_device:
                self.to_host += self.device.hear(self.to_device.pop(0), self.now)
            while self.to_host:
                self.give(self.to_host.pop(0))

    @rule(steps=st.integers(1, 30), kept=st.booleans())
    def wait(self, steps, kept):
        for _ in range(steps):
            self.now += 5 * MS
            self.send(self.host.say(codec.IDLE, self.now))
            self.flow(kept)

    @rule(ticks=st.integers(1, 5), period=st.sampled_from((MS, 250_000, 4 * MS)), kept=st.booleans())
    def servo(self, ticks, period, kept):
        for _ in range(ticks):
            self.command = self.now + period, period
            self.send(self.host.write(self.now, *self.command[:1], (0.5, 0.5, 0.0), period))
            self.flow(kept)
            self.now += period + 50_000
            self.flow(kept)

    @rule()
    def cut(self):
        period = int(self.host.state[open_state.HELD_FOR])
        self.command = self.now + period, period
        self.send(self.host.say(codec.CUT, self.now))

    @rule()
    def opened(self):
        self.send(self.host.say(codec.OPENED, self.now))

    @rule()
    def device_starts_anew(self):
        self.device = Device(AHEAD // 3)

    @rule(step=st.sampled_from((200_000, -200_000, 5 * MS, -(10**12))))
    def clock_steps(self, step):
        self.device.ahead += step

    @precondition(lambda self: self.to_device)
    @rule(data=st.data(), again=st.booleans())
    def device_hears(self, data, again):
        place = data.draw(st.integers(0, len(self.to_device) - 1))
        frame = self.to_device[place] if again else self.to_device.pop(place)
        self.to_host += self.device.hear(frame, self.now)

    @precondition(lambda self: self.to_host)
    @rule(data=st.data(), again=st.booleans())
    def host_hears(self, data, again):
        place = data.draw(st.integers(0, len(self.to_host) - 1))
        self.give(self.to_host[place] if again else self.to_host.pop(place))

    @rule(lost=st.integers(1, 20))
    def line_loses(self, lost):
        del self.to_device[:lost], self.to_host[:lost]

    @rule(session=st.integers(1, 2**32 - 1), answers=st.integers(0, 100))
    def host_hears_a_stranger(self, session, answers):
        now = self.device.clock(self.now)
        self.give(pack(SAMPLE, session, 2**31 - 1, *sample(now, now, counts=(self.STRAY,) * 3), answers=answers))

    @invariant()
    def a_link_that_is_ready_has_been_greeted(self):
        assert not self.host.state[codec.READY] or self.host.state[open_state.GREETED]


TestLine = Line.TestCase
TestLine.settings = settings(max_examples=80, stateful_step_count=30, deadline=None)
