# SPDX-License-Identifier: Apache-2.0
"""Tables that commands print: what came of a run, and runs side by side."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table
from rich.text import Text  # what nodes have said may look like markup

from haptic_device.analysis.report.run import Run
from haptic_device.digits import amount, plain, with_error
from haptic_device.process import say
from haptic_device.status import number
from haptic_sim.cli.outcome_rows import answer, rows
from haptic_sim.cli.words import console, print_sentence


def print_outcome(found: dict, everything: bool = False) -> None:
    """Prints the answer and the first figures, or all, as a table on standard output, and why the job was not done;
    without figures neither."""
    title = f"{found['scene']}: {'done' if found['done'] else 'NOT done'}"
    if found["done"] and (found.get("task") or "done") != "done":
        title = f"{found['scene']}: the run is complete, the task is not done"
    if found["exchange"]:
        table = Table(title=Text(title), show_header=False)
        for some in (answer(found), rows(found, everything)):
            for words, value in some:
                table.add_row(Text(words), Text(value))
            table.add_section()
        console().print(table)
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
    table = Table("run", *map(escape, FIGURES))
    for name, run in runs.items():
        table.add_row(name, *figures_of(run))
    console().print(table)


def figures_of(run: Run) -> list[str]:
    """The figures of one run as in FIGURES; a dash where the run does not tell."""
    return [_told(found, run) for found in FIGURES.values()]


def _told(found, run: Run) -> str:
    try:
        return found(run)
    except (ValueError, IndexError):
        return "—"


def _known(values: np.ndarray) -> np.ndarray:
    """Those that are numbers. Raises ValueError if there is none."""
    known = values[np.isfinite(values)]
    if not len(known):
        raise ValueError("nothing of it is a number")
    return known


def _stiffness(run: Run) -> str:
    """Fitted in contact, in the axis that tells most."""
    found = [fitted for (kind, axis), fitted in run.impedances.items() if kind == "contact" and axis != "theta"]
    best = min(found, key=lambda fitted: fitted.stiffness.error / abs(fitted.stiffness.value))
    return with_error(best.stiffness.value, best.stiffness.error)


def _error(run: Run) -> str:
    """RMS of the distance from handle to tool."""
    return plain(float(np.sqrt(np.mean(_known(run.distance) ** 2, dtype=float))) * 1e3)


def _energy(run: Run) -> str:
    """Largest energy given to the operator: by the truth, or else as the servo counts it."""
    try:
        return plain(float(np.max(_known(run.given))) * 1e3)
    except ValueError:
        return f"{plain(float(np.max(_known(run.booked))) * 1e3)} by the servo"


def _wave(run: Run) -> str:
    found = run.spectrum.oscillation
    return "none" if found is None else f"{plain(found.frequency, 'Hz')}, {amount(found.force, 'N')}"


def _margin(run: Run) -> str:
    return plain(float(np.min(_known(run.rows["margin"][:, :2]))))


def _cpu(run: Run) -> str:
    """In lock-step the share of a core that plant, servo and simulation would need in real time."""
    share = number(run.recording.last_values("haptic_replay").get("cpu_share", ""))
    if np.isnan(share):
        raise ValueError("a live run")
    return f"{100 * share:.1f}"


FIGURES = {
    "stiffness [N/m]": _stiffness,
    "error [mm]": _error,
    "energy given [mJ]": _energy,
    "oscillation": _wave,
    "least margin [N s/m]": _margin,
    "CPU [%]": _cpu,
}
