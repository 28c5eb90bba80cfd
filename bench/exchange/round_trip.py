# SPDX-License-Identifier: Apache-2.0
"""Handle → tool → handle on live nodes, beside a bare ping-pong by the same receive path."""

import contextlib
import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import markdown, medians
from bench.servo.load import cores
from haptic_display.device_tools.tuning import Tuning
from haptic_display.run.domain import isolated_domain
from haptic_display.run.processes import Nodes, Program

RATES = (500.0, 1000.0, 2000.0)  # [Hz]
SECONDS, TURNS = 4.0, 5
ANSWERERS = {
    "simulation": Program("haptic_simulation", "haptic_sim.node.simulation", {"scene": "free_space"}),
    "bare": Program("haptic_simulation", "bench.exchange.echo_node"),
}
NODES = ("haptic_loopback", "haptic_simulation", "haptic_driver")
NAMES = ("p50_us", "p99_us", "answered", "loopback_cores", "simulation_cores", "driver_cores", "ratio")
_RATE = "Handle samples a second; may be repeated [500 1000 2000]."
_CIRCLE = {"motion.name": "circle", "motion.start": (0.0, 0.0, 0.0), "motion.duration": 3600.0}


def main(
    rate: Annotated[list[float] | None, typer.Option(help=_RATE, min=100.0, max=2000.0)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Round trip of the exchange on live nodes against a bare ping-pong, in turns, and the cores of each node."""
    found = measure(rate or RATES)
    rows = [[one["rate"], one["answerer"], *(one[name] for name in NAMES)] for one in found]
    typer.echo(json.dumps(found) if as_json else markdown(("rate", "answerer", *NAMES), rows))


def measure(rates, turns: int = TURNS, seconds: float = SECONDS) -> list[dict]:
    """One entry a rate and answerer: medians over the turns of round trip p50, p99 [us], share answered, and the
    processor time of each node as a share of a core; `ratio`: of the p50 to the bare one's, the median of the turns."""
    found = []
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain:
        for rate in rates:
            runs = {name: [] for name in ANSWERERS}
            for turn in range(turns):
                for name, answerer in ANSWERERS.items():
                    print(f"{rate:g} Hz, {name}, turn {turn + 1}", file=sys.stderr, flush=True)
                    runs[name].append(_once(domain, answerer, rate, seconds))
            pairs = zip(runs["simulation"], runs["bare"], strict=True)
            ratio = statistics.median(one["p50_us"] / other["p50_us"] for one, other in pairs)
            for name, many in runs.items():
                found.append({"rate": rate, "answerer": name, "ratio": ratio, **medians(many, many[0])})
    return found


def _once(domain, answerer, rate, seconds):
    driver = {"auto_enable": True, "exchange.rate": rate}
    with tempfile.TemporaryDirectory() as logs, Nodes(Path(logs)) as nodes:
        nodes.start(Program("haptic_loopback", "haptic_device.nodes.loopback", _CIRCLE))
        nodes.start(answerer)
        nodes.start(Program("haptic_driver", "haptic_device.nodes.driver", driver))
        with contextlib.closing(Tuning(domain, "/haptic")) as tuning:
            tuning.wait_engaged(nodes.check)
            tuning.wait_answered(nodes.check)
            answered, sent = _counted(tuning)
            taken = cores(nodes, NODES, lambda: tuning.watch(seconds))
            more, since = _counted(tuning)
            trips = {f"{name}_us": float(tuning.said(f"round_trip_us_{name}")) for name in ("p50", "p99")}
            shares = {f"{name.removeprefix('haptic_')}_cores": share for name, share in taken.items()}
            return trips | {"answered": (more - answered) / max(1, since - sent)} | shares


def _counted(tuning):
    return [int(tuning.said(f"exchange_{word}")) for word in ("answered", "sent")]
