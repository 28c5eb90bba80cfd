# SPDX-License-Identifier: Apache-2.0
"""What an exchange costs with 10 to 300 bodies, ours and the peers', as a table, a figure and a file of all runs."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer
from matplotlib.figure import Figure

from bench.jobs import listed, usable, write_csv
from bench.methods.figure import LOOKS
from bench.methods.growing import (
    COUNTS,
    ENGINES,
    LIMIT,
    SECONDS,
    SHORT,
    STEP,
    WORLDS,
    Run,
    goals,
    jobs,
    run,
)
from bench.methods.table import TITLES
from bench.methods.world import PEERS, version
from haptic_sim.cli.progress import INTERRUPTED, progress
from haptic_sim.supervision.processes import interruptible

FEW = (10,)
EXCHANGE = 1e3  # µs, the time that an exchange has
HEADS = ("world", "bodies", "engine", "exchange, median", "p99", "deepest overlap", "energy created", "error")


def main(
    worlds: Annotated[str | None, typer.Option(help="Comma-separated worlds [all].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [some of each].")] = None,
    short: Annotated[bool, typer.Option("--short", help=f"{FEW[0]} bodies and a quarter of the time only.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for growth.csv, growth.md and growth.png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Worlds of 10, 30, 100, 300 bodies: processor time of an exchange, overlap, energy created; some minutes."""
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
        typer.echo(f"bench: interrupted; {len(found)} of {len(todo)} are kept", err=True)
    _report(found, out, as_json)
    if len(found) < len(todo):
        raise typer.Exit(INTERRUPTED)


def _report(found, out, as_json):
    if out and found:
        write(out, found)
    if as_json:
        runs = [
            {
                key: None if isinstance(value, float) and not math.isfinite(value) else value
                for key, value in item._asdict().items()
            }
            for item in found
        ]
        reached = [goal._asdict() | {"reached": goal.reached} for goal in goals(found)]
        typer.echo(json.dumps({"runs": runs, "goals": reached}))
        return
    typer.echo(markdown(found))


def markdown(runs: list[Run]) -> str:
    """A row for each world, number of bodies and engine, and what comes of the goals."""
    rows = [HEADS, ["---"] * len(HEADS), *map(_row, runs)]
    lines = [
        f"* {goal.what}: {goal.value:.3g} {goal.unit}, at most {goal.limit:g} {goal.unit}{'' if goal.reached else ' ✗'}"
        for goal in goals(runs)
    ]
    return "\n".join([*(f"| {' | '.join(row)} |" for row in rows), *([""] if lines else []), *lines])


def _row(item):
    key = [item.world, str(item.bodies), title(item.engine, item.step_us)]
    if item.cannot:
        return [*key, "cannot", *[""] * 4]
    if item.status == "over":
        return [*key, f"over {item.median_us:.0f} µs", f"over {item.p99_us:.0f} µs", *[""] * 3]
    if math.isinf(item.created):
        return [*key, f"{item.median_us:.0f} µs", f"{item.p99_us:.0f} µs", "not finite", *[""] * 2]
    return [
        *key,
        f"{item.median_us:.0f} µs",
        f"{item.p99_us:.0f} µs",
        _length(item.overlap_um),
        f"{100.0 * item.created:.2g} %",
        _length(item.error_um),
    ]


def _length(value):
    return "" if math.isnan(value) else f"{value:.2g} µm" if value < 99.5 else f"{1e-3 * value:.2g} mm"


def title(engine: str, step: int) -> str:
    """Name of an engine, with its step [µs] where it is not the one of all."""
    return TITLES.get(engine, engine) + ("" if step == STEP else f", {step} µs")


def figure(runs: list[Run], columns: int = 3) -> Figure:
    """Time of an exchange over the number of bodies, a panel a world: median, p99 faint, and the time there is."""
    worlds = list(dict.fromkeys(item.world for item in runs))
    rows, columns = -(-len(worlds) // columns), min(columns, len(worlds))
    made = Figure(figsize=(4.6 * columns, 3.6 * rows + 0.5), layout="constrained")
    panels, drawn = list(made.subplots(rows, columns, squeeze=False).flat), {}
    for world, axes in zip(worlds, panels, strict=False):
        drawn |= _panel(axes, [item for item in runs if item.world == world and not item.cannot], world)
    for axes in panels[len(worlds) :]:
        axes.set_visible(False)
    made.legend(list(drawn.values()), list(drawn), loc="outside upper center", ncols=max(1, len(drawn)), fontsize=8)
    return made


def _panel(axes, runs, world):
    drawn = {}
    for engine, step in dict.fromkeys((item.engine, item.step_us) for item in runs):
        of = [item for item in runs if (item.engine, item.step_us) == (engine, step)]
        (color, marker), style = LOOKS[engine], "-" if step == STEP else "--"
        bodies = [item.bodies for item in of]
        (drawn[title(engine, step)],) = axes.plot(
            bodies, [item.median_us for item in of], style, color=color, marker=marker, linewidth=1.3, markersize=5
        )
        axes.plot(bodies, [item.p99_us for item in of], style, color=color, linewidth=0.7, alpha=0.45)
    axes.axhline(EXCHANGE, color="black", linewidth=0.8, linestyle=":")
    axes.set_xscale("symlog", linthresh=10)
    axes.set(yscale="log", xlabel="bodies that can move", ylabel="exchange of 1 ms [µs]")
    counts = sorted({item.bodies for item in runs})
    axes.set_xticks(counts, map(str, counts))
    axes.set_xticks([], minor=True)
    axes.set_title(world, fontsize=9)
    axes.grid(alpha=0.3)
    return drawn


def write(folder: Path, runs: list[Run]) -> None:
    """growth.csv, growth.md and growth.png; OSError if they cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "growth.csv", Run, runs)
    used = dict.fromkeys(version(name) for name in PEERS if any(item.engine == name for item in runs))
    head = (
        f"# Growth\n\nWritten by `python -m bench growth`: processor time of an exchange of 1 ms, the first half "
        f"of the run left out. Peers: {', '.join(used)}, at sub-steps of {STEP} µs unless said otherwise, allowed "
        f"to let bodies sleep. Over: ended after {LIMIT:g} s of processor time. Looked at is a second run, ended "
        "after half of that. Error: the longest way of a body that should stay, or by which a pin is open.\n\n"
    )
    (folder / "growth.md").write_text(f"{head}{markdown(runs)}\n", encoding="utf-8")
    figure(runs).savefig(folder / "growth.png", dpi=90)
