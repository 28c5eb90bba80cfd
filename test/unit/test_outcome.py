# SPDX-License-Identifier: Apache-2.0
"""What is said of a run: why it did not keep up, whether it is done, and of which fault it died."""

import math
import time
from types import SimpleNamespace

import pytest
from bag_of_a_run import BOOT_TO_EPOCH, CLOUD, JOINTS, PERIOD_NS, cloud, joints, swing, write_bag, write_run

from haptic_device.control.faults import TABLE
from haptic_device.recording import load
from haptic_device.recording.status import Status
from haptic_display.cli.status import newest
from haptic_display.run import outcome
from haptic_display.run.outcome import ANSWERED, done_at, not_done
from haptic_display.run.report.reading import read_run
from haptic_display.run.report.run import Run
from haptic_display.run.report.summary import GOALS, REACHED
from haptic_sim.exchange.left_out_time import CHEAPER, QUIETER, SHARE
from haptic_sim.scene.language import Task

SERVO = {"lateness_us": {"p50": 8.0, "p99": 321.0, "max": 4567.0}, "missed": 12}


def cause(answered=600, load=0.15, waited=0.0, sent=1000, seconds=1.0):
    exchange = {"sent": sent, "answered": answered, "rate_hz": 1000.0, "age_ms": {"p50": 1.5, "p99": 4.5, "max": 10.75}}
    return outcome.cause(SERVO, exchange, load, waited, seconds)


def test_the_cause_is_a_world_that_takes_more_than_its_share_of_a_period_or_else_a_machine_that_was_late():
    for taken, start, end in (
        (SHARE + 1e-9, "the world is too dear", CHEAPER),
        (SHARE, "the machine was late", QUIETER),
    ):
        said = cause(load=taken, waited=0.34)
        lack = "600 of 1000 handle samples were answered and the world left out 0.34 s"
        assert said.startswith(f"{start}: {lack}") and said.endswith(end)
    assert cause(load=math.nan).startswith("the machine was late")
    assert [bool(cause(answered)) for answered in (1000, 990, 989)] == [False, False, True]
    assert [bool(cause(1000, waited=waited)) for waited in (None, 0.01, 0.011)] == [False, False, True]


def test_the_figures_of_a_run_have_the_cause_from_the_time_in_which_time_was_left_out(tmp_path, monkeypatch):
    rows = swing(2000)
    rows["tool_answered"] -= rows["tool_answered"] % 2  # a half of its samples is not answered
    recording = load(write_run(tmp_path / "run", rows))
    said = ((0.1, 0.0), (1.5, 0.1), (1.7, 0.3), (0.1, 0.3))
    values = [{"world_load": str(one), "waited_s": str(waited)} for one, waited in said]
    spoken = [Status(k, 0, "", each) for k, each in enumerate(values)]
    monkeypatch.setattr(type(recording), "statuses", lambda self, name: spoken if "simulation" in name else [])
    monkeypatch.setattr(type(recording), "last_values", lambda self, name: values[-1] if "sim" in name else {})
    found = outcome.figures(recording, 0.0)["exchange"]
    assert found["answered"] < 0.6 * found["sent"]
    assert found["cause"].startswith("the world is too dear") and "takes it 1.6 ms" in found["cause"]
    assert outcome.figures(recording, 0.0, lossy=True)["exchange"]["cause"] == "", "the network's"


def test_a_run_whose_bag_has_no_handle_samples_has_no_figures(tmp_path):
    bag = write_bag(tmp_path / "some", ("/haptic/trace", CLOUD, cloud(swing(400))))
    with pytest.raises(ValueError, match="no topic handle"):
        outcome.figures(load(bag), 0.0)


def test_samples_that_come_late_are_said_beyond_one_in_a_hundred():
    for late, margin, words in ((10, "-1.0", ()), (11, "0.5", ("1 %",)), (500, "-1.5", ("50 %", "1.5 N s/m", "2 ms"))):
        told = {"passivity_margin": margin, "lateness_counted_us": "2000"}
        said = outcome.late({"late_device": late, "ticks": 1000}, told)
        assert bool(said) == bool(words) and all(word in said for word in words)


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


def ended(faults=(), result=None, sent=1000, answered=1000) -> dict:
    """The figures of a run."""
    exchange = {"sent": sent, "answered": answered}
    return {**outcome.nothing(), "faults": list(faults), "result": result or {}, "exchange": exchange}


