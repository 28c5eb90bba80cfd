# SPDX-License-Identifier: Apache-2.0
"""`haptic device`: ports in made-up trees, devices that greet, keep promises and break them, hands that move."""

import contextlib
import json
import os
import pty
import select
import socket
import struct
import threading
import time
import zlib

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from in_process import haptic

from haptic_device.config_files import ConfigError
from haptic_device.description import load_device
from haptic_device.realtime import shared_memory
from haptic_device.realtime.hardware_interface import COUNTS, LATCHED, SAMPLE, STATUS
from haptic_device.realtime.null_device import NullDevice
from haptic_device.status import Status
from haptic_sim.cli import device as cli
from haptic_sim.supervision import (
    conformance,
    device_figures,
    device_page,
    device_probe,
    device_programs,
    device_questions,
    device_search,
    device_set_up,
    serial_ports,
)

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


@given(st.binary(max_size=600))
@example(b"\x01" * 254)
@example(b"\x01" * 253 + b"\0")
@example(b"\x01" * 254 + b"\0")
def test_cobs_has_no_zero_but_at_its_end_and_gives_back_what_it_was_given(frame):
    coded = device_probe.cobs(frame)
    assert coded.index(0) == len(coded) - 1
    assert device_probe.uncobs(coded[:-1]) == frame


def test_what_is_no_cobs_is_none():
    assert device_probe.uncobs(b"\x05\x01") is None and device_probe.uncobs(b"\x02\x01\x00") is None


def test_a_hello_has_a_session_and_no_byte_that_begins_a_torque_of_haplys_firmware():
    for _ in range(200):
        session, hello = device_probe.harmless_hello()
        assert hello_of(hello) == session != 0
        assert 2 not in device_probe.cobs(hello)


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
                os.write(far, before + device_probe.cobs(answer(hello_of(device_probe.uncobs(coded)))))

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        yield os.ttyname(near)
    finally:
        end.set()
        serving.join()
        os.close(far)
        os.close(near)


def test_a_device_on_a_line_is_known_by_its_greeting_whatever_comes_before_it():
    with on_a_line(greeting, before=b"\x07noise\0\xff\xff\0\0") as path:
        assert device_probe.ask_serial(path, 115200, 30.0).name == "stick"


def test_one_that_greets_in_another_session_is_not_believed():
    with on_a_line(lambda session: greeting(session ^ 1)) as path:
        assert device_probe.ask_serial(path, 115200, 0.3) is None


def test_a_baud_that_no_line_has_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"baud is 12345 bit/s; it must be one of 50, .*115200"):
        device_probe.ask_serial("/dev/null", 12345, 0.1)


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


def test_a_device_on_udp_is_found_with_the_line_for_its_description():
    with on_udp() as address:
        found = device_search.look_at(address, 30.0)
    assert found["answer"] == "box: a device with 2 axes, firmware 1.2.3, watchdog 15 ms"
    assert found["link"] == {"type": "udp", "host": "127.0.0.1", "port": int(address.split(":")[1])}


def test_where_nobody_is_on_udp_nothing_greeted():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    found = device_search.look_at(f"127.0.0.1:{port}", 0.1)
    assert found["greeting"] is None and found["link"] is None
    assert (
        found["answer"] == f"nothing greeted at 127.0.0.1, port {port}: no such device, other firmware, or a firewall"
    )


# which ports there are


