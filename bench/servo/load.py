# SPDX-License-Identifier: Apache-2.0
"""Processor and memory of the whole live system, node by node."""

import contextlib
import json
import tempfile
import time
from pathlib import Path
from typing import Annotated

import psutil
import typer

from bench.jobs import markdown
from haptic_device.config.files import find
from haptic_display.device_tools.tuning import Tuning
from haptic_display.run.domain import isolated_domain
from haptic_display.run.prepare import prepare
from haptic_display.run.processes import Nodes, Program

SETTLING = 2.0  # [s] after engaging


def main(
    seconds: Annotated[float, typer.Option(help="Length of the measurement.", min=1.0, max=3600.0)] = 10.0,
    scene: Annotated[str, typer.Option(help="A name in config/scenes or a YAML file.")] = "peg_in_hole",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Processor time and memory (PSS) of device, driver, simulation and recorder: 4 kHz servo, 1 kHz exchange."""
    found = measure(seconds, scene)
    if as_json:
        typer.echo(json.dumps(found))
        return
    rows = [[name, share, found["pss_mb"][name]] for name, share in found["node_cores"].items()]
    typer.echo(markdown(("node", "cores", "MB"), [*rows, ["all", found["cores"], None]]))


def measure(seconds: float, scene: str = "peg_in_hole") -> dict:
    """{"cores": of all, "node_cores": {node: share of a core}, "pss_mb": {node: MB}}."""
    with tempfile.TemporaryDirectory(prefix="haptic_") as place, isolated_domain(Path(place)) as domain:
        programs = _programs(Path(place) / "bag", scene)
        prepare(programs)
        with Nodes(Path(place) / "log") as nodes:
            for program in programs:
                nodes.start(program)
            with contextlib.closing(Tuning(domain, "/haptic")) as tuning:
                tuning.wait_engaged(nodes.check)
            time.sleep(SETTLING)
            names = [program.name for program in programs]
            shares = cores(nodes, names, lambda: time.sleep(seconds))
            nodes.check()
            memory = {name: psutil.Process(nodes.pid(name)).memory_full_info().pss / 1e6 for name in names}
    return {"cores": sum(shares.values()), "node_cores": shares, "pss_mb": memory}


def _programs(bag, scene):
    path = str(find("scenes", scene).absolute())
    circle = {
        "motion.name": "circle",
        "motion.start": (0.0, 0.11, 0.0),
        "motion.radius": 0.01,
        "motion.duration": 3600.0,
    }
    return [
        Program("haptic_recorder", "haptic_device.nodes.recorder", {"bag": str(bag)}),
        Program("haptic_loopback", "haptic_device.nodes.loopback", circle),
        Program("haptic_simulation", "haptic_sim.node.simulation", {"scene": path}),
        Program("haptic_driver", "haptic_device.nodes.driver", {"auto_enable": True}),
    ]


def cores(nodes: Nodes, names, wait) -> dict[str, float]:
    """{node: processor time as a share of a core} while `wait` goes on."""
    processes = [psutil.Process(nodes.pid(name)) for name in names]
    before, began = [_spent(one) for one in processes], time.monotonic()
    wait()
    passed = time.monotonic() - began
    return {name: (_spent(one) - first) / passed for name, one, first in zip(names, processes, before, strict=True)}


def _spent(process):
    times = process.cpu_times()
    return times.user + times.system
