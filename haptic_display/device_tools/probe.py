# SPDX-License-Identifier: Apache-2.0
"""Asks what is at a serial port or a UDP address for its greeting, and moves nothing by that.

The greeting is that of docs/reference/link_protocol.md.
Each hello has a session of its own and none has a byte 2, which Haply's firmware would take for the beginning of a
torque.
"""

import contextlib
import os
import secrets
import select
import socket
import struct
import termios
import time
import tty
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from haptic_device.config.link_registry import BAUDS, SPEEDS
from haptic_device.link import frame

HEADER, CRC = struct.Struct("<BBHIII"), struct.Struct("<I")
PAYLOAD = struct.Struct("<24sII3f3fIIII")
GREETED = HEADER.size + PAYLOAD.size + CRC.size
TORQUE = 2  # of Haply's firmware: "02 id f32 f32"
AGAIN = 0.05  # [s] between two hellos
MOST = 4096  # bytes of a line that are kept without a 0 among them
Frames = Callable[[bytes], list[bytes]]


class Greeting(NamedTuple):
    """What a device says of itself: counts_per_unit [counts/m, counts/rad], 0 unknown; motor_limits [motor units];
    shortest_period, watchdog [ns]."""

    name: str
    firmware: str
    axes: int
    counts_per_unit: tuple[float, float, float]
    motor_limits: tuple[float, float, float]
    shortest_period: int
    watchdog: int
    counter_bits: int
    simulated: bool


def hello_bytes(session: int) -> bytes:
    """The frame that begins this session (1 to 2³² − 1)."""
    head = HEADER.pack(frame.VERSION, frame.HELLO, 0, session, 1, 0)
    return head + CRC.pack(zlib.crc32(head))


def greeting_of(come: bytes, sessions: set[int]) -> Greeting | None:
    """The greeting that a frame is, in one of these sessions; None if it is anything else."""
    if len(come) != GREETED or CRC.unpack(come[-CRC.size :])[0] != zlib.crc32(come[: -CRC.size]):
        return None
    version, kind, _, session, _, _ = HEADER.unpack_from(come)
    if version != frame.VERSION or kind != frame.GREETING or session not in sessions:
        return None
    name, firmware, axes, *numbers, period, watchdog, bits, features = PAYLOAD.unpack_from(come, HEADER.size)
    said = "".join(letter if letter.isprintable() else "?" for letter in name.rstrip(b"\0").decode("ascii", "replace"))
    version_text = f"{firmware >> 16}.{firmware >> 8 & 255}.{firmware & 255}"
    counts, limits = tuple(numbers[:3]), tuple(numbers[3:])
    return Greeting(said, version_text, axes, counts, limits, period, watchdog, bits, bool(features & 1))


def cobs(plain: bytes) -> bytes:
    """A frame without zeros, by COBS, and the 0 that ends it."""
    coded = np.empty(len(plain) + len(plain) // 254 + 1, np.uint8)
    return coded[: frame.cobs_encode(_bytes(plain), len(plain), coded)].tobytes() + b"\0"


def uncobs(coded: bytes) -> bytes | None:
    """What was coded, given without the 0 that ends it; None if that is no COBS."""
    plain = np.empty(len(coded), np.uint8)
    count = frame.cobs_decode(_bytes(coded), 0, len(coded), plain)
    return None if count == frame.WRONG else plain[:count].tobytes()


def _bytes(data: bytes) -> np.ndarray:
    return np.frombuffer(bytearray(data), np.uint8)  # of bytes it would be read-only: another type to a kernel


def harmless_hello() -> tuple[int, bytes]:
    """(session, its hello) at random, without a byte that other firmware could take for a torque."""
    while True:
        session = secrets.randbelow(2**32 - 1) + 1
        hello = hello_bytes(session)
        if TORQUE not in cobs(hello):
            return session, hello


def ask_serial(port: Path | str, baud: int, patience: float) -> Greeting | None:
    """What greets at a serial port within the patience [s]; None: nobody. OSError where the port cannot be opened.

    Raises ValueError for a baud that serial lines do not have.
    """
    if baud not in SPEEDS:
        raise ValueError(f"baud is {baud}: it should be one of {BAUDS}")
    line = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _make_raw(line, SPEEDS[baud], port)
        return _greeted(
            line, patience, lambda hello: os.write(line, b"\0" + cobs(hello)), lambda: os.read(line, MOST), _lines()
        )
    finally:
        os.close(line)


def ask_udp(host: str, port: int, patience: float) -> Greeting | None:
    """What greets at this address within the patience [s]; None: nobody. OSError where there is no such address."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise OSError(f"{host} is no address: {error.strerror}") from None
    with socket.socket(family, kind, protocol) as peer:
        peer.setblocking(False)
        peer.connect(address)
        return _greeted(peer.fileno(), patience, peer.send, lambda: peer.recv(MOST), lambda datagram: [datagram])


def _make_raw(line: int, speed: int, port: Path | str) -> None:
    try:
        tty.setraw(line, termios.TCSANOW)
        how = termios.tcgetattr(line)
        how[4] = how[5] = speed
        termios.tcsetattr(line, termios.TCSANOW, how)
        termios.tcflush(line, termios.TCIFLUSH)
    except termios.error as error:
        raise OSError(*error.args[:2], str(port)) from None


def _greeted(
    descriptor: int, patience: float, send: Callable[[bytes], object], receive: Callable[[], bytes], frames: Frames
) -> Greeting | None:
    """Says hello again and again, and looks through what comes."""
    end, again, sessions = time.monotonic() + patience, 0.0, set[int]()
    while (now := time.monotonic()) < end:
        if now >= again:
            session, hello = harmless_hello()
            sessions.add(session)
            again = now + AGAIN
            with contextlib.suppress(BlockingIOError, ConnectionRefusedError):  # nobody reads, or nobody is there yet
                send(hello)
        if not select.select([descriptor], [], [], min(AGAIN, end - now))[0]:
            continue
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            for come in frames(receive()):
                if (greeting := greeting_of(come, sessions)) is not None:
                    return greeting
    return None


def _lines() -> Frames:
    """A function that takes bytes of a serial line and gives the frames that have become whole."""
    rest = b""

    def take(come: bytes) -> list[bytes]:
        nonlocal rest
        *whole, rest = (rest + come).split(b"\0")
        rest = rest[-MOST:]
        return [plain for line in whole if line and (plain := uncobs(line)) is not None]

    return take
