# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange without its node: what it accepts, what it answers, and how worlds change."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from handle_samples import GAINS, HOME, MS, TOOL, Recording, handle
from made_up_clock import Clock

from haptic_device.config.parameter_types import defaults
from haptic_device.control import exchange_samples
from haptic_device.control import tool_side_tank as law_port
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.recording.layouts import JointLayout
from haptic_sim.exchange import endpoint
from haptic_sim.exchange.endpoint import DEVICE_SILENCE_NS, RETURN_NS, SILENCE_NS, ExchangeEndpoint
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load


@pytest.fixture
def end():
    """The simulation's end, with a simulation that answers all alike."""
    return ExchangeEndpoint(Recording(), HOME)


@pytest.mark.parametrize("axes", [1, 3])
def test_a_handle_of_any_number_of_axes_is_taken_and_the_rest_stays_at_home(end, axes):
    end.answer([handle(axes=axes, position=(0.4, 0.5, 0.6))], 0)
    [asked] = end.simulation.asked
    assert asked.position == (0.4, 0.5, 0.6)[:axes] + HOME[axes:]
    assert asked.velocity == (0.5,) * axes + (0.0,) * (3 - axes)
    assert asked.gains == tuple(GAINS)
    assert asked.time_ns == 5_000_000_007


def test_a_second_device_begins_a_new_time_base(end):
    for session, now, sessions in ((1.0, 0, 1), (1.0, 1, 1), (2.0, DEVICE_SILENCE_NS + 1, 2)):
        assert end.answer([handle(100.0 + now, session=session)], now) is not None
        assert end.simulation.rejoined == sessions


@pytest.mark.parametrize("axes", [1, 3])
def test_the_answer_names_the_sample_it_answers_and_carries_its_stamp_and_gains(end, axes):
    layout = JointLayout(exchange_names(axes))
    answers = [layout.unpack(end.answer([handle(sequence, axes=axes)], 0)) for sequence in (42.0, 43.0)]
    assert answers[0].stamp_ns == 5_000_000_007
    assert answers[0].position[:axes].tolist() == list(TOOL.position[:axes])
    assert answers[0].velocity[:axes].tolist() == list(TOOL.velocity[:axes])
    assert answers[0].effort[:axes].tolist() == list(TOOL.force_on_tool[:axes])
    tail = dict(zip(TAIL, answers[1].position[axes:], strict=True))
    assert (tail["answered_session"], tail["answered"], tail["sequence"]) == (77.0, 43.0, 2.0)
    assert (tail["session"], tail["gains_hash"], tail["damping"]) == (
        end.session,
        exchange_samples.gains_hash(*GAINS),
        2.0,
    )
    assert (tail["contact"], tail["energy"], tail["layout_version"]) == (1.0, 0.25, exchange_samples.LAYOUT_VERSION)


def test_samples_that_are_refused_take_no_turn_of_one_that_came_before_or_between_them(end):
    wild = handle(position=(math.inf, 0.0, 0.0))
    assert end.answer([wild, handle(1.0), wild, handle(2.0), wild], 0) is not None
    assert end.answered == 1 and end.refused["NaN or out of range"] == 3
    assert end.answer([handle(2.0)], 0) is None  # which was the one that is answered
    assert end.answer([handle(3.0)], 0) is not None


def test_paused_nothing_is_answered_and_a_silence_follows(end):
    assert end.answer([handle(1.0)], 0) is not None
    end.pause(True, MS)
    assert end.answer([handle(2.0)], 2 * MS) is None
    end.pause(False, 3 * MS)
    assert end.answer([handle(3.0)], 3 * MS + SILENCE_NS - 1) is None
    assert end.answer([handle(4.0)], 3 * MS + SILENCE_NS) is not None
    assert end.simulation.rejoined == 3  # of the new session, and with each sample that was not answered


def test_a_reset_that_fails_leaves_the_device_in_a_silence(end):
    assert end.answer([handle(1.0)], 0) is not None
    end.simulation.reset = lambda: 1 / 0
    with pytest.raises(ZeroDivisionError):
        end.reset(MS)
    assert end.answer([handle(2.0)], 2 * MS) is None


@pytest.fixture
def answering(monkeypatch):
    """An end with the scene `wall`: answer(milliseconds) is whether the sample of that time is answered; load(scene)
    and reset() at the time of the last one."""
    Clock().put(monkeypatch, endpoint)  # on which the world takes no time, whatever else this machine does
    end, clock = ExchangeEndpoint(world("wall"), (0.03, 0.0, 0.0)), SimpleNamespace(ns=0)

    def answer(milliseconds, position=(0.02, 0.0, 0.0)):
        clock.ns = milliseconds * MS
        return end.answer([handle(float(milliseconds), position=position, stamp_ns=clock.ns)], clock.ns) is not None

    return SimpleNamespace(
        answer=answer, end=end, load=lambda scene: end.load(world(scene), clock.ns), reset=lambda: end.reset(clock.ns)
    )


def world(scene):
    return Simulation(reduce_scene(load(scene)), port=port_of("pspm"))


def test_another_world_is_hidden_by_a_silence_and_its_gains_return_from_nothing(answering, monkeypatch):
    loaded, back = 10, 10 + SILENCE_NS // MS
    assert all(answering.answer(time) for time in range(1, loaded + 1))
    answering.load("corner")
    assert not any(answering.answer(time) for time in range(loaded + 1, back))
    stiffness, exchange = [], answering.end.simulation.exchange

    def seen(sample, most):
        stiffness.append(sample.stiffness)
        return exchange(sample, most)

    monkeypatch.setattr(answering.end.simulation, "exchange", seen)
    assert all(answering.answer(time_ms) for time_ms in range(back, back + RETURN_NS // MS))
    assert stiffness == sorted(stiffness)
    assert 0.0 < stiffness[0] < 0.01 * GAINS[0] and stiffness[-1] == GAINS[0]


@pytest.mark.parametrize("how", ["load", "reset"])
def test_each_world_begins_with_its_budget_so_that_the_pull_is_that_of_the_first(answering, how):
    """The handle stays 6 mm behind the wall, and the tool comes to it from its start again and again."""
    began, pulls = 0, []
    lasts = (SILENCE_NS + RETURN_NS) // MS + 200
    for _ in range(5):
        answering.load("wall") if how == "load" else answering.reset()
        for time_ms in range(began + 1, began + lasts):
            answering.answer(time_ms, (-0.006, 0.0, 0.0))
        pulls.append(answering.end.simulation.method.force_on_tool[0])
        began += lasts
    assert pulls[0] < -1.0
    assert pulls == pytest.approx([pulls[0]] * len(pulls), rel=0.02)


def test_a_world_that_is_being_built_leaves_the_pull_of_the_one_that_runs_as_it_is(answering):
    port = answering.end.simulation.port
    for time_ms in range(1, 400):
        answering.answer(time_ms, (-0.006, 0.0, 0.0))
    before = port.memory.copy()
    Simulation.by_parameters(reduce_scene(load("wall")), defaults(NODES["haptic_simulation"]))
    assert np.array_equal(port.memory, before) and before[law_port.PULL] > 1.0
    answering.answer(400, (-0.006, 0.0, 0.0))
    assert port.memory[law_port.PULL] == pytest.approx(before[law_port.PULL], rel=0.02)
