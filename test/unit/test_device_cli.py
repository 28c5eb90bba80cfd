# SPDX-License-Identifier: Apache-2.0
"""`haptic device`: ports in made-up trees, devices that greet, keep promises and break them, hands that move."""

import contextlib
import itertools
import json
import os
import pty
import select
import socket
import struct
import threading
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_process import haptic
from link_frames import stuffed, unstuffed
from serial.tools.list_ports_linux import SysFS

from haptic_device.config.description import load_device
from haptic_device.config.files import ConfigError
from haptic_device.realtime import shared_memory
from haptic_device.realtime.hardware_interface import COUNTS, LATCHED, SAMPLE, STATUS
from haptic_device.realtime.null_device import NullDevice
from haptic_device.recording.status import Status
from haptic_display.cli import device as cli
from haptic_display.device_tools import conformance, device_page, serial_ports
from haptic_display.device_tools import figures as device_figures
from haptic_display.device_tools import probe as device_probe
from haptic_display.device_tools import questions as device_questions
from haptic_display.device_tools import search as device_search
from haptic_display.device_tools import set_up as device_set_up

MS = 1_000_000


# what answers: frames


def greeting(session, name=b"stick", axes=2, kind=2, version=1, features=0):
    """A greeting as the page has it."""
    head = struct.pack("<BBHIII", version, kind, 0, session, 1, 1)
    told = struct.pack("<24sII3f3fIIII", name, 0x010203, axes, 2e5, 2e5, 0, 1, 1, 0, 250_000, 15 * MS, 32, features)
    return head + told + struct.pack("<I", zlib.crc32(head + told))


def hello_of(frame):
    """Session of the hello that a frame has to be."""
    assert len(frame) == 20 and zlib.crc32(frame[:16]) == struct.unpack("<I", frame[16:])[0]
    version, kind, flags, session, sequence, answered = struct.unpack("<BBHIII", frame[:16])
    assert (version, kind, flags, sequence, answered) == (1, 1, 0, 1, 0)
    return session


def test_a_greeting_is_read_field_by_field():
    read = device_probe.greeting_of(greeting(7, features=1), {7})
    assert (read.name, read.firmware, read.axes, read.watchdog) == ("stick", "1.2.3", 2, 15 * MS)
    assert read.counts_per_unit == (2e5, 2e5, 0.0) and read.motor_limits == (1.0, 1.0, 0.0)
    assert (read.shortest_period, read.counter_bits, read.simulated) == (250_000, 32, True)


def test_what_is_no_greeting_of_ours_is_none():
    whole = greeting(7)
    for frame in (greeting(8), greeting(7, kind=4), greeting(7, version=2), whole[:-1], whole + b"\0", b""):
        assert device_probe.greeting_of(frame, {7}) is None
    for at in range(len(whole)):
        assert device_probe.greeting_of(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :], {7}) is None


@given(st.binary(max_size=120), st.integers(1, 2**32 - 1))
def test_no_bytes_that_come_are_an_error(come, session):
    assert device_probe.greeting_of(come, {session}) is None
    take = device_probe._lines()
    assert all(isinstance(frame, bytes) for frame in take(come) + take(come))


def test_a_hello_has_a_session_and_no_byte_that_begins_a_torque_of_haplys_firmware():
    for _ in range(200):
        session, hello = device_probe.harmless_hello()
        assert hello_of(hello) == session != 0
        assert 2 not in stuffed(hello)


# what answers: lines


@contextlib.contextmanager
def on_a_line(answer, before=b""):
    """A port whose other end answers each hello with answer(session); bytes `before` come first."""
    far, near = pty.openpty()
    end = threading.Event()

    def serve():
        rest = b""
        while not end.is_set():
            if not select.select([far], [], [], 0.01)[0]:
                continue
            *frames, rest = (rest + os.read(far, 4096)).split(b"\0")
            for coded in filter(None, frames):
                os.write(far, before + stuffed(answer(hello_of(unstuffed(coded)))))

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        yield os.ttyname(near)
    finally:
        end.set()
        serving.join()
        os.close(far)
        os.close(near)


