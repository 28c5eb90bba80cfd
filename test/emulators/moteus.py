# SPDX-License-Identifier: Apache-2.0
"""moteus drives on an fdcanusb: `python moteus.py LOG ID…`, one drive for each number.

A drive turns its motor by what the last position command said, and falls into mode 11 where none has come for the
command's time limit; it leaves that, and a fault, only by a stop. Of the position mode there is the torque fed forward:
gains other than 0 are no part of it.

The log has `line LINE` as it came, `torque ID N·m` at each command and where the drive gives up, and `mode ID MODE`.
A drive takes orders of its own on standard input: `ID fault CODE`, `ID temperature DEGREES`, `ID turn REVOLUTIONS`.
"""

import math
import struct
import sys
import time

from line import Joint, Line, Log, Orders, run

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


class Drive:
    def __init__(self, name, log):
        self._name, self._log = name, log
        self.motor = Joint(2.5e-4, 0.0125)
        self._mode, self.fault, self.temperature = STOPPED, 0, 25.0
        self._until = math.inf

    def pass_time(self):
        if time.monotonic() > self._until and self._mode == POSITION:
            self._go(TIMEOUT)
        self.motor.catch_up()

    def break_down(self, fault):
        self.fault = fault
        self._go(FAULT)

    def take(self, data):
        """The multiplexed frame's answer, b"" if it asks for nothing."""
        self.pass_time()
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
            self._obey(written)
        return b"".join(self._tell(register, how) for register, how in asked)

    def _obey(self, written):
        if written[MODE] == STOPPED:
            self.fault = 0
            self._go(STOPPED)
        elif written[MODE] == POSITION and self._mode in (STOPPED, POSITION):
            said = {**UNSAID, **written}
            most = math.inf if math.isnan(said[MOST_TORQUE]) else said[MOST_TORQUE]
            limit = said[TIME_LIMIT] or USUAL_LIMIT
            self._until = math.inf if math.isnan(limit) else time.monotonic() + limit
            self._go(POSITION, max(-most, min(most, said[FEED_FORWARD])))

    def _go(self, mode, torque=0.0):
        self.motor.catch_up()
        if mode != self._mode:
            self._log.tell("mode", self._name, mode)
        self._log.tell("torque", self._name, torque)
        self._mode, self.motor.torque = mode, torque

    def _tell(self, register, how):
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

    def __init__(self, line, log, drives):
        self._line, self._log, self._drives = line, log, drives
        self._text = b""

    def serve(self):
        self._text += self._line.read(0.001)
        for drive in self._drives.values():
            drive.pass_time()
        *lines, self._text = self._text.replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            if line:
                self._log.tell("line", line.decode())
                self._take(line)

    def _take(self, line):
        words = line.split()
        if words[:2] != [b"can", b"send"] or len(words) < 4:
            return self._say("ERR unknown command")
        address, data = int(words[2], 16), bytes.fromhex(words[3].decode())
        if len(data) not in LENGTHS or b"F" not in words[4]:
            return self._say("ERR no such frame")
        self._say("OK")
        drive = self._drives.get(address & 0x7F)
        if drive is None:
            return None
        told = drive.take(data)
        if address & 0x8000 and told:
            told += b"\x50" * (min(length for length in LENGTHS if length >= len(told)) - len(told))
            back = (address & 0x7F) << 8 | address >> 8 & 0x7F
            self._say(f"rcv {back:x} {told.hex().upper()} E B F")
        return None

    def _say(self, text):
        self._line.write(text.encode() + b"\r\n")

    def order(self, words):
        drive = self._drives[int(words[0])]
        if words[1] == "fault":
            drive.break_down(int(words[2]))
        elif words[1] == "temperature":
            drive.temperature = float(words[2])
        else:
            drive.motor.angle = float(words[2]) * math.tau


if __name__ == "__main__":
    line, log = Line(), Log(sys.argv[1])
    bus = Bus(line, log, {int(name): Drive(name, log) for name in sys.argv[2:]})
    print(line.path, flush=True)
    run(bus.serve, Orders(bus.order).serve)
