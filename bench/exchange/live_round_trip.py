# SPDX-License-Identifier: Apache-2.0
"""Round trip of the exchange on live nodes against a bare ping-pong by the same receive path, in turns.

Both are what the driver's exchange measures at 1 kHz in free space, from composing a handle sample to its answer, which
it looks for every 10 us (realtime/exchange_loop.py: LOOK). The share of servo ticks whose tool sample is younger than
3 ms is counted in the trace. The bare answerer waits for bytes as the simulation does, and sends them back with the few
numbers that make them an answer.
"""

import atexit
import contextlib
import json
import os
import signal
import statistics
import struct
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from haptic_device.control import exchange_samples
from haptic_device.message_fields import TAIL
from haptic_device.process import running_module
from haptic_sim.live.domain import isolated_domain
from haptic_sim.live.processes import Nodes, Program

AXES = 3
YOUNG = 3e-3  # [s]
THIS = "bench.exchange.live_round_trip"


def answer_barely(folder):
    """The other process of the ping-pong; until SIGTERM. Its times go into the folder, if there is one."""
    import rclpy
    import rclpy.signals
    from rclpy.impl.implementation_singleton import rclpy_implementation

    from haptic_device.message_fields import exchange_names
    from haptic_device.nodes.messages import LATEST, JointState
    from haptic_device.nodes.polled_subscription import Untouched
    from haptic_device.realtime.scheduling import go_realtime
    from haptic_device.recording.layouts import JointLayout

    signal.signal(signal.SIGINT, lambda *_: sys.exit())
    times = Times(folder)
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("haptic_simulation", namespace="/haptic")
    publisher = node.create_publisher(JointState, "tool", LATEST)
    subscription = node.create_subscription(
        JointState, "handle", lambda data: None, LATEST, raw=True, callback_group=Untouched()
    )
    layout = JointLayout(exchange_names(AXES))
    place = {entry: layout.offsets[0] + 8 * (AXES + entry) for entry in range(len(TAIL))}
    go_realtime("prefer", 60)
    wait_set, number = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle), 0.0
    while True:
        wait_set.clear_entities()
        wait_set.add_subscription(subscription.handle)
        wait_set.wait(50_000_000)
        latest = None
        while (taken := subscription.handle.take_message(JointState, True)) is not None:
            latest = taken
        if latest is None:
            continue
        times.taken(latest[1])
        data, number = bytearray(latest[0]), number + 1.0
        asked = struct.unpack_from("<dd", data, place[exchange_samples.SESSION])
        struct.pack_into("<dddd", data, place[exchange_samples.SESSION], 4711.0, number, *asked)
        times.answered()
        publisher.publish(bytes(data))
        times.published()


def answer_timed(folder):
    """haptic_simulation as it is, with the times of its exchange taken."""
    from haptic_sim.node import exchange_thread, simulation

    times = Times(folder)

    class Timed(exchange_thread.ExchangeThread):
        def __init__(self, node, world, port, publishers, prepare):
            super().__init__(node, world, port, (TimedPublisher(publishers[0]), publishers[1]), prepare)

        def _latest(self):
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(self._subscription.handle)
            self._wait_set.wait(exchange_thread.LOOK_UP_NS)
            latest = None
            while (taken := self._subscription.handle.take_message(exchange_thread.JointState, True)) is not None:
                latest = taken
            if latest is not None:
                times.taken(latest[1])
            return latest and latest[0]

    class TimedPublisher:
        def __init__(self, publisher):
            self._publisher = publisher

        def publish(self, data):
            times.answered()
            self._publisher.publish(data)
            times.published()

    simulation.ExchangeThread = Timed
    sys.argv = [sys.argv[0], *sys.argv[sys.argv.index("--ros-args") :]]
    return simulation.main()