class Machine:
    """A tree of /dev, /sys and /proc below a folder."""

    def __init__(self, root):
        self.root = root
        for folder in ("dev/serial/by-id", "proc/self", "sys/class/tty"):
            (root / folder).mkdir(parents=True)

    def plug(self, name, latency=None, by_id="", **facts):
        """A port of a USB device that says these facts."""
        (self.root / "dev" / name).touch()
        device = self.root / "sys/devices" / f"usb-{name}"
        interface = device / "1-1:1.0"
        interface.mkdir(parents=True)
        for fact, text in facts.items():
            (device / fact).write_text(f"{text}\n")
        if latency is not None:
            (interface / "latency_timer").write_text(f"{latency}\n")
        (self.root / "sys/class/tty" / name).mkdir()
        (self.root / "sys/class/tty" / name / "device").symlink_to(interface)
        if by_id:
            (self.root / "dev/serial/by-id" / by_id).symlink_to(f"../../{name}")

    def run(self, number, command, holds=()):
        """A process that has these ports open."""
        folder = self.root / "proc" / str(number)
        (folder / "fd").mkdir(parents=True)
        (folder / "comm").write_text(f"{command}\n")
        for at, name in enumerate(holds):
            (folder / "fd" / str(at)).symlink_to(self.root / "dev" / name)

    def look(self, **how):
        return device_search.look(self.root, hello=False, **how)


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


TEENSY = {
    "idVendor": "16c0",
    "idProduct": "0483",
    "serial": "77",
    "manufacturer": "Teensyduino",
    "product": "USB Serial",
}


def test_each_port_is_told_with_what_it_says_of_itself_and_its_lasting_name(machine):
    machine.plug("ttyACM0", by_id="usb-Teensy_77-if00", **TEENSY)
    machine.plug("ttyUSB1")
    (machine.root / "dev/ttyS0").touch()
    first, second = machine.look()
    assert first["usb"] == dict(vendor="16c0", product="0483", serial="77", maker="Teensyduino", model="USB Serial")
    assert first["by_id"] == str(machine.root / "dev/serial/by-id/usb-Teensy_77-if00")
    assert second["port"].endswith("dev/ttyUSB1") and second["by_id"] == "" and set(second["usb"].values()) == {""}
    assert first["notes"] == second["notes"] == [] and first["answer"] == "not asked"


def test_a_port_that_may_not_be_opened_says_group_and_rule_and_is_not_asked(machine):
    machine.plug("ttyACM0", **TEENSY)
    [found] = device_search.look(machine.root, allowed=lambda path: False)
    assert found["answer"] == "not asked, since it may not be opened"
    [note] = found["notes"]
    rule = 'SUBSYSTEM=="tty", ATTRS{idVendor}=="16c0", ATTRS{idProduct}=="0483", MODE="0660", GROUP="dialout", '
    assert f"by the group {serial_ports._group(machine.root / 'dev/ttyACM0')}: " in note
    assert rule in note and serial_ports.RULES in note


def test_the_group_of_a_port_is_the_one_to_join(machine):
    machine.plug("ttyACM0", **TEENSY)
    [port] = serial_ports.ports(machine.root, lambda path: False)
    [note] = serial_ports.notes(port._replace(group="dialout"), False)
    assert "sudo usermod -aG dialout $USER, then log in again or write '" in note


def test_who_holds_a_port_is_named_and_it_is_not_asked(machine):
    machine.plug("ttyACM0", **TEENSY)
    machine.run(41, "minicom", holds=["ttyACM0"])
    machine.run(42, "bash")
    [found] = device_search.look(machine.root)
    assert found["answer"] == "not asked, since it is held"
    assert found["notes"] == [f"{machine.root}/dev/ttyACM0 is held by minicom (process 41): end that first"]


def test_modem_manager_is_told_of_with_the_rule_that_keeps_it_away(machine):
    machine.plug("ttyACM0", **TEENSY)
    machine.run(7, "ModemManager")
    [note] = machine.look()[0]["notes"]
    assert note.startswith("ModemManager runs") and 'ATTRS{idProduct}=="0483", ENV{ID_MM_DEVICE_IGNORE}="1"' in note


