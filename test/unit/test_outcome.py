# SPDX-License-Identifier: Apache-2.0
"""Why a run did not keep up: a world that takes longer than it has, or a machine that was late."""

import json
import math

import pytest
from bag_of_a_run import SAID, swing, write_run

from haptic_device.analysis.report.reading import read_run
from haptic_device.analysis.report.table import MISSING, sections
from haptic_device.recording import load
from haptic_device.status import Status
from haptic_sim import outcome
from haptic_sim.cli import demo, tables
from haptic_sim.exchange.left_out_time import CHEAPER, QUIETER, SHARE
from haptic_sim.scene.language import Task
from haptic_sim.supervision.system import Order, Relay

SERVO = {"lateness_us": {"p50": 8.0, "p99": 321.0, "max": 4567.0}, "missed": 12}


def cause(answered=600, load=0.15, waited=0.0, sent=1000, seconds=1.0):
    exchange = {"sent": sent, "answered": answered, "rate_hz": 1000.0, "age_ms": {"p50": 1.5, "p99": 4.5, "max": 10.75}}
    return outcome.cause(SERVO, exchange, load, waited, seconds)


def test_a_world_that_takes_longer_than_it_has_is_the_cause_and_it_is_said_what_it_takes():
    said = cause(load=1.52, waited=0.34)
    assert said.startswith(
        "the world is too dear: 600 of 1000 handle samples were answered and the world left out 0.34 s"
    )
    assert "a period of 1 ms takes it 1.52 ms" in said and said.endswith(CHEAPER)


def test_a_machine_that_was_late_is_the_cause_where_the_world_has_time_and_it_is_said_how_late():
    said = cause(load=0.15, waited=0.34)
    assert said.startswith("the machine was late: 600 of 1000 handle samples were answered")
    assert "a period of 1 ms takes it 0.15 ms" in said and said.endswith(QUIETER)
    assert "the servo woke up 321 µs late (99 %; at most 4567) and missed 12 ticks, tool samples were 4.5 ms" in said


@pytest.mark.parametrize(("load", "word"), [(SHARE, "the machine was late"), (SHARE + 1e-9, "the world is too dear")])
def test_of_the_two_causes_the_world_is_it_above_its_share_of_the_period(load, word):
    assert cause(load=load).startswith(word)


@pytest.mark.parametrize(("answered", "told"), [(1000, False), (990, False), (989, True)])
def test_less_than_99_percent_answered_is_worth_a_word(answered, told):
    assert bool(cause(answered)) == told


@pytest.mark.parametrize(("waited", "told"), [(None, False), (0.01, False), (0.011, True)])
def test_so_is_more_than_1_percent_of_the_time_left_out_with_all_answered(waited, told):
    assert bool(cause(1000, waited=waited)) == told


def test_a_world_that_has_not_said_what_it_takes_is_not_blamed():
    said = cause(load=math.nan)
    assert said.startswith("the machine was late") and "what it takes for a period is not known" in said


@pytest.fixture
def slow(tmp_path, monkeypatch):
    """slow(*(load, waited)): recording of a run whose simulation said so in turn, a half of its samples unanswered."""

    def run(*said):
        rows = swing(2000)
        rows["tool_answered"] -= rows["tool_answered"] % 2
        recording = load(write_run(tmp_path / "run", rows))
        values = [{"world_load": str(one), "waited_s": str(waited)} for one, waited in said]
        spoken = [Status(k, 0, "", each) for k, each in enumerate(values)]
        monkeypatch.setattr(type(recording), "statuses", lambda self, name: spoken if "simulation" in name else [])
        monkeypatch.setattr(type(recording), "last_values", lambda self, name: values[-1] if "sim" in name else {})
        return recording

    return run


def test_the_figures_of_a_run_have_the_cause_and_the_time_that_was_left_out(slow, capsys):
    found = outcome.figures(slow((math.nan, 0.0), (1.5, 0.1), (1.7, 0.3)), 0.0)
    assert found["exchange"]["answered"] < 0.6 * found["exchange"]["sent"] and found["simulation"]["waited_s"] == 0.3
    assert (
        found["exchange"]["cause"].startswith("the world is too dear")
        and "takes it 1.6 ms" in found["exchange"]["cause"]
    )
    tables.print_outcome({"scene": "wall", "done": True, "why": "", **found, "bag": None, "report": None})
    assert found["exchange"]["cause"] in capsys.readouterr().out.splitlines()


