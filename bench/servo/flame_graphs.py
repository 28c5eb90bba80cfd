# SPDX-License-Identifier: Apache-2.0
"""Flame graphs of device, driver and simulation at 1 kHz exchange, as SVG.

Needs py-spy (pip install py-spy). Compiled loops show as the Python line that called them: what is to be looked for is
Python that runs once a tick or once an exchange.
"""

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.processes import Nodes, Program

NODES = {
    "haptic_loopback": "haptic_device.nodes.loopback",
    "haptic_simulation": "haptic_sim.node.simulation",
    "haptic_driver": "haptic_device.nodes.driver",
}


def main(
    out: Annotated[Path, typer.Argument(help="Folder for the SVG files.")],
    seconds: Annotated[int, typer.Argument(min=1, help="Of each node.")] = 10,
    scene: Annotated[str, typer.Argument(help="A name in config/scenes or a YAML file.")] = "peg_in_hole",
) -> None:
    """Flame graphs of device, driver and simulation at 1 kHz exchange, as SVG."""
    from haptic_sim.supervision.tuning import Tuning

    if shutil.which("py-spy") is None:
        sys.exit("flame_graphs: py-spy is not installed: pip install py-spy")
    out.mkdir(parents=True, exist_ok=True)
    circle = {
        "motion.name": "circle",
        "motion.start": (0.0, 0.11, 0.0),
        "motion.radius": 0.01,
        "motion.duration": 3600.0,
    }
    given = {"haptic_loopback": circle, "haptic_simulation": {"scene": scene}, "haptic_driver": {"auto_enable": True}}
    with tempfile.TemporaryDirectory() as logs, isolated_domain(Path(logs)) as domain, Nodes(Path(logs)) as nodes:
        for name, module in NODES.items():
            nodes.start(Program(name, module, given[name]))
        with contextlib.closing(Tuning(domain, "/haptic")) as tuning:
            tuning.wait_engaged(nodes.check)
        for name in NODES:
            file = out / f"{name}.svg"
            subprocess.run(
                [
                    "py-spy",
                    "record",
                    "--nonblocking",
                    "--threads",
                    "-r",
                    "500",
                    "-d",
                    str(seconds),
                    "-o",
                    file,
                    "-p",
                    str(nodes.pid(name)),
                ],
                check=True,
                capture_output=True,
            )
            file.write_text(re.sub(r"py-spy record [^<]*", f"{name}, {seconds} s, {scene}", file.read_text()))
            print(file)
