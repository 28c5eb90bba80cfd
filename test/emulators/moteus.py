# SPDX-License-Identifier: Apache-2.0
"""moteus drives on an fdcanusb: `python moteus.py LOG ID=REVOLUTIONS…`, one drive for each number, and where it stands.

A drive turns its motor by what the last position command said, and falls into mode 11 where none has come for the
command's time limit; it leaves that, and a fault, only by a stop. Of the position mode there is the torque fed forward:
gains other than 0 are no part of it.

The log has `line LINE` as it came, `torque ID N·m` at each command and where the drive gives up, and `mode ID MODE`.
A drive takes orders of its own on standard input: `ID fault CODE`, `ID temperature DEGREES`. Inertia and damping are
those of the description moteus_knob.
"""

import math
import struct
import sys
import time

from line import Joint, Orders, log_to, run

STOPPED, FAULT, POSITION, TIMEOUT = 0, 1, 10, 11
MODE, PLACE, SPEED, TORQUE, VOLTAGE, TEMPERATURE, FAULT_CODE = 0x00, 0x01, 0x02, 0x03, 0x0D, 0x0E, 0x0F
FEED_FORWARD, KP, KD, MOST_TORQUE, TIME_LIMIT = 0x22, 0x23, 0x24, 0x25, 0x27
UNSAID = {FEED_FORWARD: 0.0, KP: 1.0, KD: 1.0, MOST_TORQUE: math.nan, TIME_LIMIT: 0.0}
SCALES = {  # of int8, int16, int32
    PLACE: (0.01, 0.0001, 0.00001),
    SPEED: (0.1, 0.00025, 0.00001),
    TORQUE: (0.5, 0.01, 0.001),
    VOLTAGE: (0.5, 0.1, 0.001),
    TEMPERATURE: (1.0, 0.1, 0.001),
}
PACKED = "bhif"
LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)  # of CAN FD frames
USUAL_LIMIT = 0.1  # [s]
LEVER = 0.05  # [m]


class Drive:
    def __init__(self, name, tell, revolutions=0.0):
        self._name, self._tell = name, tell
        self.motor = Joint(0.1 * LEVER**2, 5.0 * LEVER**2, math.tau * revolutions)
        self._mode, self.fault, self.temperature = STOPPED, 0, 25.0
        self.until = math.inf  # [ns]; then it gives up

    def pass_time(self, now):
        if self.until <= now:
            self._go(self.until, TIMEOUT)
        self.motor.pass_time(now)

    def break_down(self, now, fault):
        self.fault = fault
        self._go(now, FAULT)

    def take(self, data, now):
        """The multiplexed frame's answer, b"" if it asks for nothing."""
        self.pass_time(now)
        written, asked, rest = {}, [], data
        while rest:
            kind, rest = rest[0], rest[1:]
            if kind == 0x50:
                continue
            how = kind >> 2 & 3
            count = kind & 3
            if not count:
                count, rest = rest[0], rest[1:]
            first, rest = rest[0], rest[1:]
            for register in range(first, first + count):
                if kind & 0xF0 == 0x00:
                    size = struct.calcsize(PACKED[how])
                    (written[register],) = struct.unpack(f"<{PACKED[how]}", rest[:size])
                    rest = rest[size:]
                elif kind & 0xF0 == 0x10:
                    asked.append((register, how))
                else:
                    raise ValueError(f"subframe {kind:02x}")
        if MODE in written:
            self._obey(written, now)
        return b"".join(self._told(register, how) for register, how in asked)

    def _obey(self, written, now):
        if written[MODE] == STOPPED:
            self.fault = 0
            self._go(now, STOPPED)
        elif written[MODE] == POSITION and self._mode in (STOPPED, POSITION):
            said = {**UNSAID, **written}
            most = math.inf if math.isnan(said[MOST_TORQUE]) else said[MOST_TORQUE]
            limit = said[TIME_LIMIT] or USUAL_LIMIT
            self._go(now, POSITION, max(-most, min(most, said[FEED_FORWARD])))
            self.until = math.inf if math.isnan(limit) else now + round(limit * 1e9)

    def _go(self, now, mode, torque=0.0):
        self.motor.pass_time(now)
        if mode != self._mode:
            self._tell(now, "mode", self._name, mode)
        self._tell(now, "torque", self._name, torque)
        self._mode, self.motor.torque, self.until = mode, torque, math.inf

    def _told(self, register, how):
        value = {
            MODE: self._mode,
            PLACE: self.motor.angle / math.tau,
            SPEED: self.motor.velocity / math.tau,
            TORQUE: self.motor.torque,
            VOLTAGE: 24.0,
            TEMPERATURE: self.temperature,
            FAULT_CODE: self.fault,
        }[register]
        if how < 3:
            value = round(value / SCALES[register][how]) if register in SCALES else value
        return bytes([0x21 | how << 2, register]) + struct.pack(f"<{PACKED[how]}", value)


class Bus:
    """The adapter: lines of text on one side, the drives on the other."""

    def __init__(self, tell, drives):
        self._tell, self.drives, self._text = tell, drives, b""

    due = property(lambda self: min(drive.until for drive in self.drives.values()))

    def serve(self, data, now):
        for drive in self.drives.values():
            drive.pass_time(now)
        *lines, self._text = (self._text + data).replace(b"\r", b"\n").split(b"\n")
        answers = []
        for line in filter(None, lines):
            self._tell(now, "line", line.decode())
            answers += self._take(line, now)
        return b"".join(answer.encode() + b"\r\n" for answer in answers)

    def _take(self, line, now):
        words = line.split()
        if words[:2] != [b"can", b"send"] or len(words) < 4:
            return ["ERR unknown command"]
        address, data = int(words[2], 16), bytes.fromhex(words[3].decode())
        if len(data) not in LENGTHS or b"F" not in words[4]:
            return ["ERR no such frame"]
        drive = self.drives.get(address & 0x7F)
        told = drive.take(data, now) if drive else b""
        if not (address & 0x8000 and told):
            return ["OK"]
        told += b"\x50" * (min(length for length in LENGTHS if length >= len(told)) - len(told))
        return ["OK", f"rcv {(address & 0x7F) << 8 | address >> 8 & 0x7F:x} {told.hex().upper()} E B F"]

    def order(self, words):
        drive = self.drives[int(words[0])]
        if words[1] == "fault":
            drive.break_down(time.monotonic_ns(), int(words[2]))
        else:
            drive.temperature = float(words[2])


if __name__ == "__main__":
    log, placed = log_to(sys.argv[1]), [word.split("=") for word in sys.argv[2:]]
    bus = Bus(log, {int(name): Drive(name, log, float(place)) for name, place in placed})
    run(bus, Orders(bus.order))
