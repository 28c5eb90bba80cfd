# SPDX-License-Identifier: Apache-2.0
"""Kills the recorder of a running demo and starts it again, many times; prints how long each took to hear the servo.

The other nodes are started once. Each kill (SIGKILL) strikes while the recorder's receiving thread runs, which is when
it does harm. With --same-port every recorder takes the network port of its predecessor, as Fast DDS by itself has it.
"""

import os
import signal
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.recording import load
from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.processes import Nodes
from haptic_sim.supervision.system import Order, programs_of

AIMING = 3.0  # [s] at most
HEAD = 2**20  # bytes


def kill_busy(pid):
    """Kills the process at a moment at which one of the threads that take messages runs; at last at any."""
    tasks = Path(f"/proc/{pid}/task")
    names = {task: (task / "comm").read_text().strip() for task in tasks.iterdir()}
    _, receiving = max((int(name[8:]), task) for task, name in names.items() if name[8:].isdigit() and "shm" in name)
    status, end = os.open(receiving / "stat", os.O_RDONLY), time.monotonic() + AIMING
    while time.monotonic() < end and os.pread(status, 200, 0).rpartition(b") ")[2][:1] != b"R":
        continue
    os.kill(pid, signal.SIGKILL)
    os.close(status)


def heard(bag):
    """Topics at the head of a bag being written, by their number of messages; all would take too long."""
    try:
        head = bag.with_suffix(".mcap")
        with open(next(bag.glob("*.mcap")), "rb") as written:
            head.write_bytes(written.read(HEAD))
        return load(head, "/haptic", {"trace": None}).counts
    except (ValueError, OSError, StopIteration):
        return {}


def await_trace(nodes, bag, patience):
    """Seconds until the trace is in the bag, or None; and how many topics are."""
    began, topics = time.monotonic(), {}
    while "/haptic/trace" not in topics:
        if time.monotonic() > began + patience:
            return None, len(topics)
        nodes.check()
        time.sleep(0.1)
        topics = heard(bag)
    return time.monotonic() - began, len(topics)


def fix_port():
    """Gives every recorder the same participant id, and with it the same port."""
    profile = Path(os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"])
    fixed = profile.with_name("same_port.xml")
    fixed.write_text(profile.read_text().replace("</rtps>", "<participantID>30</participantID></rtps>"))
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(fixed)


def main(
    kills: Annotated[int, typer.Option(min=1, help="How often.")] = 20,
    patience: Annotated[float, typer.Option(min=1.0, help="Longest wait for the servo [s].")] = 30.0,
    same_port: Annotated[bool, typer.Option("--same-port", help="Every recorder on its predecessor's port.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the bags [a temporary one].")] = None,
) -> None:
    """Kill the recorder of a running demo (SIGKILL) and start another, and say how long it took to hear the servo."""
    base = out or Path(tempfile.mkdtemp(prefix="haptic_restarts_"))
    recorder, *others = programs_of(Order("peg_in_hole", None, base, None, None, Path("config/demo.yaml").absolute()))
    print("| start | heard the trace after s | topics |")
    with isolated_domain(base / "log"), Nodes(base / "log") as nodes:
        for program in others:
            nodes.start(program)
        if same_port:
            fix_port()
        waits = [restart(nodes, recorder, base / f"bag_{number}", patience) for number in range(kills + 1)]
    reached = [waited for waited in waits if waited is not None]
    deaf = len(waits) - len(reached)
    told = f"{deaf} of {len(waits)} recorders heard no servo within {patience:g} s"
    print(f"{told}; the others within {max(reached):.1f} s")


def restart(nodes, recorder, bag, patience):
    """Starts a recorder, waits until it hears the servo, kills it; seconds waited, or None."""
    nodes.start(recorder._replace(parameters={**recorder.parameters, "bag": str(bag)}))
    waited, topics = await_trace(nodes, bag, patience)
    print(f"| {bag.name[4:]} | {'never' if waited is None else f'{waited:.1f}'} | {topics} |", flush=True)
    kill_busy(nodes.pid(recorder.name))
    nodes.end(recorder.name)
    return waited
