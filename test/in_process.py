# SPDX-License-Identifier: Apache-2.0
"""Commands without a process of their own, which takes half a second to import what is here already."""

import contextlib
import io
import subprocess
import sys

import pytest

from bench import __main__ as measurements
from haptic_display.cli.main import main


def haptic(*words):
    """What `haptic` with these words exits with and prints; an exception that it lets through is let through here."""
    return _run(main, "haptic", words)


def bench(*words):
    """The same of `python -m bench`."""
    return _run(measurements.main, "bench", words)


def _run(called, name, words):
    code, printed, said = 0, io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [name, *map(str, words)])
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
            try:
                called()
            except SystemExit as ended:
                code = ended.code or 0
    return subprocess.CompletedProcess(words, code, printed.getvalue(), said.getvalue())
