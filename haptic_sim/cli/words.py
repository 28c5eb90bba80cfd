# SPDX-License-Identifier: Apache-2.0
"""How commands write numbers, tables and the line on what to do next."""

import math
import os
import shlex
import sys
import textwrap
from pathlib import Path

PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
PREFIXED = ("m", "s", "J", "m/s")
NONE = 1e-9  # of any unit: what is less is rounding
PIPED = 120  # columns of a table that goes to a file, where COLUMNS does not say


def figure(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, without exponent below a million; a count as it is."""
    if isinstance(value, int):
        return str(value)
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text


def amount(value: float, unit: str) -> str:
    """A number with its unit, which is of SI without prefix; of metres, seconds and joules the prefix that suits."""
    if abs(value) < NONE:
        return f"0 {unit}".rstrip()
    if unit not in PREFIXED or not math.isfinite(value):
        return f"{figure(value)} {unit}".rstrip()
    factor, prefix = next((one for one in PREFIXES if abs(value) >= 0.9995 * one[0]), PREFIXES[-1])
    return f"{figure(value / factor)} {prefix}{unit}"


def with_error(value: float, error: float | None) -> str:
    """A number with its error, both to the second digit of the error; without one, to three digits."""
    if error is None or not (math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return figure(value)
    digits = 1 - math.floor(math.log10(error))
    return " ± ".join(f"{round(one, digits):.{max(0, digits)}f}" for one in (value, error))


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
    print(f"next: {text}", file=sys.stderr, flush=True)


def shown_path(path: Path | str) -> str:
    """A path as one would type it in this folder."""
    path, here = Path(path), Path.cwd()
    return shlex.quote(str(path.relative_to(here) if path.is_relative_to(here) else path))
