# SPDX-License-Identifier: Apache-2.0
"""A twin ends with the process it was forked from, whatever that was doing and however it was started."""

import signal
import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

KILLED = """
    import os, signal, threading, time
    from functools import partial
    from haptic_device.runtime.process import die_with_parent
    from haptic_device.twin import Twin

    signal.signal(signal.SIGTERM, lambda number, frame: None)  # as a node hears it: between instructions
    twin = Twin(lambda request: (print("begun", flush=True), time.sleep(60.0)), partial(die_with_parent, os.getpid()))
    threading.Thread(target=twin.ask, args=(None,), daemon=True).start()
    time.sleep(0.5)
    os.kill(os.getpid(), signal.SIGKILL)
"""

WITHOUT_FILES = """
    import os
    from haptic_device.twin import Twin

    os.closerange(0, 3)
    twin = Twin(lambda request: None, lambda: None)
    twin.ask(None)
    twin.end()
    os._exit(0)
"""


def run(script):
    """Returns once nobody has what the script and its twin print to open any more."""
    command = [sys.executable, "-c", textwrap.dedent(script)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=20)


def test_a_twin_in_the_middle_of_a_request_ends_as_soon_as_the_other_is_killed():
    done = run(KILLED)
    assert (done.returncode, done.stdout) == (-signal.SIGKILL, "begun\n")


def test_a_twin_ends_where_its_pipe_has_the_numbers_of_the_standard_files():
    assert run(WITHOUT_FILES).returncode == 0
