# SPDX-License-Identifier: Apache-2.0
"""A line to a device: a file descriptor that Python opens, and that compiled code reads, writes and waits for."""

import contextlib
import errno
import fcntl
import os
import socket
import struct
import termios

import numpy as np
from numba import types

from haptic_device.config.link_registry import SPEEDS
from haptic_device.jit import njit
from haptic_device.os_errors import in_words

POLLIN = 1
SECOND = 1_000_000_000
LOST = -1  # of `receive`: the line is gone
PASSING = tuple(getattr(errno, name) for name in ("EAGAIN", "EINTR", "ECONNREFUSED", "ENOBUFS"))
TIOCGSERIAL, TIOCSSERIAL, ASYNC_LOW_LATENCY = 0x541E, 0x541F, 1 << 13

_pointer = types.CPointer(types.int64)
_bytes = types.CPointer(types.uint8)
_ppoll = types.ExternalFunction("ppoll", types.int32(_pointer, types.uint64, _pointer, types.intp))
_read = types.ExternalFunction("read", types.intp(types.int32, _bytes, types.uintp))
_write = types.ExternalFunction("write", types.intp(types.int32, _bytes, types.uintp))
_errno = types.ExternalFunction("__errno_location", types.CPointer(types.int32)())


def open_serial(options):
    """Descriptor of a serial line: raw, nobody else's, what came before thrown away. Raises OSError, one sentence."""
    try:
        descriptor = os.open(options.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise OSError(f"port {options.port} cannot be opened: {error.strerror}") from None
    try:
        _make_raw(descriptor, SPEEDS[options.baud])
    except (OSError, termios.error) as error:
        os.close(descriptor)
        raise OSError(f"port {options.port} is no serial line: {error.args[-1]}") from None
    return descriptor


def _make_raw(descriptor, speed):
    """Bytes as they come, no echo, no control characters; a driver that waits to gather bytes is asked not to."""
    fcntl.ioctl(descriptor, termios.TIOCEXCL)
    control, characters = termios.CS8 | termios.CREAD | termios.CLOCAL, [b"\x00"] * 32
    characters[termios.VMIN] = 1  # else an empty line reads as one that has ended
    termios.tcsetattr(descriptor, termios.TCSANOW, [0, 0, control, 0, speed, speed, characters])
    termios.tcflush(descriptor, termios.TCIOFLUSH)
    with contextlib.suppress(OSError):  # a terminal that is no chip has none
        settings = bytearray(fcntl.ioctl(descriptor, TIOCGSERIAL, bytes(72)))
        flags = struct.unpack_from("i", settings, 16)[0] | ASYNC_LOW_LATENCY
        struct.pack_into("i", settings, 16, flags)
        fcntl.ioctl(descriptor, TIOCSSERIAL, bytes(settings))


def open_udp(options):
    """Descriptor of a socket to the device's address. Raises OSError, one sentence."""
    where = f"{options.host} port {options.port}"
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(options.host, options.port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK, protocol) as peer:
            peer.connect(address)
            return peer.detach()
    except OSError as error:
        raise OSError(f"{where} cannot be reached by UDP: {in_words(error)}") from None


@njit
def receive(descriptor, buffer, begin, datagrams):
    """Bytes read into buffer from begin on; 0: none are there; LOST: the line is gone. datagrams: one may be empty."""
    count = _read(descriptor, buffer[begin:].ctypes, buffer.size - begin)
    if count > 0:
        return np.int64(count)
    if count == 0:
        return np.int64(0 if datagrams else LOST)
    return np.int64(0 if _passes() else LOST)


@njit
def send(descriptor, buffer, count):
    """Whether all `count` bytes went out."""
    return _write(descriptor, buffer.ctypes, count) == count


@njit
def wait(descriptor, until, now, scratch):
    """Returns when something can be read, or at `until` [ns]; descriptor −1: at `until`. scratch: int64 (3)."""
    left = max(until - now, 0)
    scratch[0], scratch[1] = left // SECOND, left % SECOND
    scratch[2] = (np.int64(descriptor) & 0xFFFFFFFF) | (POLLIN << 32)
    _ppoll(scratch[2:].ctypes, 1, scratch.ctypes, 0)


@njit
def _passes():
    """Whether the last call failed for a reason that passes: nothing there, interrupted, a peer not there yet, full."""
    return _errno()[0] in PASSING
