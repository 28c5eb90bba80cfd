# SPDX-License-Identifier: Apache-2.0
"""The second operating point is a process beside the viewer: it goes along, or the page is told why it does not."""

import contextlib
import json
import os
import signal
import time
import types

import numpy as np
import pytest

from haptic_sim.scene import load
from haptic_sim.viewer import second as module
from haptic_sim.viewer import tuned
from haptic_sim.viewer.second import Second

pytestmark = pytest.mark.live
PATIENCE = 180.0  # s: kernels that nobody has used yet are compiled
PERIOD = 1.0 / 60.0  # s


def system(**other):
    """free_space with every parameter at its default."""
    scene = load("free_space")
    values = {node: {one.name: tuned._plain(one.default) for one in declared} for node, declared in tuned.NODES.items()}
    return {
        "scene": json.loads(scene.model_dump_json(by_alias=True, exclude_unset=True)), "device": "desktop",
        "driver": values["haptic_driver"], "loopback": values["haptic_loopback"], "method": "auto",
        "start": list(scene.tool.pose), "delay": 1e-3, **other,
    }  # fmt: skip


def until(found):
    end = time.monotonic() + PATIENCE
    while not found():
        assert time.monotonic() < end, "what was waited for did not come"
        time.sleep(0.01)


@contextlib.contextmanager
def running(given=None):
    second = Second(given or system())
    try:
        until(lambda: second.latest or second.problem)
        yield second
    finally:
        second.close()


def lead(second, seconds, target):
    """The hand to a target, at the rate of frames."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        second.move(time.monotonic(), target)
        time.sleep(PERIOD)


def test_its_handle_goes_where_the_hand_goes_and_begins_again_at_the_start():
    with running() as second:
        x, y, _ = second.system["start"]
        lead(second, 1.5, (x + 0.02, y, 0.0))
        until(lambda: second.latest["handle"][0] > x + 0.018)
        assert second.note == ""
        second.start_again()
        until(lambda: abs(second.latest["handle"][0] - x) < 1e-3)


def test_however_much_it_writes_to_its_standard_error_it_goes_on(monkeypatch):
    """PYTHONVERBOSE makes some hundred kilobytes of every start, more than a pipe holds."""
    monkeypatch.setenv("PYTHONVERBOSE", "1")
    with running() as second:
        second._errors.seek(0, os.SEEK_END)
        assert second.latest and second._errors.tell() > 100_000


def test_its_death_is_one_sentence_and_it_is_shown_no_longer():
    with running() as second:
        os.kill(second._process.pid, signal.SIGKILL)
        until(lambda: second.problem)
        assert second.note == "the second operating point has ended by itself (signal 9)"
        assert second.latest is None
        lead(second, 0.1, (0.0, 0.0, 0.0))
        second.start_again()
        assert "signal 9" in second.note


@pytest.mark.parametrize(("other", "sentence"), [({"driver": {}}, "KeyError"), ({"device": "none"}, "none is neither")])
def test_what_it_cannot_do_is_one_sentence(other, sentence):
    with running(system(**other)) as second:
        assert sentence in second.note and "\n" not in second.note and second.latest is None


@pytest.mark.parametrize("where", ("position", "bodies"))
def test_one_that_has_blown_up_says_so_in_a_sentence(where):
    place = {"position": np.zeros(3), "bodies": [0.0, 0.0, 0.0]} | {where: np.array([0.0, np.nan, 0.0])}
    bodies = [types.SimpleNamespace(name="block")]
    method = types.SimpleNamespace(position=(0.0, 0.0, 0.0), pose=lambda name: list(place["bodies"]))
    ghost = object.__new__(module.Ghost)
    ghost._row = types.SimpleNamespace(position=place["position"], force_on_handle=np.zeros(3))
    ghost._simulation = types.SimpleNamespace(method=method, scene=types.SimpleNamespace(bodies=bodies))
    with pytest.raises(ValueError, match="blown up"):
        ghost.state()


def test_one_that_stands_still_is_said_to_be_behind_and_holds_nobody_up():
    with running() as second:
        place = second.system["start"]
        lead(second, 0.3, place)
        os.kill(second._process.pid, signal.SIGSTOP)
        lead(second, 0.5, place)
        assert "s behind" in second.note
        began = time.monotonic()
        for _ in range(10_000):
            second.move(time.monotonic(), place)
        assert time.monotonic() - began < 5.0 and second._asked - second._answered <= module.MOST_BEHIND
        os.kill(second._process.pid, signal.SIGCONT)
        lead(second, 0.2, place)
        until(lambda: lead(second, PERIOD, place) or second.note == "")
