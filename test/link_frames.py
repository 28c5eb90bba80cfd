# SPDX-License-Identifier: Apache-2.0
"""Frames of docs/reference/link_protocol.md by struct and zlib alone: what both sides of the link are judged by.

Motors, counts and forces are tuples of 3; times are ns of the device's clock.
"""

import itertools
import select
import socket
import struct
import time
import zlib
from collections import namedtuple
from typing import NamedTuple

HELLO, GREETING, COMMAND, SAMPLE, CLOCK, CLOCK_ANSWER, TARGET, TRUTH = range(1, 9)
CUT, ESTOP, HOT, END_SWITCH, BROKEN_ENCODER, CLAMPED = 2, 4, 8, 16, 32, 128  # bits of a sample's flags
ENGAGED = 1  # of a command's
PAYLOADS = {
    HELLO: "<",
    GREETING: "<24sII3f3fIIII",
    COMMAND: "<qI3f",
    SAMPLE: "<qqq3ihH3f",
    CLOCK: "<q",
    CLOCK_ANSWER: "<qqq",
    TARGET: "<3d",
    TRUTH: "<q18dd",
}
HEAD = struct.Struct("<BBHIII")
LENGTHS = {kind: HEAD.size + struct.calcsize(payload) + 4 for kind, payload in PAYLOADS.items()}  # [bytes]


class Frame(NamedTuple):
    """A frame as it came; payload: its numbers in the order of the protocol's table."""

    kind: int
    flags: int
    session: int
    sequence: int
    answers: int
    payload: tuple


def _content(name, parts):
    """A named tuple of the parts of a payload, and what makes it of a frame; `counts:3` is a tuple of three."""
    names, sizes = zip(*(part.split(":") for part in parts.split()), strict=True)
    ends = list(itertools.accumulate(map(int, sizes)))
    kind = namedtuple(name, names)

    def content(frame):
        places = zip([0, *ends], ends, strict=False)
        pieces = [frame.payload[low:high] for low, high in places]
        return kind(*(piece[0] if len(piece) == 1 else piece for piece in pieces))

    return content


_greeting = _content(
    "Greeting",
    "name:1 firmware:1 axes:1 counts_per_unit:3 largest_motor:3 shortest_period:1 watchdog:1 counter_bits:1 features:1",
)
sample = _content("Sample", "deadline:1 sampled:1 applied:1 counts:3 temperature:1 reserved:1 damper:3")
truth = _content(
    "Truth", "time:1 position:3 velocity:3 operator_force:3 motor_force:3 target:3 target_velocity:3 energy:1"
)


def greeting(frame):
    told = _greeting(frame)
    return told._replace(name=told.name.rstrip(b"\0"))


def sealed(body):
    """With the CRC that ends a frame."""
    return body + struct.pack("<I", zlib.crc32(body))


def pack(kind, session, sequence, *payload, flags=0, answers=0, version=1):
    """The bytes of a frame, CRC included."""
    head = HEAD.pack(version, kind, flags, session, sequence & 0xFFFFFFFF, answers)
    return sealed(head + struct.pack(PAYLOADS[kind], *payload))


def unpack(frame):
    """A Frame; ValueError where version, kind, length or CRC are wrong."""
    version, kind, *header = HEAD.unpack_from(frame.ljust(HEAD.size, b"\0"))
    if version != 1 or LENGTHS.get(kind) != len(frame) or sealed(frame[:-4]) != frame:
        raise ValueError(f"frame of kind {kind} with {len(frame)} bytes is wrong")
    return Frame(kind, *header, struct.unpack(PAYLOADS[kind], frame[HEAD.size : -4]))


def stuffed(data):
    """By COBS (Cheshire and Baker 1999): each run without zeros behind its length + 1, and the 0 that ends a frame."""
    coded = b""
    for run in (data + b"\0").split(b"\0")[:-1]:
        while len(run) >= 254:  # the 0 after 254 bytes is none
            coded, run = coded + b"\xff" + run[:254], run[254:]
        coded += bytes([len(run) + 1]) + run
    return coded + b"\0"


def unstuffed(coded):
    """What a frame by COBS, without its 0, stands for; ValueError where it is not COBS."""
    data, place = b"", 0
    while place < len(coded):
        distance = coded[place]
        piece = coded[place + 1 : place + distance]
        if distance == 0 or len(piece) != distance - 1 or 0 in piece:
            raise ValueError("not COBS")
        place += distance
        data += piece + (b"\0" if distance < 255 and place < len(coded) else b"")
    return data


class UdpHost:
    """The host's side over UDP: `send` numbers the frames, `frames` gives those that have come."""

    def __init__(self, port, session=0x1234ABCD, host="127.0.0.1"):
        self.session, self.sequence = session, 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, port))

    def send(self, kind, *payload, flags=0):
        """Sends the next frame of this session; returns its sequence."""
        self.sequence += 1
        self.send_bytes(pack(kind, self.session, self.sequence, *payload, flags=flags))
        return self.sequence

    def send_bytes(self, frame):
        self._socket.send(frame)

    def frames(self, patience):
        """Frames that come within this time [s], one by one."""
        end = time.monotonic() + patience
        while (left := end - time.monotonic()) > 0 and select.select([self._socket], [], [], left)[0]:
            yield unpack(self._socket.recv(2048))

    def until(self, wanted, patience=5.0):
        """The first frame for which wanted(frame); AssertionError if none comes [s]."""
        for frame in self.frames(patience):
            if wanted(frame):
                return frame
        raise AssertionError("it did not come")

    def greet(self, patience=5.0):
        """Says hello until it is greeted, as the protocol wants; returns the greeting's Frame."""
        for _ in range(max(1, round(patience / 0.05))):
            said = self.send(HELLO)
            for frame in self.frames(0.05):
                if frame.kind == GREETING and frame.session == self.session:
                    assert frame.answers <= said
                    return frame
        raise AssertionError("nobody greets")

    def command(self, deadline, period=1_000_000, motors=(0.0, 0.0, 0.0), engaged=True):
        """Sends a command; returns its sequence."""
        return self.send(COMMAND, deadline, period, *motors, flags=ENGAGED if engaged else 0)

    def now(self):
        """The device's time [ns], as its answer says it: earlier than now."""
        asked = self.send(CLOCK, time.monotonic_ns())
        return self.until(lambda frame: frame.kind == CLOCK_ANSWER and frame.answers == asked).payload[2]

    def close(self):
        self._socket.close()
