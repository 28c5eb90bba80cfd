# SPDX-License-Identifier: Apache-2.0
"""Writes a bag of many minutes by repeating the trace of a recorded run, and prints what its report costs."""

import multiprocessing
import os
import struct
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from haptic_device.recording.layouts import CLOUD, JOINTS, layout_of
from haptic_device.recording.reader import Keep, read
from haptic_device.recording.writer import Bag

SECOND = 1_000_000_000


def repeat(source: Path, target: Path, seconds: float) -> None:
    """Writes the messages of the source's longest busy stretch again and again, with times and ticks that go on."""
    contents = read(source, lambda topic, kind: Keep())
    bag = Bag(target)
    channels = {name: bag.add_topic(name, topic.type_name, []) for name, topic in contents.topics.items()}
    trace = next(name for name in contents.topics if name.endswith("/trace"))
    first, last = (int(contents.topics[trace].times.received[i]) for i in (0, -1))
    messages = sorted(
        (int(received), name, data, int(published))
        for name, topic in contents.topics.items()
        for data, received, published in zip(topic.collector.data, *topic.times[:2], strict=True)
        if first <= received <= last
    )
    shift, sequences, flushed = Shift(contents.topics[trace]), dict.fromkeys(channels, 0), 0
    for received, name, data, published in shift.again_and_again(messages):
        if received + shift.ns > first + seconds * SECOND:
            break
        sequences[name] += 1
        moved = shift.moved(name, data, trace)
        bag.write(channels[name], moved, received + shift.ns, published + shift.ns, sequences[name])
        if received + shift.ns > flushed + SECOND // 4:
            bag.flush()
            flushed = received + shift.ns
    for name, data in contents.attachments.items():
        bag.attach(name, "application/yaml", data, first)
    bag.close({"namespace": trace.rsplit("/", 1)[0]})


class Shift:
    """Time and ticks from one repetition to the next."""

    def __init__(self, topic):
        first, last = (self._rows(topic.collector.data[i])[0] for i in (0, -1))
        self._ticks = int(last["tick"][-1] - first["tick"][0]) + 1
        self._span = int(last["deadline"][-1] - first["deadline"][0]) + 250_000
        self.ns = self.ticks = 0

    @property
    def seconds(self):
        return self.ns / SECOND

    def again_and_again(self, messages):
        """The messages without end; after each time through, time and ticks go on."""
        while True:
            yield from messages
            self.ns, self.ticks = self.ns + self._span, self.ticks + self._ticks

    def moved(self, name, data, trace):
        """The message with its stamp, tick, deadline and time moved on."""
        if name == trace:
            rows, begin = self._rows(data)
            rows["tick"] += self.ticks
            rows["deadline"] += self.ns
            data = data[:begin] + rows.tobytes() + data[begin + rows.nbytes :]
        if name.endswith("operator/state"):
            data = self._timed(data)
        stamp = int.from_bytes(data[4:8], "little") * SECOND + int.from_bytes(data[8:12], "little") + self.ns
        head = (stamp // SECOND).to_bytes(4, "little") + (stamp % SECOND).to_bytes(4, "little")
        return data[:4] + head + data[12:]

    def _timed(self, data):
        layout = layout_of(JOINTS, data)
        at = layout.offsets[0] + 8 * layout.names.index("time")
        (time,) = struct.unpack_from("<d", data, at)
        return data[:at] + struct.pack("<d", time + self.seconds) + data[at + 8 :]

    def _rows(self, data):
        layout = layout_of(CLOUD, data)
        return np.frombuffer(bytearray(layout.records(data)), layout.record).copy(), len(layout.template)


def main(
    bag: Annotated[Path, typer.Argument(help="Bag of a recorded run.")],
    out: Annotated[Path, typer.Argument(help="Bag to write; one that is there is taken as it is.")],
    minutes: Annotated[float, typer.Option(min=0.1)] = 10.0,
) -> None:
    """Writes a bag of many minutes and prints what its report costs."""
    if not out.exists():  # by a process of its own: the report's peak counts on from that of who starts it
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as writer:
            writer.submit(repeat, bag, out, minutes * 60.0).result()
    size = sum(file.stat().st_size for file in out.glob("*.mcap"))
    print(f"bag: {size / 1e6:.0f} MB")
    began = time.monotonic()
    command = [sys.executable, "-m", "haptic_sim.cli.main", "report", str(out), "--out", f"{out}_report"]
    process = subprocess.Popen(command)
    _, status, usage = os.wait4(process.pid, 0)
    seconds, cpu = time.monotonic() - began, usage.ru_utime + usage.ru_stime
    most = usage.ru_maxrss / 1024
    print(f"report: exit {status}, {seconds:.1f} s ({cpu:.1f} s of processor), {most:.0f} MiB at most")
