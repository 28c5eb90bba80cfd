# SPDX-License-Identifier: Apache-2.0
"""Which method and which peer survives which hard scene."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import Kept, listed, plain, sweep, usable, write_csv
from bench.methods.hard import NAMES, Verdict, verdict
from bench.methods.table import default_method
from bench.methods.world import title
from haptic_sim.cli.progress import INTERRUPTED

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
    count = FEW if short else MANY
    jobs = {(name, world): (name, world, count) for name in listed(scenes, NAMES, "scene") for world in usable(methods)}
    kept = Kept()
    whole = sweep(verdict, jobs, kept)
    found = list(kept.known.values())
    if out:
        out.mkdir(parents=True, exist_ok=True)
        write_csv(out / "hard_cases.csv", Verdict, found)
        (out / "hard_cases.md").write_text(markdown(found) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps({"verdicts": [plain(item) | {"survives": item.survives} for item in found]}))
    else:
        typer.echo(markdown(found))
    if not whole:
        raise typer.Exit(INTERRUPTED)


def markdown(found) -> str:
    """Scene by world, and what the letters mean."""
    worlds = list(dict.fromkeys(item.world for item in found))
    cells = {(item.scene, item.world): item for item in found}
    rows = [["scene", "default", *map(title, worlds)], ["---"] * (2 + len(worlds))]
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
