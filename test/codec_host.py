# SPDX-License-Identifier: Apache-2.0
"""The host's side of a codec, as the bridge calls it: in made-up time, or on a port with an emulator behind it."""

import os
import select
import subprocess
import sys
import time
import tty
from pathlib import Path
from typing import NamedTuple

import numpy as np
import waiting
from growing_log import GrowingLog

from haptic_device import description, yaml_reader
from haptic_device.link import codec, request_timing
from haptic_device.link.codec import COMMAND, CUT, DUE, IDLE, OPENED

DEVICES = Path(__file__).parents[1] / "config/devices"
EMULATORS = Path(__file__).parent / "emulators"
MS = 1_000_000  # [ns]
PATIENCE = 0.1  # [s] for an answer: a codec looks at the time only when it is called


class Sample(NamedTuple):
    latched: int
    status: int
    counts: tuple
    deadline: int


def device(axes, motor_limit=1000.0, motor_constant=1.0):
    """A device description with so many axes; the limit of the motor in motor units is motor_limit/motor_constant."""
    axis = {
        "counts_per_unit": 1000.0,
        "motor_limit": motor_limit,
        "motor_constant": motor_constant,
        "workspace": [-1.0, 1.0],
        "velocity_limit": 10.0,
        "mass": 0.1,
        "damping": 1.0,
    }
    return description.parse(
        {"name": "tested", "axes": [axis | {"name": n} for n in description.AXES[:axes]]}, "tested"
    )


def described(name, kind):
    """(options, device) of a description in config/devices with a link of this kind."""
    content = yaml_reader.load(DEVICES / f"{name}.yaml")
    link = content.pop("link")
    assert link.pop("type") == kind.__name__.rpartition(".")[2]
    return kind.Options(**link), description.parse(content, name)


class Host:
    """Calls a codec in made-up time `now` [ns], and keeps what is left of the bytes that it was given."""

    def __init__(self, made, now=1000 * MS):
        self.codec, self.now = made, now
        self.state = made.state
        self.command, self._left = np.zeros(8, np.int64), b""

    def tell(self, event, after=0):
        """Bytes to be sent at this event, so many ns later."""
        self.now += after
        outgoing = np.full(codec.ROOM, 0xAA, np.uint8)
        count = self.codec.encode(self.state, event, self.now, self.command, outgoing)
        assert 0 <= count <= codec.ROOM and (outgoing[count:] == 0xAA).all()
        return outgoing[:count].tobytes()

    def open(self, after=0):
        self._left = b""
        return self.tell(OPENED, after)

    def idle(self, after=0):
        return self.tell(IDLE, after)

    def cut(self, after=0):
        return self.tell(CUT, after)

    def due(self, after=0):
        return self.tell(DUE, after)

    def write(self, *motor, after=0, ahead=MS, engaged=1):
        """The servo writes these motor values, and a deadline so many ns ahead."""
        self.now += after
        self.command[:5] = 1, self.now, self.now + ahead, MS, engaged
        self.command.view(np.float64)[5 : 5 + len(motor)] = motor
        return self.tell(COMMAND)

    def hear(self, data, after=0):
        """Samples that are told when these bytes have come, so many ns later."""
        self.now += after
        self._left += data
        samples = []
        while self._left:
            incoming, answer = np.zeros(4096, np.uint8), np.zeros(codec.ANSWER, np.int64)
            incoming[: len(self._left)] = list(self._left)
            used = self.codec.decode(self.state, incoming, len(self._left), self.now, answer)
            assert 0 <= used <= len(self._left)
            if answer[codec.KIND] == codec.SAMPLE:
                counts = tuple(map(int, answer[codec.COUNTS : codec.COUNTS + 3]))
                told = (int(answer[word]) for word in (codec.LATCHED, codec.STATUS, codec.DEADLINE))
                latched, status, deadline = told
                samples.append(Sample(latched, status, counts, deadline))
            else:
                assert answer[codec.KIND] == codec.NOTHING
            if used == 0:
                break
            self._left = self._left[used:]
        return samples


def hear_alike(whole, split, stream, cuts):
    """One host that hears a stream at once, and one that hears it cut at these places: they make the same of it."""
    for host in (whole, split):
        host.idle(after=20 * MS + 1)
    places = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
    told = [split.hear(stream[low:high]) for low, high in zip(places, places[1:], strict=False)]
    assert sum(told, []) == whole.hear(stream)
    assert (split.state == whole.state).all()


class PortHost(Host):
    """The same in this machine's time, on a port."""

    def __init__(self, made, port):
        super().__init__(made, time.monotonic_ns())
        self._file = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._file)

    def close(self):
        os.close(self._file)

    def tell(self, event, after=0):
        self.now = time.monotonic_ns()
        sent = super().tell(event)
        assert os.write(self._file, sent) == len(sent)
        return sent

    def listen(self, seconds=0.005):
        """Samples of what comes within this time, at the first bytes."""
        if not select.select([self._file], [], [], seconds)[0]:
            return []
        data = os.read(self._file, 4096)
        self.now = time.monotonic_ns()
        return self.hear(data)

    def become_ready(self):
        self.open()
        waiting.until(lambda: self.state[codec.READY], "the device's answer", self.look)

    def send(self, data):
        """Bytes that are not the codec's."""
        os.write(self._file, data)

    def look(self):
        """What happens without a servo."""
        self.listen(PATIENCE if self.idle() else 0.005)

    def sample(self, *motor, engaged=1):
        """One turn of a servo: these motor values written, and the sample of the deadline that they announce."""
        return waiting.until(lambda: self._turn(motor, engaged), "a sample", lambda: None)

    def _turn(self, motor, engaged):
        self.now = time.monotonic_ns()
        if not self.write(*motor, ahead=0, engaged=engaged):
            self.listen()  # it still waits for an answer
            return None
        self.exchange()
        if not self.due():
            return None
        return next((sample for sample in self.exchange() if sample.deadline), None)

    def exchange(self):
        """Samples until what was asked for is answered, or has not come in time."""
        before, began, samples = self._exchanges(), time.monotonic(), []
        while self._exchanges() == before and time.monotonic() - began < PATIENCE:
            samples += self.listen(0.001)
        return samples

    def _exchanges(self):
        return self.state[request_timing.ROUND_TRIPS]


class Emulator:
    """An emulator in a process of its own: its port, and its log."""

    def __init__(self, start, name, log, *words):
        command = [sys.executable, str(EMULATORS / f"{name}.py"), str(log), *map(str, words)]
        self.process = start(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._log = GrowingLog(log, lambda line: line[1])
        self.port = self.process.stdout.readline().strip()

    def order(self, words):
        """Returns when it has been obeyed."""
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "done\n"

    def said(self, word):
        """What its log tells of this kind so far, in order, without the times."""
        lines = [line.split(maxsplit=2) for line in self._log.lines(word)]
        return [line[2] if len(line) > 2 else "" for line in lines]

    def torques(self):
        return [tuple(map(float, told.split())) for told in self.said("torque")]

    def torque(self):
        """The last of the torques, with what stands before it; () before the first."""
        told = self._log.lines("torque")
        return tuple(map(float, told[-1].split()[2:])) if told else ()


def patient_knob(knob, file):
    """Writes the description of this emulated moteus knob for a busy machine: no delay is too long for its damping."""
    content = yaml_reader.load(DEVICES / "moteus_knob.yaml")
    content["link"] |= {"port": knob.port, "watchdog": 1.0}
    content["axes"][0]["damping"] = 500.0
    file.write_text(yaml_reader.dump(content))
