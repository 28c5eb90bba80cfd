# SPDX-License-Identifier: Apache-2.0
"""Round trip of the exchange on live nodes against a bare ping-pong by the same receive path, in turns.

Both are what the driver's exchange measures at 1 kHz in free space, from composing a handle sample to its answer, which
it looks for when that can be there (realtime/answer_looks.py). The share of servo ticks whose tool sample is younger
than 3 ms is counted in the trace. The bare answerer waits for bytes as the simulation does, and sends them back with
the few numbers that make them an answer.
"""

import atexit
import contextlib
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from bench.exchange import echo_node
from bench.exchange.round_trip import ANSWERERS
from haptic_device.process import running_module
from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.processes import Nodes, Program

YOUNG = 3e-3  # [s]
THIS, TIMES = "bench.exchange.live_round_trip", "times"


def answer_barely(folder):
    """The other process of the ping-pong; its times go into the folder."""
    return echo_node.main(Times(folder))


def answer_timed(folder):
    """haptic_simulation as it is, with the times of its exchange taken."""
    from haptic_device.nodes.lifecycle import run
    from haptic_sim.node.simulation import SimulationNode

    times = Times(folder)

    class TimedSimulation(SimulationNode):
        def _turn(self, messages):
            if messages:
                times.taken()
            super()._turn(messages)

        def create_publisher(self, kind, topic, *given, **named):
            publisher = super().create_publisher(kind, topic, *given, **named)
            return TimedPublisher(publisher, times) if topic == "tool" else publisher

    return run(TimedSimulation, "haptic_simulation", sys.argv[sys.argv.index("--ros-args") :])


class TimedPublisher:
    """Tells `times` when bytes are handed to the middleware, and when it has taken them."""

    def __init__(self, publisher, times):
        self._publisher, self._times = publisher, times

    def publish(self, data):
        self._times.answered()
        self._publisher.publish(data)
        self._times.published()


class Times:
    """When a handle sample was taken, answered and published."""

    def __init__(self, folder):
        self._rows, self._row, file = [], [], Path(folder) / f"times_{os.getpid()}.json"
        atexit.register(lambda: file.write_text(json.dumps(self._rows[len(self._rows) // 5 :])))

    def taken(self):
        self._row = [time.monotonic_ns()]

    def answered(self):
        self._row.append(time.monotonic_ns())

    def published(self):
        self._rows.append([*self._row, time.monotonic_ns()])


STAGES = ("work", "publish", "middleware both ways, wake-up, and until the driver looks")


def measure(domain, answerer, seconds):
    """Round trip p50 and p99 [us], and the share of servo ticks with a tool sample younger than 3 ms."""
    from haptic_sim.supervision.tuning import Tuning

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
            for name, answerer in ANSWERERS.items():
                times = Path(folder) / f"{turn}_{name}"
                times.mkdir()
                timed = Timed("haptic_simulation", name, answerer.parameters | {TIMES: str(times)})
                one = measure(domain, timed if profiled else answerer, seconds)
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


class Timed(Program):
    """An answerer of this module as a program; its module is its name here, and TIMES the folder for its times."""

    def command(self):
        others = {name: value for name, value in self.parameters.items() if name != TIMES}
        words = Program(self.name, self.module, others).command()
        return [*running_module(THIS), self.module, self.parameters[TIMES], *words[words.index("--ros-args") :]]


if __name__ == "__main__":  # the other process
    which, where = sys.argv[1:3]
    sys.exit((answer_timed if which == "simulation" else answer_barely)(where))
