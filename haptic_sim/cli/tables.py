# SPDX-License-Identifier: Apache-2.0
"""Tables that commands print: what came of a run, and runs side by side."""

import sys
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text  # what nodes have said may look like markup

from haptic_device.control.withheld import TABLE
from haptic_sim.replay.comparison import COLUMNS

FORCES = {
    "contact max_force_n": "strongest contact [N]",
    "contact max_on_hand_n": "strongest on the hand [N]",
    "contact max_penetration_m": "deepest overlap [m]",
}
"""The report's words for what the simulation and the hand had to bear."""
WITHHELD = {f"withheld_s {each.name}": f"force withheld [s]: {each.cause}" for each in TABLE}


def print_outcome(found: dict) -> None:
    """Prints the figures as a table on standard output."""
    table = Table("figure", "value", title=Text(f"{found['scene']}: {'done' if found['done'] else 'NOT done'}"))
    for name, value in _lines(_with_greatest(found)):
        table.add_row(Text((FORCES | WITHHELD).get(name, name)), Text(value))
    console = Console()
    console.print(table)
    if found["why"]:
        console.print(Text(f"not done because {found['why']}"), soft_wrap=True)
    if cause := (found["exchange"] or {}).get("cause"):
        console.print(Text(cause), soft_wrap=True)
    for name in ("bag", "report"):
        console.print(f"{name:8}{found[name] or 'none'}", soft_wrap=True, highlight=False)


def _with_greatest(found: dict) -> dict:
    """The figures with what the scene measures told by its last and its greatest value."""
    last, greatest = found["result"], {**found["result"], **found["result_greatest"]}
    told = {name: f"last {_text(last[name])}, greatest {_text(greatest[name])}" for name in last}
    return {name: value for name, value in (found | {"result": told}).items() if name != "result_greatest"}


def _lines(found: dict):
    for name, value in found.items():
        if isinstance(value, dict):
            yield from ((f"{name} {inner}", text) for inner, text in _lines(value))
        elif name not in ("scene", "done", "why", "cause", "bag", "report"):
            yield name, _text(value)


def _text(value) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(value) or "none"
    return "unknown" if value is None else str(value)


def print_notes(bag: Path | str, notes: Iterable[str]) -> None:
    """Prints what is wrong with a bag on standard error, a line each."""
    for note in notes:
        print(f"{bag}: {note}", file=sys.stderr)


def print_comparison(figures: dict[str, dict[str, str]]) -> None:
    """Prints one line for each run: {run: its figures by COLUMNS}."""
    table = Table("run", *COLUMNS)
    for name, row in figures.items():
        table.add_row(name, *row.values())
    Console(width=max(100, 30 + 18 * len(COLUMNS))).print(table)
