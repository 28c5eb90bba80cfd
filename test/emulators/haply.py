# SPDX-License-Identifier: Apache-2.0
"""A Haply 2DIY's board: `python haply.py LOG`. As the board's, its firmware waits for what is missing of a frame.

It has no watchdog: the last torque is held whatever becomes of the host, and a reset does not take it back. A frame
that is cut short holds it up for a second. The log has `reset BYTES`, `setup BYTES`, `write BYTES`, `short` and
`torque 1 2` [N m]. It takes an order of its own on standard input, `lead 1 2` [rad]: a hand leads the joints there.
Inertia and damping are those of the description haply_2diy.
"""

import math
import struct
import sys

from line import Joint, Orders, log_to, run

PATIENCE = 1_000_000_000  # [ns] for the rest of a frame
REACH = 3.0  # [rad] from where the arms lay; there they stand still
SETUP, WRITE = 1, 2
LINK = 0.07  # [m]


class Short(Exception):
    """The rest of a frame has not come."""


class Board:
    def __init__(self, tell):
        self._tell, self._buffer, self._answer, self._now = tell, b"", b"", 0
        self.joints = [Joint(0.04 * LINK**2, 0.02 * LINK**2) for _ in range(2)]
        self._frames = self._serve()
        self._forget()
        next(self._frames)

    due = math.inf

    def _forget(self):
        self._motors, self._encoders = [], []  # (port's joint, sign), (joint, sign, offset in counts, counts per turn)

    def serve(self, data, now):
        self._buffer, self._answer, self._now = self._buffer + data, b"", now
        for joint in self.joints:
            joint.pass_time(now)
            if abs(joint.angle) > REACH:
                joint.angle, joint.velocity = math.copysign(REACH, joint.angle), 0.0
        next(self._frames)
        return self._answer

    def _serve(self):
        """One frame after the other; yields where more bytes are needed."""
        while True:
            while not self._buffer:
                yield
            try:
                kind, device = yield from self._take(2)
                if kind == SETUP:
                    yield from self._set_up(device)
                elif kind == WRITE:
                    yield from self._write(device)
                elif kind == 0:
                    self._forget()
                    self._tell(self._now, "reset", bytes([kind, device]).hex())
            except Short:
                self._tell(self._now, "short")

    def _take(self, count):
        began = self._now
        while len(self._buffer) < count:
            if self._now - began >= PATIENCE:
                self._buffer = b""
                raise Short
            yield
        taken, self._buffer = self._buffer[:count], self._buffer[count:]
        return taken

    def _set_up(self, device):
        taken = bytes([SETUP, device])
        parts = []
        for _ in range(2):  # motors, encoders: a mask of the ports in use, and a direction of each
            mask = yield from self._take(1)
            used = [port for port in range(4) if mask[0] >> port & 1]
            directions = yield from self._take(len(used))
            parts.append(list(zip(used, directions, strict=True)))
            taken += mask + directions
        for _ in range(2):  # sensors, PWM outputs: there are none
            count = yield from self._take(1)
            taken += count + (yield from self._take(count[0]))
        self._motors = [(self._joint(port), 1 if turn else -1) for port, turn in parts[0]]
        self._encoders = []
        for port, turn in parts[1]:
            given = yield from self._take(8)
            taken += given
            offset, resolution = struct.unpack("<ff", given)
            joint, sign = self._joint(port), 1 if turn else -1
            lay = int(offset * resolution / 360.0)  # where the arm lies is where the offset says
            lay -= sign * round(joint.angle * resolution / math.tau)
            self._encoders.append((joint, sign, lay, resolution))
        self._tell(self._now, "setup", taken.hex())

    def _joint(self, port):
        """The motor at the first port is the second one, as the arms are wired."""
        return self.joints[1 - port]

    def _write(self, device):
        torques = yield from self._take(4 * len(self._motors))
        for (joint, sign), value in zip(self._motors, struct.unpack(f"<{len(self._motors)}f", torques), strict=True):
            joint.torque = sign * value
        self._tell(self._now, "write", bytes([WRITE, device]).hex() + torques.hex())
        self._tell(self._now, "torque", *(joint.torque for joint in self.joints))
        angles = [
            360.0 / resolution * (lay + sign * round(joint.angle * resolution / math.tau))
            for joint, sign, lay, resolution in self._encoders
        ]
        self._answer += bytes([device]) + struct.pack(f"<{len(angles)}f", *angles)

    def order(self, words):
        for joint, goal in zip(self.joints, words[1:], strict=True):
            joint.lead(float(goal))


if __name__ == "__main__":
    board = Board(log_to(sys.argv[1]))
    run(board, Orders(board.order))