def test_a_device_on_a_line_is_known_by_its_greeting_in_our_session_whatever_comes_before_it():
    with on_a_line(greeting, before=b"\x07noise\0\xff\xff\0\0") as path:
        assert device_probe.ask_serial(path, 115200, 30.0).name == "stick"
        with pytest.raises(ValueError, match=r"baud is 12345: it should be one of 1200, .* 115200, .* bit/s"):
            device_probe.ask_serial(path, 12345, 0.1)
    with on_a_line(lambda session: greeting(session ^ 1)) as path:
        assert device_probe.ask_serial(path, 115200, 0.3) is None


@contextlib.contextmanager
def on_udp():
    """Address of a device that greets."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
        device.bind(("127.0.0.1", 0))
        device.settimeout(30.0)

        def serve():
            frame, asked_by = device.recvfrom(100)
            device.sendto(greeting(hello_of(frame), name=b"box"), asked_by)

        serving = threading.Thread(target=serve)
        serving.start()
        yield f"127.0.0.1:{device.getsockname()[1]}"
        serving.join()


def test_a_device_on_udp_is_found_with_the_line_for_its_description_and_where_nobody_is_nothing_greets():
    with on_udp() as address:
        ended = haptic("device", "find", "--silent", "--udp", address, "--wait", "30")
        port = address.split(":")[1]
    assert ended.returncode == 0
    assert f"link: {{type: udp, host: 127.0.0.1, port: {port}}}" in ended.stdout
    assert "box: a device with 2 axes, firmware 1.2.3, watchdog 15 ms" in ended.stdout
    found = device_search.look_at(address, 0.1)
    assert found["greeting"] is None
    assert found["link"] is None
    assert found["answer"].startswith(f"nothing greeted at 127.0.0.1, port {port}: no such device")


# which ports there are


class Machine:
    """USB ports that pyserial lists, and a tree of /dev, /sys and /proc below a folder."""

    def __init__(self, root):
        self.root, self.listed = root, []
        for folder in ("dev/serial/by-id", "proc/self"):
            (root / folder).mkdir(parents=True)

    def plug(self, name, latency=None, by_id="", **facts):
        """A port of a USB device that says these facts, or of none."""
        (self.root / "dev" / name).touch()
        port = SysFS(str(self.root / "dev" / name))
        port.device_path = str(self.root / "sys/devices" / name)
        Path(port.device_path).mkdir(parents=True)
        for fact, value in facts.items():
            setattr(port, fact, value)
        if latency is not None:
            (Path(port.device_path) / "latency_timer").write_text(f"{latency}\n")
        if by_id:
            (self.root / "dev/serial/by-id" / by_id).symlink_to(f"../../{name}")
        self.listed.insert(0, port)

    def run(self, number, command, holds=()):
        """A process that has these ports open."""
        folder = self.root / "proc" / str(number)
        (folder / "fd").mkdir(parents=True)
        (folder / "comm").write_text(f"{command}\n")
        for at, name in enumerate(holds):
            (folder / "fd" / str(at)).symlink_to(self.root / "dev" / name)

    def look(self, **how):
        return device_search.look(hello=False, **how)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    made = Machine(tmp_path)
    monkeypatch.setattr(serial_ports, "comports", lambda: made.listed)
    monkeypatch.setattr(serial_ports, "LASTING", tmp_path / "dev/serial/by-id")
    monkeypatch.setattr(serial_ports, "PROCESSES", tmp_path / "proc")
    return made


TEENSY = {"vid": 0x16C0, "pid": 0x0483, "serial_number": "77", "manufacturer": "Teensyduino"}


def test_each_port_is_told_with_what_it_says_of_itself_and_its_lasting_name(machine):
    machine.plug("ttyACM9", by_id="usb-Teensy_77-if00", **TEENSY)
    machine.plug("ttyACM10", **TEENSY | {"serial_number": None, "manufacturer": "a\x1b[2Jb"})
    machine.plug("ttyS0")
    first, second = machine.look()
    assert first["usb"] == dict(vendor="16c0", product="0483", serial="77", maker="Teensyduino", model="")
    assert first["by_id"] == str(machine.root / "dev/serial/by-id/usb-Teensy_77-if00")
    assert second["port"].endswith("dev/ttyACM10") and second["by_id"] == ""
    assert second["usb"]["serial"] == "" and second["usb"]["maker"] == "a[2Jb"
    assert first["notes"] == second["notes"] == []
    assert first["answer"] == "not asked"


def test_a_port_that_may_not_be_opened_or_is_held_is_not_asked_and_says_what_to_do(machine, monkeypatch):
    machine.plug("ttyACM0", **TEENSY)
    with monkeypatch.context() as patch:
        patch.setattr(serial_ports.os, "access", lambda *asked: False)
        [found], [port] = device_search.look(), serial_ports.ports()
    assert found["answer"] == "not asked, since it may not be opened"
    rule = 'SUBSYSTEM=="tty", ATTRS{idVendor}=="16c0", ATTRS{idProduct}=="0483", MODE="0660", GROUP="dialout", '
    assert rule in found["notes"][0]
    assert "sudo usermod -aG dialout $USER" in serial_ports.notes(port._replace(group="dialout"), False)[0]
    machine.run(41, "minicom", holds=["ttyACM0"])
    machine.run(42, "bash")
    [found] = device_search.look()
    assert found["answer"] == "not asked, since it is held"
    assert found["notes"] == [f"{machine.root}/dev/ttyACM0 is held by minicom (process 41): end that first"]


def test_what_keeps_a_port_late_or_takes_it_away_is_told_of_with_the_rule_against_it(machine):
    for name, timer in (("ttyUSB0", None), ("ttyUSB1", 1), ("ttyUSB2", 2)):
        machine.plug(name, latency=timer, **TEENSY)
    assert [port["notes"] for port in machine.look()[:2]] == [[], []]
    [note] = machine.look()[2]["notes"]
    assert "for 2 ms" in note
    assert 'ATTR{latency_timer}="1"' in note
    machine.run(7, "ModemManager")
    [note] = machine.look()[0]["notes"]
    assert note.startswith("ModemManager runs")
    assert 'ATTRS{idProduct}=="0483", ENV{ID_MM_DEVICE_IGNORE}="1"' in note


def test_a_port_that_is_unplugged_while_pyserial_looks_at_it_is_no_error(machine, monkeypatch):
    def stumbling():
        monkeypatch.setattr(serial_ports, "comports", lambda: machine.listed)
        raise TypeError("int() argument must be a string")

    machine.plug("ttyACM0", **TEENSY)
    monkeypatch.setattr(serial_ports, "comports", stumbling)
    assert len(machine.look()) == 1


def test_boards_that_a_stray_byte_may_block_are_not_asked(machine):
    for name, maker, link in (("ttyACM0", "mjbots", "moteus"), ("ttyACM1", "Haply Robotics", "haply")):
        machine.plug(name, vid=1, pid=2, manufacturer=maker)
        answer = device_search.look()[-1]["answer"]
        assert answer.startswith(f"a board for the link type {link}; not asked, since a byte")


def test_a_device_that_greets_on_its_port_has_a_line_for_its_description_and_what_is_no_terminal_cannot_be_asked(
    machine,
):
    machine.plug("ttyACM0", **TEENSY)
    [found] = device_search.look(patience=0.1)
    assert found["answer"] == f"it cannot be asked: {machine.root}/dev/ttyACM0: Inappropriate ioctl for device"
    with on_a_line(greeting) as path:
        (machine.root / "dev/ttyACM0").unlink()
        (machine.root / "dev/ttyACM0").symlink_to(path)
        [found] = device_search.look(baud=9600, patience=30.0)
    assert found["answer"] == "stick: a device with 2 axes, firmware 1.2.3, watchdog 15 ms"
    assert found["link"] == {"type": "serial", "port": str(machine.root / "dev/ttyACM0"), "baud": 9600}


# what a device owes


class Kept:
    """A device that keeps every promise, as an interface in Python; it moves by a count a millisecond."""

    watchdog = 15 * MS

    def __init__(self):
        self.memory, self.written, self.motor, self.most = np.zeros(1, np.int64), 0, 0.0, 0.0

    def present(self):
        return True

    def now(self):
        return time.monotonic_ns()

    def read(self, memory, deadline, give_up, sample):
        while self.now() < min(deadline, give_up):
            time.sleep(1e-5)
        now = self.now()
        fresh = now >= deadline
        latched = max(deadline, now - now % MS) if fresh else now - now % MS
        sample[:] = 0.0
        sample[LATCHED], sample[COUNTS] = latched, latched // MS % 1000
        sample[STATUS] = 2 if latched - self.written > self.watchdog else 0
        return int(fresh)

    def write(self, memory, written, deadline, period, engaged, motor):
        self.written, self.motor = written, motor[0]
        self.most = max(self.most, abs(motor).max())
        return 0


def without_compiling(monkeypatch):
    monkeypatch.delitem(conformance.CHECKS, "compiled with its signatures")


def test_a_device_that_keeps_its_promises_passes_every_check_is_pushed_gently_and_left_at_zero(monkeypatch):
    without_compiling(monkeypatch)
    device, told = Kept(), []
    results = conformance.check_all(device, told.append, 0.005)
    kept = [result for result in results if result.name != conformance.IN_TIME]  # that one is of this machine too
    assert [result.sentence for result in kept if not result.passed] == []
    assert told == [result.name for result in results] == list(conformance.CHECKS)
    assert device.most == 0.005 and device.motor == 0.0


def test_an_interface_in_python_has_not_its_signatures_and_a_compiled_one_has():
    assert conformance.has_its_signatures(NullDevice()) == ""
    with pytest.raises(conformance.Violation, match="read is not compiled with the signature"):
        conformance.has_its_signatures(Kept())
    other = NullDevice()
    other.memory = np.zeros(1)
    with pytest.raises(conformance.Violation, match="memory is no int64 array"):
        conformance.has_its_signatures(other)


def broken(change):
    """A device whose samples are changed by change(sample, fresh, deadline), which returns what reading returns."""
    device = Kept()
    read = device.read

    def otherwise(memory, deadline, give_up, sample):
        fresh = read(memory, deadline, give_up, sample)
        return change(sample, fresh, deadline)

    device.read = otherwise
    return device


def setting(place, *values):
    """A change that sets this word of the samples, to each value in turn."""
    turn = itertools.cycle(values)

    def change(sample, fresh, deadline):
        sample[place] = next(turn)
        return fresh

    return change


def fresh_as(*answers):
    """A change of what reading returns, in turn."""
    turn = itertools.cycle(answers)
    return lambda sample, fresh, deadline: next(turn)


def too_early(sample, fresh, deadline):
    sample[LATCHED] = deadline - 1000
    return 1


def runs_back():
    first = []

    def change(sample, fresh, deadline):
        first.append(deadline)
        sample[LATCHED] = 2 * first[0] - deadline
        return fresh

    return change


@pytest.mark.parametrize(
    "check, change, sentence",
    [
        (conformance.latches_at_deadlines, fresh_as(0), "no sample of a deadline that had passed"),
        (conformance.latches_at_deadlines, too_early, r"latched 1\.0 us before its deadline, was called fresh"),
        (conformance.latches_at_deadlines, setting(COUNTS + 2, np.nan), "values that are not finite"),
        (conformance.keeps_time, runs_back(), "time ran backwards by"),
        (conformance.pushes_while_written, setting(STATUS, 2), "stayed cut though the servo wrote"),
        (conformance.pushes_while_written, setting(STATUS, 2, 0), "the motor was cut .* ms after a write"),
        (conformance.gives_up, fresh_as(1), "an hour ahead was called fresh"),
        (conformance.counts_whole_steps, setting(COUNTS + 1, 0.5), "have to be whole numbers"),
        (conformance.cuts_the_motor, setting(STATUS, 2), "stayed cut though the servo wrote again"),
    ],
    ids=range(9),
)
def test_a_device_that_breaks_a_promise_is_found_out(check, change, sentence):
    with pytest.raises(conformance.Violation, match=sentence):
        check(broken(change=change))


def test_samples_of_ninety_nine_in_a_hundred_deadlines_are_enough_and_of_fewer_are_not():
    assert "99.0 % of 100; deadline to sample" in conformance.meets_deadlines(broken(fresh_as(*[1] * 99, 0)), ticks=100)
    with pytest.raises(conformance.Violation, match=r"samples of 98\.0 % of 100 deadlines .* at least 99 % are needed"):
        conformance.meets_deadlines(broken(fresh_as(*[1] * 49, 0)), ticks=100)


def test_a_device_without_a_watchdog_and_one_that_is_not_there_are_told_of(monkeypatch):
    monkeypatch.setattr(conformance, "LIMIT", 50 * MS)
    device = Kept()
    device.watchdog = 2**62
    with pytest.raises(conformance.Violation, match=r"does not cut the motor of a silent servo within 0\.05 s"):
        conformance.cuts_the_motor(device)
    without_compiling(monkeypatch)
    device.present = lambda: False
    [only] = conformance.check_all(device)
    assert not only.passed and only.sentence == "the device does not answer within 0.05 s"


# how one is described


class Handle:
    """A device whose axes count `signs` · per_unit, and whose motors push `motors` ways against friction."""

    def __init__(
        self, signs=(1, -1, 1), per_unit=(1000.0, 2000.0, 500.0), motors=(1, 1, -1), start=(100.0, -40.0, 0.0)
    ):
        self.signs, self.per_unit, self.motors = np.array(signs), np.array(per_unit), np.array(motors)
        self.start, self.place, self.motor, self.most, self.status = np.array(start), np.zeros(3), np.zeros(3), 0.0, 0
        self.friction = 0.002

    def tick(self, motor):
        self.motor, self.most = motor.copy(), max(self.most, abs(motor).max())
        self.place = self.place + 0.002 * self.motors * np.sign(motor) * (abs(motor) > self.friction)
        sample = np.zeros(SAMPLE)
        sample[STATUS] = self.status
        sample[COUNTS : COUNTS + 3] = np.round(self.start + self.signs * self.per_unit * self.place)
        return sample


class Hand:
    """Answers as somebody would who moves the handle: {key: answer, or a place, or places in turn}."""

    def __init__(self, handle, **answers):
        self.handle, self.answers, self.said, self.asked = handle, answers, [], []

    def say(self, sentence):
        self.said.append(sentence)

    def known(self, key):
        return None

    def ready(self, key, todo, look):
        self.asked.append(todo)
        for place in self._next(key):
            self.handle.place = np.array(place, float)
            look()

    def number(self, key, text, unit):
        return self._next(key)

    def yes(self, key, text):
        return self._next(key)

    def choice(self, key, text, options):
        assert self._next(key) in options
        return self._next(key)

    def _next(self, key):
        found = self.answers[key.replace(".", "_")]
        return found.pop(0) if isinstance(found, list) else found


def moves(handle, **more):
    """A hand that measures every axis of three."""
    limits = ([-0.1, -0.12, -2], [0.12, 0.14, 3], [0, 0, 0])
    ways = {"x_way": ([0.1, 0, 0],), "y_way": ([0.1, 0.1, 0],), "theta_way": ([0.1, 0.1, 1],), "zero": ([0, 0, 0],)}
    lengths = {"x_length": 0.1, "y_length": 0.1, "theta_length": 1.0}
    pushes = dict.fromkeys(("x_push", "y_push", "theta_push"), True)
    given = {"homing": "absolute", "workspace": limits, **ways, **lengths, **pushes}
    return Hand(handle, **(given | more))


def described(hand, **how):
    content = device_set_up.set_up(hand, hand.handle, load_device("desktop"), "mine", **how)
    return content, {axis["name"]: axis for axis in content["axes"]}


def test_a_hand_that_moves_the_handle_finds_signs_scales_zero_and_workspace():
    handle = Handle()
    content, axes = described(moves(handle))
    assert content["name"] == "mine" and content["homing"] == "absolute"
    assert [axis["encoder_sign"] for axis in axes.values()] == [1, -1, 1]
    assert [axis["counts_per_unit"] for axis in axes.values()] == pytest.approx([1000.0, 2000.0, 500.0])
    assert [axis["motor_sign"] for axis in axes.values()] == [1, 1, -1]
    assert [axis["zero"] for axis in axes.values()] == pytest.approx([-0.1, -0.02, 0.0])
    assert axes["x"]["workspace"] == pytest.approx([-0.1, 0.12])
    assert axes["y"]["workspace"] == pytest.approx([-0.12, 0.14])
    assert axes["theta"]["workspace"] == pytest.approx([-2.0, 3.0])
    assert handle.most <= device_set_up.PUSH and not handle.motor.any()


def test_a_handle_that_is_put_to_its_home_has_its_workspace_from_there():
    content, axes = described(moves(Handle(), homing="at_start", home_x=0.05, home_y=0.0, home_theta=1.0))
    assert content["home"] == pytest.approx([0.05, 0.0, 1.0])
    assert axes["x"]["zero"] == 0.0
    assert axes["x"]["workspace"] == pytest.approx([-0.05, 0.17])
    assert axes["theta"]["workspace"] == pytest.approx([-1.0, 4.0])


def test_a_way_that_tells_nothing_or_is_along_another_axis_is_asked_for_again_with_the_reason():
    ways = [([0.049, 0, 0],), ([0.049, 0.1, 0],), ([0.149, 0.1, 0],), ([0.249, 0.1, 0],)]
    hand = moves(Handle(), x_way=ways, x_length=[0.1, 0.1, -0.1, 0.1], y_way=([0.249, 0.2, 0],))
    _, axes = described(hand)
    assert axes["x"]["counts_per_unit"] == pytest.approx(1000.0)
    assert hand.said[0] == "axis x: its counts changed by 49; at least 50 are needed"
    assert hand.said[1].startswith("axis x: its counts changed by 0")
    assert hand.said[2] == "axis x: the way is -0.1 m; more than 0 is needed"
    hand = moves(Handle(), x_way=[([0.06, 0.1, 0],), ([0.16, 0.1, 0],)], y_way=([0.16, 0.2, 0],))
    described(hand)
    assert hand.said[0].startswith("axis x: the counts of y changed by -200, its own by 60; is the way along another")


def test_a_push_that_is_not_allowed_or_moves_nothing_leaves_the_sign_and_says_so():
    handle, stuck = Handle(), Handle()
    hand = moves(handle, x_push=False, y_push=False, theta_push=False)
    described(hand)
    assert handle.most == 0.0
    assert hand.said[-1] == "motor_sign of theta stays 1, untried"
    stuck.friction = 1.0
    hand = moves(stuck)
    described(hand, push=0.02)
    assert stuck.most == 0.02
    assert hand.said[0] == "0.02 motor units did not move x: motor_sign stays 1, untried"


def test_a_device_that_takes_no_motor_value_is_not_pushed():
    for bit, word in ((4, "emergency stop pressed"), (8, "too hot"), (32, "encoder broken")):
        handle = Handle()
        handle.status = bit
        with pytest.raises(ValueError, match=f"the device takes no motor value: {word}"):
            described(moves(handle))
        assert not handle.motor.any()


def test_an_end_of_the_hand_leaves_the_motor_at_zero():
    hand = moves(handle := Handle())

    def interrupted(key, text):
        handle.tick(np.array([0.01, 0.0, 0.0]))
        raise KeyboardInterrupt

    hand.yes = interrupted
    with pytest.raises(KeyboardInterrupt):
        described(hand)
    assert not handle.motor.any()


AXIS = {"counts_per_unit": 1000.0, "encoder_sign": -1, "zero": 0.5, "workspace": [-0.1, 0.1], "motor_sign": -1}
ALL = {"homing": "absolute", "x": AXIS, "y": AXIS, "theta": AXIS}


def answered(content):
    questions = device_questions.Answers(content, "answers.yaml")
    return device_set_up.set_up(questions, Handle(), load_device("desktop"), "mine")


def test_answers_are_the_description_and_the_file_reads_again(tmp_path):
    content = answered(ALL)
    assert {key: content["axes"][1][key] for key in AXIS} == AXIS
    device_set_up.write(tmp_path / "mine.yaml", content, "desktop")
    read = load_device(tmp_path / "mine.yaml")
    assert (read.name, read.axes[2].zero, read.axes[0].mass) == ("mine", 0.5, 0.1)


def test_a_motor_sign_that_answers_do_not_give_is_found_by_a_push_that_they_allow():
    content = answered(ALL | {"theta": AXIS | {"motor_sign": None, "encoder_sign": 1, "push": True}})
    assert content["axes"][2]["motor_sign"] == -1


def test_answers_that_are_wrong_or_missing_are_a_sentence():
    for change, sentence in (
        ({"homing": "sometimes"}, "answers.yaml: homing is 'sometimes'; absolute or at_start is needed"),
        ({"homing": None}, "answers.yaml does not tell homing"),
        ({"homing": "at_start"}, "answers.yaml does not tell home.x"),
        ({"x": {}}, "answers.yaml does not tell all, and nobody is there to move the handle from where it is along"),
        ({"x": AXIS | {"zero": None}}, "does not tell all, and nobody is there to put the handle to where"),
        ({"x": AXIS | {"zero": "here"}}, "answers.yaml: x.zero is 'here'; a number in m is needed"),
        ({"x": AXIS | {"zero": float("nan")}}, "answers.yaml: x.zero is nan; a number in m is needed"),
        ({"x": AXIS | {"encoder_sign": 2}}, "x.encoder_sign is 2; 1 or -1 is needed"),
        ({"y": AXIS | {"counts_per_unit": -1.0}}, "mine: axes[1].counts_per_unit is -1.0: it should be greater than"),
        ({"x": AXIS | {"motor_sign": None, "push": 1}}, "answers.yaml: x.push is 1; true or false is needed"),
    ):
        with pytest.raises((ValueError, ConfigError)) as refused:
            answered(ALL | change)
        assert sentence in str(refused.value)
        assert "\n" not in str(refused.value)


@contextlib.contextmanager
def terminal(typed):
    """Questions at a terminal at which these lines are typed."""
    far, near = pty.openpty()
    with open(near) as source, open(os.devnull, "w") as target:
        os.write(far, typed.encode())
        yield device_questions.Terminal(source, target)
        os.close(far)


def test_at_a_terminal_what_cannot_be_used_is_asked_again_and_the_handle_is_read_meanwhile():
    with terminal("ten\nnan\n10\nmaybe\nYes\nneither\nabsolute\n\n\x04") as asked:
        assert asked.number("x.length", "How far?", "m") == 10.0
        assert asked.yes("x.push", "May it?") is True
        assert asked.choice("homing", "How?", ("absolute", "at_start")) == "absolute"
        asked.ready("zero", "Put it there", lambda: None)
        with pytest.raises(ValueError, match="standard input has ended"):
            asked.yes("x.push", "May it?")


# what is shown


def test_a_page_is_looked_at_without_taking_part_and_one_that_is_just_written_tells_nothing(tmp_path):
    latched = time.monotonic_ns() - 10 * MS
    words = np.zeros(shared_memory.WORDS, np.int64)
    block = words[shared_memory.DEVICE_FIRST :][: shared_memory.DEVICE_WORDS]
    block[:7] = 9, latched, 6, latched, 11, -12, 13
    block[7:10].view(float)[:] = 0.5, 0.25, 0.0
    for lock, there in ((4, True), (0, False), (5, False)):
        words[shared_memory.DEVICE_LOCK] = lock
        words.tofile(tmp_path / "page")
        seen = device_page.glance("page", tmp_path)
        assert (seen is not None) == there
        if there:
            assert (seen.counts, seen.drag, seen.status) == ((11, -12, 13), (0.5, 0.25, 0.0), 6)
            assert seen.age >= 0.01
    (tmp_path / "short").write_bytes(b"\0" * 8)
    assert device_page.glance("nowhere", tmp_path) is device_page.glance("short", tmp_path) is None


BRIDGE = Status(0, 1, "serving", {"device": "mine", "connected": "True", "delay_us": "412.0", "lost": "3", "port": ""})


def test_a_device_answers_where_its_page_is_new_and_its_bridge_connected():
    new, old = (device_page.Glance(0, (0, 0, 0), (0.0, 0.0, 0.0), age) for age in (0.49, 0.51))
    unplugged = BRIDGE._replace(values={"connected": "False"})
    for nodes, page, answers in (
        ({}, new, True),
        ({"haptic_bridge": BRIDGE}, new, True),
        ({"haptic_bridge": unplugged}, new, False),
        ({}, old, False),
        ({}, None, False),
    ):
        assert device_figures.answering(nodes, page) == answers


# the command


def test_a_device_of_a_program_of_ones_own_is_asked_for_in_its_domain(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    refused = "device own_device is served by a program of your own: start it, and give its --domain"
    with pytest.raises(ValueError, match=refused), device_page.opened("own_device", None, None):
        pass


def test_a_device_that_falls_silent_is_told_of(monkeypatch):
    monkeypatch.setattr(device_page, "SILENT", 0.01)
    with pytest.raises(ValueError, match=r"the device has sent no sample for 0\.01 s"):
        device_page.PageDevice(broken(fresh_as(0))).tick(np.zeros(3))


def test_a_tick_gives_the_sample_after_it_and_engages_only_to_push():
    device, told = Kept(), []
    write = device.write
    device.write = lambda *words: told.append((words[4], words[5].tolist())) or write(*words)
    before = time.monotonic_ns()
    for motor in ([0.0, 0.0, 0.0], [0.0, 0.01, 0.0]):
        sample = device_page.PageDevice(device).tick(np.array(motor))
        assert sample[LATCHED] >= before + MS
    assert (0, [0.0, 0.0, 0.0]) in told and told[-1] == (1, [0.0, 0.01, 0.0])


def test_find_tells_the_port_what_is_wrong_with_it_and_waits_for_what_is_plugged_in(machine, monkeypatch):
    machine.plug("ttyUSB0", latency=16, **TEENSY)
    ended = haptic("device", "find", "--silent")
    assert f"{machine.root}/dev/ttyUSB0 keeps what it receives for 16 ms" in ended.stdout.splitlines()[2]
    assert ended.returncode == 1
    [port] = serial_ports.ports()
    seen = iter([[port], [], [port], [port]])
    monkeypatch.setattr(serial_ports, "ports", lambda: next(seen))
    monkeypatch.setattr(cli, "SETTLES", 0.0)
    ended = haptic("device", "find", "--watch", "--silent", "--json")
    assert f"{port.path} is gone; plug it in again" in ended.stderr
    assert [one["port"] for one in json.loads(ended.stdout)["found"]] == [port.path]
