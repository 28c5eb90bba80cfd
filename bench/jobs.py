# SPDX-License-Identifier: Apache-2.0
"""What the long measurements have in common: whom to ask, how far it is, the exit code of an interrupted one."""

import contextlib
import json
import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

import typer

INTERRUPTED = 130
SCHEDULER = "Address of a Dask scheduler (tcp://host:8786) whose workers do the runs, instead of this machine's cores."
WORKERS = "Processes at once [one a core]."
RESUME = "File that keeps every run as it is done; the same command with it goes on from there."


class Crew(NamedTuple):
    """Who does the runs: so many workers here, or those behind a scheduler."""

    workers: int
    scheduler: str = ""


class Kept:
    """What came of a sweep's runs, line by line in a file from which the sweep goes on; without a path, in memory."""

    def __init__(self, path: Path | None, of: str):
        """`of` says what the sweep is of. ValueError, one sentence, for a file that is of another one."""
        self._path, self.known = path, {}
        if path is None:
            return
        lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []  # a torn last line is none
        if lines and json.loads(lines[0]) != of:
            raise ValueError(f"resume file {path} is of another sweep; delete it or name another")
        self.known = {key: values for key, values in map(json.loads, lines[1:])}
        beside = path.with_name(path.name + ".part")  # no half file is ever under its name
        beside.write_text("".join(f"{line}\n" for line in lines or [json.dumps(of)]), encoding="utf-8")
        os.replace(beside, path)

    def keep(self, key: str, values) -> None:
        """Keeps what JSON can say of a run."""
        self.known[key] = list(values)
        if self._path is not None:
            with open(self._path, "a", encoding="utf-8") as file:
                file.write(json.dumps([key, self.known[key]]) + "\n")


def sweep(function, jobs: dict, crew: Crew, kept: Kept, show=lambda done, what: None) -> None:
    """Runs the jobs {key: arguments} that `kept` does not know yet; what comes of each is kept as it comes.

    By processes, by the workers of the scheduler, or here if one worker is enough. Raises ValueError, one sentence, for
    a scheduler that is not there or goes away; what was done is kept.
    """
    from haptic_device.analysis.sweep import spread

    todo = {key: arguments for key, arguments in jobs.items() if key not in kept.known}
    workers = min(crew.workers, len(todo))
    alone = ((key, function(*arguments)) for key, arguments in todo.items())
    many = crew.scheduler or workers > 1
    results = spread(function, todo, workers, crew.scheduler, processes=True) if many else alone
    show(len(jobs) - len(todo), "begins")
    with contextlib.closing(results):
        for key, found in results:
            kept.keep(key, found)
            show(len(kept.known), key)


@contextlib.contextmanager
def deaths_told():
    """A node that ends by itself ends the command as any refusal does: ValueError with its sentence."""
    from haptic_sim.cli.processes import NodeDiedError

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
        typer.echo(f"haptic bench: {reason}", err=True)
    return [name for name in names if not reasons[name]]


def progress(total: int):
    """Context of a function (runs done, what is next) on standard error: a bar on a terminal, else some lines."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    @contextlib.contextmanager
    def lines():
        last = [0.0]

        def show(done, what):
            if time.monotonic() - last[0] > 5.0 or done == total:
                last[0] = time.monotonic()
                print(f"{done}/{total} {what}", file=sys.stderr, flush=True)

        yield show

    @contextlib.contextmanager
    def bar():
        columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
        with Progress(*columns, console=Console(file=sys.stderr)) as shown:
            task = shown.add_task("", total=total)
            yield lambda done, what: shown.update(task, completed=done, description=what)

    return bar() if sys.stderr.isatty() else lines()
