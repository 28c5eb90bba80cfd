# SPDX-License-Identifier: Apache-2.0
"""How commands write tables, and what they say is to be done next."""

import re

from examples import few
from hypothesis import given
from hypothesis import strategies as st
from in_process import haptic

from haptic_device.config.files import find
from haptic_device.control.withheld import SHORT, TABLE
from haptic_display.cli import demo, outcome_rows, tables
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.outcome import nothing

PASSIVITY = "--damping 0 --physical-damping 1 --period 0.001 --stiffness"
SPREAD = {"p50": 12.3456, "p99": 45.0, "p999": 80.0, "max": 1234.5}
RUN = {
    "scene": "peg_in_hole",
    "done": True,
    "why": "",
    "seconds": 12.34567,
    "late": "",
    "servo": {
        "rate_hz": 3999.99999,
        "ticks": 49382,
        "missed": 0,
        "lateness_us": SPREAD,
        "compute_us": {"p50": 8.0, "p99": 9.0, "max": 30.0},
        "late_device": 2,
        "realtime": "SCHED_FIFO 80",
    },
    "exchange": {
        "rate_hz": 1000.0,
        "sent": 12345,
        "answered": 12344,
        "age_ms": {"p50": 1.5, "p99": 2.0, "max": 3.0},
        "cause": "",
    },
    "simulation": {"method": "impulse", "why": "several contacts have to be solved together " * 4, "waited_s": 0.0},
    "withheld_s": {each.name: 3.2 for each in TABLE} | {"tool_port": 0.7},
    "energy_j": {"given_to_operator_max": 2.0000000001e-3, "given_to_operator_end": -0.5, "tool_port_end": None},
    "contact": {"max_force_n": 2.5, "max_on_hand_n": 3.14159, "max_penetration_m": 9.78e-7},
    "residual": {"rms_n": 0.1234, "explained_by_age_n": 0.1, "unexplained_n": 0.01},
    "result": {"insertion_fraction": 0.98765},
    "result_greatest": {"insertion_fraction": 0.99},
    "task": "done",
    "faults": [],
    "bag": "/somewhere/bag",
    "report": "/somewhere/report.png",
    "startup_s": 4.2,
}


def test_the_figures_of_a_run_are_words_with_units_and_no_keys():
    said = dict(outcome_rows.rows(RUN))
    assert said["servo rate"] == "4000 Hz" and said["servo lateness, largest"] == "1.23 ms"
    assert said["handle samples answered"] == "12344" and said["age of the tool sample, median"] == "1.5 ms"
    assert said["energy given to the hand, largest"] == "2 mJ" and said["deepest overlap"] == "978 nm"
    assert said["energy given to the tool, at the end"] == "unknown"
    assert said["why this method"].startswith("several contacts")
    assert all(said[f"force withheld: {each.cause}"] == "3.2 s" for each in TABLE)
    assert said[f"force withheld: {SHORT}"] == "700 ms"
    assert not any("_" in words for words in said)


def test_a_run_that_left_no_figures_has_no_table(capsys):
    tables.print_outcome(nothing() | {"scene": "wall", "done": False, "why": "the motor never moved", "bag": None})
    assert capsys.readouterr().out.splitlines() == ["wall: NOT done", "bag     none", "report  none"]
    assert dict(outcome_rows.rows(nothing())) == {"length of the run": "0 s"}


def test_the_answer_is_the_task_then_what_the_scene_measures_and_the_faults():
    told = [("task", "done"), ("insertion fraction", "last 0.988, greatest 0.99"), ("faults", "none")]
    assert [*outcome_rows.answer(RUN)] == told
    assert [*outcome_rows.answer(nothing() | {"faults": ["estop", "velocity"]})] == [("faults", "estop, velocity")]


@given(st.floats(-2.0, 2.0))
@few(100)
def test_a_measure_has_three_decimals_a_true_minus_and_what_is_below_them_is_nothing(value):
    shown = dict(outcome_rows.answer(RUN | {"result": {"way": value}, "result_greatest": {}}))["way"]
    assert re.fullmatch(r"last (−?\d(?:\.\d{1,3})?), greatest \1", shown)
    assert (shown == "last 0, greatest 0") == (abs(round(value, 3)) == 0.0)


