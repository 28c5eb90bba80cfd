# SPDX-License-Identifier: Apache-2.0
"""What each exchange method makes of a network, in lock-step, at handle and tool."""

import itertools
import json
import os
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from bench.exchange.motion import CIRCLE, PRESS, SECONDS, run, stiffness
from bench.jobs import WORKERS, Kept, markdown, sweep
from haptic_device.config.parameters import EXCHANGE_METHODS, OPERATING_POINT
from haptic_display.cli.progress import INTERRUPTED
from haptic_sim.lockstep.lockstep import Network

_DELAYS, _RATES = "Round trip (ms) [0 1 2 5 10 20 50 100].", "Handle samples a second [1000]."
_CSV = "CSV file for the figures, each as it comes; cases that are in it are not done again."
BUDGET = next(one.default for one in OPERATING_POINT if one.name == "exchange.budget")  # [J]
TURNING = 2.0 * np.pi * 3.0 / (0.9 * SECONDS)  # [rad/s] between easing in and out
HEADS = ("method", "delay ms", "jitter ms", "loss", "rate Hz", "stiffness N/m", "tool error mm", "drag N s/m")
HEADS += ("mass kg", "ratio 1/s", "given J", "supplied J", "jump N/ms")


class Case(NamedTuple):
    """A method and a network: delay of both ways together and its jitter [s], loss of a turn, samples a second."""

    method: str
    delay: float
    jitter: float
    loss: float
    rate: float


class Figures(NamedTuple):
    """Contact stiffness felt [N/m]; free motion: tool error [m], apparent damping [N s/m] and mass [kg]; the largest
    energy given to the operator and supplied to the tool in either [J]; the fastest change of force [N/ms]."""

    stiffness: float
    tool_error: float
    damping: float
    mass: float
    given: float
    supplied: float
    jump: float

    @property
    def impedance_ratio(self) -> float:
        """Contact stiffness over free-space drag [1/s]."""
        return self.stiffness / max(1e-3, abs(self.damping))

    @property
    def passive(self) -> bool:
        """Whether no more energy than the default of `exchange.budget` was given; the rest means little if not."""
        return self.given <= BUDGET


_HOW = ("params", str), ("live", bool)
Row = NamedTuple("Row", [*Case.__annotations__.items(), *_HOW, *Figures.__annotations__.items()])


def main(
    method: Annotated[list[str] | None, typer.Option(help="Exchange method; may be repeated [all].")] = None,
    delay: Annotated[list[float] | None, typer.Option(help=_DELAYS, min=0.0, max=2000.0)] = None,
    jitter: Annotated[float, typer.Option(help="Uniform jitter, ± share of the delay.", min=0.0, max=1.0)] = 0.0,
    loss: Annotated[list[float] | None, typer.Option(help="Share of turns lost [0].", min=0.0, max=1.0)] = None,
    rate: Annotated[list[float] | None, typer.Option(help=_RATES, min=100.0, max=2000.0)] = None,
    params: Annotated[str, typer.Option(help="Operating point: a name in config or a YAML file.")] = "demo",
    table: Annotated[Path | None, typer.Option("--csv", help=_CSV)] = None,
    live: Annotated[bool, typer.Option("--live", help="On running nodes behind a relay, not in lock-step.")] = False,
    workers: Annotated[int | None, typer.Option(min=1, max=1024, help=WORKERS)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Exchange methods against delay, jitter, loss and rate: stiffness, tool error, drag, energies, force jumps.

    Two motions a case, of 3 s each: pressing a rigid wall, and a circle in free space.
    """
    delays = [value * 1e-3 for value in delay or (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)]
    cases = [
        Case(name, late, jitter * late, lost, fast)
        for lost, fast, late, name in itertools.product(
            loss or (0.0,), rate or (1000.0,), delays, method or EXCHANGE_METHODS
        )
    ]
    kept = Kept(table, Row, lambda row: row[:7])
    jobs = {(*case, params, live): (case, params, live) for case in cases}
    whole = sweep(_row, jobs, kept, 1 if live else workers or len(os.sched_getaffinity(0)))
    found = {case: Figures(*kept.known[key][7:]) for key, (case, *_) in jobs.items() if key in kept.known}
    if as_json:
        rows = [
            {**case._asdict(), **one._asdict(), "impedance_ratio": one.impedance_ratio, "passive": one.passive}
            for case, one in found.items()
        ]
        typer.echo(json.dumps({"live": live, "params": params, "cases": rows}))
    else:
        typer.echo(markdown(HEADS, [_shown(case, one) for case, one in found.items()]))
    if not whole:
        raise typer.Exit(INTERRUPTED)


def _row(case, params, live):
    return Row(*case, params, live, *measure(case, params, live))


def measure(case: Case, params: str = "demo", live: bool = False) -> Figures:
    """Figures of one case at an operating point; ValueError, one sentence, for values that cannot be."""
    network = Network(case.delay, case.jitter, case.loss, 1)
    press, circle = (
        run(scene, case.method, network, case.rate, {}, motion, live=live, params=params)
        for scene, motion in (("wall", PRESS), ("free_space", CIRCLE))
    )
    damping, mass = _drag(circle.rows[int(0.2 * len(circle.rows)) : int(0.8 * len(circle.rows))])
    given, supplied = max(press.given, circle.given), max(press.supplied, circle.supplied)
    jump = max(_jump(press.rows), _jump(circle.rows))
    return Figures(stiffness(press.rows), circle.error, damping, mass, given, supplied, jump)


def _drag(rows):
    """Apparent damping and mass of the coupling: least squares of f = −c v + m ω² (x − centre) over a steady circle."""
    place = rows.position[:, :2] - rows.position[:, :2].mean(axis=0)
    known = np.stack([-rows.velocity[:, :2].ravel(), (TURNING**2 * place).ravel()], axis=1)
    (damping, mass), *_ = np.linalg.lstsq(known, rows.force_coupling[:, :2].ravel(), rcond=None)
    return float(damping), float(mass)


def _jump(rows):
    """Largest change of the coupling's force within a millisecond [N]."""
    late = max(1, round(1e6 / (rows.deadline[1] - rows.deadline[0])))
    return float(np.abs(rows.force_coupling[late:, :2] - rows.force_coupling[:-late, :2]).max())


def _shown(case, one):
    network = case.method, case.delay * 1e3, case.jitter * 1e3, case.loss, case.rate
    felt = one.stiffness, one.tool_error * 1e3, one.damping, one.mass, one.impedance_ratio
    felt = felt if one.passive else ("active", None, None, None, None)
    return *network, *felt, one.given, one.supplied, one.jump