class Times:
    """When a handle sample left the driver and arrived (the middleware's stamps), was taken, answered and published."""

    def __init__(self, folder):
        self._rows, self._row = [], []
        if folder:
            file = Path(folder) / f"times_{os.getpid()}.json"
            atexit.register(lambda: file.write_text(json.dumps(self._rows[len(self._rows) // 5 :])))

    def taken(self, information):
        self._row = [information["source_timestamp"], information["received_timestamp"], time.time_ns()]

    def answered(self):
        self._row.append(time.time_ns())

    def published(self):
        self._rows.append([*self._row, time.time_ns()])


STAGES = (
    "middleware, driver to answerer",
    "wake-up and take",
    "work",
    "publish",
    "middleware back, and until the driver looks",
)


def measure(domain, answerer, seconds):
    """Round trip p50 and p99 [us], and the share of servo ticks with a tool sample younger than 3 ms."""
    from haptic_sim.live.tuning import Tuning

    with tempfile.TemporaryDirectory() as logs, Nodes(Path(logs)) as nodes:
        circle = {"motion.name": "circle", "motion.start": (0.0, 0.0, 0.0), "motion.duration": 60.0}
        nodes.start(Program("haptic_loopback", "haptic_device.nodes.loopback", circle))
        nodes.start(answerer)
        nodes.start(Program("haptic_driver", "haptic_device.nodes.driver", {"auto_enable": True}))
        with contextlib.closing(Tuning(domain, "/haptic", trace=True)) as tuning:
            tuning.wait_engaged(nodes.check)
            tuning.wait_answered(nodes.check)
            tuning.rows.clear()
            tuning.watch(seconds)
            ages = np.concatenate([rows["tool_age"] for rows in tuning.rows])
            trips = (float(tuning.said(f"round_trip_us_{name}")) for name in ("p50", "p99"))
            return *trips, float(np.mean((ages >= 0.0) & (ages < YOUNG)))


def profile(folder):
    """Medians [us] of the stages of all round trips whose times lie in the folder."""
    rows = np.array([row for file in Path(folder).glob("times_*.json") for row in json.loads(file.read_text())])
    return np.median(np.diff(rows, axis=1), axis=0) * 1e-3


def main(
    turns: Annotated[int, typer.Argument(min=1)] = 5,
    seconds: Annotated[float, typer.Argument(min=0.1, help="Of each turn.")] = 5.0,
    profiled: Annotated[bool, typer.Option("--profile", help="Say where the time of a round trip goes.")] = False,
) -> None:
    """Round trip of the exchange on live nodes against a bare ping-pong, in turns."""
    found, stages = {}, {}
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain:
        for turn in range(turns):
            for name, word in (("simulation", "timed"), ("bare", "bare")):
                times = Path(folder) / f"{turn}_{name}"
                times.mkdir()
                free = {"scene": "free_space"} if word == "timed" else {}
                here = Here("haptic_simulation", word if profiled else f"{word}_only", {"_times": str(times)} | free)
                plain = Program("haptic_simulation", "haptic_sim.node.simulation", free)
                one = measure(domain, here if profiled or word == "bare" else plain, seconds)
                found.setdefault(name, []).append(one)
                print(
                    f"{turn} {name:10} round trip {one[0]:6.1f} us, p99 {one[1]:7.1f} us; "
                    f"ticks with a tool sample under 3 ms: {one[2]:.3%}",
                    flush=True,
                )
                if profiled:
                    stages.setdefault(name, []).append([*profile(times), one[0]])
    ratio = statistics.median(one[0] / other[0] for one, other in zip(*found.values(), strict=True))
    print(f"median ratio of {turns} turns: {ratio:.3f}")
    for name, turns_of in stages.items():
        *known, whole = np.median(turns_of, axis=0)
        print(f"{name}: round trip {whole:.1f} us")
        for stage, microseconds in zip(STAGES, (*known, whole - sum(known)), strict=True):
            print(f"    {microseconds:7.1f} us {stage}")


class Here(Program):
    """An answerer of this module as a program."""

    def command(self):
        times, others = self.parameters["_times"], {k: v for k, v in self.parameters.items() if k != "_times"}
        words = Program(self.name, self.module, others).command()
        return [*running_module(THIS), self.module, times, *words[words.index("--ros-args") :]]


if __name__ == "__main__":  # the other process
    which, where = sys.argv[1:3]
    sys.exit(answer_timed(where) if which == "timed" else answer_barely(where if which == "bare" else ""))
