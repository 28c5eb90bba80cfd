# SPDX-License-Identifier: Apache-2.0
"""`haptic bench growth`: what an exchange costs with 10 to 300 bodies, ours and the peers'."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import INTERRUPTED, listed, progress, usable

FEW = (10,)


def growth(
    worlds: Annotated[str | None, typer.Option(help="Comma-separated worlds [all].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [some of each].")] = None,
    short: Annotated[bool, typer.Option("--short", help=f"{FEW[0]} bodies and a quarter of the time only.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for growth.csv, growth.md and growth.png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Worlds of 10, 30, 100, 300 bodies: processor time of an exchange, overlap, energy created; some minutes."""
    from bench.methods.growth import COUNTS, ENGINES, SECONDS, SHORT, WORLDS, jobs, run
    from haptic_sim.cli.processes import interruptible

    names = listed(worlds, WORLDS)
    for name in names:
        if name not in WORLDS:
            raise ValueError(f"world is {name!r}; it must be one of {', '.join(WORLDS)}")
    todo, found = jobs(names, FEW if short else COUNTS, usable(methods or ",".join(ENGINES))), []
    try:
        with interruptible(), progress(len(todo)) as show:
            for world, count, engine, step in todo:
                show(len(found), f"{world} of {count}, {engine}")
                found.append(run(world, count, engine, step, SHORT if short else SECONDS))
            show(len(todo), "done")
    except KeyboardInterrupt:
        typer.echo(f"haptic bench: interrupted; {len(found)} of {len(todo)} are kept", err=True)
    _report(found, out, as_json)
    if len(found) < len(todo):
        raise typer.Exit(INTERRUPTED)


def _report(found, out, as_json):
    from bench.methods.growth import goals
    from bench.methods.growth_report import markdown, write

    if out and found:
        write(out, found)
    if as_json:
        runs = [{key: None if isinstance(value, float) and not math.isfinite(value) else value
                 for key, value in item._asdict().items()} for item in found]
        reached = [goal._asdict() | {"reached": goal.reached} for goal in goals(found)]
        typer.echo(json.dumps({"runs": runs, "goals": reached}))
        return
    typer.echo(markdown(found))
