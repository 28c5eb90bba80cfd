# SPDX-License-Identifier: Apache-2.0
"""Keys of the terminal, read as they are pressed and never waited for."""

import contextlib
import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator

ESTOP = " "


@contextlib.contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """Yields a function that returns the key pressed since the last look, or ""; without a terminal always ""."""
    try:
        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor)
    except (OSError, ValueError, AttributeError, termios.error):
        yield lambda: ""
        return
    tty.setcbreak(descriptor)
    try:
        yield lambda: _pressed(descriptor)
    finally:
        with contextlib.suppress(termios.error):  # the terminal may have been closed
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


@contextlib.contextmanager
def stop_key() -> Iterator[Callable[[], bool] | None]:
    """Yields a function that says whether the e-stop's key has been pressed; None without a terminal."""
    with keys() as pressed:
        yield (lambda: pressed() == ESTOP) if sys.stdin and sys.stdin.isatty() else None


def _pressed(descriptor: int) -> str:
    if not select.select([descriptor], [], [], 0.0)[0]:
        return ""
    try:
        typed = os.read(descriptor, 64).decode(errors="replace")
    except OSError:
        return ""
    return ESTOP if ESTOP in typed else typed[-1:]  # of several keys at once the one that stops counts
