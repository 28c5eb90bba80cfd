# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange without its node: what it accepts, what it answers, and how worlds change."""

import math
import threading
import types

import numpy as np
import pytest
from handle_samples import GAINS, HOME, MS, handle

from haptic_device.control import exchange_samples
from haptic_device.control import tool_side_tank as law_port
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.recording.layouts import JointLayout
from haptic_sim.node import exchange_thread
from haptic_sim.node.endpoint import SILENCE_NS, Port
from haptic_sim.node.exchange_thread import RETURN_NS, ExchangeThread
from haptic_sim.node.parameters import PARAMETERS
from haptic_sim.node.simulation import SimulationNode
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation, ToolSample
from haptic_sim.tool_port import port_of

TOOL = ToolSample((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (7.0, 8.0, 9.0), True, 0.25)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_handle_of_any_number_of_axes_is_taken_and_the_rest_stays_at_home(axes):
    question = Port(HOME).take(handle(axes=axes, position=(0.4, 0.5, 0.6)), 0)
    assert question.handle.position == (0.4, 0.5, 0.6)[:axes] + HOME[axes:]
    assert question.handle.velocity == (0.5,) * axes + (0.0,) * (3 - axes)
    assert question.handle.gains == tuple(GAINS)
    assert question.handle.time_ns == 5_000_000_007


REFUSED = [
    ({"position": (math.nan, 0.0, 0.0)}, "NaN or out of range"),
    ({"position": (0.0, 1.1e6, 0.0)}, "NaN or out of range"),
    ({"stiffness": math.nan}, "NaN or out of range"),
    ({"damping": -1.0}, "NaN or out of range"),
    ({"session": math.nan}, "NaN or out of range"),
    ({"layout_version": exchange_samples.LAYOUT_VERSION + 1.0}, "other layout version"),
    ({"exchange_method": 99.0}, "other exchange method"),
    ({"exchange_method": 1.0}, "other exchange method"),
    ({"gains_hash": 1.0}, "other coupling gains"),
]


@pytest.mark.parametrize(("change", "reason"), REFUSED)
def test_a_message_that_cannot_be_meant_is_refused_and_counted(change, reason):
    port = Port(HOME)
    assert port.take(handle(**change), 0) is None
    assert port.refused[reason] == sum(port.refused.values()) == 1
    assert port.take(handle(), 0) is not None


def test_other_axis_names_and_foreign_bytes_are_refused():
    port, names = Port(HOME), ("x", "z", "theta", *TAIL)
    other = JointLayout(names).pack(0, *[[0.0] * 16] * 3)
    assert len(other) == len(handle())
    assert [port.take(data, 0) for data in (other, b"", b"\0" * len(other), handle()[:-1])] == [None] * 4
    assert port.refused["other axis names or size"] == 4


def test_repeated_and_late_messages_are_refused():
    port = Port(HOME)
    taken = [port.take(handle(sequence), 0) is not None for sequence in (5.0, 5.0, 4.0, 6.0)]
    assert taken == [True, False, False, True]
    assert port.refused["late or repeated"] == 2


def test_a_second_device_is_heard_only_after_the_first_has_gone_silent():
    port = Port(HOME)
    assert port.take(handle(100.0, session=1.0), 0).new_session
    assert port.take(handle(1.0, session=2.0), SILENCE_NS - 1) is None
    assert port.refused["second publisher"] == 1
    assert not port.take(handle(101.0, session=1.0), SILENCE_NS - 1).new_session
    assert port.take(handle(1.0, session=2.0), 2 * SILENCE_NS - 1).new_session


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_answer_names_the_sample_it_answers_and_carries_its_stamp_and_gains(axes):
    port = Port(HOME)
    port.take(handle(41.0, axes=axes), 0)
    layout = JointLayout(exchange_names(axes))
    answers = [layout.unpack(port.answer(port.take(handle(sequence, axes=axes), 0), TOOL)) for sequence in (42.0, 43.0)]
    assert answers[0].stamp_ns == 5_000_000_007
    assert answers[0].position[:axes].tolist() == list(TOOL.position[:axes])
    assert answers[0].velocity[:axes].tolist() == list(TOOL.velocity[:axes])
    assert answers[0].effort[:axes].tolist() == list(TOOL.force_on_tool[:axes])
    tail = dict(zip(TAIL, answers[1].position[axes:], strict=True))
    assert (tail["answered_session"], tail["answered"], tail["sequence"]) == (77.0, 43.0, 2.0)
    assert (tail["session"], tail["gains_hash"], tail["damping"]) == (
        port.session,
        exchange_samples.gains_hash(*GAINS),
        2.0,
    )
    assert (tail["contact"], tail["energy"], tail["layout_version"]) == (1.0, 0.25, exchange_samples.LAYOUT_VERSION)


@pytest.fixture
def answering(monkeypatch):
    """What the exchange thread does with a sample, without the thread: answer(milliseconds) is whether the sample of
    that time is answered; `thread`, `grant(wish)`, and `load(scene)`."""
    clock, tools = types.SimpleNamespace(ns=0), []
    clocks = types.SimpleNamespace(monotonic_ns=lambda: clock.ns, perf_counter_ns=lambda: clock.ns)
    monkeypatch.setattr(exchange_thread, "time", clocks)
    thread = object.__new__(ExchangeThread)
    thread.simulation, thread.port = (
        Simulation(reduce_scene(load("wall")), port=port_of("pspm")),
        Port((0.03, 0.0, 0.0)),
    )
    thread._publisher, thread._near_publisher = types.SimpleNamespace(publish=tools.append), None
    thread._showing = types.SimpleNamespace(show=lambda *_: None)
    thread._wish, thread._granted, thread._granting = None, threading.Event(), threading.Lock()
    thread._handle, thread.failure = None, ""
    thread._silent_until_ns, thread._returned_ns, thread.paused = 0, 0, False
    thread.answered, thread.compute_ns = 0, []

    def answer(milliseconds, position=(0.02, 0.0, 0.0)):
        clock.ns, before = milliseconds * MS, thread.answered
        thread._answer(handle(float(milliseconds), position=position, stamp_ns=clock.ns))
        return thread.answered > before

    def grant(wish):
        thread._wish = wish
        thread._grant()

    def another(scene):
        grant(lambda: thread._exchange_world(Simulation(reduce_scene(load(scene)), port=port_of("pspm"))))

    return types.SimpleNamespace(answer=answer, load=another, grant=grant, thread=thread)


def test_samples_that_are_refused_take_no_turn_of_one_that_came_before_or_between_them(answering):
    wild = handle(position=(math.inf, 0.0, 0.0))
    answering.thread._answer(wild, handle(1.0), wild, handle(2.0), wild)
    assert answering.thread.answered == 1 and answering.thread.port.refused["NaN or out of range"] == 3
    assert not answering.answer(2)  # which was the one that is answered
    assert answering.answer(3)


def test_another_world_is_hidden_by_a_silence_and_its_gains_return_from_nothing(answering):
    loaded, back = 10, 10 + exchange_thread.SILENCE_NS // MS
    assert all(answering.answer(time) for time in range(1, loaded + 1))
    answering.load("corner")
    assert not any(answering.answer(time) for time in range(loaded + 1, back))
    stiffness = []
    for time_ms in range(back, back + RETURN_NS // MS):
        assert answering.answer(time_ms)
        stiffness.append(answering.thread.simulation._coupled.stiffness)
    assert stiffness == sorted(stiffness)
    assert 0.0 < stiffness[0] < 0.01 * GAINS[0] and stiffness[-1] == GAINS[0]


@pytest.mark.parametrize("how", ["load", "reset"])
def test_each_world_begins_with_its_budget_so_that_the_pull_is_that_of_the_first(answering, how):
    """The handle stays 6 mm behind the wall, and the tool comes to it from its start again and again."""
    began, pulls, thread = 0, [], answering.thread
    lasts = (exchange_thread.SILENCE_NS + RETURN_NS) // MS + 200
    for _ in range(13):
        answering.load("wall") if how == "load" else answering.grant(thread.simulation.reset)
        for time_ms in range(began + 1, began + lasts):
            answering.answer(time_ms, (-0.006, 0.0, 0.0))
        pulls.append(thread.simulation.method.force_on_tool[0])
        began += lasts
    assert pulls[0] < -1.0
    assert pulls == pytest.approx([pulls[0]] * len(pulls), rel=0.02)


def test_a_load_that_was_refused_because_nothing_answered_in_time_does_not_come_about_later(answering):
    thread = answering.thread
    assert "did not answer" in thread.load(Simulation(reduce_scene(load("corner")), port=port_of("pspm")), patience=0.0)
    thread._grant()  # as soon as it looks
    assert thread.simulation.scene.name == "wall"


def test_a_world_that_is_being_built_leaves_the_pull_of_the_one_that_runs_as_it_is(answering):
    node, thread = object.__new__(SimulationNode), answering.thread
    node.simulation, node.told = thread.simulation, ()
    values = {parameter.name: parameter.default for parameter in PARAMETERS} | {"scene": "wall"}
    for time_ms in range(1, 400):
        answering.answer(time_ms, (-0.006, 0.0, 0.0))
    before = thread.simulation.port.memory.copy()
    node._world(values)
    assert np.array_equal(thread.simulation.port.memory, before) and before[law_port.PULL] > 1.0
    answering.answer(400, (-0.006, 0.0, 0.0))
    assert thread.simulation.port.memory[law_port.PULL] == pytest.approx(before[law_port.PULL], rel=0.02)
