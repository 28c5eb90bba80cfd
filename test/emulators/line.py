# SPDX-License-Identifier: Apache-2.0
"""What the emulators share: joints with a hand on them, a log, and a process around them. They know nothing of the code
under test, and no clock: what they do, they do at a time that they are given [ns].

An emulator has `serve(data, now)`, which takes bytes that come now and returns its answer; and `due`, when it wants to
be served without any [ns]. As a process it has a pty, whose path it prints, and writes a log: lines of a time [ns of
CLOCK_MONOTONIC], a word, and what it tells.
"""

import contextlib
import math
import os
import select
import time
import tty

STEP = 50_000  # [ns] longest step of a plant, over which the hand's torque is held


def run(emulator, orders=lambda: None):
    """Serves a pty until the process is interrupted; the port stays there when its user has gone, as USB's does."""
    master, port = os.openpty()
    tty.setraw(port)
    os.set_blocking(master, False)
    print(os.ttyname(port), flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            came = select.select([master], [], [], 0.001)[0]
            os.write(master, emulator.serve(os.read(master, 4096) if came else b"", time.monotonic_ns()))
            orders()


def log_to(path):
    """tell(now, word, *what) writes a line."""
    file = open(path, "w", buffering=1)  # noqa: SIM115
    return lambda *line: print(*line, file=file)


class Orders:
    """Lines on standard input, for the emulator itself: `obey` is called with the words, then it says done."""

    def __init__(self, obey):
        self._obey, self._text, self._open = obey, b"", True

    def __call__(self):
        if not self._open or not select.select([0], [], [], 0)[0]:
            return
        read = os.read(0, 4096)
        self._open = bool(read)
        *orders, self._text = (self._text + read).split(b"\n")
        for order in orders:
            self._obey(order.decode().split())
            print("done", flush=True)


class Joint:
    """Inertia [kg m²] with damping [N m s/rad], under `torque` [N m] of the motor and of a hand that pulls to `goal`
    [rad] by a spring [N m/rad] and a damper [N m s/rad] between hand and joint.

    given: work [J] that the hand was given. Over a step both torques are constant, and the way is exact.
    """

    def __init__(self, inertia, damping, angle=0.0):
        self.inertia, self.damping, self.angle, self.goal = inertia, damping, angle, angle
        self.velocity = self.torque = self.spring = self.damper = self.given = 0.0
        self._now = None

    def pass_time(self, now):
        self._now = self._now or now
        while (left := now - self._now) > 0:
            self._step(min(left, STEP) * 1e-9)
            self._now += min(left, STEP)

    def lead(self, goal):
        """A firm hand leads it there, in a second that is past at once: it stands still until then."""
        self.goal, self.spring, self.damper = goal, 1.0, 0.02
        self.pass_time((self._now or 0) + 1_000_000_000)

    def _step(self, time):
        hand = self.spring * (self.goal - self.angle) - self.damper * self.velocity
        lag, final = self.inertia / self.damping, (self.torque + hand) / self.damping
        kept = math.exp(-time / lag)
        way = final * time + (self.velocity - final) * lag * (1.0 - kept)
        self.angle, self.velocity = self.angle + way, final + (self.velocity - final) * kept
        self.given -= hand * way
