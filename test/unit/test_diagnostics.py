# SPDX-License-Identifier: Apache-2.0
"""The limits of diagnostics, and the keys of `haptic status`."""

import os
import pty
import subprocess
import sys

import pytest
import waiting
from waiting import until

from haptic_device.nodes import diagnostics
from haptic_device.parameters import DRIVER_FIGURES, LOOPBACK_FIGURES
from haptic_sim.cli.keys import ESTOP, keys
from haptic_sim.node.parameters import FIGURES


@pytest.mark.parametrize("watched", [*DRIVER_FIGURES, *LOOPBACK_FIGURES, *FIGURES], ids=lambda each: each.name)
def test_a_figure_is_ok_at_its_limit_and_warns_or_errs_just_beyond(watched):
    beyond = 1e-9 if watched.error >= watched.warn else -1e-9
    for figure, level in (
        (watched.warn, "ok"),
        (watched.warn + beyond, "warn"),
        (watched.error, "warn"),
        (watched.error + beyond, "error"),
        (float("nan"), "ok"),
    ):
        assert diagnostics.level_of(watched, figure, watched.warn, watched.error) == level


def test_of_the_keys_the_e_stop_counts_whatever_is_typed_with_it(monkeypatch):
    control, terminal = pty.openpty()
    with os.fdopen(terminal) as stdin, keys_of(monkeypatch, stdin) as pressed:
        assert pressed() == ""
        for typed, key in ((b"r", "r"), (b"ab d", ESTOP)):
            os.write(control, typed)
            assert until(pressed, f"the key {key!r}") == key
    os.close(control)


def keys_of(monkeypatch, stdin):
    monkeypatch.setattr("sys.stdin", stdin)
    return keys()


def test_without_a_terminal_there_are_no_keys(monkeypatch):
    with open(os.devnull) as stdin, keys_of(monkeypatch, stdin) as pressed:
        assert pressed() == ""


IN_TERMINAL = """
import os, sys
terminal = os.open(sys.argv[1], os.O_RDWR)  # of a process that leads a session: from now on its own
for background in (True, False):
    child = os.fork()
    if child == 0:
        if background:
            os.setpgid(0, 0)
        os.dup2(terminal, 0)
        from haptic_sim.cli.keys import keys, stop_key
        with stop_key() as stop, keys() as pressed:
            print(background, stop is None, repr(pressed()), flush=True)
        os._exit(0)
    print("stopped" if os.WIFSTOPPED(os.waitpid(child, os.WUNTRACED)[1]) else "ended", flush=True)
"""


def test_in_the_background_of_a_terminal_there_are_no_keys_and_nothing_stops():
    control, terminal = pty.openpty()
    command = [sys.executable, "-c", IN_TERMINAL, os.ttyname(terminal)]
    done = waiting.run(command, stdin=subprocess.DEVNULL, start_new_session=True)
    os.close(terminal)
    os.close(control)
    assert done.stdout.splitlines() == ["True True ''", "ended", "False False ''", "ended"], done.stderr
