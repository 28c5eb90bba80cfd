# SPDX-License-Identifier: Apache-2.0
"""Kills the recorder of a running demo and starts it again, many times, and prints how long each took to hear the servo.

usage: python bench/recorder_restart.py [--kills 20] [--seed 1] [--patience 60] [--out FOLDER]

The other nodes are started once. A recorder that hears nothing within the patience [s] is a row with a NO.
"""

import argparse
import os
import random
import signal
import tempfile
import time
from pathlib import Path

from haptic_device.analysis.recording import load
from haptic_sim.cli.demo import Order, _programs
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import Nodes


def heard(bag):
    """Topics that a bag being written holds so far, by their number of messages."""
    try:
        return {name: count for name, count in load(bag, "/haptic", {"trace": None}).counts.items() if count}
    except (ValueError, OSError):
        return {}


def waited_for_trace(nodes, bag, patience):
    """Seconds until the trace is in the bag, or None; and what is."""
    began = time.monotonic()
    while time.monotonic() < began + patience:
        nodes.check()
        if "/haptic/trace" in (topics := heard(bag)):
            return time.monotonic() - began, topics
        time.sleep(0.1)
    return None, heard(bag)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--patience", type=float, default=60.0)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    base = given.out or Path(tempfile.mkdtemp(prefix="haptic_restarts_"))
    order = Order("peg_in_hole", None, base, None, None, Path("config/demo.yaml").absolute())
    recorder, *others = _programs(order)
    moments, waits = random.Random(given.seed), []
    print("| start | heard the trace after s | topics in the bag |")
    with isolated_domain(base / "log"), Nodes(base / "log") as nodes:
        for program in others:
            nodes.start(program)
        for number in range(given.kills + 1):
            bag = base / f"bag_{number}"
            nodes.start(recorder._replace(parameters={**recorder.parameters, "bag": str(bag)}))
            waited, topics = waited_for_trace(nodes, bag, given.patience)
            waits.append(waited)
            print(f"| {number} | {'NO' if waited is None else f'{waited:.1f}'} | {len(topics)} |", flush=True)
            time.sleep(moments.uniform(0.0, 1.0))
            os.kill(nodes.pid("haptic_recorder"), signal.SIGKILL)
            time.sleep(0.5)
    deaf = sum(waited is None for waited in waits)
    longest = max((waited for waited in waits if waited is not None), default=float("nan"))
    print(f"{deaf} of {len(waits)} recorders heard nothing within {given.patience:g} s; the slowest of the others {longest:.1f} s")


if __name__ == "__main__":
    main()