def printed(capsys, everything):
    """Rows of the outcome, without frames; a line between them is a row of one."""
    tables.print_outcome(RUN, everything)
    return [tuple(re.split(" +│ +", line.strip("│ "))) for line in capsys.readouterr().out.splitlines()]


def test_the_answer_and_ten_figures_of_all_are_what_a_screen_shows_first(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    answer, rows = [*outcome_rows.answer(RUN)], [*outcome_rows.rows(RUN, everything=False)]
    title, top, *told, middle = printed(capsys, everything=True)[:6]
    assert title == ("peg_in_hole: done",) and told == answer
    first = printed(capsys, everything=False)
    assert [len(row) for row in first] == [1, 1, 2, 2, 2, 1, *[2] * 10, 1, 1, 1] and len(first) < 20
    assert first[2:5] == answer and first[6:16] == rows and {*rows} < {*outcome_rows.rows(RUN)}


def test_all_figures_are_asked_for_by_name(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(demo, "run", lambda order, started, json, everything: not asked.append((json, everything)))
    for k, words in enumerate(((), ("--all",), ("--all", "--json"))):
        assert haptic("demo", "--out", tmp_path / str(k), *words).returncode == 0
    assert asked == [(False, False), (False, True), (True, True)]


def test_no_table_is_wider_than_eighty_columns(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(tmp_path)
    tables.print_outcome(RUN, everything=True)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80
    for words in (
        "scenes",
        "scenes --explain wall",
        f"passivity {PASSIVITY} 2000",
        "zwidth --points 4 --lateness 1e-4 --seconds 0.02 --out map",
    ):
        done = haptic(*words.split())
        assert max(map(len, done.stdout.splitlines())) <= 80, words
        assert re.search("^next: haptic |^next: open |^next: the same with ", done.stderr, re.MULTILINE)


def test_a_sentence_that_is_piped_stays_on_one_line(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    [advice] = [line for line in passivity(3000).stdout.splitlines() if line.startswith("Not passive")]
    assert advice.endswith(".")


def passivity(stiffness, *words):
    return haptic("passivity", *PASSIVITY.split(), stiffness, *words)


def test_with_a_delay_the_limits_of_stiffness_as_a_wall_and_as_a_coupling_are_told_beside_each_other():
    delayed = ("--physical-damping", "0.5", "--delay-samples", "1")
    for stiffness, told in ((333, ["yes", "yes"]), (334, ["no", "no"])):
        said = passivity(stiffness, *delayed).stdout
        wall, coupling = (line.split() for line in said.splitlines() if "soft enough as a passive" in line)
        assert [next(word for word in row if word in ("yes", "no")) for row in (wall, coupling)] == told
        assert "333" in wall and "333" in coupling


def test_a_right_file_is_told_the_command_that_runs_it():
    for folder, name, option in (("", "demo", "params"), ("scenes", "wall", "scene"), ("devices", "desktop", "device")):
        path = find(folder, name)
        said = haptic("check", "--lateness", "0", path).stderr
        assert said == f"next: haptic demo --view --{option} {shown_path(path)}\n"


def test_passive_gains_are_told_how_to_set_them_and_others_what_to_try():
    assert passivity(1000).stderr.strip().endswith("haptic set haptic_driver coupling.stiffness 1000")
    assert passivity(3000).stderr.strip() == "next: the same with --stiffness 1800, or more --physical-damping"
    assert passivity(3000, "--json").stderr == ""


def test_a_path_is_shown_as_it_is_typed_here(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    next_step(f"haptic report {shown_path(tmp_path / 'my run' / 'bag')}")
    assert capsys.readouterr().err == "next: haptic report 'my run/bag'\n"
    assert shown_path("/elsewhere/bag") == "/elsewhere/bag"
