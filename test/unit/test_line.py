# SPDX-License-Identifier: Apache-2.0
"""A line to a device: what cannot be opened, what is read and written, and when it is gone."""

import contextlib
import os
import pty
import socket
import termios
import time
import tty
from types import SimpleNamespace

import numpy as np
import pytest

from haptic_device.config.link_registry import SPEEDS
from haptic_device.link import line
from haptic_device.link.open_serial import Options as SerialOptions
from haptic_device.link.open_udp import Options as UdpOptions

MS = 1_000_000  # [ns]


@pytest.fixture
def terminal():
    """The device's end and the host's end of a pseudo-terminal, the latter by its path."""
    far, near = pty.openpty()
    tty.setraw(near)
    yield SimpleNamespace(far=far, path=os.ttyname(near))
    os.close(near)
    with contextlib.suppress(OSError):
        os.close(far)


@pytest.fixture
def opened(terminal):
    """The descriptor of the host's end."""
    descriptor = line.open_serial(SerialOptions(port=terminal.path))
    yield descriptor
    os.close(descriptor)


def refusal(options):
    """Why this serial line is not opened."""
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError) as refused:
        line.open_serial(options)
    assert len(os.listdir("/proc/self/fd")) == before
    return str(refused.value)


def test_a_port_that_is_none_is_named_once_and_stays_as_it_was(tmp_path, terminal):
    gone, file, no_line = tmp_path / "line", tmp_path / "file", "is no serial line: Inappropriate ioctl for device"
    file.write_text("kept")
    assert refusal(SerialOptions(port=str(gone))) == f"port {gone} cannot be opened: No such file or directory"
    for port in ("/dev/null", str(file)):
        assert refusal(SerialOptions(port=port)) == f"port {port} {no_line}"
    assert file.read_text() == "kept"


def test_every_baud_that_a_description_may_have_is_opened_with(terminal):
    for baud, speed in SPEEDS.items():
        descriptor = line.open_serial(SerialOptions(port=terminal.path, baud=baud))
        assert baud and termios.tcgetattr(descriptor)[4:6] == [speed] * 2
        os.close(descriptor)


def test_every_byte_passes_as_it_is_what_came_before_is_gone_and_a_device_that_is_gone_is_lost(terminal):
    os.write(terminal.far, b"old\n")
    descriptor = line.open_serial(SerialOptions(port=terminal.path, baud=4_000_000))
    assert termios.tcgetattr(descriptor)[4:6] == [SPEEDS[4_000_000]] * 2
    every, buffer = np.arange(256, dtype=np.uint8), np.zeros(300, np.uint8)
    assert line.receive(descriptor, buffer, 0, False) == 0  # nothing is there: it is not lost
    os.write(terminal.far, every.tobytes())
    heard = heard_all(descriptor, buffer, 256)
    assert line.send(descriptor, every, 256)
    back = b""
    while len(back) < 256:
        back += os.read(terminal.far, 512)
    assert heard == back == every.tobytes()
    os.close(terminal.far)
    assert line.receive(descriptor, buffer, 0, False) == line.LOST
    assert not line.send(descriptor, buffer, 8)
    os.close(descriptor)


def heard_all(descriptor, buffer, count):
    """So many bytes of the line."""
    have, scratch = 0, np.zeros(3, np.int64)
    while have < count:
        now = time.monotonic_ns()
        line.wait(descriptor, now + 1000 * MS, now, scratch)
        came = line.receive(descriptor, buffer, have, False)
        assert came >= 0
        have += came
    return buffer[:have].tobytes()


def test_a_wait_ends_when_a_byte_is_there_and_without_one_not_before_its_time(terminal, opened):
    scratch, now = np.zeros(3, np.int64), time.monotonic_ns()
    line.wait(opened, now + 2 * MS, now, scratch)
    assert time.monotonic_ns() >= now + 2 * MS
    line.wait(-1, now + 3 * MS, now, scratch)
    assert time.monotonic_ns() >= now + 3 * MS
    os.write(terminal.far, b"x")
    heard = np.zeros(8, np.uint8)
    line.wait(opened, time.monotonic_ns() + 3_600_000 * MS, time.monotonic_ns(), scratch)  # else it never ends
    assert line.receive(opened, heard, 0, False) == 1 and heard[0] == ord("x")


def test_a_udp_peer_that_is_not_there_yet_is_not_lost():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    descriptor, buffer = line.open_udp(UdpOptions(port=port)), np.zeros(8, np.uint8)
    line.send(descriptor, buffer, 8)
    assert line.receive(descriptor, buffer, 0, True) == 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", port))
        peer.settimeout(60.0)
        line.send(descriptor, buffer, 3)
        data, sender = peer.recvfrom(100)
        peer.sendto(b"yes", sender)
        assert data == bytes(3) and heard_all(descriptor, buffer, 3) == b"yes"
    os.close(descriptor)


def test_a_host_that_has_no_address_is_said():
    with pytest.raises(OSError) as refused:
        line.open_udp(UdpOptions(host="no.such.host.invalid", port=5))
    assert str(refused.value).startswith("no.such.host.invalid port 5 cannot be reached by UDP: ")
    assert "[Errno" not in str(refused.value) and "\n" not in str(refused.value)
