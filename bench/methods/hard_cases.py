# SPDX-License-Identifier: Apache-2.0
"""Which method and which peer survives which hard scene."""

import csv
import json
import math
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import listed, usable
from bench.methods.hard import NAMES, verdict
from bench.methods.table import TITLES, default_method
from haptic_sim.cli.progress import INTERRUPTED, progress
from haptic_sim.supervision.processes import interruptible

LEGEND = (
    "✓ survives · N not finite · T through a wall · P overlap beyond 0.1 mm · E creates more than 1 % of the "
    "energy about · (e) creates more than rounding · – cannot model it"
)
MANY, FEW = 6, 2


def main(
    scenes: Annotated[str | None, typer.Option(help="Comma-separated hard scenes [all].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [all].")] = None,
    short: Annotated[bool, typer.Option("--short", help=f"{FEW} positions of each scene instead of {MANY}.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for hard_cases.csv and hard_cases.md.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Hard scenes, turned and shifted: what stays finite, apart, on its side of walls, and creates no energy."""
    names, worlds = listed(scenes, NAMES), usable(methods)
    for name in names:
        if name not in NAMES:
            raise ValueError(f"scene is {name!r}; the hard ones are {', '.join(NAMES)}")
    found, jobs, whole = [], [(name, world) for name in names for world in worlds], False
    try:
        with interruptible(), progress(len(jobs)) as show:
            for done, (name, world) in enumerate(jobs):
                show(done, f"{name}, {world}")
                found.append(verdict(name, world, FEW if short else MANY))
            show(len(jobs), "done")
            whole = True
    except KeyboardInterrupt:
        typer.echo(f"bench: interrupted; {len(found)} of {len(jobs)} are kept", err=True)
    _report(found, out, as_json)
    if not whole:
        raise typer.Exit(INTERRUPTED)


def _report(found, out, as_json):
    if out and found:
        out.mkdir(parents=True, exist_ok=True)
        with (out / "hard_cases.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(found[0]._fields)
            writer.writerows(
                [f"{value:.4g}" if isinstance(value, float) else value for value in item] for item in found
            )
        (out / "hard_cases.md").write_text(markdown(found) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(
            json.dumps(
                {
                    "verdicts": [
                        {
                            key: None if isinstance(value, float) and not math.isfinite(value) else value
                            for key, value in item._asdict().items()
                        }
                        | {"survives": item.survives}
                        for item in found
                    ]
                }
            )
        )
        return
    typer.echo(markdown(found))


def markdown(found) -> str:
    """Scene by world, and what the letters mean."""
    worlds = list(dict.fromkeys(item.world for item in found))
    cells = {(item.scene, item.world): item for item in found}
    rows = [["scene", "default", *(TITLES.get(world, world) for world in worlds)], ["---"] * (2 + len(worlds))]
    for scene in dict.fromkeys(item.scene for item in found):
        rows.append([scene, default_method(scene), *(_cell(cells.get((scene, world))) for world in worlds)])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + f"\n\n{LEGEND}"


def _cell(item):
    if item is None:
        return ""
    if item.letters.startswith("cannot"):
        return "–"
    failed = "".join(letter for letter in item.letters if letter in "NTPE")
    return failed or ("✓ (e)" if "e" in item.letters else "✓")
