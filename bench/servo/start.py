# SPDX-License-Identifier: Apache-2.0
"""Seconds from starting device, driver and simulation to each doing its work, and its memory."""

import contextlib
import json
import tempfile
import time
from pathlib import Path
from typing import Annotated

import psutil
import typer

from bench.jobs import markdown, medians
from haptic_device.config.files import find
from haptic_device.process import environment
from haptic_display.run.domain import isolated_domain
from haptic_display.run.processes import NAMESPACE, Nodes, Program

READY = {  # the diagnostic entry that a node counts up in once it does its work
    "haptic_loopback": "driven",
    "haptic_driver": "ticks",
    "haptic_simulation": "answered",
}
LOOK = 0.02  # [s]
PATIENCE = 180.0  # [s]


def main(
    scene: Annotated[str, typer.Option(help="A name in config/scenes or a YAML file.")] = "peg_in_hole",
    again: Annotated[int, typer.Option(min=1, max=100, help="Starts after the very first one.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Start-up of the three nodes at once: with an empty cache of kernels, and from that cache."""
    found = measure(scene, again)
    typer.echo(json.dumps(found) if as_json else _shown(found))


def measure(scene: str = "peg_in_hole", again: int = 3) -> dict:
    """{"first": {node: s}, "first_pss_mb": {node: MB}, "again": [{node: s}, …]}, memory when the last node was at work.

    ValueError for a scene that is none, NodeDiedError.
    """
    path = str(find("scenes", scene).absolute())
    with tempfile.TemporaryDirectory(prefix="haptic_") as folder, environment({"XDG_CACHE_HOME": f"{folder}/cache"}):
        (first, memory), *others = (_once(Path(folder), path) for _ in range(1 + again))
    return {"scene": scene, "first": first, "first_pss_mb": memory, "again": [ready for ready, _ in others]}


def _once(folder, scene):
    """Seconds from the first process to each node at work (diagnostics come every 0.5 s); their memory [MB]."""
    programs = (
        Program("haptic_loopback", "haptic_device.nodes.loopback"),
        Program("haptic_simulation", "haptic_sim.node.simulation", {"scene": scene}),
        Program("haptic_driver", "haptic_device.nodes.driver", {"auto_enable": True}),
    )
    began, ready = time.monotonic(), {}
    with isolated_domain(folder) as domain, Nodes(folder / "log") as nodes:
        for program in programs:
            nodes.start(program)
        from haptic_display.client import Client  # ROS is imported while the nodes start

        with contextlib.closing(Client.join("haptic_demo", domain, NAMESPACE)) as client:
            while len(ready) < len(READY):
                nodes.check()
                client.look()
                new = [name for name, entry in READY.items() if client.said(name, entry) not in ("", "0", "False")]
                ready = {name: time.monotonic() - began for name in new} | ready
                if time.monotonic() - began > PATIENCE:
                    raise ValueError(f"{', '.join(set(READY) - set(ready))} did not start within {PATIENCE:g} s")
                time.sleep(LOOK)
        memory = {name: psutil.Process(nodes.pid(name)).memory_full_info().pss / 1e6 for name in READY}
    return ready, memory


def _shown(found):
    heads = ("node", "very first start s", "later (median) s", "memory, very first MB")
    later = medians(found["again"], READY)
    rows = [[name, found["first"][name], later[name], found["first_pss_mb"][name]] for name in READY]
    return markdown(heads, rows)
