# SPDX-License-Identifier: Apache-2.0
"""The firmware against its protocol: its core on a board that a test plays, and the reference device on real lines."""

import contextlib
import ctypes
import math
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path
from types import SimpleNamespace

import link_frames as link
import numpy as np
import pytest
import waiting
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.description import load_device, parse
from haptic_device.parameters import LOOPBACK
from haptic_sim.supervision import reference_device

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE, PORTS = ROOT / "firmware", ROOT / "test/firmware"
MS, US = 1_000_000, 1000
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
SANITIZED = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
CORE = ["haptic_core.c", "haptic_frame.c", "haptic_main.c"]
PLANT = ["reference/plant.c", "reference/hand.c"]


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """Programs: the reference device and the fuzzer, both under sanitizers, and the ports, a library."""
    folder = tmp_path_factory.mktemp("firmware")
    core, plant = [FIRMWARE / name for name in CORE], [FIRMWARE / name for name in PLANT]
    host = [*sorted(FIRMWARE.glob("boards/host/*.c")), *sorted(FIRMWARE.glob("reference/*.c"))]
    commands = {
        "device": [*SANITIZED, *core, *host],
        "fuzz": [*SANITIZED, PORTS / "fuzz_core.c", *core[:2]],
        "ports.so": ["-O1", "-shared", "-fPIC", PORTS / "core_port.c", PORTS / "plant_port.c", *core, *plant],
    }
    compilers = [
        subprocess.Popen(["gcc", *STRICT, *map(str, command), f"-I{FIRMWARE}", "-lm", "-o", str(folder / name)])
        for name, command in commands.items()
    ]
    assert [compiler.wait() for compiler in compilers] == [0, 0, 0]
    return folder


@pytest.fixture(scope="session")
def library(built):
    """The ports' functions."""
    ports = ctypes.CDLL(str(built / "ports.so"))
    for name in ("port_due", "plant_port_push"):
        getattr(ports, name).restype = ctypes.c_int64
    ports.haptic_crc32.restype = ctypes.c_uint32
    return ports


# ---- frames ----


def test_crc_is_the_one_of_ethernet(library):
    assert library.haptic_crc32(b"123456789", 9) == 0xCBF43926


@given(st.binary(max_size=254))
def test_cobs_goes_both_ways_and_no_zero_is_in_it(library, data):
    coded, back = ctypes.create_string_buffer(300), ctypes.create_string_buffer(300)
    count = library.haptic_cobs_encode(data, len(data), coded)
    assert count == len(data) + 1
    assert 0 not in coded.raw[:count]
    assert link.cobs_decode(coded.raw[:count]) == data
    assert library.haptic_cobs_decode(coded, count, back) == len(data)
    assert back.raw[: len(data)] == data


@given(st.lists(st.sampled_from([0, 1, 2, 3, 5, 254, 255]), max_size=40).map(bytes))
def test_what_is_no_cobs_is_none_for_both(library, coded):
    back = ctypes.create_string_buffer(64)
    count = library.haptic_cobs_decode(coded, len(coded), back)
    try:
        assert back.raw[:count] == link.cobs_decode(coded)
        assert count >= 0
    except ValueError:
        assert count == -1


