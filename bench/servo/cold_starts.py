# SPDX-License-Identifier: Apache-2.0
"""Demos with an empty cache of kernels, one after the other; and the end of a demo told to end while it compiles.

`python -m bench cold_starts COUNT BUSY`: COUNT starts of `haptic demo --scene wall --seconds 1` (15), beside BUSY
processes that do nothing but count (0). A line each: time to the first motor command and of the whole [s], lines that
said what is compiled, processes left behind. Then SIGINT and SIGTERM while it compiles: time until everything has
ended, and whether the next demo, on that cache, does its work. Exit code 1 if one stood still, left something behind,
failed, or ended late.
"""

import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import psutil
import typer

STILL = 600.0  # [s] after which a start stands still
DEMO = [sys.executable, "-m", "haptic_sim.cli.main", "demo", "--scene", "wall", "--seconds", "1", "--json"]
GONE = 1.0  # [s] after a signal, when nothing of it may be left
COMPILING = "compiling, once for this machine"


def start(folder, name):
    """A demo whose cache is in the folder, in a session of its own; its output goes to files there."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
    with open(folder / f"{name}.out", "w") as out, open(folder / f"{name}.err", "w") as error:
        return subprocess.Popen(
            [*DEMO, "--out", str(folder / name)], stdout=out, stderr=error, env=environment, start_new_session=True
        )


def left(folder):
    """Processes that know this cache."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if process.environ().get("XDG_CACHE_HOME") == str(folder / "cache"):
                found.append(process)
    return found


def whole(folder, name):
    """One demo to its end: a line, whether it did its work, and seconds to the first motor command."""
    began, process = time.monotonic(), start(folder, name)
    try:
        code = process.wait(STILL)
    except subprocess.TimeoutExpired:
        code = None
        for one in left(folder):
            one.kill()
    took, behind = time.monotonic() - began, len(left(folder))
    said = (folder / f"{name}.out").read_text().splitlines()
    found = json.loads(said[-1]) if code is not None and said else {}
    lines = (folder / f"{name}.err").read_text().count(COMPILING)
    first = found.get("startup_s") or float("nan")
    line = f"first command {first:6.2f} s, whole {took:6.2f} s, {lines:3d} compile lines, left behind {behind}"
    return f"{line}, exit code {'none: it stood still' if code is None else code}", code == 0 and not behind, first


def interrupted(folder, number):
    """A demo told to end once something is compiled: seconds until nothing of it is left."""
    process = start(folder, "interrupted")
    while not list((folder / "cache").rglob("*.nbi")):
        if process.poll() is not None:
            return float("nan")
        time.sleep(0.05)
    told = time.monotonic()
    process.send_signal(number)
    while left(folder) and time.monotonic() < told + STILL:
        time.sleep(0.01)
    process.wait(STILL)
    return time.monotonic() - told


def main(
    count: Annotated[int, typer.Argument(min=0, help="Starts.")] = 15,
    busy: Annotated[int, typer.Argument(min=0, help="Processes beside them that do nothing but count.")] = 0,
) -> None:
    """Demos with an empty cache of kernels, and the end of one told to end while it compiles."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    good, firsts = True, []
    try:
        for k in range(count):
            with tempfile.TemporaryDirectory() as folder:
                line, fine, first = whole(Path(folder), "demo")
            print(f"{k + 1:3d} of {count}, beside {busy}: {line}", flush=True)
            good, firsts = good and fine, [*firsts, first]
        for number in (signal.SIGINT, signal.SIGTERM):
            with tempfile.TemporaryDirectory() as folder:
                seconds = interrupted(Path(folder), number)
                line, fine, _ = whole(Path(folder), "after")
            print(f"{number.name} while it compiles: all ended after {seconds:.2f} s; then {line}", flush=True)
            good = good and fine and seconds <= GONE
    finally:
        for loop in loops:
            loop.kill()
    if firsts:
        print(f"first command: median {statistics.median(firsts):.2f} s, at most {max(firsts):.2f} s")
    raise typer.Exit(0 if good else 1)
