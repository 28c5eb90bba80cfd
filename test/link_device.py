# SPDX-License-Identifier: Apache-2.0
"""A device at the other end of an open link, after docs/reference/link_protocol.md alone, and a host that runs a codec.

Nothing here takes time: the tests say what time it is [ns of the host's clock].
"""

import struct
import zlib

import numpy as np

from haptic_device.link import codec

HELLO, GREETING, COMMAND, SAMPLE, CLOCK, CLOCK_ANSWER, TARGET, TRUTH = range(1, 9)
LENGTHS = {HELLO: 20, GREETING: 92, COMMAND: 44, SAMPLE: 72, CLOCK: 28, CLOCK_ANSWER: 44, TARGET: 44, TRUTH: 180}
MS = 1_000_000
UNASKED = MS


def packed(kind, session, sequence, payload=b"", *, flags=0, answers=0, version=1):
    """A frame as the page has it."""
    body = struct.pack("<BBHIII", version, kind, flags, session, sequence & 0xFFFFFFFF, answers) + payload
    return body + struct.pack("<I", zlib.crc32(body))


def unpacked(data):
    """kind, flags, session, sequence, answers, payload of a frame, which must be one."""
    version, kind, flags, session, sequence, answers = struct.unpack("<BBHIII", data[:16])
    assert (version, len(data), zlib.crc32(data[:-4])) == (1, LENGTHS[kind], struct.unpack("<I", data[-4:])[0])
    return kind, flags, session, sequence, answers, data[16:-4]


def stuffed(data):
    """By COBS, with the 0 that ends it: each run without zeros behind its length + 1; the 0 after 254 bytes is none."""
    coded = b""
    for run in (data + b"\0").split(b"\0")[:-1]:
        while len(run) >= 254:
            coded, run = coded + b"\xff" + run[:254], run[254:]
        coded += bytes([len(run) + 1]) + run
    return coded + b"\0"


def unstuffed(coded):
    """What a frame by COBS, without its 0, stands for."""
    data, at = b"", 0
    while at < len(coded):
        length = coded[at]
        assert length, "a 0 is the end of a frame, and none of its bytes"
        data += coded[at + 1 : at + length]
        at += length
        data += b"\0" if length < 255 and at < len(coded) else b""
    return data


def greeting(
    axes=2, bits=32, features=0, *, counts=(1e5, 1e5, 1e4), largest=(1.0, 1.0, 1.0), least=100_000, watchdog=15 * MS
):
    name = struct.pack("<24sII", b"model", 0x010203, axes)
    return name + struct.pack("<6f4I", *counts, *largest, least, watchdog, bits, features)


def sample(deadline, sampled, applied=0, counts=(0, 0, 0), temperature=-32768, drag=(0.0, 0.0, 0.0)):
    return struct.pack("<qqq3ihH3f", deadline, sampled, applied, *counts, temperature, 0, *drag)


class Device:
    """Takes frames and gives frames; `ahead` [ns], `skew`: of its clock; counts: its encoders, now."""

    def __init__(self, ahead=0, skew=0.0, **told):
        self.ahead, self.skew, self.told = ahead, skew, told
        self.counts, self.motor, self.status, self.engaged = [0, 0, 0], (0.0, 0.0, 0.0), 0, False
        self.targets, self.wrong = [], 0
        self.session = self.sequence = self.taken = self.deadline = self.asked = self.applied = 0
        self.watchdog = told.get("watchdog", 15 * MS)

    def clock(self, host):
        """Its time at this time of the host."""
        return host + self.ahead + round(self.skew * host)

    def hear(self, data, host):
        """Its answers to a frame that comes now, frames each."""
        kind, flags, session, sequence, _, payload = unpacked(data)
        if kind == HELLO:
            if session != self.session:
                self.session, self.sequence, self.taken, self.motor = session, 0, 0, (0.0, 0.0, 0.0)
                self.asked, self.deadline, self.driven_at = 0, self.clock(host) + UNASKED, None
                self.period, self.engaged, self.applied = UNASKED, False, 0
            self.taken = sequence
            return [self.frame(GREETING, greeting(**self.told), answers=sequence)]
        if session != self.session or not 0 < (sequence - self.taken) % 2**32 < 2**31:
            self.wrong += 1
            return []
        self.taken = sequence
        if kind == CLOCK:
            now = self.clock(host)
            return [self.frame(CLOCK_ANSWER, payload + struct.pack("<qq", now, now), answers=sequence)]
        if kind == TARGET:
            self.targets.append(struct.unpack("<3d", payload))
        if kind == COMMAND:
            self.deadline, self.period, *self.motor = struct.unpack("<qI3f", payload)
            self.asked, self.applied, self.driven_at, self.engaged = sequence, self.clock(host), host, bool(flags & 1)
        return []

    def run(self, until):
        """Its samples up to this time of the host."""
        frames = []
        while self.session and self.deadline <= (now := self.clock(until)):
            if self.driven_at is not None and until - self.driven_at > self.watchdog:
                self.motor, self.driven_at, self.period = (0.0, 0.0, 0.0), None, UNASKED
            cut = 2 if self.driven_at is None and self.applied else 0
            content = sample(self.deadline, max(self.deadline, now), self.applied, self.counts)
            frames.append(self.frame(SAMPLE, content, flags=self.status | cut, answers=self.asked))
            self.asked, self.deadline = 0, self.deadline + self.period
        return frames

    def frame(self, kind, payload, **header):
        self.sequence += 1
        return packed(kind, self.session, self.sequence, payload, **header)


class Host:
    """A codec of datagrams, and the last write of a servo; `heard` are the answers that were not NOTHING."""

    def __init__(self, link):
        self.link, self.state = link, link.state
        self.outgoing, self.answer = np.zeros(codec.ROOM, np.uint8), np.zeros(codec.ANSWER, np.int64)
        self.command, self.heard = np.zeros(8, np.int64), []

    def say(self, event, now):
        """The bytes that an event makes."""
        count = self.link.encode(self.state, event, now, self.command, self.outgoing)
        return bytes(self.outgoing[:count])

    def write(self, now, deadline, motor=(0.0, 0.0, 0.0), period=MS, engaged=1, event=codec.COMMAND):
        """A servo's write, as a frame."""
        self.command[:5] = 1, now, deadline, period, engaged
        self.command.view(np.float64)[5:] = motor
        return self.say(event, now)

    def hear(self, data, now):
        """Gives bytes to the codec; returns what it makes of them: a copy of the answer, None for NOTHING."""
        incoming = np.frombuffer(bytes(data), np.uint8).copy()
        count = self.link.decode(self.state, incoming, len(incoming), now, self.answer)
        assert 0 <= count <= len(incoming)
        if self.answer[codec.KIND] == codec.NOTHING:
            return None
        self.heard.append(self.answer.copy())
        return self.heard[-1]


def acquainted(host, device, now, way=30_000):
    """Greets, and asks for the clock until commands can be sent; returns the time then."""
    sent = host.say(codec.OPENED, now)
    for _ in range(100):
        for reply in device.hear(sent, now + way) if sent else []:
            host.hear(reply, now + 2 * way)
        if host.state[codec.READY]:
            return now + 5 * MS
        now += 5 * MS
        for reply in device.run(now):
            host.hear(reply, now)
        sent = host.say(codec.IDLE, now)
    raise AssertionError("the device is not ready")
