# SPDX-License-Identifier: Apache-2.0
"""How commands write tables, paths and the line on what to do next."""

import os
import shlex
import sys
import textwrap
from pathlib import Path

from haptic_device.process import say

PIPED = 120  # columns of a table that goes to a file, where COLUMNS does not say


def console():
    """Where tables go: standard output, as wide as the terminal or COLUMNS."""
    from rich.console import Console

    return Console(width=None if _width_is_known() else PIPED)


def print_sentence(text: str, indent: int = 0) -> None:
    """On standard output, broken between words where the width is known; piped, on one line. Indent: of later lines."""
    lines = [text]
    if _width_is_known():
        lines = textwrap.wrap(text, console().width, subsequent_indent=" " * indent, break_long_words=False)
    print("\n".join(lines))


def _width_is_known() -> bool:
    return sys.stdout.isatty() or "COLUMNS" in os.environ


def next_step(text: str) -> None:
    """Says on standard error what to do now."""
    say(f"next: {text}")


def shown_path(path: Path | str) -> str:
    """A path as one would type it in this folder."""
    path, here = Path(path), Path.cwd()
    return shlex.quote(str(path.relative_to(here) if path.is_relative_to(here) else path))
