# SPDX-License-Identifier: Apache-2.0
"""Space as the e-stop of the commands that serve a page, in a terminal that the test types into."""

import os
import pty
import sys
from types import SimpleNamespace

import pytest
import waiting

from haptic_sim.cli.keys import stop_key
from haptic_sim.cli.view import view
from haptic_sim.viewer import viewer


@pytest.fixture
def typed(monkeypatch):
    """Types into the terminal that stands for this process's own."""
    ours, terminal = pty.openpty()
    with open(terminal, encoding="utf-8") as own:
        monkeypatch.setattr(sys, "stdin", own)
        yield lambda text: os.write(ours, text.encode())
    os.close(ours)


@pytest.mark.parametrize(("text", "stops"), ((" ", True), ("ab c", True), ("x", False), ("\n", False)))
def test_space_alone_is_the_e_stop(typed, text, stops):
    with stop_key() as stop:
        assert not stop(), "nothing has been pressed"
        typed(text)
        if stops:
            waiting.until(stop, "the key")
        assert not stop(), "once is once"


def test_without_a_terminal_there_is_no_key(monkeypatch):
    for none in (None, SimpleNamespace(isatty=lambda: False, fileno=lambda: -1)):
        monkeypatch.setattr(sys, "stdin", none)
        with stop_key() as stop:
            assert stop is None


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
