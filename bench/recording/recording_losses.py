# SPDX-License-Identifier: Apache-2.0
"""Runs the demo's system with and without a recorder, in pairs, and prints what was lost and what it cost.

Lateness is that of the driver's last 20000 ticks. CPU is of one core, after the first seconds. At the end, for each
rate: how lateness with a recorder differs from that without, in the median over the pairs, beside the noise, which is
how two runs alike differ (median over all twos of runs with a recorder, and of runs without).
"""

import contextlib
import tempfile
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from bench.recording.paired import compared
from haptic_device.recording import load
from haptic_sim.client import Client
from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.processes import NAMESPACE, Nodes
from haptic_sim.supervision.system import Order, programs_of

RATES = 4000.0, 10000.0  # Hz
SETTLING = 5.0  # s


class Seen(NamedTuple):
    """One run: median and p99 of lateness [us], shares of a core, and what the bag lost."""

    p50: float
    p99: float
    publishing: float
    recorder: float
    rows: int
    missing: int
    dropped: int
    lost: int


def run(rate, seconds, folder, recorded):
    """The system for so long."""
    programs = programs_of(Order("peg_in_hole", seconds, folder, None, rate, Path("config/demo.yaml").absolute()))
    programs = [program for program in programs if recorded or program.name != "haptic_recorder"]
    with isolated_domain(folder / "log") as domain, Nodes(folder / "log") as nodes:
        for program in programs:
            nodes.start(program)
        with contextlib.closing(Client.join("haptic_demo", domain, NAMESPACE)) as client:
            watch(client, nodes, lambda: client.motor_commanded, 120.0)
            watch(client, nodes, None, SETTLING)
            begin = said(client, recorded)
            watch(client, nodes, None, seconds - SETTLING)
            end = said(client, recorded)
    span = end["time"] - begin["time"]
    publishing = (end["publishing"] - begin["publishing"]) / span
    recorder = (end["recorder"] - begin["recorder"]) / span
    return Seen(end["p50"], end["p99"], publishing, recorder, *(lost(folder / "bag") if recorded else (0, 0, 0, 0)))


def watch(client, nodes, condition, limit):
    end = time.monotonic() + limit
    while time.monotonic() < end and not (condition and condition()):
        client.look()
        nodes.check()
        time.sleep(0.05)


def said(client, recorded):
    driver = client.statuses["haptic_driver"].values
    own = client.statuses["haptic_recorder"].values if recorded else {"cpu_s": "0"}
    return {
        "time": time.monotonic(),
        "p50": float(driver["lateness_us_p50"]),
        "p99": float(driver["lateness_us_p99"]),
        "publishing": float(driver["telemetry_cpu_s"]),
        "recorder": float(own["cpu_s"]),
    }


def lost(bag):
    """Rows, rows missing between them, rows the servo dropped, messages that never came."""
    recording = load(bag, only={"trace": np.dtype([("tick", "f8")])})
    ours = [count or 0 for topic, count in recording.lost.items() if topic.startswith("/haptic/")]
    dropped = int(recording.last_values("haptic_driver")["trace_dropped"])
    return len(recording.trace), recording.trace_rows_missing, dropped, sum(ours)


def verdict(rate, name, found):
    """A row: what the recorder adds to one figure of lateness, and how much two runs alike differ in it [us]."""
    added, noise, within = compared(*([getattr(seen, name) for seen in found[recorded]] for recorded in (False, True)))
    return f"| {rate:.0f} | {name} | {added:+.1f} | {noise:.1f} | {within} |"


def main(
    rate: Annotated[list[float] | None, typer.Option(help="Servo rate (Hz), once or more [4000 10000].")] = None,
    seconds: Annotated[float, typer.Option(min=SETTLING + 1.0, help="Of each run.")] = 60.0,
    pairs: Annotated[int, typer.Option(min=1, help="Runs with and without a recorder at each rate.")] = 5,
    out: Annotated[Path | None, typer.Option(help="Folder for the runs; else a temporary one.")] = None,
) -> None:
    """What a recorder loses and what it costs, in pairs of runs with and without one."""
    base = out or Path(tempfile.mkdtemp(prefix="haptic_losses_"))
    verdicts = []
    print("| rate Hz | recorded | rows | missing | dropped | lost messages | recorder % | publishing % | p50, p99 |")
    for each in rate or RATES:
        found = {True: [], False: []}
        for pair in range(pairs):
            for recorded in (False, True) if pair % 2 else (True, False):
                seen = run(each, seconds, base / f"{each:.0f}_{pair}_{recorded:d}", recorded)
                found[recorded].append(seen)
                bag = f"{'yes' if recorded else 'no'} | {seen.rows} | {seen.missing} | {seen.dropped} | {seen.lost}"
                cpu = f"{100 * seen.recorder:.1f} | {100 * seen.publishing:.1f}"
                print(f"| {each:.0f} | {bag} | {cpu} | {seen.p50:.1f}, {seen.p99:.1f} µs |", flush=True)
        verdicts += [verdict(each, name, found) for name in ("p50", "p99")]
    print("\n".join(["| rate Hz | lateness | with less without µs | noise µs | within noise |", *verdicts]))
