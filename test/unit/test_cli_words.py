# SPDX-License-Identifier: Apache-2.0
"""How commands write tables, and what they say is to be done next."""

import re

import pytest
from in_process import haptic

from haptic_device.config_files import find
from haptic_device.control.withheld import TABLE
from haptic_device.realtime.machine import Check
from haptic_sim.cli import device, doctor, identify, outcome_rows, status, tables, zwidth
from haptic_sim.cli.words import console, next_step, shown_path
from haptic_sim.supervision.conformance import Result

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
    "withheld_s": {each.name: 3.2 for each in TABLE},
    "energy_j": {"given_to_operator_max": 2.0000000001e-3, "given_to_operator_end": -0.5, "tool_port_end": None},
    "contact": {"max_force_n": 2.5, "max_on_hand_n": 3.14159, "max_penetration_m": 9.78e-7},
    "residual": {"rms_n": 0.1234, "explained_by_age_n": 0.1, "unexplained_n": 0.01},
    "result": {"insertion_fraction": 0.98765},
    "result_greatest": {"insertion_fraction": 0.99},
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
    assert said["energy given to the tool, at the end"] == "unknown" and said["faults"] == "none"
    assert said["why this method"].startswith("several contacts")
    assert said["insertion fraction"] == "last 0.988, greatest 0.99"
    assert all(said[f"force withheld: {each.cause}"] == "3.2 s" for each in TABLE)
    assert not any("_" in words for words in said)


def test_a_run_that_left_no_figures_has_no_table(capsys):
    from haptic_sim.outcome import nothing

    tables.print_outcome(nothing() | {"scene": "wall", "done": False, "why": "the motor never moved", "bag": None})
    assert capsys.readouterr().out.splitlines() == ["wall: NOT done", "bag     none", "report  none"]
    assert dict(outcome_rows.rows(nothing() | {"faults": ["estop"]})) == {
        "length of the run": "0 s",
        "faults": "estop",
    }


MACHINE = {
    "checks": [
        Check(
            "cores", "2 of 2 for this process", False, "servo, plant and simulation want a core each: four"
        )._asdict(),
        Check("compiled kernels", "79 kept in /some/long/path/of/a/cache/folder/" + 20 * "x", True, "")._asdict(),
    ],
    "servo": {
        rate: {**SPREAD, "missed": 3, "ticks": rate, "scheduling": "SCHED_OTHER, no permission for SCHED_FIFO"}
        for rate in (1000, 10000)
    },
    "exchange_us_p99": 99.0,
    "choose": {"servo.rate": 4000, "exchange.rate": 1000},
}
LIVE = {
    "rate": 4000.0,
    "damping": 0.0,
    "passive": 8000.0,
    "live": {"quiet": 7654.321, "shaking": None, "damping": {"none": 1.0, "cancelled": 0.1}},
    "lockstep": {"quiet": 7654.321, "shaking": 9876.5, "damping": {"none": 1.0, "cancelled": 0.1}},
    "at_95_percent_of_passive": {"shaking": False, "energy_given": 1.5e-6},
}
AXIS = {
    "mass": (0.0801234, 0.00031),
    "damping": (1.6, 0.01),
    "coulomb": (0.05, 0.002),
    "bias": (0.0, 0.001),
    "delay": (1.2345e-4, 2.2e-6),
    "resolution": (5e-6, None),
    "residual": (1e-6, None),
}
IDENTIFIED = {"device": "mine", "axes": dict.fromkeys(("x", "y", "theta"), AXIS), "file": "identified.yaml"}
SAID = {
    "haptic_driver": {"level": 1, "message": "force withheld: " + 12 * "the tank is empty "},
    "haptic_driver: margin_theta": {"level": 0, "message": "4.2723e-05 s"},
    "haptic_driver: age": {"level": 3, "message": "nothing heard for 3 s"},
}
PROMISES = [
    Result("a sample of each deadline", True, "99.9 %", ""),
    Result("watchdog", False, "", 9 * "it did not cut "),
]
TABLES = {
    "demo": lambda: tables.print_outcome(RUN),
    "doctor": lambda: doctor._show(MACHINE),
    "zwidth --live": lambda: zwidth._show_live(LIVE),
    "identify": lambda: identify._show(IDENTIFIED),
    "status": lambda: status._print(SAID, 7),
    "device test": lambda: console().print(device._results(PROMISES)),
    "device show": lambda: console().print(device._figures({"driven": (30 * "so ", "")}, 7)),
}


@pytest.fixture
def shown(monkeypatch, capsys):
    """shown(name): what this table of TABLES is at 80 columns."""

    def show(name):
        monkeypatch.setenv("COLUMNS", "80")
        TABLES[name]()
        return capsys.readouterr().out

    return show


@pytest.mark.parametrize("name", TABLES)
def test_no_table_is_wider_than_eighty_columns(shown, name):
    assert max(map(len, shown(name).splitlines())) <= 80


