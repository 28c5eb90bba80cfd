# SPDX-License-Identifier: Apache-2.0
"""What the long measurements have in common: whom to ask, and what is done kept in a table."""

import contextlib
import csv
import math
import os
import statistics
from collections.abc import Callable, Iterable
from pathlib import Path

import typer

from haptic_device.theory.sweep import spread
from haptic_display.cli.progress import progress

WORKERS = "Processes at once [one a core]."


class Kept:
    """Rows of a table, kept in a CSV file as they come: what the file has is not done again. Without a path, in memory.

    `kind` is the NamedTuple of a row, `key` says which run a row is of.
    """

    def __init__(self, path: Path | None = None, kind: type = tuple, key: Callable = hash):
        self._path, self._kind, self.known = path, kind, {}
        if path is None:
            return
        if not path.parent.is_dir():
            raise ValueError(f"{path} cannot be written: there is no folder {path.parent}")
        if path.exists():
            self.known = {key(row): row for row in read_csv(path, kind)}

    def keep(self, key, row) -> None:
        """Keeps the row of a run, at once."""
        self.known[key] = row
        if self._path is not None:
            write_csv(self._path, self._kind, self.known.values())


def write_csv(path: Path, kind: type, rows: Iterable) -> None:
    """Writes NamedTuples of a kind, a line each; no half file is ever under its name."""
    beside = path.with_name(path.name + ".part")
    with beside.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(kind._fields)
        out.writerows(rows)
    os.replace(beside, path)


def read_csv(path: Path, kind: type) -> list:
    """The rows of a file, as NamedTuples; a last line that was torn off is none. ValueError if it is no such file."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    if not lines or lines[0].strip().split(",") != list(kind._fields):
        raise ValueError(f"{path} has not the columns {', '.join(kind._fields)}")
    whole = lines if lines[-1].endswith("\n") else lines[:-1]
    try:
        return [
            kind(*(_READ[kind.__annotations__[name]](text) for name, text in zip(kind._fields, row, strict=True)))
            for row in csv.reader(whole[1:])
        ]
    except ValueError:
        raise ValueError(f"{path} has a line that is no row of {', '.join(kind._fields)}") from None


_READ = {str: str, int: int, float: float, bool: "True".__eq__}


def sweep(function, jobs: dict, kept: Kept, workers: int = 1) -> bool:
    """Runs the jobs {key: arguments} that `kept` does not know yet; the row that each comes to is kept as it comes.

    By processes, or here if one worker is enough. Whether all were done: Ctrl-C ends it, and is said.
    """
    todo = {key: arguments for key, arguments in jobs.items() if key not in kept.known}
    alone = ((key, function(*arguments)) for key, arguments in todo.items())
    try:
        with progress(len(jobs)) as show:
            show(len(jobs) - len(todo), "begins")
            many = min(workers, len(todo)) > 1
            with contextlib.closing(spread(function, todo, workers) if many else alone) as results:
                for key, row in results:
                    kept.keep(key, row)
                    show(len(kept.known.keys() & jobs), ", ".join(map(str, key)))
        return True
    except KeyboardInterrupt:
        typer.echo(f"bench: interrupted; {len(kept.known.keys() & jobs)} of {len(jobs)} runs are kept", err=True)
        return False


def plain(row) -> dict:
    """A row for JSON, with null for a number that is none."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in row._asdict().items()
    }


def markdown(heads, rows) -> str:
    """A table; numbers with four digits, a dash for what there is not."""
    return "\n".join(f"| {' | '.join(map(_cell, row))} |" for row in (heads, ["---"] * len(heads), *rows))


def _cell(value):
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1e4 else f"{value:.4g}"
    return "–" if value is None else str(value)


def medians(rows: list[dict], names: Iterable[str]) -> dict:
    """{name: median over the rows that have a number}; None where none has one."""
    known = {name: [row[name] for row in rows if row[name] is not None] for name in names}
    return {name: statistics.median(values) if values else None for name, values in known.items()}


def listed(given: str | None, known, what: str = "") -> tuple[str, ...]:
    """Names of a comma-separated option, else all that are known; ValueError for another `what`."""
    names = tuple(part.strip() for part in given.split(",")) if given else tuple(known)
    for name in names if what else ():
        if name not in known:
            raise ValueError(f"{what} is {name!r}; it must be one of {', '.join(known)}")
    return names


def usable(given: str | None) -> list[str]:
    """Methods and peers of the option that are installed; a sentence on standard error for those that are not."""
    from bench.methods.world import NAMES, missing

    names = listed(given, NAMES, "method")
    reasons = {name: missing(name) for name in names}
    for reason in filter(None, reasons.values()):
        typer.echo(f"bench: {reason}", err=True)
    return [name for name in names if not reasons[name]]
