# SPDX-License-Identifier: Apache-2.0
"""What an exchange costs with 10 to 300 bodies, ours and the peers', and what is right of the result.

Two runs of each: in the timed one nothing is looked at, in the other energies are booked, and overlaps and bodies that
should stay where they are looked at now and then. The one ends early once it has cost `LIMIT` of processor time, and
then there is no other; the other at half of it.
"""

import json
import math
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bench.jobs import Kept, listed, plain, sweep, usable, write_csv
from bench.jobs import markdown as as_table
from bench.methods import loads
from bench.methods.figure import DPI, LOOKS, panels
from bench.methods.world import Impossible, make, title
from haptic_device.analysis.palette import DOTTED, FAIL, GREY
from haptic_sim.cli.progress import INTERRUPTED
from haptic_sim.rollout import GAINS, overlap_watch, rollout

WORLDS = {
    "row": "blocks at rest",
    "heap": "stirred in a trough",
    "chain": "links on pins",
    "pyramid": "boxes",
    "joint_grid": "discs on pins",
}
"""Name → what it is of."""
COUNTS, FEW = (10, 30, 100, 300), (10,)
ENGINES = ("impulse", "partitioned", "pymunk", "box2d", "mujoco_implicit")
STEP, STEPS = 250, {"box2d": (250, 50)}  # µs; the finer one for Box2D overlaps as little as `impulse` does
LIMIT, SECONDS, SHORT = 5.0, 1.2, 0.3  # s; the latter two of simulated time
SETTLED = 2  # the first half is not counted: heaps fall, what rests falls asleep (Box2D after half a second)
BOOK_EVERY, LOOK_EVERY = 10, 50  # exchanges
EXCHANGE = 1e3  # µs, the time that an exchange has
MOST, TINT = 1e6, 0.12  # of the picture: µs, opacity of what is too long
HEADS = ("world", "bodies", "engine", "exchange, median", "p99", "deepest overlap", "energy created", "error")
_NOTHING = (math.nan,) * 3


