# SPDX-License-Identifier: Apache-2.0
"""Keys of a terminal: space as the e-stop of commands that serve a page, and whom a key of `haptic status` reaches."""

import contextlib
import os
import pty
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
import waiting

from haptic_device.config.parameters import DRIVER_FIGURES, LOOPBACK_FIGURES
from haptic_device.nodes import diagnostics
from haptic_device.recording.status import Status
from haptic_display.cli.keys import ESTOP, keys, stop_key
from haptic_display.cli.status import KEYS, _answers, _drivers, newest
from haptic_display.cli.view import view
from haptic_display.page import viewer
from haptic_sim.node.parameters import FIGURES

DRIVER = Status(0, 0, "idle", {"namespace": "/haptic"})
LEFT = {"haptic_driver": (Status(0, 0, "idle", {"namespace": "/left"}), time.monotonic())}


@pytest.fixture
def typed(monkeypatch):
    """Types into the terminal that stands for this process's own."""
    ours, terminal = pty.openpty()
    with open(terminal, encoding="utf-8") as own:
        monkeypatch.setattr(sys, "stdin", own)
        yield lambda text: os.write(ours, text.encode())
    os.close(ours)


def test_space_alone_is_the_e_stop_and_counts_whatever_is_typed_with_it(typed):
    with stop_key() as stop, keys() as pressed:
        for text, key in (("r", "r"), ("ab d", ESTOP)):
            typed(text)
            assert waiting.until(pressed, f"the key {key!r}") == key
        typed("x\n")
        assert not stop(), "no space"
        typed("ab c")
        waiting.until(stop, "the key")
        assert not stop(), "once is once"


def test_haptic_view_hears_space_while_it_serves(typed, monkeypatch):
    heard = []

    def main(args, stop):
        typed(" ")
        waiting.until(stop, "the key")
        heard.append(args)
        return 0

    monkeypatch.setattr(viewer, "main", main)
    view()
    assert len(heard) == 1


IN_TERMINAL = """
import os, sys
terminal = os.open(sys.argv[1], os.O_RDWR)  # of a process that leads a session: from now on its own
for background in (True, False):
    child = os.fork()
    if child == 0:
        if background:
            os.setpgid(0, 0)
        os.dup2(terminal, 0)
        from haptic_display.cli.keys import keys, stop_key
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


class Heard:
    """A client that hears of these displays, and what it is told to ask."""

    def __init__(self, own=(), elsewhere=()):
        self.statuses, self.elsewhere, self.asked = dict(own), dict(elsewhere), []
        self.heard = dict.fromkeys(self.statuses, time.monotonic())
        self.node = SimpleNamespace(get_namespace=lambda: "/haptic")

    @contextlib.contextmanager
    def ask(self, question):
        yield SimpleNamespace(poll=lambda: self.asked.append(question.service))

    def call(self, question):
        self.asked.append(question.service)
        return "done"


def test_a_key_reaches_the_display_that_is_there_and_of_several_an_e_stop_all_at_once_and_nothing_else_any():
    for heard, driver in ((Heard(), "/haptic"), (Heard((), {"/left": LEFT}), "/left")):
        assert _drivers(heard, True) == [f"{driver}/haptic_driver"]
    both = Heard({"haptic_driver": DRIVER}, {"/left": LEFT})
    assert list(newest(both, True)) == ["/haptic/haptic_driver", "/left/haptic_driver"]
    drivers = _drivers(both, True)
    assert _answers(both, drivers, "reset") == "reset refused: 2 displays are here; name one by --namespace"
    assert both.asked == []
    _answers(both, drivers, KEYS[ESTOP])
    assert set(both.asked[:2]) == {"/haptic/haptic_driver/estop", "/left/haptic_driver/estop"}


def test_a_figure_is_ok_at_its_limit_and_warns_or_errs_just_beyond():
    for watched in (*DRIVER_FIGURES, *LOOPBACK_FIGURES, *FIGURES):
        beyond = 1e-9 if watched.error >= watched.warn else -1e-9
        figures = watched.warn, watched.warn + beyond, watched.error + beyond, float("nan")
        levels = [diagnostics.level_of(watched, figure, watched.warn, watched.error) for figure in figures]
        assert levels == ["ok", "warn", "error", "ok"], watched.name
