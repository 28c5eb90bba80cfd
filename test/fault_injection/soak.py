# SPDX-License-Identifier: Apache-2.0
"""Chaos with `--soak`: the demo for a long time, its hand going to the wall and back; what grows is a leak."""

import sys
import tempfile
import time
from pathlib import Path

import psutil

from fault_injection.fault_injector import FREE, PRESSED, FaultInjector
from haptic_device.control.faults import FAULTS
from haptic_display.run.domain import isolated_domain

SETTLED = 60.0  # [s] after which memory must stay flat
PERIOD = 1.0  # [s] between looks
GROWTH = 0.02  # of the resident memory, at most
RECORDER_GROWTH = 0.1  # its memory has the index of the present file, some 8 MB in half an hour
STROKE = 4.0  # [s] from the wall to the wall


def soak(minutes: float, programs) -> dict:
    """{ok, minutes, faults, nodes: a row for each}; memory [MB], threads, descriptors, after a minute and at end."""
    with tempfile.TemporaryDirectory(prefix="haptic_soak_") as name:
        folder = Path(name)
        with isolated_domain(folder / "log") as domain:
            injector = FaultInjector(programs(folder), folder, domain)
            with injector:
                injector.begin()
                samples, faults = _watch(injector, 60.0 * minutes)
                tracebacks = injector.tracebacks()
    rows = [_row(name, found) for name, found in samples.items()]
    ok = not faults and not tracebacks and all(row["grown"] <= _bound(row["node"]) for row in rows)
    ok = ok and all(row["threads"][0] >= row["threads"][1] and row["files"][0] >= row["files"][1] for row in rows)
    return {"ok": ok, "minutes": minutes, "faults": faults, "tracebacks": tracebacks, "nodes": rows}


def _watch(injector, seconds):
    """{node: [(age [s], resident bytes, threads, descriptors)]}, and the faults that were told of."""
    processes = {name: psutil.Process(injector.nodes.pid(name)) for name in injector.programs}
    samples, faults, began = {name: [] for name in processes}, set(), time.monotonic()
    while (age := time.monotonic() - began) < seconds:
        injector.nodes.check()
        injector.listener.aim(PRESSED if age % STROKE < STROKE / 2 else FREE)
        for name, process in processes.items():
            with process.oneshot():
                samples[name].append((age, process.memory_info().rss, process.num_threads(), process.num_fds()))
        faults |= {injector.listener.said("haptic_driver", "fault")} & FAULTS.keys()
        injector.listener.begin()
        if int(age) % 60 == 0:
            print(f"chaos: soak {age:.0f} s; {injector.driver_says()}", file=sys.stderr, flush=True)
        time.sleep(PERIOD)
    return samples, sorted(faults)


def _bound(node) -> float:
    return RECORDER_GROWTH if node == "haptic_recorder" else GROWTH


def _row(name, samples) -> dict:
    """Medians of the ten looks after the first minute (or after a third of a shorter run), and of the last ten."""
    first = next((i for i, each in enumerate(samples) if each[0] >= min(SETTLED, samples[-1][0] / 3)), 0)
    early, late = samples[first : first + 10], samples[-10:]
    memory = [sorted(each[1] for each in part)[len(part) // 2] for part in (early, late)]
    return {
        "node": name,
        "rss_mb": tuple(round(each / 1e6, 2) for each in memory),
        "grown": memory[1] / memory[0] - 1.0,
        "threads": (max(each[2] for each in early), max(each[2] for each in late)),
        "files": (max(each[3] for each in early), max(each[3] for each in late)),
    }
