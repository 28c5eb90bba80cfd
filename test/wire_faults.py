# SPDX-License-Identifier: Apache-2.0
"""What goes wrong on the wire of an open link: a row a fault, written from docs/reference/link_protocol.md alone.

From a moment on each frame of one way becomes what a row makes of it, and each row is so bad that no force may be left.
"""

import ctypes
import math
from typing import NamedTuple

import link_frames as page
from fault_table import FREE, WALL
from link_frames import CLOCK, CLOCK_ANSWER, COMMAND, GREETING, HELLO, SAMPLE, pack, sealed
from lockstep_link import BEGAN, MS, SECOND, Link, Reference

TO_DEVICE, TO_HOST = 0, 1
PERIOD = MS  # [ns] of the servo
WATCHDOG, NEXT = 15 * MS, PERIOD  # [ns] from the last right command: the device's own, and with the next frame
SILENCE, SAID = 22 * MS, 3 * PERIOD  # [ns] from the last right sample: fault.silence, and with the next sample
JUDGED = 600 * MS  # [ns] in which the answers tell what is wrong with a clock
FIELDS = {
    COMMAND: "deadline period x y theta",
    SAMPLE: "deadline sampled applied x y theta temperature zero drag_x drag_y drag_theta",
    CLOCK_ANSWER: "asked came went",
}


class Clocked(Reference):
    """A device whose clock is `ahead` [ns] of what it was, and drifts from `since` on."""

    ahead, drift, since = 0, 0.0, 0

    def _own(self, now):
        return ctypes.c_int64(now - BEGAN + self.ahead + round(self.drift * (now - self.since)))

    @property
    def motors(self):
        """What its board was told last [N, N, N m]."""
        values = (ctypes.c_float * 3)()
        self._port.port_motors(values)
        return tuple(values)


class Wire(Link):
    """A servo that presses a wall over this link. log: (time, motors) of the device; row: what is wrong, if something
    is; count: of frames since then; last, right: the last right command and sample, and when they were sent [ns]."""

    def __init__(self, datagrams=True):
        free = FREE | WALL | {"engage__time": 0.02, "servo__rate": SECOND / PERIOD, "wall__stiffness": (200.0,)}
        super().__init__(Clocked(datagrams, 0.02), late=0.002, **free)
        self.log, self.row, self.count, self.held, self.last, self.right = [], None, 0, [], [b"", b""], [0, 0]
        self.mechanism.hold(0.01)
        self.enable()
        self.mechanism.hold(-0.02)
        self.until(lambda: self.mechanism.force > 1.0)

    def _fly(self, far, data, what):
        frames = [data]
        if self.row and self.row.way == far:
            self.count += 1
            frames = self.row.act(self, data)
        elif not self.row and self._kind(data) == bytes([(COMMAND, SAMPLE)[far]]):
            self.last[far], self.right[far] = data, self.now
        for each in frames:
            super()._fly(far, each, what)

    def _kind(self, data):
        return (data if self.mechanism.datagram else page.unstuffed(data.strip(b"\0")))[1:2]

    def _device(self, data=b"", turn=None):
        super()._device(data, turn)
        self.log.append((self.now, self.mechanism.motors))


class Row(NamedTuple):
    """what: goes wrong; way: of the frames; act: (wire, bytes) → what comes of them; within: when the device's motors
    are at zero; fault: that is latched then, by name."""

    what: str
    way: int
    act: object
    within: int
    fault: str
    datagrams: bool = True


def lost(wire, data):
    return []


def anew(data, **changes):
    """A frame with other fields, each a value or a function of the old one, and a right CRC."""
    frame, names = page.unpack(data), FIELDS[data[1]].split()
    fields = {"version": 1} | frame._asdict() | dict(zip(names, frame.payload, strict=True))
    for name, value in changes.items():
        fields[name] = value(fields[name]) if callable(value) else value
    header = {name: fields[name] for name in ("flags", "answers", "version")}
    return pack(frame.kind, fields["session"], fields["sequence"], *(fields[name] for name in names), **header)


def of(kind, act):
    """The same of frames of this kind only."""
    return lambda wire, data: act(wire, data) if data[1] == kind else [data]


def says(kind, **changes):
    return of(kind, lambda wire, data: [anew(data, **changes)])


def inverted(data):
    return bytes(255 - byte for byte in data)


def raw(change, kind=COMMAND):
    """Bytes changed on the way."""
    return of(kind, lambda wire, data: [change(data)])


