# SPDX-License-Identifier: Apache-2.0
"""What the tool in the servo is worth: stiffness, drag and mass, Fig. 5, tasks."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from bench.exchange.felt import NETWORKS, Felt, compare, insertion, measure
from bench.exchange.local_figure import save
from bench.jobs import deaths_told
from haptic_device.parameters import EXCHANGE_METHODS

TASKS = ("wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block")
DEPTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)  # [m] of the peg in Fig. 5
ROTATION = (0.0, 1.0)  # [N m/rad] of the coupling
LIVE_NETWORK = "1 kHz"
_PARTS = "What to measure: felt, insertion, tasks; may be repeated [all]."
_PARAMS = "Operating point of the tasks: a name in config or a YAML file."


def main(
    rate: Annotated[list[float] | None, typer.Option(help="Servo rate (Hz) [1000 4000 10000].")] = None,
    task: Annotated[list[str] | None, typer.Option(help="Scene of the comparison; may be repeated [all].")] = None,
    only: Annotated[list[str] | None, typer.Option(help=_PARTS)] = None,
    params: Annotated[str, typer.Option(help=_PARAMS)] = "demo",
    live: Annotated[bool, typer.Option("--live", help="On running nodes, not in lock-step.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Write the figure to this PNG file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
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
    with deaths_told():
        found = {
            part: {job: _do(live, params, part, *job) for job in of if part in (only or jobs)}
            for part, of in jobs.items()
        }
    if plot is not None:
        save(found, plot, live)
    if as_json:
        rows = {part: [[*job, *one] for job, one in done.items()] for part, done in found.items()}
        typer.echo(json.dumps({"live": live, **rows}))
        return
    for part, show in (("felt", _show_felt), ("insertion", _show_insertion), ("tasks", _show_tasks)):
        if found[part]:
            show(found[part])


def _do(live, params, part, *job):
    """Numbers of one measurement; a fault that latched on live nodes stands in their place."""
    try:
        if part == "tasks":
            scene, name = job
            return list(compare(scene, *NETWORKS[name], live=live, params=params).items())
        return {"felt": measure, "insertion": insertion}[part](*job, live=live)
    except ValueError as error:
        if not live:
            raise
        typer.echo(f"bench: {error}", err=True)
        return [str(error)]


def _show_felt(found):
    typer.echo(
        "servo Hz  method  coupling N/m  felt N/m  share  drag N s/m  mass kg  ratio 1/s  given mJ  local  age ms  sets"
    )
    for (hertz, name), numbers in found.items():
        if len(numbers) == 1:
            typer.echo(f"{hertz:8.0f}  {name:6} {numbers[0]}")
            continue
        one = Felt(*numbers)
        felt, share = f"{one.stiffness:9.0f}", f"{one.stiffness / one.coupling:6.3f}"
        ratio = f"{one.stiffness / max(1e-3, abs(one.drag)):10.3g}"
        if not one.steady:
            felt, share, ratio = f"{'unsteady':>9}", f"{'–':>6}", f"{'–':>10}"
        typer.echo(
            f"{hertz:8.0f}  {name:6} {one.coupling:13.0f} {felt} {share} {one.drag:11.4f} {one.mass:8.4f}"
            f" {ratio} {one.given * 1e3:9.3f} {one.local:6.3f} {one.age * 1e3:7.2f} {one.sets:5d}"
        )


def _show_insertion(found):
    typer.echo("\nrotation gain N m/rad  insertion mm  felt N/m  theory N/m   apart")
    for (deep, gain), numbers in found.items():
        felt, exact = numbers if len(numbers) == 2 else (math.nan, math.nan)
        typer.echo(f"{gain:21.1f} {deep * 1e3:13.0f} {felt:9.2f} {exact:11.2f} {felt / exact - 1.0:+7.2%}")


def _show_tasks(found):
    typer.echo(
        "\nscene          network            tool RMS mm  force RMS diff  mean force  rough    ref  fallbacks  local"
        "  given mJ  age ms"
    )
    for (scene, name), numbers in found.items():
        if len(numbers) == 1:
            typer.echo(f"{scene:14} {name:18} {numbers[0]}")
            continue
        one = dict(numbers)
        typer.echo(
            f"{scene:14} {name:18} {one['tool'] * 1e3:11.4f} {one['force']:14.2%}"
            f" {one['mean']:11.3f} {one['rough']:6.2%} {one['smooth']:6.2%}"
            f" {one['fallbacks']:9d} {one['local']:7.3f} {one['given'] * 1e3:9.3f}"
            f" {one['age'] * 1e3:7.2f}"
        )
