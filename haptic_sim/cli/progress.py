# SPDX-License-Identifier: Apache-2.0
"""What long commands share: how far they are, the exit code of an interrupted one, the option of a scheduler."""

import contextlib
import sys
import time

INTERRUPTED = 130
SCHEDULER = "Address of a Dask scheduler (tcp://host:8786) whose workers do the runs, instead of this machine's cores."


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