@pytest.mark.parametrize("timer, told", [(None, False), (0, False), (1, False), (2, True), (16, True)])
def test_a_latency_timer_of_more_than_a_millisecond_is_told_of(machine, timer, told):
    machine.plug("ttyUSB0", latency=timer, idVendor="0403")
    notes = machine.look()[0]["notes"]
    assert bool(notes) == told
    assert not told or (f"for {timer} ms" in notes[0] and 'ATTR{latency_timer}="1"' in notes[0])


@pytest.mark.parametrize("maker, link", [("mjbots", "moteus"), ("Haply Robotics", "haply")])
def test_boards_that_a_stray_byte_may_block_are_not_asked(machine, maker, link):
    machine.plug("ttyACM0", idVendor="1", manufacturer=maker)
    [found] = device_search.look(machine.root)
    assert found["answer"].startswith(f"a board for the link type {link}; not asked, since a byte")


def test_a_port_that_is_no_terminal_cannot_be_asked_and_says_why(machine):
    machine.plug("ttyACM0", **TEENSY)
    [found] = device_search.look(machine.root, patience=0.1)
    assert found["answer"] == f"it cannot be asked: {machine.root}/dev/ttyACM0: Inappropriate ioctl for device"


def test_a_device_that_greets_on_its_port_has_a_line_for_its_description(machine):
    machine.plug("ttyACM0", by_id="usb-77", **TEENSY)
    with on_a_line(greeting) as path:
        (machine.root / "dev/ttyACM0").unlink()
        (machine.root / "dev/ttyACM0").symlink_to(path)
        (machine.root / "dev/serial/by-id/usb-77").unlink()
        [found] = device_search.look(machine.root, baud=9600, patience=30.0)
    assert found["answer"] == "stick: a device with 2 axes, firmware 1.2.3, watchdog 15 ms"
    assert found["link"] == {"type": "serial", "port": str(machine.root / "dev/ttyACM0"), "baud": 9600}


def test_the_port_that_is_plugged_in_is_the_one_that_was_gone(machine):
    machine.plug("ttyACM0", **TEENSY)
    machine.plug("ttyACM1", idVendor="2341", serial="9")
    [one, other] = serial_ports.ports(machine.root)
    moved = other._replace(path="/dev/ttyACM2")
    seen, said = iter([[one, other], [one, other], [one], [one], [one, moved]]), []
    assert device_search.plugged(lambda: next(seen), said.append, lambda: None) == moved
    assert said == [f"{other.path} is gone; plug it in again"]


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


def never_fresh(sample, fresh, deadline):
    return 0


def always_fresh(sample, fresh, deadline):
    return 1


def too_early(sample, fresh, deadline):
    sample[LATCHED] = deadline - 1000
    return 1


def no_number(sample, fresh, deadline):
    sample[COUNTS + 2] = np.nan
    return fresh


def half_a_count(sample, fresh, deadline):
    sample[COUNTS + 1] = 0.5
    return fresh


def cut_for_ever(sample, fresh, deadline):
    sample[STATUS] = 2
    return fresh


def cuts_at_once():
    turn = [0]

    def change(sample, fresh, deadline):
        turn[0] += 1
        sample[STATUS] = 2 * (turn[0] % 2)
        return fresh

    return change


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
        (conformance.latches_at_deadlines, never_fresh, "no sample of a deadline that had passed"),
        (conformance.latches_at_deadlines, too_early, r"latched 1\.0 us before its deadline, was called fresh"),
        (conformance.latches_at_deadlines, no_number, "values that are not finite"),
        (conformance.keeps_time, runs_back(), "time ran backwards by"),
        (conformance.pushes_while_written, cut_for_ever, "stayed cut though the servo wrote"),
        (conformance.pushes_while_written, cuts_at_once(), "the motor was cut .* ms after a write"),
        (conformance.gives_up, always_fresh, "an hour ahead was called fresh"),
        (conformance.counts_whole_steps, half_a_count, "have to be whole numbers"),
        (conformance.cuts_the_motor, cut_for_ever, "stayed cut though the servo wrote again"),
    ],
)
def test_a_device_that_breaks_a_promise_is_found_out(check, change, sentence):
    with pytest.raises(conformance.Violation, match=sentence):
        check(broken(change=change))


