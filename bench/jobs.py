# SPDX-License-Identifier: Apache-2.0
"""What the long measurements have in common: whom to ask, and what is done kept in a table."""

import contextlib
import csv
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import typer

from haptic_device.analysis.sweep import spread

WORKERS = "Processes at once [one a core]."


class Kept:
    """Rows of a table, kept in a CSV file as they come: what the file has is not done again. Without a path, in memory.

    `kind` is the NamedTuple of a row, `key` says which run a row is of.
    """

    def __init__(self, path: Path | None, kind: type, key: Callable):
        self._path, self._key, self.known = path, key, {}
        if path is None:
            return
        if not path.parent.is_dir():
            raise ValueError(f"{path} cannot be written: there is no folder {path.parent}")
        if path.exists():
            self.known = {key(row): row for row in read_csv(path, kind)}
            write_csv(path, kind, self.known.values())  # without a line that was torn off

    def keep(self, row) -> None:
        """Keeps a row, at once."""
        self.known[self._key(row)] = row
        if self._path is not None:
            new = not self._path.exists()
            with self._path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([*([row._fields] if new else []), row])


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


def sweep(function, jobs: dict, kept: Kept, workers: int, scheduler: str = "", show=lambda done, what: None) -> None:
    """Runs the jobs {key: arguments} that `kept` does not know yet; the row that each comes to is kept as it comes.

    By processes, by the workers of the scheduler, or here if one worker is enough. Raises ValueError, one sentence, for
    a scheduler that is not there or goes away.
    """
    todo = {key: arguments for key, arguments in jobs.items() if key not in kept.known}
    done = len(jobs) - len(todo)
    show(done, "begins")
    many = scheduler or min(workers, len(todo)) > 1
    alone = ((key, function(*arguments)) for key, arguments in todo.items())
    with contextlib.closing(spread(function, todo, workers, scheduler) if many else alone) as results:
        for key, row in results:
            kept.keep(row)
            done += 1
            show(done, ", ".join(map(str, key)))


@contextlib.contextmanager
def deaths_told():
    """A node that ends by itself ends the command as any refusal does: ValueError with its sentence."""
    from haptic_sim.supervision.processes import NodeDiedError

    try:
        yield
    except NodeDiedError as error:
        raise ValueError(str(error)) from None


def listed(given: str | None, known) -> tuple[str, ...]:
    """Names of a comma-separated option, else all that are known."""
    return tuple(part.strip() for part in given.split(",")) if given else tuple(known)


def usable(given: str | None) -> list[str]:
    """Methods and peers of the option that are installed; a sentence on standard error for those that are not."""
    from bench.methods.world import NAMES, missing

    names = listed(given, NAMES)
    for name in names:
        if name not in NAMES:
            raise ValueError(f"method is {name!r}; it must be one of {', '.join(NAMES)}")
    reasons = {name: missing(name) for name in names}
    for reason in filter(None, reasons.values()):
        typer.echo(f"bench: {reason}", err=True)
    return [name for name in names if not reasons[name]]