def test_a_goal_is_reached_just_above_the_bound_and_not_just_below_and_every_one_that_was_missed_is_said():
    stood = "the motion did not end, and no news for 90 s"
    for goal in GOALS:
        assert (
            not_done(ended(result={goal: REACHED}, answered=1)) == not_done(ended(result={goal: REACHED}), stood) == ""
        )
        short = f"{goal} came to 0.94, and {REACHED:g} is the least"
        assert not_done(ended(result={goal: 0.94}), stood) == f"{stood}; {short}"
        assert not_done(ended(result={goal: REACHED - 1e-9}))
    missed = [f"{goal} came to 0, and {REACHED:g} is the least" for goal in GOALS]
    assert not_done(ended(result=dict.fromkeys(GOALS, 0.0))) == "; ".join(missed)


def test_another_scene_is_done_if_it_ended_and_was_answered_and_behind_a_relay_one_answer_is_enough():
    least = int(ANSWERED * 1000)
    lack = "{} of 1000 handle samples were answered, and {} are the least".format
    assert not_done(ended(answered=least)) == "" and not_done(ended(answered=least - 1)) == lack(least - 1, least)
    assert not_done(ended(), "the motion did not end") == "the motion did not end"
    assert not_done(ended(answered=1), share=0.0) == "" and not_done(ended(answered=0), share=0.0) == lack(0, 1)
    assert not_done(outcome.nothing()) == "the run left no figures"


def test_nothing_is_done_with_a_fault_whose_cause_and_next_step_are_said():
    for entry in TABLE:
        said = not_done(ended(faults=[entry.name], result={"insertion_fraction": 1.0}))
        assert said.startswith(f"{entry.title} (fault {entry.name}): {entry.cause}. ")
        assert said.lower().endswith(f"{entry.first.lower()}{', then ' if entry.first else ''}start again.")
    died = "haptic_simulation was ended by SIGKILL (signal 9)"
    assert not_done(outcome.nothing() | {"faults": [died]}) == died


def test_haptic_status_tells_a_fault_in_its_words_and_what_else_a_node_says_as_it_is():
    def shown(**values):
        said = {"haptic_driver": Status(0, 2, "its own words", values)}
        node = SimpleNamespace(get_namespace=lambda: "/haptic")
        client = SimpleNamespace(statuses=said, heard={"haptic_driver": time.monotonic()}, node=node)
        return newest(client)["haptic_driver"]["message"]

    for entry in TABLE:
        told = shown(fault=entry.name, fault_detail="1 m")
        assert told.startswith(f"{entry.title} (fault {entry.name}): {entry.cause}; 1 m. ")
        assert told.lower().endswith("press r and e in haptic status.") and "~/" not in told
        told = shown(fault=entry.name, fault_first="look at the line")
        assert told.endswith(". Look at the line, then press r and e in haptic status.")
    assert shown(fault="") == shown(fault="of a newer driver") == shown() == "its own words"


def of_a_peg(folder, shares):
    """A run of .5 s whose world shows how deep the peg is, every 50 ms."""
    rows = swing(2000)
    rows["force_on_handle"] = 0.0
    rows["force_on_handle"][1600:, 1] = 5.0  # from .4 s on
    first = int(rows["deadline"][0]) + BOOT_TO_EPOCH
    shown = [(first + k * 200 * PERIOD_NS, share) for k, share in enumerate(shares)]
    blocks = [(int(part["deadline"][-1]) + BOOT_TO_EPOCH, part) for part in rows.reshape(-1, 80)]
    said = [
        *(("/haptic/trace", CLOUD, cloud(part), k, time) for k, (time, part) in enumerate(blocks, 1)),
        *(("/haptic/scene/state", JOINTS, joints(("result.depth",), [share], time), 1, time) for time, share in shown),
    ]
    return Run(load(write_bag(folder, *said)), "peg")


def test_a_task_is_done_when_the_last_of_what_it_asks_for_has_come_and_never_if_one_has_not(tmp_path):
    words = {"title": "t", "goal": "g", "hint": "h", "words": "{percent} %"}
    run = of_a_peg(tmp_path / "in", [0.0, 0.94, 0.95, 1.0, 0.5])
    deep, pressed = Task(**words, done={"depth": 0.95}), Task(**words, force=5.0)
    both = Task(**words, done={"depth": 0.95}, force=5.0)
    for task, when, said in (
        (deep, 0.1, "task done: depth 95 %"),
        (pressed, 0.4, "task done: 5 N on the hand"),
        (both, 0.4, "task done: depth 95 %, 5 N on the hand"),
    ):
        [(time, name)] = done_at(run, task)
        assert time == pytest.approx(when, abs=1e-3) and name == said
    assert done_at(of_a_peg(tmp_path / "not", [0.0, 0.949]), both) == []
    assert done_at(run, Task(**words, force=5.001)) == done_at(run, None) == []
    assert done_at(read_run(write_run(tmp_path / "unseen", swing(400))), deep) == [], "nobody told how deep"