def one_missed_in(each):
    turn = [0]

    def change(sample, fresh, deadline):
        turn[0] += 1
        return int(turn[0] % each != 0)

    return change


def test_samples_of_ninety_nine_in_a_hundred_deadlines_are_enough_and_of_fewer_are_not():
    assert "99.0 % of 100; deadline to sample" in conformance.meets_deadlines(
        broken(change=one_missed_in(100)), ticks=100
    )
    with pytest.raises(conformance.Violation, match=r"samples of 98\.0 % of 100 deadlines .* at least 99 % are needed"):
        conformance.meets_deadlines(broken(change=one_missed_in(50)), ticks=100)


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
    hand = moves(Handle(), homing="at_start", home_x=0.05, home_y=0.0, home_theta=1.0)
    content, axes = described(hand)
    assert content["home"] == pytest.approx([0.05, 0.0, 1.0]) and axes["x"]["zero"] == 0.0
    assert axes["x"]["workspace"] == pytest.approx([-0.05, 0.17])
    assert axes["theta"]["workspace"] == pytest.approx([-1.0, 4.0])
    assert "Put the handle to its home" in hand.asked


def test_a_way_that_tells_nothing_is_asked_for_again_with_the_reason():
    ways = [([0.049, 0, 0],), ([0.049, 0.1, 0],), ([0.149, 0.1, 0],), ([0.249, 0.1, 0],)]
    hand = moves(Handle(), x_way=ways, x_length=[0.1, 0.1, -0.1, 0.1], y_way=([0.249, 0.2, 0],))
    _, axes = described(hand)
    assert axes["x"]["counts_per_unit"] == pytest.approx(1000.0)
    assert hand.said[0] == "axis x: its counts changed by 49; at least 50 are needed"
    assert hand.said[1].startswith("axis x: its counts changed by 0")
    assert hand.said[2] == "axis x: the way is -0.1 m; more than 0 is needed"


def test_a_way_along_another_axis_is_not_taken():
    hand = moves(Handle(), x_way=[([0.06, 0.1, 0],), ([0.16, 0.1, 0],)], y_way=([0.16, 0.2, 0],))
    described(hand)
    assert hand.said[0].startswith("axis x: the counts of y changed by -200, its own by 60; is the way along another")


def test_figures_of_the_description_may_stand_where_the_measured_ones_agree():
    handle = Handle(per_unit=(201000.0, 2000.0, 500.0))
    _, axes = described(moves(handle, x_keep=True))
    assert axes["x"]["counts_per_unit"] == 200000.0
    _, axes = described(moves(Handle(per_unit=(201000.0, 2000.0, 500.0)), x_keep=False))
    assert axes["x"]["counts_per_unit"] == pytest.approx(201000.0)


def test_a_push_that_is_not_allowed_or_moves_nothing_leaves_the_sign_and_says_so():
    handle = Handle()
    hand = moves(handle, x_push=False, y_push=False, theta_push=False)
    _, axes = described(hand)
    assert handle.most == 0.0 and hand.said[-1] == "motor_sign of theta stays 1, untried"
    stuck = Handle()
    stuck.friction = 1.0
    hand = moves(stuck)
    described(hand, push=0.02)
    assert stuck.most == 0.02 and hand.said[0] == "0.02 motor units did not move x: motor_sign stays 1, untried"


@pytest.mark.parametrize("bit, word", [(4, "emergency stop pressed"), (8, "too hot"), (32, "encoder broken")])
def test_a_device_that_takes_no_motor_value_is_not_pushed(bit, word):
    handle = Handle()
    handle.status = bit
    with pytest.raises(ValueError, match=f"the device takes no motor value: {word}"):
        described(moves(handle))
    assert not handle.motor.any()


