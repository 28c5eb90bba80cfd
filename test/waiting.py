# SPDX-License-Identifier: Apache-2.0
"""Waiting for what must come: for the thing itself, never for a time. A long wait says on the terminal what for."""

import contextlib
import linecache
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

LIMIT = 60.0  # [s] for whatever is waited for: a node that starts on a busy machine; no assertion
SAY_AFTER = 20.0  # [s] of waiting, and after as many again
MOST = 1000  # characters of what was said last
LOOK = 1.0  # [s] between two looks of who watches the waits that do not look themselves
YOUNG = 0.25  # of SAY_AFTER, in which nobody looks where a test stands: to look at its frames costs it memory
TESTS = str(Path(__file__).parent)
_looks = [0]  # of `until`, all there were
terminal = 2  # file descriptor; conftest.py gives the one from before pytest captures


def until(condition, what, look=lambda: time.sleep(0.005), said=lambda: "", limit=None):
    """Does look() until condition() holds, and returns what that gives.

    Raises AssertionError after the limit [s], LIMIT if none is given, with what was waited for and said().
    """
    began, limit, told = time.monotonic(), LIMIT if limit is None else limit, 0.0
    while not (found := condition()):
        _looks[0] += 1
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


class Watch:
    """Says where the thread that makes it stands, if that is for long: in a wait that does not go through `until`, or
    in a look of one that does."""

    def __init__(self):
        self._thread, self._over = threading.get_ident(), threading.Event()
        self._watching = threading.Thread(target=self._watch, daemon=True)
        self._watching.start()

    def close(self):
        self._over.set()
        self._watching.join()

    def _watch(self):
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())  # they are for the thread that may hold them
        before, since, told, test, begun = None, 0.0, 0.0, None, 0.0
        while not self._over.wait(LOOK):
            now = time.monotonic()
            if (running := os.environ.get("PYTEST_CURRENT_TEST")) != test:
                before, since, told, test, begun = None, now, 0.0, running, now
            if running is None or now - begun < YOUNG * SAY_AFTER:
                continue
            if (place := (self._place(), _looks[0])) != before:
                # what a young test did nobody has looked at
                before, since, told = place, now if before else begun, 0.0
            if now - since - told >= SAY_AFTER:
                told = now - since
                tell(f"stands {_lines(place[0])} since {told:.0f} s")

    def _place(self):
        """File and number of the innermost lines of a test and of what tests share; it keeps no memory of them."""
        frame, lines = sys._current_frames().get(self._thread), {}
        while frame is not None:
            file = frame.f_code.co_filename
            named = file.rpartition(os.sep)[2].startswith("test_")
            if named or file.startswith(TESTS):
                lines.setdefault(named, (file, frame.f_lineno))
            frame = frame.f_back
        return tuple(lines.values())


def _lines(place):
    told = [f"{Path(file).name}:{line}, {linecache.getline(file, line).strip()!r}" for file, line in place]
    return f"at {', from '.join(told)}," if told else "in this test"  # a browser's own loop has no line of ours