@pytest.mark.parametrize(
    "words",
    [
        ("scenes",),
        ("scenes", "--explain", "wall"),
        ("passivity", "--stiffness", "2000", "--damping", "1", "--physical-damping", "1.6", "--period", "0.001"),
        ("zwidth", "--points", "4", "--lateness", "1e-4", "--seconds", "0.02", "--out", "map"),
    ],
)
def test_nor_is_what_a_command_prints_without_nodes(words, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    done = haptic(*words)
    assert done.stdout and max(map(len, done.stdout.splitlines())) <= 80
    assert re.search("^next: haptic |^next: open |^next: the same with ", done.stderr, re.MULTILINE)


def test_a_sentence_that_is_piped_stays_on_one_line(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    words = ("passivity", "--stiffness", "2000", "--damping", "1", "--physical-damping", "1.6", "--period", "0.001")
    [advice] = [line for line in haptic(*words).stdout.splitlines() if line.startswith("Not passive")]
    assert advice.endswith("only an operator would find out.")


def test_the_table_of_a_machine_has_warn_and_what_to_do(shown):
    said = shown("doctor")
    assert (
        20 * "x" in said.replace("│", "").replace(" ", "").replace("\n", "")
        and "warn" in said
        and "four" in said
        and "12.3 µs" in said
        and "3 of 1000" in said
    )
    assert "choose servo.rate 4000 Hz and exchange.rate 1000 Hz" in said


def test_the_table_of_what_was_identified_has_each_figure_to_its_error(shown):
    said = " ".join(shown("identify").split())
    assert "0.0801 ± 0.0003" in said and "0.123 ± 0.002" in said and "[ms]" in said and "[µm" in said


def test_the_table_of_a_running_display_has_each_figure_to_three_digits(shown):
    said = shown("status")
    assert "margin theta" in said and "42.7 µs" in said and "nothing heard for 3 s" in said


def test_the_table_of_walls_says_what_the_wall_at_the_limit_did(shown):
    said = " ".join(shown("zwidth --live").split())
    assert "7654" in said and "none" in said
    assert "passive up to 8000 N/m; a wall at 95 % of that stands still and gives 1.5 µJ to the hand" in said


def test_the_row_of_a_stiffness_beyond_the_passive_limit_says_no(monkeypatch):
    words = ("passivity", "--damping", "0", "--physical-damping", "1", "--period", "0.001", "--stiffness")
    for stiffness, answer in (("1999", "yes"), ("2001", "no")):
        rows = [line for line in haptic(*words, stiffness).stdout.splitlines() if "soft enough as a passive" in line]
        assert len(rows) == 2 and "wall" in rows[0] and "coupling" in rows[1]
        assert all(answer in row.split() and "2000 N/m" in row for row in rows)


def test_with_a_delay_the_limits_of_stiffness_as_a_wall_and_as_a_coupling_are_told_apart():
    words = ["--damping", "0", "--physical-damping", "0.5", "--period", "0.001", "--delay-samples", "1", "--stiffness"]
    for stiffness, told in (("249", ["yes", "yes"]), ("251", ["yes", "no"]), ("334", ["no", "no"])):
        said = haptic("passivity", *words, stiffness).stdout
        wall, coupling = (line.split() for line in said.splitlines() if "soft enough as a passive" in line)
        assert [next(word for word in row if word in ("yes", "no")) for row in (wall, coupling)] == told
        assert "333" in wall and "250" in coupling
    assert "could rise to 250 N/m as a coupling, to 333.33 N/m as a wall" in " ".join(
        haptic("passivity", *words, "100").stdout.split()
    )


@pytest.mark.parametrize(
    ("folder", "name", "option"),
    [("", "demo", "--params"), ("scenes", "wall", "--scene"), ("devices", "desktop", "--device")],
)
def test_a_right_file_is_told_the_command_that_runs_it(folder, name, option):
    path = find(folder, name)
    assert haptic("check", "--lateness", "0", path).stderr == f"next: haptic demo --view {option} {shown_path(path)}\n"


def test_passive_gains_are_told_how_to_set_them_and_others_what_to_try():
    words = ("passivity", "--damping", "0", "--physical-damping", "1", "--period", "0.001", "--stiffness")
    assert haptic(*words, "1000").stderr.strip().endswith("haptic set haptic_driver coupling.stiffness 1000")
    assert haptic(*words, "3000").stderr.strip() == "next: the same with --stiffness 1800, or more --physical-damping"
    assert haptic(*words, "3000", "--json").stderr == ""


def test_a_path_is_shown_as_it_is_typed_here(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    next_step(f"haptic report {shown_path(tmp_path / 'my run' / 'bag')}")
    assert capsys.readouterr().err == "next: haptic report 'my run/bag'\n"
    assert shown_path("/elsewhere/bag") == "/elsewhere/bag"