def test_an_end_of_the_hand_leaves_the_motor_at_zero():
    handle = Handle()

    def interrupted(key, text):
        handle.tick(np.array([0.01, 0.0, 0.0]))
        raise KeyboardInterrupt

    hand = moves(handle)
    hand.yes = interrupted
    with pytest.raises(KeyboardInterrupt):
        described(hand)
    assert not handle.motor.any()


AXIS = {"counts_per_unit": 1000.0, "encoder_sign": -1, "zero": 0.5, "workspace": [-0.1, 0.1], "motor_sign": -1}
ALL = {"homing": "absolute", "x": AXIS, "y": AXIS, "theta": AXIS}


def answered(content, handle=None):
    questions = device_questions.Answers(content, "answers.yaml")
    return device_set_up.set_up(questions, handle or Handle(), load_device("desktop"), "mine")


def test_answers_are_the_description_and_the_file_reads_again(tmp_path):
    content = answered(ALL)
    assert {key: content["axes"][1][key] for key in AXIS} == AXIS
    device_set_up.write(tmp_path / "mine.yaml", content, "desktop")
    read = load_device(tmp_path / "mine.yaml")
    assert read.name == "mine" and read.axes[2].zero == 0.5 and read.axes[0].mass == 0.1
    assert (tmp_path / "mine.yaml").read_text().startswith("# Set up by haptic device set-up from desktop: ")


def test_a_motor_sign_that_answers_do_not_give_is_found_by_a_push_that_they_allow():
    without = {key: value for key, value in AXIS.items() if key != "motor_sign"} | {"encoder_sign": 1}
    content = answered(ALL | {"theta": without | {"push": True}})
    assert content["axes"][2]["motor_sign"] == -1


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"homing": "sometimes"}, "answers.yaml: homing is 'sometimes'; absolute or at_start is needed"),
        ({"homing": None}, "answers.yaml does not tell homing"),
        ({"homing": "at_start"}, "answers.yaml does not tell home.x"),
        ({"x": {}}, "answers.yaml does not tell all, and nobody is there to move the handle from where it is along"),
        (
            {"x": AXIS | {"zero": None}},
            "answers.yaml does not tell all, and nobody is there to put the handle to where",
        ),
        ({"x": AXIS | {"zero": "here"}}, "answers.yaml: x.zero is 'here'; a number in m is needed"),
        ({"x": AXIS | {"zero": float("nan")}}, "answers.yaml: x.zero is nan; a number in m is needed"),
        ({"x": AXIS | {"encoder_sign": 2}}, "x.encoder_sign is 2; 1 or -1 is needed"),
        ({"y": AXIS | {"counts_per_unit": -1.0}}, "mine: axes[1].counts_per_unit is -1.0: it should be greater than 0"),
        ({"y": AXIS | {"workspace": [1.0, 0.0]}}, "workspace"),
        ({"x": AXIS | {"motor_sign": None, "push": 1}}, "answers.yaml: x.push is 1; true or false is needed"),
    ],
)
def test_answers_that_are_wrong_or_missing_are_a_sentence(change, sentence):
    with pytest.raises((ValueError, ConfigError)) as refused:
        answered(ALL | change)
    assert sentence in str(refused.value) and "\n" not in str(refused.value)


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


def a_page(folder, lock=4, status=6, age=0.01):
    words = np.zeros(shared_memory.WORDS, np.int64)
    words[shared_memory.DEVICE_LOCK] = lock
    latched = time.monotonic_ns() - round(1e9 * age)
    block = words[shared_memory.DEVICE_FIRST :][: shared_memory.DEVICE_WORDS]
    block[:7] = 9, latched, status, latched, 11, -12, 13
    block[7:10].view(float)[:] = 0.5, 0.25, 0.0
    block[10] = 412_000
    words.tofile(folder / "page")


