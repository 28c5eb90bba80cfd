# SPDX-License-Identifier: Apache-2.0
"""What the tool in the servo is worth: stiffness, drag and mass, Fig. 5, tasks."""

import json
from typing import Annotated

import typer

from bench.exchange.felt import NETWORKS, Felt, compare, insertion, measure
from bench.jobs import markdown
from haptic_device.config.parameters import EXCHANGE_METHODS

TASKS = ("wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block")
DEPTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)  # [m] of the peg in Fig. 5
ROTATION = (0.0, 1.0)  # [N m/rad] of the coupling
LIVE_NETWORK = "1 kHz"
HEADS = {
    "felt": ("servo Hz", "method", "coupling N/m", "felt N/m", "drag N s/m", "mass kg", "ratio 1/s", "given J")
    + ("copy in use", "age s"),
    "insertion": ("insertion m", "rotation gain N m/rad", "felt N/m", "theory N/m"),
    "tasks": ("scene", "network", "tool RMS m", "force RMS diff", "mean force", "rough", "reference", "fallbacks")
    + ("copy in use", "given J", "age s"),
}
_PARTS = "What to measure: felt, insertion, tasks; may be repeated [all]."
_PARAMS = "Operating point of the tasks: a name in config or a YAML file."


def main(
    rate: Annotated[list[float] | None, typer.Option(help="Servo rate (Hz) [1000 4000 10000].")] = None,
    task: Annotated[list[str] | None, typer.Option(help="Scene of the comparison; may be repeated [all].")] = None,
    only: Annotated[list[str] | None, typer.Option(help=_PARTS)] = None,
    params: Annotated[str, typer.Option(help=_PARAMS)] = "demo",
    live: Annotated[bool, typer.Option("--live", help="On running nodes, not in lock-step.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """The tool in the servo: stiffness against drag for every method, Fig. 5, scenes against the synchronous world."""
    networks = (LIVE_NETWORK,) if live else tuple(NETWORKS)
    jobs = {
        "felt": [(hertz, name) for hertz in rate or (1000.0, 4000.0, 10000.0) for name in EXCHANGE_METHODS],
        "insertion": [(deep, gain) for gain in ROTATION for deep in DEPTHS],
        "tasks": [(scene, name) for scene in task or TASKS for name in networks],
    }
    for part in only or ():
        if part not in jobs:
            raise ValueError(f"--only {part}: it must be one of {', '.join(jobs)}")
    found = {part: [_do(live, params, part, *job) for job in jobs[part]] for part in only or jobs}
    if as_json:
        typer.echo(json.dumps({"live": live, **found}))
        return
    for part, rows in found.items():
        typer.echo(markdown(HEADS[part], map(_shown, rows) if part == "felt" else rows) + "\n")


def _do(live, params, part, *job):
    """Row of one measurement; a fault that latched on live nodes stands in place of its numbers."""
    try:
        if part == "tasks":
            return [*job, *compare(*job, live=live, params=params).values()]
        return [*job, *{"felt": measure, "insertion": insertion}[part](*job, live=live)]
    except ValueError as error:
        if not live:
            raise
        typer.echo(f"bench: {error}", err=True)
        return [*job, str(error)]


def _shown(row):
    rate, method, *numbers = row
    if len(numbers) == 1:
        return row
    one = Felt(*numbers)
    felt, ratio = (one.stiffness, one.stiffness / max(1e-3, abs(one.drag))) if one.steady else ("unsteady", None)
    return [rate, method, one.coupling, felt, one.drag, one.mass, ratio, one.given, one.local, one.age]
