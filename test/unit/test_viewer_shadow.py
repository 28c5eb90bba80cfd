# SPDX-License-Identifier: Apache-2.0
"""The second operating point is a process beside the viewer: it goes along, or the page is told why it does not."""

import asyncio
import itertools
import json
import os
import signal
import subprocess
import types

import numpy as np
import pytest
from waiting import LIMIT

from haptic_device.process import own_environment, running_module
from haptic_sim.scene.language import load
from haptic_sim.viewer import settings
from haptic_sim.viewer import shadow_simulation as module
from haptic_sim.viewer.scene_controller import SceneController
from haptic_sim.viewer.shadow_simulation import ShadowSimulation, ShadowSystem

pytestmark = pytest.mark.timeout(600)
PERIOD = 1.0 / 60.0  # s


def system(**other):
    """free_space with every parameter at its default."""
    scene = load("free_space")
    values = {node: {one.name: one.default for one in declared} for node, declared in settings.NODES.items()}
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


@pytest.fixture(scope="module")
def loop():
    """until(condition, what) runs an event loop until condition() holds; do(awaitable) runs it until that is done."""
    with asyncio.Runner() as runner:

        async def come(condition, what):
            end = asyncio.get_running_loop().time() + LIMIT
            while not condition():
                assert asyncio.get_running_loop().time() < end, f"not within {LIMIT:g} s: {what}"
                await asyncio.sleep(0.005)

        yield types.SimpleNamespace(do=runner.run, until=lambda condition, what: runner.run(come(condition, what)))


@pytest.fixture(scope="module")
def started(loop):
    """started(system): a shadow simulation that is ready or has a problem."""
    begun = []

    async def start(made_of):
        begun.append(ShadowSimulation(made_of))
        return begun[-1]

    def run(made_of):
        shadow = loop.do(start(made_of))
        loop.until(lambda: shadow.latest or shadow.problem, "a state or a sentence")
        return shadow

    yield run
    for one in begun:
        loop.do(one.close())


@pytest.fixture(scope="module")
def kept():
    return []


@pytest.fixture
def shadow(loop, started, kept):
    """One at the start of its scene; the tests share it while it lives."""
    if not kept or kept[-1].problem:
        kept.append(started(system()))
    kept[-1].start_again()
    answered(loop, kept[-1])
    yield kept[-1]
    if not kept[-1].problem:
        os.kill(kept[-1].pid, signal.SIGCONT)  # a test that failed may have left it stopped


def answered(loop, shadow):
    loop.until(lambda: not shadow.awaited or shadow.problem, "an answer to all that was asked")


def frames(shadow, count, target):
    """So many frames in which nothing is waited for."""
    for _ in range(count):
        shadow.move(PERIOD * next(FRAMES), target)


def lead(loop, shadow, seconds, target):
    """The hand to a target, at the rate of frames."""
    for _ in range(round(seconds / PERIOD)):
        frames(shadow, 1, target)
        answered(loop, shadow)


def test_its_handle_goes_where_the_hand_goes_and_begins_again_at_the_start(loop, shadow):
    x, y, _ = shadow.system["start"]
    lead(loop, shadow, 1.5, (x + 0.02, y, 0.0))
    assert shadow.latest["handle"][0] > x + 0.018 and shadow.note == ""
    shadow.start_again()
    answered(loop, shadow)
    assert shadow.latest["handle"][0] == pytest.approx(x, abs=1e-3)


def test_however_much_it_writes_to_its_standard_error_it_goes_on(started, monkeypatch):
    """PYTHONVERBOSE makes some hundred kilobytes of every start, more than a pipe holds."""
    monkeypatch.setenv("PYTHONVERBOSE", "1")
    command = running_module("haptic_sim.viewer.shadow_simulation")
    alone = subprocess.run(command, env=own_environment(), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, check=True)
    assert len(alone.stderr) > 100_000 and started(system()).latest


