# SPDX-License-Identifier: Apache-2.0
"""Kills the recorder of a running demo at random moments, repairs its bags, and prints what was missing."""

import os
import random
import signal
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from haptic_device.recording import load
from haptic_device.recording.recover import recovered
from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.processes import Nodes
from haptic_sim.supervision.system import Order, programs_of


def kill_one(folder, wait, rate):
    """A system whose recorder dies so long [s] after its first tick; time of its death on the system clock [ns]."""
    bag = folder / "bag"
    programs = programs_of(Order("peg_in_hole", None, folder, None, rate, Path("config/demo.yaml").absolute()))
    with isolated_domain(folder / "log"), Nodes(folder / "log") as nodes:
        for program in programs:
            nodes.start(program)
        while not has_trace(bag):
            nodes.check()
            time.sleep(0.1)
        time.sleep(wait)
        killed = time.time_ns()
        os.kill(nodes.pid("haptic_recorder"), signal.SIGKILL)
    return killed


def has_trace(bag):
    try:
        return "trace" in load(bag).clouds
    except (ValueError, OSError):
        return False


def judge(bag, killed):
    """Figures of one killed bag: before and after its repair."""
    before = load(bag)
    last = min(int(before.joint("handle").received[-1]), int(before.pairs[0][-1]))  # of handle and trace
    missing = (killed - last) / 1e6
    for _ in recovered(bag):
        continue
    with AnyReader([bag]) as reader:
        by_rosbags = sum(1 for _ in reader.messages())
    with open(next(bag.glob("*.mcap")), "rb") as stream:
        by_mcap = make_reader(stream, validate_crcs=True).get_summary().statistics.message_count
    after = load(bag)
    whole = by_rosbags == by_mcap == sum(after.counts.values()) and not after.notes
    return missing, after.trace_rows_missing, by_rosbags, whole


def main(
    kills: Annotated[int, typer.Option(min=1, help="How often.")] = 20,
    rate: Annotated[float, typer.Option(min=500.0, max=10000.0, help="Servo rate [Hz].")] = 4000.0,
    seed: Annotated[int, typer.Option(help="Of the moments.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for the bags [a temporary one].")] = None,
) -> None:
    """Kill the recorder of a running demo (SIGKILL), repair what it left, and say what was missing."""
    base = out or Path(tempfile.mkdtemp(prefix="haptic_crashes_"))
    moments, worst = random.Random(seed), 0.0
    print("| kill | after s | missing ms | trace rows missing | messages | opens after recover |")
    for number in range(kills):
        wait = moments.uniform(0.0, 3.0)
        killed = kill_one(base / f"{number}", wait, rate)
        missing, rows, messages, whole = judge(base / f"{number}" / "bag", killed)
        worst = max(worst, missing)
        opens = "yes" if whole else "NO"
        print(f"| {number + 1} | {wait:.2f} | {missing:.0f} | {rows} | {messages} | {opens} |", flush=True)
    print(f"worst: the last {worst:.0f} ms are missing")
