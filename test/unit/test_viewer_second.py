# SPDX-License-Identifier: Apache-2.0
"""The second operating point is a process beside the viewer: it goes along, or the page is told why it does not."""

import contextlib
import itertools
import json
import os
import signal
import threading
import types

import numpy as np
import pytest
from waiting import LIMIT, until

from haptic_sim.scene import load
from haptic_sim.viewer import second as module
from haptic_sim.viewer import tuned
from haptic_sim.viewer.second import Second
from haptic_sim.viewer.stage import Stage

pytestmark = pytest.mark.timeout(600)
PERIOD = 1.0 / 60.0  # s


def system(**other):
    """free_space with every parameter at its default."""
    scene = load("free_space")
    values = {node: {one.name: tuned._plain(one.default) for one in declared} for node, declared in tuned.NODES.items()}
    return {
        "scene": json.loads(scene.model_dump_json(by_alias=True, exclude_unset=True)),
        "device": "desktop",
        "driver": values["haptic_driver"],
        "loopback": values["haptic_loopback"],
        "simulation": values["haptic_simulation"],
        "method": "auto",
        "start": list(scene.tool.pose),
        "delay": 1e-3,
        **other,
    }


FRAMES = itertools.count(1)  # the tests' own time: the hand is led by it, and each frame answered before the next


@contextlib.contextmanager
def running(*systems):
    """Second operating points, each ready or with a problem."""
    with contextlib.ExitStack() as stack:
        begun = [Second(one) for one in systems]
        for one in begun:
            stack.callback(one.close)
        for one in begun:
            until(lambda one=one: one.latest or one.problem, "a state or a sentence")
        yield begun


@pytest.fixture(scope="module")
def kept():
    with contextlib.ExitStack() as stack:
        yield stack, []


@pytest.fixture
def second(kept):
    """One at the start of its scene; the tests share it while it lives."""
    stack, begun = kept
    if not begun or begun[-1].problem:
        begun += stack.enter_context(running(system()))
    begun[-1].start_again()
    answered(begun[-1])
    yield begun[-1]
    begun[-1]._process.send_signal(signal.SIGCONT)  # a test that failed may have left it stopped


def answered(second):
    until(lambda: second._answered == second._asked or second.problem, "an answer to all that was asked")


def frames(second, count, target):
    """So many frames in which nothing is waited for."""
    for _ in range(count):
        second.move(PERIOD * next(FRAMES), target)


def lead(second, seconds, target):
    """The hand to a target, at the rate of frames."""
    for _ in range(round(seconds / PERIOD)):
        frames(second, 1, target)
        answered(second)


def test_its_handle_goes_where_the_hand_goes_and_begins_again_at_the_start(second):
    x, y, _ = second.system["start"]
    lead(second, 1.5, (x + 0.02, y, 0.0))
    assert second.latest["handle"][0] > x + 0.018 and second.note == ""
    second.start_again()
    answered(second)
    assert second.latest["handle"][0] == pytest.approx(x, abs=1e-3)


def test_however_much_it_writes_to_its_standard_error_it_goes_on(monkeypatch):
    """PYTHONVERBOSE makes some hundred kilobytes of every start, more than a pipe holds."""
    monkeypatch.setenv("PYTHONVERBOSE", "1")
    with running(system()) as [second]:
        second._errors.seek(0, os.SEEK_END)
        assert second.latest and second._errors.tell() > 100_000


def test_one_that_stands_still_is_said_to_be_behind_and_holds_nobody_up(second):
    place = second.system["start"]
    lead(second, 0.3, place)
    os.kill(second._process.pid, signal.SIGSTOP)
    frames(second, 30, place)
    assert "s behind" in second.note
    asking = threading.Thread(target=frames, args=(second, 10_000, place), daemon=True)
    asking.start()
    asking.join(LIMIT)
    assert not asking.is_alive(), "whoever asks is held up"
    assert second._asked - second._answered <= module.MOST_BEHIND
    assert module.MOST_BEHIND * module.LONGEST <= module.LATE, "it works off an old way first"
    os.kill(second._process.pid, signal.SIGCONT)
    answered(second)
    lead(second, 0.2, place)
    assert second.note == ""


def test_its_death_is_one_sentence_and_it_is_shown_no_longer(second):
    os.kill(second._process.pid, signal.SIGKILL)
    until(lambda: second.problem, "a sentence")
    assert second.note == "the second operating point has ended by itself (signal 9)"
    until(lambda: second.latest is None, "that it is shown no longer")
    frames(second, 6, (0.0, 0.0, 0.0))
    second.start_again()
    assert "signal 9" in second.note


def test_what_it_cannot_do_is_one_sentence():
    with running(system(driver={}), system(device="none")) as begun:
        for second, sentence in zip(begun, ("KeyError", "none is neither"), strict=True):
            assert sentence in second.note and "\n" not in second.note
            until(lambda second=second: second.latest is None, "that it is shown no longer")


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


def staged(said=(), **given):
    """What a second operating point is made of beside a simulation with these parameters, by the words of the nodes."""
    words = dict(said)
    feed = types.SimpleNamespace(scene=load("free_space"), said=lambda node, entry, other="": words.get(entry, other))
    values = {f"haptic_{node}": system()[node] for node in ("driver", "loopback", "simulation")}
    values["haptic_simulation"] = values["haptic_simulation"] | given
    return json.loads(json.dumps(Stage(types.SimpleNamespace(feed=feed, values=values, device="desktop"))._system()))


def test_it_simulates_by_the_parameters_of_the_simulation_that_runs():
    limits = {"port_budget": 0.02, "port_force": 3.0, "port_torque": 0.2, "port_slew": 50.0}
    given = {"sub_step": 2e-4, "max_catch_up": 0.005, **limits}
    assert not set(given) - set(system()["simulation"])
    simulation = module.Ghost(staged(**given))._simulation
    assert (simulation.sub_step_ns, simulation.max_catch_up_ns) == (200_000, 5_000_000)
    assert (simulation.port.budget, *simulation.port.limits) == tuple(limits.values())


@pytest.mark.parametrize(("said", "delay"), [("2.5", 2.5e-3), ("nan", 1e-3), ("soon", 1e-3), ("-1", 1e-3), ("", 1e-3)])
def test_its_delay_is_the_age_that_the_driver_tells_or_a_millisecond_where_that_is_no_time(said, delay):
    assert staged([("age_ms_p50", said)])["delay"] == delay
