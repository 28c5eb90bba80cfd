# SPDX-License-Identifier: Apache-2.0
"""Tables that commands print: what came of a run, and runs side by side."""

from collections.abc import Iterable
from pathlib import Path

from rich.text import Text  # a scene's name may look like markup

from haptic_device.process import say
from haptic_display.cli.outcome_rows import answer, rows
from haptic_display.cli.words import console, print_sentence, table
from haptic_display.run.report.quantities import QUANTITIES
from haptic_display.run.report.run import Run


def print_outcome(found: dict, everything: bool = False) -> None:
    """Prints the answer and the first figures, or all, as a table on standard output, and why the job was not done;
    without figures neither."""
    title = f"{found['scene']}: {'done' if found['done'] else 'NOT done'}"
    if found["done"] and (found.get("task") or "done") != "done":
        title = f"{found['scene']}: the run is complete, the task is not done"
    if found["exchange"]:
        first, others = list(answer(found)), list(rows(found, everything))
        shown = table(("", ""), first + others, title=Text(title), show_header=False)
        shown.rows[len(first) - 1].end_section = True
        console().print(shown)
        if found["why"]:
            print_sentence(f"not done because {found['why']}")
        for sentence in filter(None, (found["exchange"].get("cause"), found["late"])):
            print_sentence(sentence)
    else:
        print(title)
    for name in ("bag", "report"):
        print(f"{name:8}{found[name] or 'none'}")


def print_notes(bag: Path | str, notes: Iterable[str]) -> None:
    """Prints what is wrong with a bag on standard error, a line each."""
    for note in notes:
        say(f"{bag}: {note}")


def print_comparison(runs: dict[str, Run]) -> None:
    """Prints one line for each run."""
    told = {name: compared(run) for name, run in runs.items()}
    rows = ((name, *found.values()) for name, found in told.items())
    console().print(table(("run", *next(iter(told.values()))), rows))


def compared(run: Run) -> dict[str, str]:
    """What the table of several runs tells of one, by column; a dash where the run does not tell."""
    return {one.column: one.text(run) for one in QUANTITIES if one.column}
