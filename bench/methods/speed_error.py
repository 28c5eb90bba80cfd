# SPDX-License-Identifier: Apache-2.0
"""Wall time against error of every method and peer on every scene, at every step."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import Kept, listed, plain, sweep, usable, write_csv
from bench.methods import table
from bench.methods.figure import DPI, pareto_figure
from bench.methods.measure import Run, run
from bench.methods.world import PEERS, title, version
from bench.reference.case import NAMES, case
from bench.reference.reference import reference
from haptic_display.cli.progress import INTERRUPTED

SHORT = ("pendulum", "four_bar", "wall", "zeno_ball", "push_block", "peg_in_hole")
STEPS, SHORT_STEPS = (50000, 25000, 10000, 5000, 2500, 1000, 500, 250, 100, 50, 25), (10000, 1000, 250)  # µs
_OUT = "Folder for speed_error.csv, speed_error.md and pareto.png; runs in it are not done again [nothing kept]."
_SHORT = f"Scenes {', '.join(SHORT)} and steps {', '.join(f'{step * 1e-3:g}' for step in SHORT_STEPS)} ms only."


def main(
    scenes: Annotated[str | None, typer.Option(help="Comma-separated cases [all that have a reference].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [all].")] = None,
    short: Annotated[bool, typer.Option("--short", help=_SHORT)] = False,
    out: Annotated[Path | None, typer.Option(help=_OUT)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Wall time against error of every method and peer on every scene, energy created and overlap; one table."""
    names = listed(scenes, SHORT if short else NAMES)
    jobs = _jobs(names, usable(methods), SHORT_STEPS if short else STEPS)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    kept = Kept(out / "speed_error.csv" if out else None, Run, lambda row: (row.scene, row.method, row.step_us))
    whole = sweep(measured, jobs, kept)
    _report(_runs(jobs, kept), [row for key, row in kept.known.items() if key not in jobs], out, as_json)
    if not whole:
        raise typer.Exit(INTERRUPTED)


def _jobs(scenes, methods, steps):
    """{(scene, method, step [µs]): the same}"""
    jobs = {}
    for name in scenes:
        found = case(name)
        reference(name)  # a case without one is refused before anything runs
        wanted = [step for step in steps if 1000 * step <= found.period]
        jobs |= {(name, method, step): (name, method, step) for method in methods for step in wanted}
    return jobs


def measured(name: str, method: str, step: int):
    """The run of a method on a case at this step [µs]."""
    return run(case(name), reference(name), method, step)


def _runs(jobs, kept):
    """What is known of the jobs, in their order; what a method cannot do counts once, at whatever step."""
    runs, impossible = [], set()
    for key in jobs:
        if key in kept.known and key[:2] not in impossible:
            runs.append(kept.known[key])
            if runs[-1].status.startswith("cannot"):
                impossible.add(key[:2])
    return runs


def _report(runs, others, out, as_json):
    if out and runs:
        write_csv(out / "speed_error.csv", Run, [*runs, *others])
        (out / "speed_error.md").write_text(_page(runs), encoding="utf-8")
        pareto_figure(runs).savefig(out / "pareto.png", dpi=DPI)
    if as_json:
        typer.echo(json.dumps(_content(runs)))
        return
    typer.echo(table.markdown(runs))
    for kind, peer, least, wanted, reached, count in table.summary(runs):
        typer.echo(
            f"{kind} against {title(peer)}: at equal error at least {least:.3g} times as fast; "
            f"{reached} of {count} scenes reach {wanted:g}"
        )


def _page(runs):
    return (
        "# Speed against error\n\n`python -m bench speed_error` writes this page. For each scene the table shows "
        "`impulse`, the default method (in bold) and `partitioned`, each with the step that the scene gives it. *Of an "
        "exchange* is the wall time as a share of the simulated time. The last columns compare with other engines. "
        "They show how many times faster the best of `closed_form`, `partitioned` and `event_driven` is, at the "
        "smallest error that both sides reach. ✗ marks a ratio below the goal. The goal is 15 for linkages against "
        "RK4, 5 for single contacts and 1 for all others.\n\n"
        f"{table.markdown(runs)}\n\n## Where a peer is ahead\n\n"
        "Here a peer is faster than the best of `closed_form`, `partitioned` and `event_driven` by more than "
        f"{100 * (table.AHEAD - 1):.0f} %.\n\n"
        f"{table.told_leads(runs)}\n"
    )


def _content(runs):
    equal = [
        ratio._asdict() | {"ratio": ratio.ratio}
        for of_scene in table.by_scene(runs).values()
        for ratio in table.ratios(of_scene)
    ]
    used = {item.method for item in runs}
    return {
        "runs": [plain(item) for item in runs],
        "equal_error": equal,
        "versions": {name: version(name) for name in PEERS if name in used},
    }