def flipped(kind, *steps):
    """So many bits, others in each frame."""

    def act(wire, data):
        mask = sum(1 << (7 * wire.count + step) % (8 * len(data)) for step in steps)
        return [(int.from_bytes(data, "little") ^ mask).to_bytes(len(data), "little")]

    return of(kind, act)


def instead(frame, kind=COMMAND):
    """This frame, from the bytes of the one in whose place it comes: in its session, with its sequence."""
    return of(kind, lambda wire, data: [frame(wire, *page.unpack(data)[2:4])])


def stalled(wire, data):
    """All frames wait for 40 ms, and come at once then."""
    come, ended = [*wire.held, data], wire.now - wire.right[TO_DEVICE] > 40 * MS
    wire.held = [] if ended else come
    return come if ended else []


def clock(ahead=0, drift=0.0):
    """The device's clock is another from now on; the frames are right."""

    def act(wire, data):
        if wire.count == 1:
            wire.mechanism.ahead, wire.mechanism.drift, wire.mechanism.since = ahead, drift, wire.now
        return [data]

    return act


def device(what, act, within=WATCHDOG, fault="device_watchdog", **given):
    return Row(what, TO_DEVICE, act, within, fault, **given)


def host(what, act, within=SILENCE, fault="device_silent"):
    return Row(what, TO_HOST, act, within, fault)


def serial(what, change):
    return device(what, lambda wire, data: [change(data)], datagrams=False)


def numbered(sequence):
    """Commands with a sequence made of the last right one and the count since then."""
    return of(COMMAND, lambda wire, data: [anew(data, sequence=sequence(page.unpack(wire.last[0])[3], wire.count))])


def turned(value):
    return (value + 2**31) % 2**32


def jittered(wire, data):
    """The times in the answers are up to 5 ms wrong, each otherwise."""
    wrong = (wire.count * 7919 % 101 - 50) * MS // 10
    return [anew(data, came=lambda at: at + wrong, went=lambda at: at + wrong)]


def later(at):
    return at + 50 * MS


def flag(bit):
    return says(SAMPLE, flags=lambda flags: flags | bit)