def test_one_that_stands_still_is_said_to_be_behind_and_holds_nobody_up(loop, shadow):
    place = shadow.system["start"]
    lead(loop, shadow, 0.3, place)
    os.kill(shadow.pid, signal.SIGSTOP)
    frames(shadow, 30, place)
    assert "s behind" in shadow.note
    frames(shadow, 10_000, place)
    assert shadow.awaited <= module.MOST_BEHIND
    assert module.MOST_BEHIND * module.LONGEST <= module.LATE, "it works off an old way first"
    os.kill(shadow.pid, signal.SIGCONT)
    answered(loop, shadow)
    lead(loop, shadow, 0.2, place)
    assert shadow.note == ""


def test_its_death_is_one_sentence_and_it_is_shown_no_longer(loop, shadow):
    os.kill(shadow.pid, signal.SIGKILL)
    loop.until(lambda: shadow.problem, "a sentence")
    assert shadow.note == "the second operating point has ended by itself (signal 9)"
    loop.until(lambda: shadow.latest is None, "that it is shown no longer")
    frames(shadow, 6, (0.0, 0.0, 0.0))
    shadow.start_again()
    assert "signal 9" in shadow.note


def test_what_it_cannot_do_is_one_sentence(loop, started):
    for made_of, sentence in ((system(driver={}), "KeyError"), (system(device="none"), "none is neither")):
        shadow = started(made_of)
        assert sentence in shadow.note and "\n" not in shadow.note
        loop.until(lambda shadow=shadow: shadow.latest is None, "that it is shown no longer")


@pytest.mark.parametrize("turns", (0, 1, 30))
def test_one_that_is_closed_while_it_starts_leaves_no_process(loop, turns):
    async def live():
        shadow = ShadowSimulation(system())
        for _ in range(turns):
            await asyncio.sleep(0.005)
        await shadow.close()
        return shadow

    shadow = loop.do(live())
    assert shadow.latest is None and shadow.problem == ""
    if shadow.pid is not None:
        with pytest.raises(ProcessLookupError):
            os.kill(shadow.pid, 0)


@pytest.mark.parametrize("where", ("position", "bodies"))
def test_one_that_has_blown_up_says_so_in_a_sentence(where):
    place = {"position": np.zeros(3), "bodies": [0.0, 0.0, 0.0]} | {where: np.array([0.0, np.nan, 0.0])}
    bodies = [types.SimpleNamespace(name="block")]
    method = types.SimpleNamespace(position=(0.0, 0.0, 0.0), pose=lambda name: list(place["bodies"]))
    row = types.SimpleNamespace(position=place["position"], force_on_handle=np.zeros(3))
    simulation = types.SimpleNamespace(method=method, scene=types.SimpleNamespace(bodies=bodies))
    with pytest.raises(ValueError, match="blown up"):
        module.places(row, simulation)


def staged(said=(), **given):
    """What a second operating point is made of beside a simulation with these parameters, by the words of the nodes."""
    words = dict(said)
    state = types.SimpleNamespace(scene=load("free_space"), said=lambda node, entry, other="": words.get(entry, other))
    values = {f"haptic_{node}": system()[node] for node in ("driver", "loopback", "simulation")}
    values["haptic_simulation"] = values["haptic_simulation"] | given
    commands = types.SimpleNamespace(state=state, values=values, device="desktop")
    return json.loads(json.dumps(SceneController(commands).system()))


def test_it_simulates_by_the_parameters_of_the_simulation_that_runs():
    limits = {"port_budget": 0.02, "port_force": 3.0, "port_torque": 0.2, "port_slew": 50.0}
    given = {"sub_step": 2e-4, "max_catch_up": 0.005, **limits}
    assert not set(given) - set(system()["simulation"])
    simulation = ShadowSystem(staged(**given)).simulation
    assert (simulation.sub_step_ns, simulation.max_catch_up_ns) == (200_000, 5_000_000)
    assert (simulation.port.budget, *simulation.port.limits) == tuple(limits.values())


@pytest.mark.parametrize(("said", "delay"), [("2.5", 2.5e-3), ("nan", 1e-3), ("soon", 1e-3), ("-1", 1e-3), ("", 1e-3)])
def test_its_delay_is_the_age_that_the_driver_tells_or_a_millisecond_where_that_is_no_time(said, delay):
    assert staged([("age_ms_p50", said)])["delay"] == delay
