# SPDX-License-Identifier: Apache-2.0
"""A Haply 2DIY's board: `python haply.py LOG [3]`. As the board's, its firmware waits for what is missing of a frame.

It has no watchdog: the last torque is held whatever becomes of the host, and a reset does not take it back. A frame
that is cut short holds it up for a second. The log has `reset BYTES`, `setup BYTES`, `write BYTES`, `short` and
`torque 1 2` [N m]. Orders on standard input are its hand's: `hold X Y` [m, in the linkage's frame] holds the handle
there from now on, and `lead 1 2` [rad] puts the joints to these angles and holds the handle there.
Lengths, inertia and damping are those of the description of this generation, its arms begin in their rest pose.
"""

import math
import struct
import sys

import numpy as np
from line import Orders, log_to, run

from haptic_device.config.description import load_device
from haptic_device.config.drives import place_of
from haptic_device.device import loopback_config, operator_hand, simulated_device
from haptic_device.device.plant import PLANT_MEMORY

PATIENCE = 1_000_000_000  # [ns] for the rest of a frame
SETUP, WRITE = 1, 2
REST = {2: (241.0, -61.0), 3: (168.0, 12.0)}  # [deg]
TURNS = {2: (1, -1), 3: (1, 1)}  # -1: that motor looks the other way
SPRING, DAMPER = 500.0, 5.0  # of a hand at the handle [N/m], [N s/m]


class Short(Exception):
    """The rest of a frame has not come."""


class FiveBar:
    """Two arms whose ends meet in the handle, under torques [N m] and a hand that pulls the handle to a place by spring
    and damper: the plant of the simulated device, which is held against Hamilton's equations. `memory` is that of it.
    """

    def __init__(self, device, angles):
        self._device, self._plant, self.memory = device, loopback_config.plant_of(device), np.zeros(1, PLANT_MEMORY)
        self._motion = np.zeros(1, operator_hand.MOTION)
        self._motion["kind"], self._motion["lag"], self._motion["grip"] = operator_hand.FOLLOW, 1e-9, 1.0
        self.torque, self.angles = self.memory["torque"][0], self.memory["joint"][0]
        self._put(angles)

    def _put(self, angles):
        self.memory["position"] = self.memory["target"] = place_of(self._device, (*angles, 0.0))
        self.memory["knot"], self.memory["joint_velocity"], self.angles[:] = 0, 0.0, angles

    def hold(self, x, y):
        goal = np.subtract((x, y), self._device.kinematics.origin)
        self.memory["target"][0, :2] = self._motion["points"][0, 0, :2] = goal
        self._plant["hand_stiffness"][0, :2], self._plant["hand_damping"][0, :2] = SPRING, DAMPER

    def lead(self, a, b):
        """The way there takes no time, and is not counted in what the hand was given."""
        self._put((a, b))
        self.hold(*self._device.kinematics.pose(a, b)[:2])

    def pass_time(self, now):
        self.memory["time"][0] = self.memory["time"][0] or now
        simulated_device.advance(self._plant[0], self.memory[0], self._motion[0], now)


class Board:
    def __init__(self, tell, generation=3):
        self._tell, self._buffer, self._answer, self._now = tell, b"", b"", 0
        self._rest, self._turns = [math.radians(angle) for angle in REST[generation]], TURNS[generation]
        self.arms = FiveBar(load_device(f"haply_2diy_gen{generation}"), self._rest)
        self._frames = self._serve()
        self._forget()
        next(self._frames)

    due = math.inf

    def _forget(self):
        self._motors, self._encoders = [], []  # (joint, sign), (joint, sign, offset in counts, counts per turn)

    def serve(self, data, now):
        self._buffer, self._answer, self._now = self._buffer + data, b"", now
        self.arms.pass_time(now)
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
            lay -= sign * self._counts(joint, resolution)
            self._encoders.append((joint, sign, lay, resolution))
        self._tell(self._now, "setup", taken.hex())

    def _joint(self, port):
        """The motor at the first port is the second one, as the arms are wired."""
        return 1 - port

    def _counts(self, joint, resolution):
        """That the motor's own encoder is from where the arms lay."""
        return self._turns[joint] * round((self.arms.angles[joint] - self._rest[joint]) * resolution / math.tau)

    def _write(self, device):
        torques = yield from self._take(4 * len(self._motors))
        for (joint, sign), value in zip(self._motors, struct.unpack(f"<{len(self._motors)}f", torques), strict=True):
            self.arms.torque[joint] = self._turns[joint] * sign * value
        self._tell(self._now, "write", bytes([WRITE, device]).hex() + torques.hex())
        self._tell(self._now, "torque", *self.arms.torque)
        angles = [
            360.0 / resolution * (lay + sign * self._counts(joint, resolution))
            for joint, sign, lay, resolution in self._encoders
        ]
        self._answer += bytes([device]) + struct.pack(f"<{len(angles)}f", *angles)

    def order(self, words):
        {"hold": self.arms.hold, "lead": self.arms.lead}[words[0]](*map(float, words[1:]))


if __name__ == "__main__":
    board = Board(log_to(sys.argv[1]), *map(int, sys.argv[2:3]))
    run(board, Orders(board.order))
