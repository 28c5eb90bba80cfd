# SPDX-License-Identifier: Apache-2.0
"""How commands write tables, refusals, paths and the line on what to do next."""

import contextlib
import os
import shlex
import sys
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer

from haptic_device.os_errors import in_words
from haptic_device.process import say
from haptic_display.cli.progress import INTERRUPTED

PIPED = 120  # columns of a table that goes to a file, where COLUMNS does not say


def console():
    """Where tables go: standard output, as wide as the terminal or COLUMNS."""
    from rich.console import Console

    return Console(width=None if _width_is_known() else PIPED)


def table(columns: Iterable[Any], rows: Iterable[Iterable[str | tuple[str, str]]], **look: Any):
    """A rich.table.Table. columns: headings, or rich's own; a cell: text, or text and style. No text is markup."""
    from rich.table import Column, Table
    from rich.text import Text

    made = Table(*(Column(Text(each)) if isinstance(each, str) else each.copy() for each in columns), **look)
    for row in rows:
        made.add_row(*(Text(cell) if isinstance(cell, str) else Text(*cell) for cell in row))
    return made


def print_sentence(text: str, indent: int = 0) -> None:
    """On standard output, broken between words where the width is known; piped, on one line. Indent: of later lines."""
    lines = [text]
    if _width_is_known():
        lines = textwrap.wrap(text, console().width, subsequent_indent=" " * indent, break_long_words=False)
    print("\n".join(lines))


def _width_is_known() -> bool:
    return sys.stdout.isatty() or "COLUMNS" in os.environ


@contextlib.contextmanager
def refused(command: str, kept: str = "") -> Iterator[None]:
    """What cannot be done is said in one sentence, exit code 2; interrupted: 130, and what is kept is said."""
    from haptic_display.run.processes import NodeDiedError, interruptible

    try:
        with interruptible():
            yield
    except (ValueError, OSError, NodeDiedError) as error:
        say(f"haptic {command}: {in_words(error)}")
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        if kept:
            say(f"haptic {command}: interrupted; {kept}")
        raise typer.Exit(INTERRUPTED) from None


def next_step(text: str) -> None:
    """Says on standard error what to do now."""
    say(f"next: {text}")


def shown_path(path: Path | str) -> str:
    """A path as one would type it in this folder."""
    path, here = Path(path), Path.cwd()
    return shlex.quote(str(path.relative_to(here) if path.is_relative_to(here) else path))
