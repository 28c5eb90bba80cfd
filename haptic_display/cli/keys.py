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
    """Yields a function that returns the key pressed since the last look, or ""; without a terminal, or in its
    background, always ""."""
    try:
        descriptor = sys.stdin.fileno()
        before = None if _in_background(descriptor) else termios.tcgetattr(descriptor)
    except (OSError, ValueError, AttributeError, termios.error):
        before = None
    if before is None:
        yield lambda: ""
        return
    tty.setcbreak(descriptor)
    try:
        yield lambda: _pressed(descriptor)
    finally:
        if not _in_background(descriptor):
            with contextlib.suppress(termios.error):  # the terminal may have been closed
                termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


@contextlib.contextmanager
def stop_key() -> Iterator[Callable[[], bool] | None]:
    """Yields a function that says whether the e-stop's key has been pressed; None without a terminal, or in its
    background."""
    with keys() as pressed:
        heard = sys.stdin and sys.stdin.isatty() and not _in_background(sys.stdin.fileno())
        yield (lambda: pressed() == ESTOP) if heard else None


def _in_background(descriptor: int) -> bool:
    """Whether the shell has the terminal: who reads it or changes it then is stopped (SIGTTIN, SIGTTOU)."""
    try:
        return os.tcgetpgrp(descriptor) != os.getpgrp()
    except OSError:  # it is not the terminal that this process was started from
        return False


def _pressed(descriptor: int) -> str:
    if _in_background(descriptor) or not select.select([descriptor], [], [], 0.0)[0]:
        return ""
    try:
        typed = os.read(descriptor, 64).decode(errors="replace")
    except OSError:
        return ""
    return ESTOP if ESTOP in typed else typed[-1:]  # of several keys at once the one that stops counts
