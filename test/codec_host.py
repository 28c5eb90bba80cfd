# SPDX-License-Identifier: Apache-2.0
"""The host's side of a codec, as the bridge calls it, in made-up time; with an emulator behind it too."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from haptic_device.config import description, yaml_reader
from haptic_device.config.link_registry import LINKS
from haptic_device.link import codec
from haptic_device.link.codec import COMMAND, CUT, DUE, IDLE, OPENED

DEVICES = Path(__file__).parents[1] / "config/devices"
EMULATORS = Path(__file__).parent / "emulators"
MS = 1_000_000  # [ns]
WAY = MS // 10  # [ns] from a request to its answer


class Sample(NamedTuple):
    latched: int
    status: int
    counts: tuple
    deadline: int


AXES = description.AXES
AXIS = {"counts_per_unit": 1000.0, "workspace": [-1.0, 1.0], "velocity_limit": 10.0, "mass": 0.1, "damping": 1.0}


def device(axes, motor_limit=1000.0, motor_constant=1.0):
    """A device description with so many axes; the limit of the motor in motor units is motor_limit/motor_constant."""
    made = [AXIS | {"name": n, "motor_limit": motor_limit, "motor_constant": motor_constant} for n in AXES[:axes]]
    return description.parse({"name": "tested", "axes": made}, "tested")


def five_bars(motor_limit=1000.0, motor_constant=1.0, theta=False):
    """A Haply 2DIY, with a third axis or not; the limit of its motors in motor units is motor_limit/motor_constant."""
    content = yaml_reader.load(DEVICES / "haply_2diy_gen3.yaml")
    for joint in content["joints"]:
        joint |= {"torque_limit": motor_limit, "torque_constant": motor_constant}
    content["axes"] = [AXIS | {"name": "theta", "motor_limit": 1.0}] * theta
    return description.parse(content, "tested")


def described(name, kind, **link):
    """(options, device) of a description in config/devices, with a link of this kind: a Haply where it has none."""
    content = yaml_reader.load(DEVICES / f"{name}.yaml")
    link = content.pop("link", {"type": "haply", "port": "/dev/none"} | link)
    assert LINKS[link.pop("type")] == kind.__name__
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


def emulated(name):
    """The module of an emulator in test/emulators; a link of the product has the same name."""
    sys.path.insert(0, str(EMULATORS))
    try:
        found = importlib.util.spec_from_file_location(f"emulated_{name}", EMULATORS / f"{name}.py")
        module = importlib.util.module_from_spec(found)
        found.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    return module


class Log(list):
    """What an emulator tells: lines of a time, a word and what it tells."""

    def __call__(self, now, word, *what):
        self.append((str(now), word, " ".join(map(str, what))))

    def said(self, word):
        """What was told of this kind so far, in order, without the times."""
        return [what for _, kind, what in self if kind == word]

    def torques(self):
        return [tuple(map(float, told.split())) for told in self.said("torque")]


class Wired(Host):
    """The same, wired to an emulator; `samples` are those that it was told so far."""

    def __init__(self, made, emulator):
        super().__init__(made)
        self.emulator, self.samples = emulator, []

    def tell(self, event, after=0):
        sent = super().tell(event, after)
        self.samples += self.hear(self.emulator.serve(sent, self.now), after=WAY)
        return sent

    def become_ready(self):
        self.open()
        for _ in range(5):
            self.idle(after=20 * MS)
        assert self.state[codec.READY]

    def sample(self, *motor, engaged=1):
        """One turn of a servo: these motor values written, and the sample of the deadline that they announce."""
        self.write(*motor, after=MS, engaged=engaged)
        self.due(after=MS)
        return self.samples[-1]


class Emulator:
    """An emulator in a process of its own: its port, and its log."""

    def __init__(self, start, name, log, *words):
        command = [sys.executable, str(EMULATORS / f"{name}.py"), str(log), *map(str, words)]
        self.process, self._log = start(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE), log
        self.port = self.process.stdout.readline().strip()

    def order(self, words):
        """Returns when it has been obeyed."""
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "done\n"

    def log(self):
        """What its log tells so far."""
        lines = [line.split(maxsplit=2) for line in self._log.read_text().splitlines()]
        return Log((line[0], line[1], line[2] if len(line) > 2 else "") for line in lines)