ODD = b"odd", 1, 9, *(1.0,) * 6, 1, 0, 32, 0  # a greeting with nine axes and a watchdog of 0
DEVICE = (
    device("nothing comes", lost),
    device("no command comes, but questions for the clock", of(COMMAND, lost)),
    device("commands end behind the header", raw(lambda data: data[:16])),
    device("commands lack their last byte", raw(lambda data: data[:-1])),
    device("commands lack their CRC", raw(lambda data: data[:-4])),
    device("commands lack a motor value, and the CRC is right", raw(lambda data: sealed(data[:-8]))),
    device("commands have four motor values, and the CRC is right", raw(lambda data: sealed(data[:-4] + bytes(4)))),
    device("commands have a byte too many", raw(lambda data: data + b"\0")),
    device("two commands are in each datagram", raw(lambda data: data + data)),
    device("the CRC is 0", raw(lambda data: data[:-4] + bytes(4))),
    device("the CRC has its bytes in reverse order", raw(lambda data: data[:-4] + data[:-5:-1])),
    device("the CRC lacks its last XOR", raw(lambda data: data[:-4] + inverted(data[-4:]))),
    device("a bit of each command is flipped", flipped(COMMAND, 1)),
    device("three bits of each command are flipped", flipped(COMMAND, 1, 3, 5)),
    device("four bytes are inverted", raw(lambda data: data[:20] + inverted(data[20:24]) + data[24:])),
    device("the version is 2", says(COMMAND, version=2)),
    device("the kind is not known", raw(lambda data: sealed(data[:1] + b"\x09" + data[2:-4]))),
    device("the kind is that of a device's frame", raw(lambda data: sealed(data[:1] + b"\x06" + data[2:-4]))),
    device("the session is 0", says(COMMAND, session=0)),
    device("the session is another", says(COMMAND, session=lambda session: session ^ 1)),
    device("the sequence is always the last right one", numbered(lambda last, count: last)),
    device("the sequence runs backwards", numbered(lambda last, count: last - count)),
    device("the sequence is half of the circle ahead", says(COMMAND, sequence=turned)),
    device("an old command comes again and again", of(COMMAND, lambda wire, data: [wire.last[TO_DEVICE]])),
    device("a motor value is not a number", says(COMMAND, x=math.nan)),
    device("a motor value is infinite", says(COMMAND, theta=-math.inf)),
    device("the period is 0", says(COMMAND, period=0)),
    device("the period is below the shortest", says(COMMAND, period=99_999)),
    device("the period is above 10 ms", says(COMMAND, period=10 * MS + 1)),
    device("the deadline passed longer ago than the watchdog's time", says(COMMAND, deadline=lambda at: at - 17 * MS)),
    device("the deadline is further ahead than that", says(COMMAND, deadline=lambda at: at + 15 * MS)),
    device("the deadline is the least number", says(COMMAND, deadline=-(2**63))),
    device("the deadline is of the host's clock", says(COMMAND, deadline=lambda at: at + BEGAN)),
    device("hello comes again instead of commands", instead(lambda wire, *head: pack(HELLO, *head))),
    device("hello of session 0 comes instead of commands", instead(lambda wire, _, number: pack(HELLO, 0, number))),
    device("questions for the clock come instead", instead(lambda wire, *head: pack(CLOCK, *head, wire.now))),
    device("another host says hello", lambda wire, data: [pack(HELLO, 77, wire.count), data], NEXT, "device_silent"),
    device("the line stalls for 40 ms", stalled),
    device("the device's clock is set back", clock(-100 * MS), WATCHDOG + NEXT, "device_clock"),
    device("the device's clock is set ahead", clock(SECOND), 2 * NEXT, "device_clock"),
    serial("frames have no 0 around them", lambda data: data.strip(b"\0")),
    serial("a byte of each frame is lost", lambda data: data[:9] + data[10:]),
)
HOST = (
    host("nothing comes", lost),
    host("no sample comes, but answers to questions for the clock", of(SAMPLE, lost)),
    host("samples lack their last byte", raw(lambda data: data[:-1], SAMPLE)),
    host("samples have a byte too many", raw(lambda data: data + b"\0", SAMPLE)),
    host("a bit of each sample is flipped", flipped(SAMPLE, 1)),
    host("the version is 2", says(SAMPLE, version=2)),
    host("the session is another", says(SAMPLE, session=lambda session: session ^ 1)),
    host("the sequence is half of the circle ahead", says(SAMPLE, sequence=turned)),
    host("an old sample comes again and again", of(SAMPLE, lambda wire, data: [wire.last[TO_HOST]])),
    host("samples answer commands that were never sent", says(SAMPLE, answers=lambda number: number + 1000)),
    host("the deadline is not the announced one", says(SAMPLE, deadline=lambda at: at - 1)),
    host("samples are of before their deadline", says(SAMPLE, sampled=lambda at: at - 2 * MS)),
    host("the force of the damper is not a number", says(SAMPLE, drag_x=math.nan)),
    host("the force of the damper is more than any damper's", says(SAMPLE, drag_x=3e38)),
    host("greetings of nonsense come instead", instead(lambda wire, *head: pack(GREETING, *head, *ODD), SAMPLE)),
    host("samples are stamped 5 ms ahead", says(SAMPLE, sampled=lambda at: at + 5 * MS), SAID, "device_clock"),
    host(
        "unasked samples are stamped ahead",
        says(SAMPLE, answers=0, deadline=later, sampled=later),
        SAID,
        "device_clock",
    ),
    host("the clock drifts by 1 %", clock(drift=0.01), JUDGED, "device_clock"),
    host("the clock is told 5 ms wrong, each time otherwise", of(CLOCK_ANSWER, jittered), JUDGED, "device_clock"),
    host("the counts jump", says(SAMPLE, x=lambda count: count + 10**6), SAID, "encoder_jump"),
    host("the device says that its watchdog has cut the motors", flag(page.CUT), SAID, "device_watchdog"),
    host("the device says that its button is pressed", flag(page.ESTOP), SAID, "device_estop"),
    host("the device says that it is too hot", flag(page.HOT), SAID, "device_hot"),
    host("the device says that an encoder is broken", flag(page.BROKEN_ENCODER), SAID, "device_encoder"),
)
NUMBERS = {
    "device_watchdog": r"no command came over the line to the device for 0\.015 s; the servo gave it",
    "device_silent": r"no sample came over the line from the device for 0\.02\d* s; the limit is 0\.02 s",
    "encoder_jump": r"x moved by [0-9.]+ m in [0-9.]+ ms; the limit is [0-9.]+ m",
}
"""What is told of a fault beside its row in docs/reference/faults.md, a pattern by name; of others no number is."""