def test_a_page_is_looked_at_without_taking_part(tmp_path):
    a_page(tmp_path)
    seen = device_page.glance("page", tmp_path)
    assert seen.counts == (11, -12, 13) and seen.drag == (0.5, 0.25, 0.0) and seen.status == 6 and seen.age >= 0.01


@pytest.mark.parametrize("lock", [0, 5])
def test_a_page_that_nobody_wrote_or_is_just_written_tells_nothing(tmp_path, lock):
    a_page(tmp_path, lock)
    assert device_page.glance("page", tmp_path) is None
    assert device_page.glance("nowhere", tmp_path) is None
    (tmp_path / "short").write_bytes(b"\0" * 8)
    assert device_page.glance("short", tmp_path) is None


BRIDGE = Status(0, 1, "serving", {"device": "mine", "connected": "True", "delay_us": "412.0", "lost": "3", "port": ""})


def test_the_table_has_what_page_bridge_driver_and_handle_tell_in_words_and_units():
    page = device_page.Glance(6, (11, -12, 13), (0.0, 0.0, 0.0), 0.001)
    driver = Status(0, 0, "engaged", {"state": "engaged", "fault": "none"})
    shown = device_figures.figures({"haptic_bridge": BRIDGE, "haptic_driver": driver}, page, {"x": 0.01})
    assert shown["haptic_bridge"] == ("WARN: serving", "") and shown["delay of the motor"] == ("412.0", "us")
    assert shown["counts y"] == ("-12", "") and shown["position x"] == ("+0.010000", "m")
    assert shown["status of the device"] == ("motors cut by its watchdog, emergency stop pressed", "")
    assert shown["samples lost"] == ("3", "") and shown["state of the driver"] == ("engaged", "")
    assert "port" not in shown and "position y" not in shown


def test_a_device_answers_where_its_page_is_new_and_its_bridge_connected():
    new, old = (device_page.Glance(0, (0, 0, 0), (0.0, 0.0, 0.0), age) for age in (0.49, 0.51))
    unplugged = BRIDGE._replace(values={"connected": "False"})
    assert device_figures.answering({}, new) and device_figures.answering({"haptic_bridge": BRIDGE}, new)
    assert not device_figures.answering({}, None) and not device_figures.answering({}, old)
    assert not device_figures.answering({"haptic_bridge": unplugged}, new)
    assert device_figures.figures({}, old, {})["age of the sample"] == ("0.5: the device is silent", "s")


# the command


