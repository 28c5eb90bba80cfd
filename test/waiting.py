# SPDX-License-Identifier: Apache-2.0
"""Waiting for what must come: for the thing itself, never for a time. A long wait says on the terminal what for."""

import contextlib
import os
import subprocess
import time

LIMIT = 60.0  # [s] for whatever is waited for: a node that starts on a busy machine; no assertion
SAY_AFTER = 20.0  # [s] of waiting, and after as many again
MOST = 1000  # characters of what was said last
terminal = 2  # file descriptor; conftest.py gives the one from before pytest captures


def until(condition, what, look=lambda: time.sleep(0.005), said=lambda: "", limit=None):
    """Does look() until condition() holds, and returns what that gives.

    Raises AssertionError after the limit [s], LIMIT if none is given, with what was waited for and said().
    """
    began, limit, told = time.monotonic(), LIMIT if limit is None else limit, 0.0
    while not (found := condition()):
        waited = time.monotonic() - began
        assert waited < limit, f"not within {limit:g} s: {what}; {said()}"
        if waited - told >= SAY_AFTER:
            tell(f"waits for {what} since {waited:.0f} s; said: {' '.join(str(said()).split())[-MOST:]}")
            told = waited
        look()
    return found


def exit_code(process, said=lambda: ""):
    """Exit code of a process, when it has ended."""
    until(lambda: process.poll() is not None, f"the end of {_name(process)}", said=said)
    return process.returncode


def output(process):
    """What a process has written to its pipes when it has ended, as `communicate` has it."""
    so_far = [b""]

    def ends():
        try:
            return [process.communicate(timeout=0.1)]
        except subprocess.TimeoutExpired as wait:
            so_far[0] = (wait.output or b"") + (wait.stderr or b"")

    what = f"the end of {_name(process)}"
    return until(ends, what, lambda: None, lambda: so_far[0].decode(errors="replace"))[0]


def run(command, **options):
    """As subprocess.run, with the output as text; options as of Popen."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes | options) as process:
        try:
            said = output(process)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, *said)


def tell(sentence):
    """Writes a line to the terminal, past what pytest captures."""
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]
    with contextlib.suppress(OSError):
        os.write(terminal, f"\n{test}: {sentence}\n".encode())


def _name(process):
    words = process.args if isinstance(process.args, str) else " ".join(map(str, process.args))
    return words if len(words) < 200 else f"{words[:90]} … {words[-90:]}"
