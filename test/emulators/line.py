# SPDX-License-Identifier: Apache-2.0
"""What the emulators share: a serial line that is a pty, a plant, a log. They know nothing of the code under test.

An emulator is a program of its own. It prints the path of its port, and writes a log that a test judges by: lines of
a time [ns of CLOCK_MONOTONIC], a word, and what it tells.
"""

import contextlib
import os
import select
import time
import tty

STEP = 0.0002  # [s] longest step of a plant


def run(*steps):
    """Takes these steps in turn until the process is interrupted."""
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            for step in steps:
                step()


class Line:
    """The device's end of a serial line; the port stays there when its user has gone, as a USB device's does."""

    def __init__(self):
        self._master, self._port = os.openpty()
        tty.setraw(self._port)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._port)

    def read(self, seconds):
        """Bytes that have come, after waiting no longer than this; b"" if there are none."""
        if not select.select([self._master], [], [], seconds)[0]:
            return b""
        return os.read(self._master, 4096)

    def write(self, data):
        os.write(self._master, data)


class Log:
    def __init__(self, path):
        self._file = open(path, "w", buffering=1)  # noqa: SIM115

    def tell(self, word, *what):
        print(time.monotonic_ns(), word, *what, file=self._file)


class Orders:
    """Lines on standard input, for the emulator itself: `obey` is called with the words, then it says done."""

    def __init__(self, obey):
        self._obey, self._text, self._open = obey, b"", True

    def serve(self):
        if not self._open or not select.select([0], [], [], 0)[0]:
            return
        read = os.read(0, 4096)
        self._open = bool(read)
        *orders, self._text = (self._text + read).split(b"\n")
        for order in orders:
            self._obey(order.decode().split())
            print("done", flush=True)


class Joint:
    """Inertia [kg m²] with damping [N m s/rad], turned by `torque` [N m] since the plant was last looked at."""

    def __init__(self, inertia, damping, angle=0.0):
        self.inertia, self.damping, self.angle = inertia, damping, angle
        self.velocity = self.torque = 0.0
        self._now = time.monotonic()

    def catch_up(self):
        passed = time.monotonic() - self._now
        self._now += passed
        steps = min(int(passed / STEP) + 1, 5000)
        for _ in range(steps):
            self.velocity += (self.torque - self.damping * self.velocity) / self.inertia * passed / steps
            self.angle += self.velocity * passed / steps
