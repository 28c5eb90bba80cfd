# SPDX-License-Identifier: Apache-2.0
"""A Haply 2DIY's board: `python haply.py LOG`. As the board's, its firmware waits for what is missing of a frame.

It has no watchdog: the last torque is held whatever becomes of the host, and a reset does not take it back. A frame
that is cut short holds it up for a second. The log has `reset BYTES`, `setup BYTES`, `write BYTES`,
`short` and `torque 1 2` [N m]. It takes an order of its own on standard input, `turn 1 2` [rad]: where the joints are.
"""

import math
import struct
import sys

from line import Joint, Line, Log, Orders, run

PATIENCE = 1.0  # [s] for the rest of a frame
REACH = 3.0  # [rad] from where the arms lay; there they stand still
SETUP, WRITE = 1, 2


class Short(Exception):
    """The rest of a frame has not come."""


class Board:
    def __init__(self, line, log):
        self._line, self._log, self._buffer = line, log, b""
        self.joints = [Joint(2e-4, 2e-3) for _ in range(2)]
        self._forget()

    def _forget(self):
        self._motors, self._encoders = [], []  # (port's joint, sign), (joint, sign, offset in counts, counts per turn)

    def serve(self):
        """One frame, or a millisecond without any."""
        self._fetch(0.001)
        if not self._buffer:
            return
        try:
            kind, device = self._take(2)
            if kind == SETUP:
                self._set_up(device)
            elif kind == WRITE:
                self._write(device)
            elif kind == 0:
                self._forget()
                self._log.tell("reset", bytes([kind, device]).hex())
        except Short:
            self._log.tell("short")

    def _fetch(self, seconds):
        self._buffer += self._line.read(seconds)
        for joint in self.joints:
            joint.catch_up()
            if abs(joint.angle) > REACH:
                joint.angle, joint.velocity = math.copysign(REACH, joint.angle), 0.0

    def _take(self, count):
        waited = 0
        while len(self._buffer) < count:
            if waited >= PATIENCE * 1000:
                self._buffer = b""
                raise Short
            self._fetch(0.001)
            waited += 1
        taken, self._buffer = self._buffer[:count], self._buffer[count:]
        return taken

    def _set_up(self, device):
        taken = bytes([SETUP, device])
        parts = []
        for _ in range(2):  # motors, encoders: a mask of the ports in use, and a direction of each
            mask = self._take(1)
            used = [port for port in range(4) if mask[0] >> port & 1]
            directions = self._take(len(used))
            parts.append(list(zip(used, directions, strict=True)))
            taken += mask + directions
        for _ in range(2):  # sensors, PWM outputs: there are none
            count = self._take(1)
            taken += count + self._take(count[0])
        self._motors = [(self._joint(port), 1 if turn else -1) for port, turn in parts[0]]
        self._encoders = []
        for port, turn in parts[1]:
            given = self._take(8)
            taken += given
            offset, resolution = struct.unpack("<ff", given)
            joint, sign = self._joint(port), 1 if turn else -1
            lay = int(offset * resolution / 360.0)  # where the arm lies is where the offset says
            lay -= sign * round(joint.angle * resolution / math.tau)
            self._encoders.append((joint, sign, lay, resolution))
        self._log.tell("setup", taken.hex())

    def _joint(self, port):
        """The motor at the first port is the second one, as the arms are wired."""
        return self.joints[1 - port]

    def _write(self, device):
        torques = self._take(4 * len(self._motors))
        for (joint, sign), value in zip(self._motors, struct.unpack(f"<{len(self._motors)}f", torques), strict=True):
            joint.torque = sign * value
        self._log.tell("write", bytes([WRITE, device]).hex() + torques.hex())
        self._log.tell("torque", *(joint.torque for joint in self.joints))
        angles = [
            360.0 / resolution * (lay + sign * round(joint.angle * resolution / math.tau))
            for joint, sign, lay, resolution in self._encoders
        ]
        self._line.write(bytes([device]) + struct.pack(f"<{len(angles)}f", *angles))

    def order(self, words):
        for joint, angle in zip(self.joints, words[1:], strict=True):
            joint.angle = float(angle)


if __name__ == "__main__":
    line = Line()
    board = Board(line, Log(sys.argv[1]))
    print(line.path, flush=True)
    run(board.serve, Orders(board.order).serve)