def test_no_damaged_or_false_frame_moves_a_motor(built):
    done = subprocess.run([built / "fuzz"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


@pytest.mark.parametrize("board", ["teensy4", "rp2040"])
def test_sketches_are_c_plus_plus(board):
    sketch = FIRMWARE / "boards" / board / f"{board}.ino"
    places = [f"-I{PORTS / 'stubs'}", f"-I{FIRMWARE}"]
    compiler = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++"]
    assert subprocess.run([*compiler, *places, sketch], check=False).returncode == 0


def test_core_needs_nothing_but_the_board(built):
    """What its objects leave open is the board's, and memcpy and memset."""
    objects = [str(built / f"{name}.o") for name in CORE]
    for name, made in zip(CORE, objects, strict=True):
        subprocess.run(["gcc", *STRICT, "-O2", "-c", str(FIRMWARE / name), "-o", made], check=True)
    listed = subprocess.run(["nm", "-u", *objects], capture_output=True, text=True, check=True).stdout
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
        return self.take(frame if self.datagrams else link.cobs_encode(frame) + b"\0")

    def command(self, ms=1.0, motors=(1.0, -1.0, 0.5), period=MS, flags=link.ENGAGED, **header):
        """A command whose deadline is this many ms from now."""
        return self.say(link.COMMAND, self.now + round(ms * MS), period, *motors, flags=flags, **header)

    def writes(self):
        room = ctypes.create_string_buffer(1 << 16)
        count = self.port.port_sent(room, len(room))
        data, writes = room.raw[:count], []
        while data:
            count = data[0] | data[1] << 8
            writes.append(data[2 : 2 + count])
            data = data[2 + count :]
        return writes

    def sent(self):
        if self.datagrams:
            return [link.unpack(write) for write in self.writes()]
        return [link.unpack(link.cobs_decode(coded)) for coded in b"".join(self.writes()).split(b"\0") if coded]

    @property
    def motors(self):
        values = (ctypes.c_float * 3)()
        self.port.port_motors(values)
        return tuple(values)

    @property
    def refused(self):
        return self.port.port_refused()

    def inputs(self, bits, temperature=-32768):
        self.port.port_inputs(bits, temperature)


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


def test_greeting_says_what_the_device_is(library):
    core = Core(library, axes=2)
    (frame,) = core.say(link.HELLO)
    greeting = link.greeting(frame)
    assert (frame.session, frame.sequence, frame.answers, frame.flags) == (7, 1, 1, 0)
    assert (greeting.name, greeting.firmware, greeting.axes) == (b"port", 0x010203, 2)
    assert greeting.counts_per_unit == (1000.0, 1000.0, 0.0) and greeting.largest_motor == (2.0, 2.0, 0.0)
    assert greeting[5:] == (100_000, 15 * MS, 32, 1)


def test_a_session_of_a_stream_begins_with_a_zero(library):
    core = Core(library, datagrams=False)
    core.port.port_receive(link.cobs_encode(link.pack(link.HELLO, 7, 1)) + b"\0", 22)
    assert [write[:1] == b"\0" for write in core.writes()] == [True, False]


def test_nothing_is_said_before_the_first_hello(library):
    core = Core(library)
    assert core.at(10.0) == [] and core.command() == [] and core.say(link.CLOCK, 5) == []
    assert core.say(link.HELLO, session=0) == [] and core.refused == 3


def test_a_sample_answers_its_command_at_its_deadline(core):
    assert core.command(ms=1.0) == [] and core.motors == (1.0, -1.0, 0.5)
    said = core.sequence
    assert core.at(0.999) == []
    (frame,) = core.at(1.02)
    sample = link.sample(frame)
    assert frame.answers == said and frame.flags == 0
    assert (sample.deadline - core.BEGAN, sample.sampled - core.BEGAN) == (MS, 1_020_000)
    assert sample.applied == core.BEGAN and sample.damper == (0.5, 0.0, 0.0)
    assert sample.counts == (1, -1, -(2**31)) and (sample.temperature, sample.reserved) == (-32768, 0)


def test_a_deadline_that_has_passed_is_latched_at_once_and_the_grid_goes_on_after_it(core):
    core.at(0.5)
    ((answers, sample),) = samples(core.command(ms=-3.7))
    assert answers == core.sequence and sample.deadline == core.now - 3_700_000 and sample.sampled == core.now
    ((answers, sample),) = samples(core.at(1.0))
    assert answers == 0 and sample.deadline == core.BEGAN + 800_000


def test_deadlines_run_on_with_the_motor_held_until_the_watchdog_cuts(core):
    core.command(ms=1.0, period=2 * MS)
    assert [answers for answers, _ in samples(core.at(1.0))] == [core.sequence]
    ran = samples(core.at(14.999))
    assert [(answers, sample.deadline - core.BEGAN) for answers, sample in ran] == [
        (0, (3 + 2 * i) * MS) for i in range(6)
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


def test_a_late_loop_makes_up_for_each_deadline_and_then_cuts(core):
    core.command(ms=1.0, period=100 * US)
    ran = core.at(400.0)
    grid = [sample.deadline - core.BEGAN for _, sample in samples(ran)]
    assert grid[:140] == [MS + i * 100 * US for i in range(140)]
    assert len(grid) == 142 and status(ran) == link.CUT and core.motors == (0.0, 0.0, 0.0)


def test_unasked_samples_come_each_millisecond_before_the_first_command(core):
    assert [len(core.at(0.1 * i)) for i in range(31)] == [1 if i in (10, 20, 30) else 0 for i in range(31)]


def test_a_clock_that_is_set_back_does_not_stretch_the_watchdog(core):
    core.command()
    core.BEGAN -= 1000 * MS
    core.at(0.0)
    assert core.motors == (1.0, -1.0, 0.5)
    core.at(15.0)
    assert core.motors == (0.0, 0.0, 0.0) and len(core.at(16.0)) == 1


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


def test_sequences_go_round(library):
    core = Core(library)
    core.say(link.HELLO, sequence=2**32 - 1)
    core.port.port_sent_sequence(ctypes.c_uint32(2**32 - 1))
    core.command(sequence=0)
    assert core.motors[0] == 1.0 and [frame.sequence for frame in core.at(1.0)] == [0]


@pytest.mark.parametrize(
    "values, taken",
    [
        ({"ms": 15.0}, True),
        ({"ms": 15.000001}, False),
        ({"ms": 20.0, "period": 10 * MS}, True),
        ({"ms": 20.000001, "period": 10 * MS}, False),
        ({"ms": -1000.0}, True),
        ({"ms": -1000.000001}, False),
        ({"period": 100_000}, True),
        ({"period": 99_999}, False),
        ({"period": 10 * MS}, True),
        ({"period": 10 * MS + 1}, False),
        ({"motors": (1.0, math.nan, 0.0)}, False),
        ({"motors": (math.inf, 0.0, 0.0)}, False),
        ({"motors": (1.0, 0.0, -math.inf)}, False),
        ({"session": 9}, False),
        ({"version": 2}, False),
    ],
)
def test_a_command_is_refused_just_beyond_each_bound(core, values, taken):
    core.command(**values)
    assert core.port.port_writes() == taken and core.refused == (not taken)
    assert any(core.motors) == taken
    core.at(15.0)
    assert core.port.port_cuts() == taken  # a refused one feeds no watchdog


@given(st.data())
def test_every_change_of_a_few_bits_and_every_cut_is_refused(library, data):
    core = Core(library)
    core.say(link.HELLO)
    frame = bytearray(link.pack(link.COMMAND, 7, 2, core.now + MS, MS, 1.0, 1.0, 1.0, flags=1))
    if data.draw(st.booleans()):
        for bit in data.draw(st.sets(st.integers(0, 8 * len(frame) - 1), min_size=1, max_size=3)):
            frame[bit // 8] ^= 1 << bit % 8
    else:
        frame = frame[: data.draw(st.integers(0, len(frame) - 1))] + data.draw(st.sampled_from([b"", b"\0", b"\1\2"]))
    core.take(bytes(frame))
    assert core.motors == (0.0, 0.0, 0.0) and core.refused == 1


@given(st.lists(st.integers(1, 9), max_size=30), st.binary(max_size=300))
def test_a_stream_comes_in_any_pieces_and_after_any_noise(library, pieces, noise):
    core = Core(library, datagrams=False)
    stream = (
        noise
        + b"\0\0"
        + b"".join(
            link.cobs_encode(frame) + b"\0"
            for frame in (link.pack(link.HELLO, 7, 1), link.pack(link.COMMAND, 7, 2, core.now + MS, MS, 1.0, 0.0, 0.0))
        )
    )
    answers = []
    for piece in [*pieces, len(stream)]:
        answers += core.take(stream[:piece]) if stream[:piece] else []
        stream = stream[piece:]
    assert [frame.kind for frame in answers] == [link.GREETING] and core.motors == (1.0, 0.0, 0.0)


def test_motors_are_clamped_to_the_limits_and_said_to_be(core):
    core.command(motors=(2.0, -2.0, 0.0))
    assert core.motors == (2.0, -2.0, 0.0) and status(core.at(1.0)) == 0
    core.command(motors=(2.001, -50.0, 3e38))
    assert core.motors == (2.0, -2.0, 2.0) and status(core.at(2.0)) == link.CLAMPED


def test_axes_that_are_not_there_stay_zero(library):
    core = Core(library, axes=1)
    core.say(link.HELLO)
    core.command(motors=(1.0, 1.0, 1.0))
    assert core.motors == (1.0, 0.0, 0.0) and status(core.at(1.0)) == 0


@pytest.mark.parametrize("bit", [link.ESTOP, link.HOT, link.BROKEN_ENCODER])
def test_a_fault_stays_until_its_cause_is_gone_and_a_command_clears_it(core, bit):
    core.command()
    core.inputs(bit, 715)
    frames = core.at(1.0)
    assert status(frames) == bit and core.motors == (0.0, 0.0, 0.0) and link.sample(frames[-1]).temperature == 715
    core.command(motors=(0.0, 0.0, 0.0), flags=0)  # the cause is still there
    assert status(core.at(2.0)) == bit and core.port.port_writes() == 1
    core.inputs(0)
    core.command()
    assert status(core.at(3.0)) == bit and core.motors == (0.0, 0.0, 0.0)  # it wants force
    core.command(motors=(0.0, 0.0, 0.0))
    assert status(core.at(4.0)) == bit  # it is engaged
    core.command(motors=(0.0, 0.1, 0.0), flags=0)
    assert status(core.at(5.0)) == bit and core.motors == (0.0, 0.0, 0.0)
    core.command(motors=(0.0, 0.0, 0.0), flags=0)
    assert status(core.at(6.0)) == 0
    core.command()
    assert core.motors == (1.0, -1.0, 0.5)


def test_a_short_press_is_a_fault_too_and_outlives_the_session(core):
    core.inputs(link.ESTOP)
    core.at(0.1)
    core.inputs(0)
    core.session = 8
    core.say(link.HELLO, sequence=1)
    core.command()
    assert core.motors == (0.0, 0.0, 0.0) and status(core.at(1.1)) == link.ESTOP


def test_an_end_switch_is_shown_as_it_is_and_cuts_nothing(core):
    core.command()
    core.inputs(link.END_SWITCH)
    assert status(core.at(1.0)) == link.END_SWITCH and core.motors == (1.0, -1.0, 0.5)
    core.inputs(0)
    assert status(core.at(2.0)) == 0


def test_the_clock_is_answered_at_once(core):
    core.at(0.25)
    (frame,) = core.say(link.CLOCK, -123456789)
    assert (frame.kind, frame.answers) == (link.CLOCK_ANSWER, core.sequence)
    assert frame.payload == (-123456789, core.now, core.now)


def test_targets_are_taken_if_they_are_numbers(core):
    target = (ctypes.c_double * 3)()
    core.say(link.TARGET, 0.1, -0.2, 3.0)
    core.say(link.TARGET, 0.1, math.nan, 3.0)
    core.port.port_target(target)
    assert tuple(target) == (0.1, -0.2, 3.0) and core.refused == 1


@pytest.mark.parametrize("kind", [link.GREETING, link.SAMPLE, link.CLOCK_ANSWER, link.TRUTH])
def test_what_devices_say_is_refused(core, kind):
    payload = {link.GREETING: (b"", 0, 3, *[0.0] * 6, *[0] * 4), link.SAMPLE: (*[0] * 8, *[0.0] * 3)}
    payload |= {link.CLOCK_ANSWER: (0, 0, 0), link.TRUTH: (0, *[0.0] * 19)}
    assert core.say(kind, *payload[kind]) == [] and core.refused == 1


def test_the_loop_is_told_what_comes_next(core):
    assert core.port.port_due() - core.now == MS
    core.command(ms=0.3)
    assert core.port.port_due() - core.now == 300 * US
    core.command(ms=14.0)
    assert core.port.port_due() - core.now == MS  # inputs
    core.at(14.5)
    assert core.port.port_due() - core.now == 500 * US  # the watchdog, or the next deadline


# ---- the plant, against closed forms ----

FREE = (0.1, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # m, b, f_c, g, m_h, b_h, k_h, start


class Plant:
    """The reference device's plant; each axis by (m, b, f_c, g, m_h, b_h, k_h, start)."""

    PARTS = ("position", "velocity", "motor", "operator", "target", "target_velocity", "sensed")

    def __init__(self, library, x=FREE, y=FREE, theta=FREE, sensing=0.0, actuation=0.0):
        self.port = library
        delays = (ctypes.c_int64(round(sensing * 1e9)), ctypes.c_int64(round(actuation * 1e9)))
        library.plant_port_begin((ctypes.c_double * 8 * 3)(x, y, theta), *delays)

    def push(self, time, *force):
        values = (ctypes.c_double * 3)(*force, *[0.0] * (3 - len(force)))
        return self.port.plant_port_push(ctypes.c_int64(round(time * 1e9)), values) * 1e-9

    def cut(self, time):
        self.port.plant_port_cut(ctypes.c_int64(round(time * 1e9)))

    def waypoint(self, *numbers):
        self.port.plant_port_waypoint(*map(ctypes.c_double, numbers))

    def at(self, time):
        """The state at this time [s]: arrays of 3, and energy."""
        self.port.plant_port_advance(ctypes.c_int64(round(time * 1e9)))
        state = (ctypes.c_double * 22)()
        self.port.plant_port_state(state)
        parts = {name: np.array(state[3 * i : 3 * i + 3]) for i, name in enumerate(self.PARTS)}
        return SimpleNamespace(energy=state[21], **parts)


def test_a_constant_motor_against_damping(library):
    plant = Plant(library, y=(0.2, 0.5, 0.0, -1.962, 0.0, 0.0, 0.0, 0.1))
    plant.push(0.0, 1.0)
    for t in (0.001, 0.0123456, 0.2):
        state, lag = plant.at(t), 0.1 / 3.0
        assert state.position[0] == pytest.approx((t - lag * (1 - math.exp(-t / lag))) / 3.0, abs=1e-13)
        assert state.velocity[0] == pytest.approx((1 - math.exp(-t / lag)) / 3.0, abs=1e-12)
        lag = 0.4
        assert state.position[1] == pytest.approx(0.1 - 3.924 * (t - lag * (1 - math.exp(-t / lag))), abs=1e-13)
        assert state.energy == 0.0


def test_a_hand_that_holds_is_a_damped_oscillator(library):
    m, b, k, force = 0.2, 11.0, 500.0, 2.0
    plant = Plant(library, x=(0.1, 3.0, 0.0, 0.0, 0.1, 8.0, 500.0, 0.02))
    plant.push(0.0, force)
    decay = b / (2 * m)
    ringing = math.sqrt(k / m - decay**2)
    for t in (0.003, 0.05, 0.3):
        swing = math.exp(-decay * t) * (math.cos(ringing * t) + decay / ringing * math.sin(ringing * t))
        assert plant.at(t).position[0] == pytest.approx(0.02 + force / k * (1 - swing), abs=1e-12)


def test_friction_holds_what_is_at_most_as_strong(library):
    plant = Plant(library, x=(0.1, 3.0, 0.5, 0.0, 0.1, 8.0, 500.0, 0.0))
    plant.push(0.0, 0.5)
    assert plant.at(0.1).position[0] == 0.0
    plant.push(0.1, -0.5)
    assert plant.at(0.2).position[0] == 0.0
    plant.push(0.2, 0.501)
    state = plant.at(2.0)
    assert 0.0 < state.position[0] <= 0.002 / 500.0


def test_friction_alone_ends_a_motion_where_its_energy_is_gone(library):
    plant = Plant(library, x=(0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    plant.push(0.0, 1.2)
    speed, way = 10.0 * 0.05, 0.5 * 10.0 * 0.05**2
    assert plant.at(0.05).velocity[0] == pytest.approx(speed, abs=1e-12)
    plant.push(0.05, 0.0)
    stopped = 0.05 + speed / 2.0  # at 0.2/0.1 m/s²
    moving, standing = plant.at(stopped - 1e-5), plant.at(stopped + 1e-4)
    assert moving.velocity[0] == pytest.approx(2e-5, rel=1e-6) and standing.velocity[0] == 0.0
    assert standing.position[0] == pytest.approx(way + 0.1 * speed**2 / (2 * 0.2), abs=1e-12)
    assert plant.at(5.0).position[0] == standing.position[0]


def test_friction_takes_the_same_from_each_half_swing(library):
    """A spring swings about its new rest, 11.3 dead bands away, by 2 f_c/k less each time, and then sticks."""
    m, k, friction = 0.2, 800.0, 0.16
    band, half = friction / k, math.pi * math.sqrt(m / k)
    plant = Plant(library, x=(m, 0.0, friction, 0.0, 0.0, 0.0, k, 0.0))
    plant.push(0.0, 11.3 * friction)  # from 0 it swings about 11.3 bands
    peaks = [plant.at(half * (i + 1)).position[0] / band - 11.3 for i in range(7)]
    assert peaks[:5] == pytest.approx([9.3, -7.3, 5.3, -3.3, 1.3], abs=1e-7)
    assert peaks[5:] == pytest.approx([0.7, 0.7], abs=1e-7)


def test_energy_is_what_the_motor_gives_less_what_is_kept_and_lost(library):
    """A hand throws the handle at a wall, which the motor renders late: all books, once round the bounce."""
    m, b, friction = 0.1, 0.4, 0.02
    plant = Plant(library, x=(m, b, friction, 0.0, 0.1, 2.0, 120.0, 0.0))
    for when, place in ((0.0, 0.0), (0.15, 0.06), (0.6, 0.0)):
        plant.waypoint(when, place, 0.0, 0.0, 1.0)
    plant.port.plant_port_script()
    work = lost = 0.0
    before, touched, last = plant.at(0.0), False, 0.0
    for i in range(700):
        force = min(0.0, -900.0 * (before.position[0] - 0.03)) if i % 2 == 0 else last
        plant.push(i * 1e-3, force)
        last, touched = force, touched or force < -3.0
        for j in range(1, 21):
            now = plant.at(i * 1e-3 + j * 5e-5)
            middle = 0.5 * (before.velocity[0] + now.velocity[0])
            way = now.position[0] - before.position[0]
            work += force * way
            lost += friction * abs(way) + b * (middle * way if way else 0.0)
            before = now
    kept = 0.5 * m * before.velocity[0] ** 2
    assert touched
    assert before.energy == pytest.approx(work - lost - kept, abs=2e-7)


def test_a_motor_at_zero_gives_nothing(library):
    plant = Plant(
        library, x=(0.1, 3.0, 0.02, 0.0, 0.1, 8.0, 500.0, 0.0), theta=(1e-4, 4e-3, 1e-4, 0.0, 1e-4, 0.02, 1.0, 0.0)
    )
    for when, x, theta in ((0.0, 0.0, 0.0), (0.1, 0.05, 1.0), (0.2, -0.05, -2.0), (0.3, 0.0, 0.0)):
        plant.waypoint(when, x, 0.0, theta, 1.0)
    plant.port.plant_port_script()
    energies = [plant.at(0.001 * i).energy for i in range(500)]
    assert max(energies) == 0.0 and energies[-1] < -0.01


def test_delays_shift_the_motor_and_the_encoder(library):
    plant = Plant(library, sensing=0.0015, actuation=0.002)
    assert plant.push(0.001, 1.0) == pytest.approx(0.003, abs=1e-12)
    assert plant.push(0.002, -1.0) == pytest.approx(0.004, abs=1e-12)
    assert plant.at(0.003).position[0] == 0.0 and plant.at(0.003).motor[0] == 1.0
    middle = plant.at(0.0036)
    assert plant.at(0.0051).sensed[0] == pytest.approx(middle.position[0], abs=1e-10)
    assert plant.at(0.0051).motor[0] == -1.0
    plant.push(0.0051, 1.0)
    plant.cut(0.0052)
    assert plant.at(0.0052).motor[0] == 0.0 and plant.at(0.01).motor[0] == 0.0


def test_the_hand_goes_by_minimum_jerk_and_lets_go(library):
    held = (0.1, 0.0, 0.0, 0.0, 0.1, 60.0, 9000.0, 0.0)
    plant = Plant(library, x=held, y=held)
    for when, x, grip in ((0.0, 0.0, 1.0), (0.2, 0.04, 1.0), (0.4, -0.04, 0.0), (0.5, -0.04, 0.0)):
        plant.waypoint(when, x, 0.0, 0.0, grip)
    assert plant.at(0.1).target[0] == 0.0  # not begun
    plant.port.plant_port_script()
    middle = plant.at(0.2)
    assert middle.target[0] == pytest.approx(0.02) and middle.target_velocity[0] == pytest.approx(0.04 * 1.875 / 0.2)
    assert plant.at(0.25).target[0] == pytest.approx(0.04 * (10 * 0.75**3 - 15 * 0.75**4 + 6 * 0.75**5))
    assert not plant.port.plant_port_done()
    gone = plant.at(0.5001)
    plant.push(0.5001, 1.0)
    later = plant.at(0.5501)
    assert later.operator[0] == 0.0
    assert later.velocity[0] - gone.velocity[0] == pytest.approx(1.0 / 0.1 * 0.05, abs=1e-12)
    plant.at(0.61)
    assert plant.port.plant_port_done()


def test_the_hand_goes_round_at_an_even_rate_between_its_easing(library):
    plant = Plant(library, x=(*FREE[:7], 0.05))
    plant.port.plant_port_circle(ctypes.c_double(0.03), ctypes.c_double(2.0), ctypes.c_double(4.0))
    plant.port.plant_port_script()
    for when in (0.4, 1.0, 2.5, 3.6):
        state = plant.at(when)
        assert math.hypot(*(state.target[:2] - (0.02, 0.0))) == pytest.approx(0.03)
        assert math.hypot(*state.target_velocity[:2]) == pytest.approx(0.03 * 2 * math.pi * 2.0 / (0.9 * 4.0))
    ahead, behind = plant.at(3.9999), plant.at(4.0)
    assert behind.target[:2] == pytest.approx([0.05, 0.0], abs=1e-12)
    assert math.hypot(*ahead.target_velocity[:2]) < 1e-3


def test_a_following_hand_lags(library):
    plant = Plant(library)
    plant.port.plant_port_follow(ctypes.c_double(0.02))
    plant.port.plant_port_script()
    plant.at(0.1)
    plant.port.plant_port_goal((ctypes.c_double * 3)(0.05, -0.05, 1.0))
    state = plant.at(0.12)
    assert state.target == pytest.approx(np.array([0.05, -0.05, 1.0]) * (1 - math.exp(-1.0)))
    assert state.target_velocity == pytest.approx(np.array([0.05, -0.05, 1.0]) * math.exp(-1.0) / 0.02)


# ---- the reference device ----


class Device:
    """A reference device that runs; `say` sets an input."""

    def __init__(self, program, *options, config=""):
        if config:
            file = Path(program).parent / f"{os.getpid()}_{time.monotonic_ns()}.config"
            file.write_text(config)
            options = (*options, "--config", str(file))
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([program, *map(str, options)], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        self.line = self.process.stdout.readline().split()

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self, number=signal.SIGTERM):
        """What it says at its end."""
        self.process.send_signal(number)
        said, complained = self.process.communicate()
        assert (self.process.returncode, complained) == (0, "")
        return said


@pytest.fixture
def device(built):
    """Starts devices, and ends those that are left."""
    devices = []

    def start(*options, **more):
        devices.append(Device(built / "device", *options, **more))
        return devices[-1]

    yield start
    for one in devices:
        one.process.kill()
        one.process.communicate()


@contextlib.contextmanager
def talking(host):
    try:
        yield host
    finally:
        host.close()


def udp(device):
    return talking(link.UdpHost(int(device.line[1])))


def is_sample(frame):
    return frame.kind == link.SAMPLE


@contextlib.contextmanager
def terminal(path):
    """A host on a serial line that it opens as hosts do."""
    file = os.open(path, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(file, termios.TCIOFLUSH)
    with talking(link.SerialHost(file, session=time.monotonic_ns() & 0x7FFFFFFF | 1)) as host:
        yield host


def motor_changes(file):
    """(time [ns], force on x) of a device's log."""
    return [(int(line.split()[0]), float(line.split()[1])) for line in file.read_text().splitlines()]


def test_a_device_on_udp_is_driven_and_cut_to_the_nanosecond(device, tmp_path):
    log, config = tmp_path / "log", "watchdog 0.2\nmotor_constant 2 1 1\nmotor_sign -1 1 1\nencoder_sign -1 1 1\n"
    running = device("--udp", 0, "--log", log, config=config)
    with udp(running) as host:
        greeting = link.greeting(host.greet())
        assert greeting.name == b"reference" and greeting.largest_motor == (7.5, 15.0, 1.0) and greeting.features == 1
        deadline = host.now() + 100 * MS
        said = host.command(deadline, 5 * MS, (1.0, 0.0, 0.0))
        sample = link.sample(host.until(lambda frame: is_sample(frame) and frame.answers == said))
        assert (sample.deadline, sample.sampled) == (deadline, deadline)
        t, lag = (deadline - sample.applied) * 1e-9, 0.1 / 3.0
        way = -2.0 / 3.0 * (t - lag * (1 - math.exp(-t / lag)))
        assert sample.counts == (math.floor(-way * 2e5 + 0.5), 0, 0)
        assert sample.damper[0] == pytest.approx(-2.0 * (1 - math.exp(-t / lag)), rel=1e-6)
        cut = host.until(lambda frame: is_sample(frame) and frame.flags == link.CUT)
        assert cut.answers == 0 and link.sample(cut).deadline == sample.applied + 200 * MS
        truth = link.truth(host.until(lambda frame: frame.kind == link.TRUTH and not frame.flags & 2))
        assert truth.motor_force == (0.0, 0.0, 0.0) and truth.position[0] < way and truth.energy == 0.0
    assert running.end() == "frames refused 0, watchdog cuts 1, energy given 0 J\n"
    assert motor_changes(log) == [(sample.applied, -2.0), (sample.applied + 200 * MS, 0.0)]


def test_the_last_hello_has_the_device_and_the_motor_is_cut_for_it(device, tmp_path):
    log = tmp_path / "log"
    running = device("--udp", 0, "--log", log, config="watchdog 4\n")
    with udp(running) as host, talking(link.UdpHost(int(running.line[1]), session=99)) as second:
        host.greet()
        host.command(host.now() + MS, MS, (1.0, 0.0, 0.0))
        second.greet()
        assert [force for _, force in motor_changes(log)] == [1.0, 0.0]
        host.command(second.now() + MS, MS, (1.0, 0.0, 0.0))
        said = second.command(second.now() + MS)
        second.until(lambda frame: is_sample(frame) and frame.answers == said)
        assert {frame.session for frame in host.frames(0.01)} <= {host.session}
    assert running.end(signal.SIGINT).startswith("frames refused 1, watchdog cuts 0,")
    assert [force for _, force in motor_changes(log)] == [1.0, 0.0]


def clocks(host):
    """CLOCK_MONOTONIC before the device said its time, that time, and after it [ns]."""
    before, device_time, after = time.monotonic_ns(), host.now(), time.monotonic_ns()
    return np.array([before, device_time, after])


def sampled_exactly(host):
    """Whether a command of now is answered with a sample of the very deadline."""
    said = host.command(host.now() + 300 * MS)
    sample = link.sample(host.until(lambda frame: is_sample(frame) and frame.answers == said))
    return sample.sampled == sample.deadline


def test_a_clock_may_be_off_and_run_off(device):
    running = device("--udp", 0, "--clock-offset-s", -5, "--clock-ppm", 5e4, config="watchdog 1\n")
    with udp(running) as host:
        host.greet()
        first = clocks(host)
        assert first[1] - first[0] >= -5e9 and sampled_exactly(host)
        passed = clocks(host) - first
        assert (passed[0] - first[2] + first[0]) * 1.05 <= passed[1] <= (passed[2] + first[2] - first[0]) * 1.05


def test_a_clock_may_step(device):
    running = device("--udp", 0, "--clock-step-us", -2e6, "--clock-step-at", 0.05, config="watchdog 1\n")
    with udp(running) as host:
        host.greet()
        waiting.until(lambda: clocks(host)[1] < clocks(host)[0] - 1.9e9, "the step")
        now = clocks(host)
        assert now[0] <= now[1] + 2e9 <= now[2] and sampled_exactly(host)


def test_inputs_of_a_device_are_set_by_lines(device):
    running = device("--udp", 0)
    with udp(running) as host:
        host.greet()

        def shown(flags):
            return link.sample(host.until(lambda frame: is_sample(frame) and frame.flags == flags))

        assert shown(0).temperature == -32768
        running.say("temperature 71.5\nlimit 1")
        assert shown(link.END_SWITCH).temperature == 715
        running.say("limit 0\njump 5000\nestop 1")
        assert shown(link.ESTOP).counts == (5000, 0, 0)
        running.say("estop 0\ntemperature 80")
        assert shown(link.ESTOP | link.HOT).temperature == 800
        running.say("temperature 79.9")
        waiting.until(lambda: shown(link.ESTOP | link.HOT).temperature == 799, "a colder device")
        host.command(host.now() + MS, engaged=False)
        shown(0)
        running.process.stdin.close()
        running.process.stdin = None
        host.greet()
    assert "watchdog cuts" in running.end()


def test_a_hand_follows_targets_and_tells_the_truth(device):
    config = "motion follow\nlag 0.005\nhand_mass 0 0 0\nhand_damping 8 8 0\nhand_stiffness 500 500 0\nstart 0.01 0 0\n"
    running = device("--udp", 0, config=config)
    with udp(running) as host:
        host.greet()
        first = link.truth(host.until(lambda frame: frame.kind == link.TRUTH))
        assert first.position == first.target == (0.01, 0.0, 0.0)

        def drawn():
            host.command(host.now() + MS)
            host.send(link.TARGET, 0.03, -0.01, 0.0)
            truth = link.truth(host.until(lambda frame: frame.kind == link.TRUTH))
            return abs(truth.position[0] - 0.03) < 1e-4 and truth

        last = waiting.until(drawn, "the handle at its target")
        assert last.target[1] == pytest.approx(-0.01, abs=1e-3) and last.energy < 0.0
        assert last.time > first.time


def test_a_hand_waits_for_the_display_and_says_when_it_is_done(device):
    config = "hand_stiffness 500 500 1\nhand_damping 8 8 0.02\nwaypoint 0 0 0 0 1\nwaypoint 0.05 0.01 0 0 1\n"
    running = device("--udp", 0, config=config)
    with udp(running) as host:

        def told(flags):
            return link.truth(host.until(lambda frame: frame.kind == link.TRUTH and frame.flags == flags))

        host.greet()
        host.command(host.now() + MS, engaged=False)
        assert told(2).target == (0.0, 0.0, 0.0)
        first, later = told(0), told(0)
        assert later.target == (0.0, 0.0, 0.0) and later.time - first.time >= MS
        host.command(host.now() + MS)
        done = told(1)
        assert done.target == (0.01, 0.0, 0.0) and done.target_velocity == (0.0, 0.0, 0.0)
        assert done.operator_force[0] != 0.0 and done.motor_force == (0.0, 0.0, 0.0)


def test_a_device_on_a_line_takes_hosts_that_come_and_go(device, tmp_path):
    running = device("--pty", tmp_path / "line", config="watchdog 1\n")
    assert running.line[0] == "pty" and os.readlink(tmp_path / "line") == running.line[1]
    for _ in range(2):
        with terminal(tmp_path / "line") as host:
            assert link.greeting(host.greet()).axes == 3
            host.write(b"\1\2\3\0\0noise\0")
            assert sampled_exactly(host)
    assert running.end().startswith("frames refused 4,")
    assert not (tmp_path / "line").is_symlink()


def test_a_device_ends_with_its_parent(built):
    parent = (
        "import subprocess, sys\n"
        f"device = subprocess.Popen([{str(built / 'device')!r}, '--udp', '0'], stdout=subprocess.PIPE, text=True)\n"
        "device.stdout.readline()\n"
        "print(device.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen([sys.executable, "-c", parent], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        pid = int(process.stdout.readline())
        process.kill()

    def gone():
        stat = Path(f"/proc/{pid}/stat")
        return not stat.exists() or stat.read_text().split()[2] == "Z"

    waiting.until(gone, "the end of the device")


@pytest.mark.parametrize(
    "options, config, sentence",
    [
        (("--udp", "0"), "mas 1 1 1", "line 1: mas is no key that is known"),
        (("--udp", "0"), "axes 2\nmass 1 1", "line 2: mass has 2 numbers; write 3"),
        (("--udp", "0"), "mass 1 nought 1", "line 1: mass is 1 nought 1, which is no number"),
        (("--udp", "0"), "mass 1 0 1", "line 1: mass is 0 kg | kg m2; the limits are 1e-12 and 1e+09"),
        (("--udp", "0"), "mass 1 nan 1", "line 1: mass is nan kg | kg m2; the limits are 1e-12 and 1e+09"),
        (("--udp", "0"), "sensing_delay 0.101", "line 1: sensing_delay is 0.101 s; the limits are 0 and 0.1"),
        (("--udp", "0"), "axes 2.5", "line 1: axes is 2.5; the limits are 1 and 3"),
        (("--udp", "0"), "motor_sign 1 0.5 1", "line 1: motor_sign is 0.5; the limits are -1 and 1"),
        (("--udp", "0"), "motion jump", "line 1: motion is jump; write waypoints, circle or follow"),
        (("--udp", "0"), "hand_damping 9999999 0 0", "axis 1 as fast as 1e+08 1/s; the limit is 100000 1/s"),
        (
            ("--udp", "0"),
            "waypoint 1 0 0 0 1\nwaypoint 0.5 0 0 0 1",
            "comes after one at 1 s; write them in the order of their times",
        ),
        (("--udp", "0", "--pty", "/tmp/x"), "", "write either --udp PORT or --pty LINK"),
        ((), "", "write either --udp PORT or --pty LINK"),
        (("--udp", "65536"), "", "--udp is 65536; write a number from 0 to 65535"),
        (("--udp", "0", "--frob", "1"), "", "--frob is no option that is known"),
        (("--udp",), "", "--udp needs a value"),
        (("--udp", "0", "--bind", "nowhere"), "", "nowhere:0: Invalid argument"),
        (("--pty", "/"), "", "/: File exists"),
        (("--udp", "0", "--config", "/nowhere"), "", "/nowhere: No such file or directory"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(built, tmp_path, options, config, sentence):
    if config:
        (tmp_path / "config").write_text(config + "\n")
        options = (*options, "--config", str(tmp_path / "config"))
    done = subprocess.run([built / "device", *options], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.rstrip("\n").endswith(sentence)


# ---- what starts it ----

VALUES = {parameter.name: parameter.default for parameter in LOOPBACK}


def test_make_and_the_package_build_the_same_program(monkeypatch, tmp_path, built):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    program = reference_device.compiled()
    assert program.parent.parent == tmp_path / "haptic_display" and list(program.parent.iterdir()) == [program]
    monkeypatch.setenv("CC", "nothing_of_this_name")
    assert reference_device.compiled() == program
    copy = tmp_path / "firmware"
    subprocess.run(["cp", "-r", str(FIRMWARE), str(copy)], check=True)
    subprocess.run(["make", "-s", "-C", str(copy), "clean", "CC=gcc"], check=True)
    subprocess.run(["make", "-s", "-C", str(copy), "CC=gcc"], check=True)
    for one in (program, copy / "build/reference_device"):
        done = subprocess.run([one], capture_output=True, text=True, check=False)
        assert done.stderr == "reference_device: write either --udp PORT or --pty LINK\n"


def test_an_installed_package_finds_all_that_it_compiles(monkeypatch, tmp_path):
    """What setup.py installs, in the place where it installs it, of a package that has no source tree around it."""
    monkeypatch.chdir(ROOT)
    told = {}
    monkeypatch.setattr("setuptools.setup", lambda **facts: told.update(facts))
    runpy.run_path("setup.py")
    for folder, files in told["data_files"]:
        for file in files:
            (tmp_path / folder).mkdir(parents=True, exist_ok=True)
            shutil.copy(file, tmp_path / folder)
    monkeypatch.setattr("sys.prefix", "/nowhere")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr(reference_device, "__file__", str(tmp_path / "lib/haptic_sim/supervision/reference_device.py"))
    with pytest.raises(ValueError, match="^the firmware's sources are not in "):
        reference_device.sources()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert reference_device.sources() == tmp_path / "share/haptic_display/firmware"
    assert reference_device.compiled().is_file()


def test_without_a_compiler_or_with_one_that_refuses_a_sentence_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ValueError, match=r"^the reference device needs a C compiler \(\$CC, cc, gcc, clang\); install"):
        reference_device.compiled()
    refusing = tmp_path / "cc"
    refusing.write_text("#!/bin/sh\necho 'x.c:1: note' >&2\necho 'x.c:1: error: no' >&2\nexit 1\n")
    refusing.chmod(0o755)
    with pytest.raises(ValueError, match="^cc does not compile the reference device: x.c:1: error: no$"):
        reference_device.compiled()
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(ValueError, match="^the reference device cannot be compiled: .*Not a directory$"):
        reference_device.compiled()


@pytest.mark.parametrize("script", ["hold", "insert_peg", "tap", "circle", "let_go", "waypoints", "follow"])
def test_a_described_device_is_one_that_the_reference_device_takes(device, script):
    values = VALUES | {"motion.name": script, "motion.target": (0.04, -0.02, 0.5), "motion.waypoints": (0.01, 0.0, 0.2)}
    running = device("--udp", 0, config=reference_device.config_of(load_device("desktop"), values))
    with udp(running) as host:
        greeting = link.greeting(host.greet())
    assert greeting.name == b"desktop" and greeting.counts_per_unit == (200000.0, 200000.0, 40000.0)
    assert greeting.watchdog == 15 * MS


def test_places_of_the_world_are_told_in_the_devices_own_units():
    axis = {"counts_per_unit": 1000.0, "motor_limit": 2.0, "workspace": [-1.0, 1.0], "velocity_limit": 1.0}
    axes = [{"name": name, "mass": 0.1, "damping": 1.0, **axis} for name in ("x", "y")]
    described = parse({"name": "small", "axes": axes, "scale": [2.0, 1.0], "gravity": [0.0, -9.81]}, "small")
    values = VALUES | {"motion.name": "waypoints", "motion.waypoints": (0.2, 0.1, 0.7), "motion.start": (0.1, 0.0, 0.3)}
    lines = reference_device.config_of(described, values).splitlines()
    assert {"axes 2", "start 0.05 0.0 0.0", "gravity 0.0 -9.81 0.0", "motor_limit 2.0 2.0 2.0"} <= set(lines)
    assert [line for line in lines if line.startswith("waypoint")] == [
        "waypoint 0.0 0.05 0.0 0.0 1.0",
        "waypoint 4.0 0.1 0.05 0.0 1.0",
    ]
    circle = reference_device.config_of(described, VALUES | {"motion.name": "circle"}).splitlines()
    assert {"motion circle", "radius 0.015", "turns 4.0", "duration 4.0"} <= set(circle)
    with pytest.raises(ValueError, match=r"^motor_watchdog is 4.01 s; the reference device stands 4 s at most$"):
        reference_device.config_of(described, VALUES | {"motor_watchdog": 4.01})
