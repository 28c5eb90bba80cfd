# SPDX-License-Identifier: Apache-2.0
"""Tables that commands print: what came of a run, and runs side by side."""

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text  # what nodes have said may look like markup

from haptic_device.analysis.report.digits import with_error
from haptic_device.analysis.report.run import Run
from haptic_device.control.withheld import TABLE
from haptic_device.status import number

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
    if found["late"]:
        console.print(Text(found["late"]), soft_wrap=True)
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
        elif name not in ("scene", "done", "why", "cause", "late", "bag", "report"):
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


def print_comparison(runs: dict[str, Run]) -> None:
    """Prints one line for each run."""
    table = Table("run", *FIGURES)
    for name, run in runs.items():
        table.add_row(name, *figures_of(run))
    Console(width=max(100, 30 + 18 * len(FIGURES))).print(table)


def figures_of(run: Run) -> list[str]:
    """The figures of one run as in FIGURES; a dash where the run does not tell."""
    return [_told(figure, run) for figure in FIGURES.values()]


def _told(figure, run: Run) -> str:
    try:
        return figure(run)
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
    return f"{np.sqrt(np.mean(_known(run.distance) ** 2, dtype=float)) * 1e3:.4f}"


def _energy(run: Run) -> str:
    """Largest energy given to the operator: by the truth, or else by the servo's books."""
    try:
        return f"{np.max(_known(run.given)) * 1e3:.3f}"
    except ValueError:
        return f"{np.max(_known(run.booked)) * 1e3:.3f} booked"


def _wave(run: Run) -> str:
    found = run.spectrum.oscillation
    return "none" if found is None else f"{found.frequency:.0f} Hz, {found.force:.2g} N"


def _margin(run: Run) -> str:
    return f"{float(np.min(_known(run.rows['margin'][:, :2]))):.3f} N s/m"


def _cpu(run: Run) -> str:
    """In lock-step the share of a core that plant, servo and simulation would need in real time."""
    share = number(run.recording.last_values("haptic_replay").get("cpu_share", ""))
    if np.isnan(share):
        raise ValueError("a live run")
    return f"{100 * share:.1f}"


FIGURES = {
    "stiffness N/m": _stiffness,
    "error mm": _error,
    "energy given mJ": _energy,
    "oscillation": _wave,
    "margin": _margin,
    "CPU %": _cpu,
}