def main(
    worlds: Annotated[str | None, typer.Option(help="Comma-separated worlds [all].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [some of each].")] = None,
    short: Annotated[bool, typer.Option("--short", help=f"{FEW[0]} bodies and a quarter of the time only.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for growth.csv, growth.md and growth.png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Worlds of 10, 30, 100, 300 bodies: processor time of an exchange, overlap, energy created; some minutes."""
    names, engines = listed(worlds, WORLDS, "world"), usable(methods or ",".join(ENGINES))
    kept, counts, seconds = Kept(), FEW if short else COUNTS, SHORT if short else SECONDS
    whole = sweep(run, {job: (*job, seconds) for job in jobs(names, counts, engines)}, kept)
    found = list(kept.known.values())
    if out and found:
        write(out, found)
    if as_json:
        typer.echo(json.dumps({"runs": [plain(item) for item in found]}))
    else:
        typer.echo(markdown(found))
    if not whole:
        raise typer.Exit(INTERRUPTED)


class Run(NamedTuple):
    """One line of the table: an engine at a step with so many bodies that can move, the tool not counted."""

    world: str
    bodies: int
    engine: str
    step_us: int
    median_us: float
    """Processor time of an exchange of 1 ms, half of them within it; within the next all but a hundredth."""
    p99_us: float
    overlap_um: float
    created: float
    """Energy from nowhere, of the largest about."""
    error_um: float
    """Longest way of a body that should stay, or by which a pin is open; nan where neither is known."""
    status: str = ""
    """Empty; "over" if the timed run was ended at its limit, "partly" if the other alone; or why it cannot be done."""

    @property
    def cannot(self) -> bool:
        """Whether there is nothing to compare."""
        return self.status.startswith("cannot")


def jobs(worlds, counts, engines) -> list[tuple[str, int, str, int]]:
    """(world, bodies asked for, engine, step) of all runs; the row also without any block."""
    return [
        (world, count, engine, step)
        for world in worlds
        for count in (*([0] if world == "row" else []), *counts)
        for engine in engines
        for step in STEPS.get(engine, (STEP,))
    ]


def run(world: str, count: int, engine: str, step: int, seconds: float, limit: float = LIMIT) -> Run:
    """An engine at this step [µs] on a world of about `count` bodies."""
    load = getattr(loads, world)(count, seconds)
    key = (world, sum(not body.fixed for body in load.scene.bodies), engine, step)
    try:
        spent, whole = _timed(load, engine, step, limit)
        judged, seen = _judged(load, engine, step, 0.5 * limit) if whole else (_NOTHING, False)
    except Impossible as reason:
        return Run(*key, math.nan, math.nan, *_NOTHING, f"cannot: {reason}")
    counted = 1e6 * np.array(spent[len(spent) // SETTLED :])
    status = "over" if not whole else "" if seen else "partly"
    return Run(*key, float(np.median(counted)), float(np.percentile(counted, 99)), *judged, status)


def _ready(load, engine, step):
    world = make(engine, load.scene, step * 1e-6, many=True)
    world.couple(GAINS)
    return world


def _timed(load, engine, step, limit):
    """Processor time [s] of each exchange, and whether all were done."""
    path, count = load.path(), 1000 // step
    rollout(_ready(load, engine, step), path[:2], count)  # what is compiled or allocated once is so now
    spent = rollout(_ready(load, engine, step), path, count, limit=limit).spent
    return spent, float(np.sum(spent)) <= limit


def _judged(load, engine, step, limit):
    """Deepest overlap [µm], energy created over the largest about, error [µm]; and whether it came to the end."""
    path, world = load.path(), _ready(load, engine, step)
    look, wrong = overlap_watch(load.scene, world.pose), _error(load, world)
    errors = [wrong()]

    def watched():
        errors.append(wrong())
        return look()

    found = rollout(world, path, 1000 // step, BOOK_EVERY, LOOK_EVERY, overlap=watched, gains=GAINS, limit=limit)
    if not found.finite:
        return (math.inf, math.inf, math.inf), True
    judged = 1e6 * found.overlap, found.created / max(found.scale, 1e-3), 1e6 * np.max(errors)
    return judged, len(found.spent) * BOOK_EVERY >= len(path) - 1


def _error(load, world):
    """() → what is wrong [m] of the bodies that should stay, and of the pins; nan if there are neither."""
    start = {body.name: body.pose for body in load.scene.bodies}

    def wrong():
        ways = [math.dist(world.pose(name)[:2], start[name][:2]) for name in load.still]
        return max([loads.pins_open(load.scene, world.pose)] if load.scene.joints else ways, default=math.nan)

    return wrong


def markdown(runs: list[Run]) -> str:
    """A row for each world, number of bodies and engine."""
    return as_table(HEADS, map(_row, runs))


def _row(item):
    key = [item.world, str(item.bodies), _title(item.engine, item.step_us)]
    over = "over " if item.status == "over" else ""
    times = [f"{over}{item.median_us:.0f} µs", f"{over}{item.p99_us:.0f} µs"]
    if item.cannot:
        return [*key, "cannot", *[""] * 4]
    if over:
        return [*key, *times, *[""] * 3]
    if math.isinf(item.created):
        return [*key, *times, "not finite", *[""] * 2]
    return [*key, *times, _length(item.overlap_um), f"{100.0 * item.created:.2g} %", _length(item.error_um)]


def _length(value):
    return "" if math.isnan(value) else f"{value:.2g} µm" if value < 99.5 else f"{1e-3 * value:.2g} mm"


def _title(engine, step):
    """Name of an engine, with its step [µs] where it is not the one of all."""
    return title(engine) + ("" if step == STEP else f", {step} µs")


def figure(runs: list[Run]) -> Figure:
    """Time of an exchange over the number of bodies, a panel a world: median, p99 thin, tinted where it is too long."""
    of = {f"{world}: {WORLDS[world]}": [] for world in dict.fromkeys(item.world for item in runs)}
    for item in runs:
        of[f"{item.world}: {WORLDS[item.world]}"] += [] if item.cannot else [item]
    more = {
        "thin: 99 % are shorter": Line2D([], [], color=GREY, linewidth=0.8),
        "too long: over 1 ms": Patch(facecolor=FAIL, alpha=TINT),
    }
    return panels(of, _panel, "Time of an exchange, by the number of bodies: lower is better", 2.7, more)


def _panel(axes, runs):
    drawn = {}
    for engine, step in dict.fromkeys((item.engine, item.step_us) for item in runs):
        of = [item for item in runs if (item.engine, item.step_us) == (engine, step)]
        look = LOOKS[engine].line | ({} if step == STEP else {"linestyle": DOTTED})
        bodies = [item.bodies for item in of]
        (drawn[_title(engine, step)],) = axes.plot(
            bodies, [item.median_us for item in of], **look, linewidth=1.5, markersize=6
        )
        axes.plot(bodies, [item.p99_us for item in of], **look | {"marker": ""}, linewidth=0.8, alpha=0.6)
    axes.axhspan(EXCHANGE, MOST, color=FAIL, alpha=TINT, linewidth=0)
    axes.set_xscale("symlog", linthresh=10)
    axes.set(
        yscale="log",
        xlabel="bodies that can move",
        ylabel="time of an exchange [µs]",
        xlim=(-1.0, 400.0),
        ylim=(3.0, MOST),
    )
    axes.set_xticks([0, *COUNTS], map(str, (0, *COUNTS)))
    axes.set_xticks([], minor=True)
    return drawn


def write(folder: Path, runs: list[Run]) -> None:
    """growth.csv, growth.md and growth.png; OSError if they cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "growth.csv", Run, runs)
    head = (
        "# Growth\n\n`python -m bench growth` writes this page. Each time is the processor time of an exchange of 1 "
        f"ms. The first half of a run does not count. Other engines take sub-steps of {STEP} µs unless the table names "
        f"another step, and their bodies may sleep. *Over* means that the run was stopped after {LIMIT:g} s of "
        "processor time. Overlap, energy and error come from a second run, which is stopped after half of that time. "
        "*Error* is the largest motion of a body that should stay, or the gap of a pin.\n\n"
    )
    (folder / "growth.md").write_text(f"{head}{markdown(runs)}\n", encoding="utf-8")
    figure(runs).savefig(folder / "growth.png", dpi=DPI)
