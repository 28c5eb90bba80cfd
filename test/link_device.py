# SPDX-License-Identifier: Apache-2.0
"""A device at the other end of an open link, after docs/reference/link_protocol.md alone, and a host that runs a codec.

Nothing here takes time: the tests say what time it is [ns of the host's clock].
"""

import numpy as np
from link_frames import CLOCK, CLOCK_ANSWER, COMMAND, GREETING, HELLO, SAMPLE, TARGET, pack, unpack

from haptic_device.link import codec

MS = 1_000_000
UNASKED = MS


def greeting(
    axes=2, bits=32, features=0, *, counts=(1e5, 1e5, 1e4), largest=(1.0, 1.0, 1.0), least=100_000, watchdog=15 * MS
):
    return b"model", 0x010203, axes, *counts, *largest, least, watchdog, bits, features


def sample(deadline, sampled, applied=0, counts=(0, 0, 0), temperature=-32768, drag=(0.0, 0.0, 0.0)):
    return deadline, sampled, applied, *counts, temperature, 0, *drag


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
        kind, flags, session, sequence, _, payload = unpack(data)
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
            return [self.frame(CLOCK_ANSWER, (*payload, now, now), answers=sequence)]
        if kind == TARGET:
            self.targets.append(payload)
        if kind == COMMAND:
            self.deadline, self.period, *self.motor = payload
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
        return pack(kind, self.session, self.sequence, *payload, **header)


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


def acquainted(host, device, now, event=codec.OPENED):
    """Greets, and asks for the clock until commands can be sent; returns the time then."""
    way, sent = 30_000, host.say(event, now)
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
