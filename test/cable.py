# SPDX-License-Identifier: Apache-2.0
"""A cable between a host and a device that can be pulled out, and knows what went by: of the standard library alone.

`python cable.py serial LINK PORT` puts a serial line at LINK, whose other end is the device's PORT; `python cable.py
udp 0 NUMBER` takes datagrams at a port that it prints, for the device's port NUMBER. Orders on standard input, each
answered by what the class Seen keeps: `hold` lets nothing pass, `pass` everything; `close` takes the line away from the
host, `open` gives it a new one; `tell`. A serial device that is gone takes the line away, until it is there.
"""

import contextlib
import gc
import json
import os
import select
import socket
import sys
import time
import tty

import link_frames as link

PRIORITY = 83  # below bridge and device, above the servo: it stands for a wire
AGAIN = 0.02  # [s] between looks for a device that is gone


class Seen:
    """pushed: when the last command went to the device that has a motor value other than 0, commanded: when the last
    of all did; its motors [ns, motor units]. cut: whether the device's last sample says that its watchdog has cut."""

    def __init__(self):
        self.pushed = self.commanded = 0
        self.motors, self.cut = (), False

    def command(self, frame):
        """Takes a frame on its way to the device."""
        if frame.kind == link.COMMAND:
            self.commanded, self.motors = time.monotonic_ns(), frame.payload[2:]
            if any(self.motors):
                self.pushed = self.commanded

    def answer(self, frame):
        """Takes a frame on its way to the host."""
        if frame.kind == link.SAMPLE:
            self.cut = bool(frame.flags & link.CUT)


class Datagrams:
    def __init__(self, _, number):
        self.host, self.device = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.host.bind(("127.0.0.1", 0))
        self.device.connect(("127.0.0.1", int(number)))
        for end in (self.host, self.device):
            end.setblocking(False)
        self._asked_by = None
        self.where = self.host.getsockname()[1]

    def read(self, end):
        """What has come at an end, and the frames in it."""
        with contextlib.suppress(ConnectionRefusedError, BlockingIOError):  # the first may have been told to a write
            data, sender = end.recvfrom(4096)
            self._asked_by = sender if end is self.host else self._asked_by
            return data, frames([data])
        return b"", []

    def write(self, end, data):
        with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
            end.send(data) if end is self.device else end.sendto(data, self._asked_by)

    def look(self):
        pass


class Serial:
    def __init__(self, where, port):
        self.where, self._port = where, port
        self.host = self.device = self._far = None
        self._rest, self.closed = {}, False
        self.look()

    def look(self):
        """Has both ends, or neither."""
        if self.device is None:
            with contextlib.suppress(OSError):
                self.device = os.open(self._port, os.O_RDWR | os.O_NOCTTY)
                tty.setraw(self.device)
        if self.device is not None and self.host is None and not self.closed:
            self.host, self._far = os.openpty()
            tty.setraw(self._far)
            os.set_blocking(self.host, False)
            os.symlink(os.ttyname(self._far), self.where)

    def close(self):
        """Takes the line away from the host."""
        if self.host is not None:
            os.unlink(self.where)
            os.close(self.host)
            os.close(self._far)
        self.host = None
        self._rest = {}

    def read(self, end):
        """What has come at an end, and the frames that it completes."""
        try:
            data = os.read(end, 4096)
        except OSError:
            data = b""
        if not data:
            os.close(self.device)
            self.device = None
            self.close()
            return b"", []
        *whole, self._rest[end] = (self._rest.get(end, b"") + data).split(b"\0")
        return data, frames(decoded(whole))

    def write(self, end, data):
        with contextlib.suppress(OSError):  # full, or gone
            os.write(end, data)


def decoded(pieces):
    for piece in pieces:
        with contextlib.suppress(ValueError):
            yield link.cobs_decode(piece)


def frames(pieces):
    """Those that are whole."""
    found = []
    for piece in pieces:
        with contextlib.suppress(ValueError):
            found.append(link.unpack(piece))
    return found


def carry(line, seen, end, passes):
    """Takes what has come at an end to the other one."""
    from_host = end == line.host
    data, whole = line.read(end)
    if from_host and passes:
        for frame in whole:
            seen.command(frame)
    other = line.device if from_host else line.host
    if data and passes and other is not None:
        line.write(other, data)
    if not from_host:
        for frame in whole:
            seen.answer(frame)


def run(line):
    seen, passes, text = Seen(), True, b""
    print(line.where, flush=True)
    while True:
        ends = [end for end in (line.host, line.device) if end is not None]
        ready = select.select([0, *ends], [], [], AGAIN)[0]
        for end in ready:
            if end != 0 and end in (line.host, line.device):
                carry(line, seen, end, passes)
        line.look()
        if 0 not in ready:
            continue
        read = os.read(0, 4096)
        if not read:
            return
        *orders, text = (text + read).split(b"\n")
        for order in orders:
            if order in (b"hold", b"pass"):
                passes = order == b"pass"
            elif order in (b"close", b"open"):
                line.closed = order == b"close"
                line.close() if line.closed else line.look()
            print(json.dumps(vars(seen)), flush=True)


if __name__ == "__main__":
    gc.disable()
    with contextlib.suppress(OSError):  # not permitted: then it is as late as the machine makes it
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    kind, where, device = sys.argv[1:]
    run({"udp": Datagrams, "serial": Serial}[kind](where, device))
