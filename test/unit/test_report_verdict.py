# SPDX-License-Identifier: Apache-2.0
"""The verdict on a run, which stands on top of its report."""

import tempfile
from pathlib import Path

import bag_of_a_run
import numpy as np
import pytest
from bag_of_a_run import CLOUD, DIAGNOSTICS, SAID, cloud, diagnostics, joints, swing, write_bag, write_run

from haptic_device.control import faults, withheld
from haptic_display.run.report.reading import read_run
from haptic_display.run.report.verdict import BAD, GOOD, WARN, verdict

TICKS = 8000


@pytest.fixture
def judged(tmp_path):
    """judged(change of the rows): the verdict on a good run whose rows were changed."""

    def of(change=lambda rows: None):
        rows = swing(TICKS)
        rows["margin"] = 1.0
        change(rows)
        return verdict(read_run(write_run(Path(tempfile.mkdtemp(dir=tmp_path)) / "run", rows)))

    return of


def test_a_run_without_anything_wrong_is_good_and_says_so(judged):
    found = judged()
    assert found.level == GOOD and found.ending == "No fault."
    assert found.rest.startswith("The operator never got more energy than was put in. No force was withheld. ")


@pytest.mark.parametrize(
    ("until", "level", "words"),
    [
        (TICKS, BAD, "Ended by a fault: Emergency stop (a person or a program pressed stop)."),
        (7000, WARN, "A fault came and was cleared: Emergency stop."),
    ],
)
def test_a_fault_at_the_end_ended_the_run_and_one_that_was_cleared_did_not(judged, until, level, words):
    def fall(rows):
        rows["fault"][6000:until] = faults.ESTOP

    found = judged(fall)
    assert (found.level, found.ending) == (level, words)


def test_the_job_is_done_from_the_least_of_its_goal_on(judged, monkeypatch):
    for said, level, words in (("0.95", GOOD, "Job done: insertion fraction 95 %."), ("0.94", BAD, "Job not done: ")):
        monkeypatch.setitem(SAID, "result.insertion_fraction", said)
        found = judged()
        assert found.level == level and words in found.ending


@pytest.mark.parametrize(("most", "level"), [(0.99e-6, GOOD), (1.01e-6, WARN)])
def test_energy_that_the_operator_got_beyond_what_was_put_in_is_told(judged, monkeypatch, most, level):
    def truth(names, position, *rest, **more):
        if "energy_given" in names:
            position[names.index("energy_given")] = 5.0 + most * min(1.0, position[-1] - 5.0)
        return joints(names, position, *rest, **more)

    monkeypatch.setattr(bag_of_a_run, "joints", truth)
    found = judged()
    assert found.level == level and ("The operator got up to" in found.rest) == (level == WARN)


def test_a_margin_below_zero_is_told_with_its_least_value(judged):
    def lower(rows):
        rows["margin"][100, 1] = -1.5

    found = judged(lower)
    assert found.level == WARN and "The passivity margin fell to −1.5 N s/m." in found.rest


def test_force_that_was_withheld_and_samples_that_were_not_answered_are_told_with_how_much(judged):
    def keep(rows):
        rows["withheld"][1000:3000] = withheld.TANK
        rows["tool_answered"] -= rows["tool_answered"] % 2

    found = judged(keep)
    assert found.level == WARN and "Force was withheld: tank 0.50 s." in found.rest
    assert "of 2000 handle samples were answered." in found.rest


@pytest.mark.parametrize(("seconds", "level"), [("0.19", GOOD), ("0.5", WARN)])
def test_force_that_the_tools_port_withheld_is_told_where_it_lasted(judged, monkeypatch, seconds, level):
    monkeypatch.setitem(SAID, "short_s", seconds)
    found = judged()
    assert found.level == level and ("Force was withheld: tool_port 0.50 s." in found.rest) == (level == WARN)


@pytest.mark.parametrize(("force", "level"), [(0.098, GOOD), (0.102, WARN)])
def test_more_than_a_tenth_of_a_newton_between_handle_and_tool_that_no_age_explains_is_not_good(judged, force, level):
    def lessen(rows):
        rows["tool_effort"][:, 0] -= force

    found = judged(lessen)
    assert found.level == level and ("Forces on handle and tool differ by 102 mN" in found.rest) == (level == WARN)


@pytest.mark.parametrize(("count", "level"), [(80, GOOD), (81, WARN)])
def test_more_than_one_sample_in_a_hundred_late_or_one_tick_missed_is_a_warning(judged, count, level):
    def late(rows):
        rows["device_status"][:count] = 0.0

    def miss(rows):
        rows["missed"][4000:] = count

    found = judged(late)
    assert found.level == level and f"{count} of the device's samples late." in found.rest
    found = judged(miss)
    assert found.level == level and f"{count} of {TICKS} ticks missed" in found.rest


@pytest.mark.parametrize("column", ["withheld", "lateness", "position", "margin"])
def test_no_run_with_a_column_of_which_values_are_missing_is_good(judged, column):
    def spoil(rows):
        rows[column][100:200] = np.nan

    found = judged(spoil)
    assert found.level == WARN and f"trace column {column} is no number in 100 of {TICKS} ticks" in found.rest


def test_no_run_that_lacks_ticks_is_good(tmp_path):
    rows = swing(TICKS)
    found = verdict(read_run(write_run(tmp_path / "run", np.delete(rows, slice(800, 807)))))
    assert found.level == WARN and "7 ticks are missing from the trace." in found.rest


@pytest.mark.parametrize("lost, level", [(2, GOOD), (3, WARN)])
def test_no_run_of_which_more_than_one_message_in_a_hundred_was_lost_is_good(tmp_path, lost, level):
    rows, names = swing(TICKS), ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    tail = (*names, "exchange_method", "session", "sequence")
    handle = joints(("x", *tail), [0.0] * 8, 0)
    tool = joints(("answered",), [1.0], 0)
    messages = [("/haptic/trace", CLOUD, cloud(rows), 1, 1)]
    messages += [
        ("/haptic/handle", bag_of_a_run.JOINTS, handle, number, number) for number in [*range(1, 200), 200 + lost]
    ]
    messages += [("/haptic/tool", bag_of_a_run.JOINTS, tool, number, number) for number in (1, 2)]
    found = verdict(read_run(write_bag(tmp_path / "run", *messages)))
    assert ("Not the whole run was recorded" in found.rest) == (level == WARN)
    assert (f"{lost} messages of handle are missing" in found.rest) == (level == WARN)


@pytest.mark.parametrize("dropped, level", [(0, GOOD), (180, WARN)])
def test_no_run_of_which_the_driver_left_rows_out_is_good(tmp_path, dropped, level):
    run = read_run(write_run(tmp_path / "run", swing(TICKS)))
    said = [diagnostics("haptic_driver", {"trace_dropped": str(count)}) for count in (20, 20 + dropped)]
    told = write_bag(tmp_path / "told", *(("/diagnostics", DIAGNOSTICS, one, i, i) for i, one in enumerate(said, 1)))
    run.recording.diagnostics["haptic_driver"] = read_run(told).recording.statuses("haptic_driver")
    found = verdict(run)
    assert found.level == level and (f"{dropped} trace rows are missing" in found.rest) == (level == WARN)


def test_a_part_that_cannot_be_judged_says_why_and_no_run_with_one_is_good(tmp_path):
    found = verdict(read_run(write_bag(tmp_path / "run", ("/haptic/trace", CLOUD, cloud(swing(TICKS))))))
    assert found.level == WARN and "Not judged: forces (bag " in found.rest and "no topic handle" in found.rest