def test_what_the_world_takes_is_that_of_the_time_in_which_it_left_time_out(slow):
    recording = slow((0.1, 0.0), (0.1, 0.0), (1.5, 0.3), (0.1, 0.3), (0.1, 0.3))
    assert outcome.figures(recording, 0.0)["exchange"]["cause"].startswith("the world is too dear")


def test_behind_a_network_that_loses_samples_nobody_else_is_to_blame(slow):
    recording = slow((1.5, 0.3))
    assert outcome.figures(recording, 0.0, lossy=True)["exchange"]["cause"] == ""


@pytest.mark.parametrize(
    ("relay", "lossy"),
    [(None, False), (Relay(0.02), False), (Relay(loss=0.1), True), (Relay(0.02, 0.01), True)],
)
def test_a_relay_that_loses_or_mixes_up_is_the_network_s_cause(slow, monkeypatch, tmp_path, relay, lossy):
    recording = slow((1.5, 0.3))
    monkeypatch.setattr("haptic_device.recording.load", lambda bag: recording)
    monkeypatch.setattr("haptic_device.analysis.report.figures.draw_picture", lambda run, report: None)
    monkeypatch.setattr("haptic_device.analysis.report.run.Run", lambda recording, scene: None)
    found = demo._evaluate(Order("wall", None, tmp_path, None, None, tmp_path, relay), 0.0)
    assert bool(found["exchange"]["cause"]) != lossy


def test_the_demo_says_the_cause_in_one_line_and_its_object_has_it(capsys, tmp_path):
    said = cause(load=1.52, waited=0.34)
    found = {"exchange": {"sent": 1000, "answered": 950, "cause": said}}
    order = Order("free_space", None, tmp_path, None, None, tmp_path)
    assert demo._conclude(order, found, "", [], True)
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [f"haptic demo: {said}"]
    assert json.loads(printed.out)["exchange"]["cause"] == said


def test_the_report_says_how_long_the_world_waited_or_that_it_was_not_said(tmp_path, monkeypatch):
    told = "time that the world left out"
    bag = write_run(tmp_path / "old", swing(2000))
    assert sections(read_run(bag))["Exchange"][told] == MISSING
    monkeypatch.setitem(SAID, "waited_s", "0.34")  # after a first status that says 0
    assert sections(read_run(write_run(tmp_path / "new", swing(2000))))["Exchange"][told] == "340 ms"


@pytest.mark.parametrize(
    ("late", "margin", "words"), [(10, "-1.0", ()), (11, "0.5", ("1 %",)), (500, "-1.5", ("50 %", "1.5 N s/m"))]
)
def test_samples_that_come_late_are_said_beyond_one_in_a_hundred(late, margin, words):
    said = outcome.late(
        {"late_device": late, "ticks": 1000}, {"passivity_margin": margin, "lateness_counted_us": "2000"}
    )
    assert bool(said) == bool(words) and all(word in said for word in words)
    assert ("2 ms" in said) == (margin == "-1.5")


@pytest.mark.parametrize(
    ("greatest", "felt", "said"),
    [
        ({"pressed": 0.9}, 2.0, "done"),
        ({"pressed": 0.899}, 2.0, "not done: pressed came to 0.899; 0.9 is needed"),
        ({"pressed": 0.9}, 1.99, "not done: force on the hand came to 1.99 N; 2 N is needed"),
        ({}, None, "not done: pressed came to —; 0.9 is needed, force on the hand came to —; 2 N is needed"),
    ],
)
def test_a_task_is_done_where_its_best_reaches_what_it_asks_for(greatest, felt, said):
    task = Task(title="Press", goal="Press it.", done={"pressed": 0.9}, force=2.0)
    found = {"exchange": {"sent": 1}, "result_greatest": greatest, "contact": {"max_on_hand_n": felt}}
    assert outcome.task_of(task, found) == said
    assert outcome.task_of(None, found) is None and outcome.task_of(task, outcome.nothing()) is None


def test_a_run_whose_task_is_not_done_is_not_called_done(capsys, tmp_path):
    found = {"exchange": {"sent": 10, "answered": 10, "cause": ""}, "result_greatest": {"turned": 0.1}}
    order = Order("wrench_on_nut", None, tmp_path, None, None, tmp_path)
    assert demo._conclude(order, found, "", [], False)
    said = capsys.readouterr().out
    assert "the run is complete, the task is not done" in said and "turned came to 0.1; 0.95 is needed" in said
