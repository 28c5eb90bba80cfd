# SPDX-License-Identifier: Apache-2.0
"""The firmware's core against the protocol, on a board that a test plays, under a made-up clock."""

import ctypes
import math
import re
import subprocess

import firmware_builds
import link_frames as link
import pytest
from firmware_builds import FIRMWARE, PORTS
from hypothesis import given
from hypothesis import strategies as st

MS, US = 1_000_000, 1000


@pytest.fixture(scope="session")
def library():
    """The ports' functions."""
    return firmware_builds.ports()


def test_no_damaged_or_false_frame_moves_a_motor():
    done = subprocess.run([firmware_builds.fuzzer()], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


@pytest.mark.parametrize("board", ["teensy4", "rp2040"])
def test_sketches_are_c_plus_plus(board):
    sketch = FIRMWARE / "boards" / board / f"{board}.ino"
    places = [f"-I{PORTS / 'stubs'}", f"-I{FIRMWARE}"]
    compiler = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++"]
    assert subprocess.run([*compiler, *places, sketch], check=False).returncode == 0


def test_core_needs_nothing_but_the_board():
    """What its objects leave open is the board's, and memcpy and memset."""
    listed = subprocess.run(["nm", "-u", *firmware_builds.objects()], capture_output=True, text=True, check=True).stdout
    needed = set(re.findall(r" U (\w+)", listed)) - {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    needed = {name for name in needed if not name.startswith("haptic_")}
    board = {name for name in needed if name.startswith("board_")}
    assert needed - board <= {"memcpy", "memset"}
    declared = re.findall(r"\bboard_\w+(?=\()", (FIRMWARE / "haptic_board.h").read_text())
    assert board == set(declared) and len(board) <= 10


# ---- the core, on a made-up clock ----


class Core:
    """The core on a made-up board; session and sequence as a host counts them."""

    BEGAN = 10**12

    def __init__(self, library, datagrams=True, axes=3):
        self.port, self.datagrams, self.session, self.sequence = library, datagrams, 7, 0
        self.now = self.BEGAN
        library.port_begin(ctypes.c_int64(self.now), axes, datagrams)

    def at(self, ms):
        """Time goes on to this many ms after the beginning; returns the frames that were sent."""
        self.now = self.BEGAN + round(ms * MS)
        self.port.port_time(ctypes.c_int64(self.now))
        self.port.port_advance()
        return self.sent()

    def take(self, data):
        self.port.port_receive(data, len(data))
        return self.sent()

    def say(self, kind, *payload, **header):
        """Sends the next frame, or one with another session, sequence or version; returns the answers."""
        self.sequence = (header.pop("sequence", self.sequence + 1)) & 0xFFFFFFFF
        frame = link.pack(kind, header.pop("session", self.session), self.sequence, *payload, **header)
        return self.take(frame if self.datagrams else link.stuffed(frame))

    def command(self, ms=1.0, motors=(1.0, -1.0, 0.5), period=MS, flags=link.ENGAGED, **header):
        """A command whose deadline is this many ms from now."""
        return self.say(link.COMMAND, self.now + round(ms * MS), period, *motors, flags=flags, **header)

    def sent(self):
        """The frames that it has written since."""
        room, writes = ctypes.create_string_buffer(1 << 16), []
        count = self.port.port_sent(room, len(room))
        data = room.raw[:count]
        while data:
            end = 2 + int.from_bytes(data[:2], "little")
            writes.append(data[2:end])
            data = data[end:]
        if self.datagrams:
            return [link.unpack(write) for write in writes]
        return [link.unpack(link.unstuffed(coded)) for coded in b"".join(writes).split(b"\0") if coded]

    @property
    def motors(self):
        values = (ctypes.c_float * 3)()
        self.port.port_motors(values)
        return tuple(values)

    refused = property(lambda self: self.port.port_refused())


@pytest.fixture(params=[True, False], ids=["datagrams", "stream"])
def core(library, request):
    """A core that has greeted."""
    core = Core(library, request.param)
    assert [frame.kind for frame in core.say(link.HELLO)] == [link.GREETING]
    return core


def samples(frames):
    return [(frame.answers, link.sample(frame)) for frame in frames if frame.kind == link.SAMPLE]


def status(frames):
    return [frame.flags for frame in frames if frame.kind == link.SAMPLE][-1]


def test_nothing_is_said_before_the_first_hello(library):
    core = Core(library)
    assert core.at(10.0) == [] and core.command() == [] and core.say(link.CLOCK, 5) == []
    assert core.say(link.HELLO, session=0) == [] and core.refused == 3


def test_deadlines_run_on_with_the_motor_held_until_the_watchdog_cuts(core):
    core.command(ms=1.0, period=2 * MS)
    assert [answers for answers, _ in samples(core.at(1.0))] == [core.sequence]
    ran = samples([frame for ms in range(2, 15) for frame in core.at(ms)] + core.at(14.999))
    assert [(answers, sample.deadline - core.BEGAN) for answers, sample in ran] == [
        (0, i * MS) for i in range(3, 14, 2)
    ]
    assert core.motors == (1.0, -1.0, 0.5) and core.port.port_cuts() == 0
    cut = core.at(15.0)
    assert core.motors == (0.0, 0.0, 0.0) and core.port.port_cuts() == 1
    assert status(cut) == link.CUT
    unasked = samples(core.at(16.0)) + samples(core.at(17.0))
    assert [answers for answers, _ in unasked] == [0, 0]
    assert all(sample.deadline == sample.sampled for _, sample in unasked)
    core.command(ms=1.0)
    assert core.motors == (1.0, -1.0, 0.5) and status(core.at(18.5)) == 0


@pytest.mark.parametrize("back", [2 * MS, 59 * MS, 1000 * MS])
@pytest.mark.parametrize("times", [1, 4])
def test_a_clock_that_is_set_back_however_often_does_not_stretch_the_watchdog(core, back, times):
    core.command()
    for i in range(2 * 15):
        core.at(0.5 * i)
        assert core.motors == (1.0, -1.0, 0.5) or i > 2 * (14 - times)
        if i % 7 == 6 and i < 7 * times:
            core.BEGAN -= back
    core.at(15.0)
    assert core.motors == (0.0, 0.0, 0.0) and core.port.port_cuts() == 1
    core.at(16.0)
    assert len(core.at(17.0)) == 1


@pytest.mark.parametrize("step", [0, 60 * MS])
def test_deadlines_that_were_missed_in_a_stall_or_by_a_step_are_not_made_up_for(core, step):
    core.command(ms=1.0)
    core.at(1.0)
    missed = samples(core.at(12.3))
    assert [sample.sampled for _, sample in missed] == [core.now]
    assert [sample.deadline - core.BEGAN for _, sample in samples(core.at(13.0))] == [13 * MS]
    core.command(ms=1.0)
    core.BEGAN += step
    late = core.at(74.0 - step / MS)
    assert len(samples(late)) <= 3 and status(late) == link.CUT and core.motors == (0.0, 0.0, 0.0)
    assert len(core.at(75.0 - step / MS)) == 1


def test_a_command_does_not_replace_a_deadline_that_is_not_reached_and_each_has_its_own_sample(core):
    commands = []
    for i, ms in enumerate((2.0, 3.0, 3.5, 4.0)):
        core.at(0.1 * i)
        core.command(ms=ms - 0.1 * i, motors=(0.1 * (i + 1), 0.0, 0.0))
        commands.append((core.sequence, round(ms * MS), core.now))
    assert core.motors[0] == pytest.approx(0.4)  # values act at once
    told = [one for i in range(5, 41) for one in samples(core.at(0.1 * i))]
    assert [(answers, one.deadline - core.BEGAN, one.applied) for answers, one in told] == commands
    core.command(ms=3.0)
    core.command(ms=3.0)  # the same again: one sample, which answers the last
    told = [one for i in range(41, 76) for one in samples(core.at(0.1 * i))]
    assert [(answers, one.deadline - core.BEGAN) for answers, one in told] == [(core.sequence, 7 * MS)]


def test_of_deadlines_that_wait_those_are_forgotten_that_a_cut_a_stall_or_a_session_passes(core):
    for ending in ("cut", "stall", "session"):
        for ms in (10.0, 11.0, 12.0):
            core.command(ms=ms, period=5 * MS)
        began = (core.now - core.BEGAN) / MS
        if ending == "session":
            core.session += 1
            core.say(link.HELLO, sequence=1)
        told = samples(core.at(began + (12.5 if ending == "stall" else 15.0 if ending == "cut" else 1.0)))
        answered = [answers for answers, _ in told if answers]
        assert answered == ([core.sequence] if ending != "session" else [])
        told = [one for i in range(4) for one in samples(core.at(began + 16.0 + i))]
        assert not any(answers for answers, _ in told)


@pytest.mark.parametrize("drag, told", [(999.0, 999.0), (1001.0, 0.0), (3e38, 0.0), (math.nan, 0.0), (-math.inf, 0.0)])
def test_a_drag_that_no_damper_can_feel_is_told_as_not_measured(core, drag, told):
    core.port.port_drag(ctypes.c_float(drag))
    core.command()
    ((_, one),) = samples(core.at(1.0))
    assert one.damper == (told, 0.0, 0.0)


def test_no_bit_is_set_after_power_up_until_a_watchdog_has_cut(core):
    assert status(core.at(1.0)) == 0


def test_a_new_hello_cuts_and_forgets_and_one_of_the_session_changes_nothing(core):
    core.command()
    (again,) = core.say(link.HELLO)
    assert again.kind == link.GREETING and again.answers == core.sequence and core.motors == (1.0, -1.0, 0.5)
    core.session = 8
    (anew,) = core.say(link.HELLO, sequence=1)
    assert anew.sequence == 1 and core.motors == (0.0, 0.0, 0.0)
    ((answers, sample),) = samples(core.at(1.0))
    assert (answers, sample.applied, sample.deadline) == (0, 0, core.now)
    core.command(sequence=2, session=7)
    assert core.motors == (0.0, 0.0, 0.0) and core.refused == 1
    core.command(sequence=2)
    assert core.motors == (1.0, -1.0, 0.5)


@pytest.mark.parametrize("step, taken", [(0, False), (-1, False), (1, True), (2**31 - 1, True), (2**31, False)])
def test_only_newer_sequences_are_taken(core, step, taken):
    core.command(motors=(1.0, 0.0, 0.0))
    core.command(motors=(0.5, 0.0, 0.0), sequence=core.sequence + step)
    assert (core.motors[0] == 0.5) == taken and core.refused == (not taken)


JUST = [  # what is taken, and what is not any more
    ({"ms": 15.0}, {"ms": 15.000001}),
    ({"ms": 20.0, "period": 10 * MS}, {"ms": 20.000001, "period": 10 * MS}),
    ({"ms": -15.0}, {"ms": -15.000001}),
    ({"period": 100_000}, {"period": 99_999}),
    ({"period": 10 * MS}, {"period": 10 * MS + 1}),
    *(({}, {"motors": motors}) for motors in ((1.0, math.nan, 0.0), (math.inf, 0.0, 0.0), (1.0, 0.0, -math.inf))),
    ({}, {"session": 9}),
    ({}, {"version": 2}),
]


@pytest.mark.parametrize("datagrams", [True, False])
def test_a_command_is_refused_just_beyond_each_bound(library, datagrams):
    for values, taken in [(within, True) for within, _ in JUST] + [(beyond, False) for _, beyond in JUST]:
        core = Core(library, datagrams)
        core.say(link.HELLO)
        core.command(**values)
        assert (core.port.port_writes(), core.refused, any(core.motors)) == (taken, not taken, taken), values
        core.at(15.0)
        assert core.port.port_cuts() == taken  # a refused one feeds no watchdog


@given(st.lists(st.integers(1, 9), max_size=30), st.binary(max_size=300))
def test_a_stream_comes_in_any_pieces_and_after_any_noise(library, pieces, noise):
    core = Core(library, datagrams=False)
    frames = link.pack(link.HELLO, 7, 1), link.pack(link.COMMAND, 7, 2, core.now + MS, MS, 1.0, 0.0, 0.0)
    stream = noise + b"\0\0" + b"".join(map(link.stuffed, frames))
    answers = []
    for piece in [*pieces, len(stream)]:
        answers += core.take(stream[:piece]) if stream[:piece] else []
        stream = stream[piece:]
    assert [frame.kind for frame in answers] == [link.GREETING] and core.motors == (1.0, 0.0, 0.0)


def test_motors_are_clamped_to_the_limits_and_said_to_be_and_axes_that_are_not_there_stay_zero(library, core):
    core.command(motors=(2.0, -2.0, 0.0))
    assert core.motors == (2.0, -2.0, 0.0) and status(core.at(1.0)) == 0
    core.command(motors=(2.001, -50.0, 3e38))
    assert core.motors == (2.0, -2.0, 2.0) and status(core.at(2.0)) == link.CLAMPED
    core = Core(library, axes=1)
    core.say(link.HELLO)
    core.command(motors=(1.0, 1.0, 1.0))
    assert core.motors == (1.0, 0.0, 0.0) and status(core.at(1.0)) == 0


@pytest.mark.parametrize("bit", [link.ESTOP, link.HOT, link.BROKEN_ENCODER])
def test_a_fault_stays_until_its_cause_is_gone_and_a_command_clears_it(core, bit):
    core.command()
    core.port.port_inputs(bit, 715)
    frames = core.at(1.0)
    assert status(frames) == bit and core.motors == (0.0, 0.0, 0.0) and link.sample(frames[-1]).temperature == 715
    disengaged = {"motors": (0.0, 0.0, 0.0), "flags": 0}
    core.command(**disengaged)  # the cause is still there
    assert status(core.at(2.0)) == bit and core.port.port_writes() == 1
    core.port.port_inputs(0, -32768)
    wrong = {}, {"motors": (0.0, 0.0, 0.0)}, {"motors": (0.0, 0.1, 0.0), "flags": 0}  # wants force, engaged, or both
    for ms, command in enumerate(wrong, 3):
        core.command(**command)
        assert status(core.at(ms)) == bit and core.motors == (0.0, 0.0, 0.0)
    core.command(**disengaged)
    assert status(core.at(6.0)) == 0
    core.command()
    assert core.motors == (1.0, -1.0, 0.5)


def test_a_short_press_is_a_fault_too_and_outlives_the_session(core):
    core.port.port_inputs(link.ESTOP, -32768)
    core.at(0.1)
    core.port.port_inputs(0, -32768)
    core.session = 8
    core.say(link.HELLO, sequence=1)
    core.command()
    assert core.motors == (0.0, 0.0, 0.0) and status(core.at(1.1)) == link.ESTOP
