# SPDX-License-Identifier: Apache-2.0
"""What long commands share: how far they are, the exit code of an interrupted one, the option of a scheduler."""

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator

from haptic_device.process import say

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
                say(f"{done}/{total} {what}")

        yield show

    @contextlib.contextmanager
    def bar():
        columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
        with Progress(*columns, console=Console(file=sys.stderr)) as shown:
            task = shown.add_task("", total=total)
            yield lambda done, what: shown.update(task, completed=done, description=what)

    return bar() if sys.stderr.isatty() else lines()


@contextlib.contextmanager
def status_line(seldom: float = 1.0) -> Iterator[Callable[[str], None]]:
    """On a terminal one line that is kept up to date; elsewhere a line, and the next after so many seconds."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    began, last = time.monotonic(), -math.inf
    console = Console(stderr=True)

    def print_seldom(line: str) -> None:
        nonlocal last
        if time.monotonic() - last >= seldom:
            last = time.monotonic()
            say(stamped(line))

    def stamped(line: str) -> str:
        return f"{time.monotonic() - began:6.1f} s   {line}"

    if not console.is_terminal:
        yield print_seldom
        return
    with Live(console=console, auto_refresh=False) as display:
        yield lambda line: display.update(Text(stamped(line)), refresh=True)