@pytest.mark.parametrize(
    "words, sentence",
    [
        (
            "find --silent --udp nowhere",
            "haptic device find: --udp is 'nowhere'; HOST:PORT is needed, the port from 1 to 65535",
        ),
        ("find --silent --udp 127.0.0.1:0", "--udp is '127.0.0.1:0'; HOST:PORT is needed"),
        ("find --silent --udp 127.0.0.1:65536", "--udp is '127.0.0.1:65536'; HOST:PORT is needed"),
        ("find --watch --udp 127.0.0.1:9", "--watch is for what is plugged in: leave --udp out"),
        ("find --wait 0", "haptic: --wait is 0.0 s; at least 0.1 s is needed"),
        ("find --baud 1", "haptic: --baud is 1; at least 1200 is needed"),
        ("test nowhere", "haptic device test: nowhere is neither a file nor a name in config/devices"),
        ("test --motor 2", "haptic: --motor is 2.0 motor units; at most 1.0 motor units is allowed"),
        ("test --namespace 4x", "4x"),
        ("set-up desktop", "haptic device set-up: it asks for what only a hand at the device can tell"),
        ("set-up desktop --answers none.yaml", "haptic device set-up: none.yaml: No such file or directory"),
        ("set-up desktop --answers a.yaml --out .", "--out is ., but it must be a new file in a folder that exists"),
        ("set-up nowhere --answers a.yaml --out b.yaml", "nowhere is neither a file nor a name in config/devices"),
        ("show --domain 233", "haptic: --domain is 233; at most 232 is allowed"),
    ],
)
def test_what_cannot_be_done_is_one_sentence_and_exit_code_2(words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("homing: absolute\n")
    ended = haptic("device", *words.split())
    assert ended.returncode == 2 and sentence in ended.stderr
    assert len(ended.stderr.strip().splitlines()) == 1 and ended.stdout == ""


def test_find_says_what_answers_and_the_line_to_write():
    with on_udp() as address:
        ended = haptic("device", "find", "--silent", "--udp", address, "--wait", "30")
    assert ended.returncode == 0
    port = address.split(":")[1]
    assert f"link: {{type: udp, host: 127.0.0.1, port: {port}}}" in ended.stdout
    assert "box: a device with 2 axes" in ended.stdout


def test_who_serves_a_described_device_is_told_by_its_link(tmp_path):
    [loopback] = device_programs.device_programs("desktop", {}, tmp_path)
    assert loopback[:3] == ("haptic_loopback", "haptic_device.nodes.loopback", {"device": "desktop"})
    [bridge] = device_programs.device_programs("haply_2diy", {}, tmp_path)
    assert bridge[:3] == ("haptic_bridge", "haptic_device.nodes.bridge", {"device": "haply_2diy"})


def test_what_a_users_program_serves_is_left_to_it(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    refused = "device own_device is served by a program of your own: start it, and give its --domain"
    with pytest.raises(ValueError, match=refused), device_page.opened("own_device", None, None):
        pass


def test_a_device_that_falls_silent_is_told_of(monkeypatch):
    monkeypatch.setattr(device_page, "SILENT", 0.01)
    with pytest.raises(ValueError, match=r"the device has sent no sample for 0\.01 s"):
        device_page.PageDevice(broken(never_fresh)).tick(np.zeros(3))


def test_a_tick_gives_the_sample_after_it_and_engages_only_to_push():
    device, told = Kept(), []
    write = device.write
    device.write = lambda *words: told.append((words[4], words[5].tolist())) or write(*words)
    before = time.monotonic_ns()
    for motor in ([0.0, 0.0, 0.0], [0.0, 0.01, 0.0]):
        sample = device_page.PageDevice(device).tick(np.array(motor))
        assert sample[LATCHED] >= before + MS
    assert (0, [0.0, 0.0, 0.0]) in told and told[-1] == (1, [0.0, 0.01, 0.0])


def test_find_tells_the_port_what_is_wrong_with_it_and_the_cure_below_it(machine, monkeypatch):
    machine.plug("ttyUSB0", latency=16, **TEENSY)
    monkeypatch.setattr(device_search, "look", lambda look=device_search.look, **how: look(machine.root, hello=False))
    ended = haptic("device", "find")
    first, answer, note = ended.stdout.splitlines()
    assert first == f"{machine.root}/dev/ttyUSB0  (Teensyduino USB Serial 77)" and answer == "    not asked"
    assert note.startswith(f"    {machine.root}/dev/ttyUSB0 keeps what it receives for 16 ms") and ended.returncode == 1
    (machine.root / "dev/ttyUSB0").unlink()
    assert haptic("device", "find").stdout.startswith("no serial port of a USB device is there")


def test_find_waits_for_what_is_plugged_in_and_tells_which_it_is(machine, monkeypatch):
    machine.plug("ttyACM0", **TEENSY)
    [port] = serial_ports.ports(machine.root)
    seen = iter([[port], [], [port], [port]])
    monkeypatch.setattr(serial_ports, "ports", lambda: next(seen))
    monkeypatch.setattr(cli, "SETTLES", 0.0)
    ended = haptic("device", "find", "--watch", "--silent", "--json")
    assert f"{port.path} is gone; plug it in again" in ended.stderr
    assert [one["port"] for one in json.loads(ended.stdout)["found"]] == [port.path]
