# SPDX-License-Identifier: Apache-2.0
"""What the long measurements have in common: whom to ask, how far it is, the exit code of an interrupted one."""

import contextlib
import sys
import time

import typer

INTERRUPTED = 130


def listed(given: str | None, known) -> tuple[str, ...]:
    """Names of a comma-separated option, else all that are known."""
    return tuple(part.strip() for part in given.split(",")) if given else tuple(known)


def usable(given: str | None) -> list[str]:
    """Methods and peers of the option that are installed; a sentence on standard error for those that are not."""
    from haptic_sim.bench.world import NAMES, missing

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
