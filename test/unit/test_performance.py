# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: what is missing is said, figures are those of what was measured, results are kept, shown, compared."""

import json
import sys

import numpy as np
import pytest
from in_process import bench, haptic

from bench import all as every
from bench import results
from bench.servo import cyclictest
from bench.servo import servo as bench_servo
from haptic_device.realtime import machine
from haptic_sim.supervision import lateness, machine_trial


def test_without_cyclictest_the_rest_is_measured_and_says_so(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    done = bench("servo", "--rate", "1000", "--seconds", "0.2", "--turns", "1")
    assert done.returncode == 0, done.stderr
    assert cyclictest.MISSING in done.stderr
    assert "| 1000 | prefer |" in done.stdout


def late(*microseconds):
    return lateness.Lateness(np.array(microseconds, float), 0, "test")


@pytest.fixture
def measured(monkeypatch):
    """measured(servo's, cyclictest's) has the next measurements come to these latenesses; once for all: the last."""

    def given(*pairs):
        ours, theirs = (list(column) for column in zip(*pairs, strict=True))
        monkeypatch.setattr(lateness, "alone", lambda *_: (ours.pop(0) if len(ours) > 1 else ours[0], None))
        monkeypatch.setattr(cyclictest, "cyclictest", lambda *_: theirs.pop(0) if len(theirs) > 1 else theirs[0])

    return given


def test_a_turn_without_cyclictest_takes_no_part_in_the_ratio_and_the_others_do(measured):
    measured((late(8.0), None), (late(6.0), late(2.0)), (late(4.0), late(4.0)), (late(8.0), None))
    found, without = bench_servo.lateness([1000.0], 0.2, 3)
    assert (found["p50"], found["cyclictest"]["p50"], found["p99_ratio"]) == (6.0, 3.0, 2.0)
    assert (without["p50"], without["cyclictest"], without["p99_ratio"]) == (8.0, None, None)


def test_histogram_of_cyclictest_with_late_ones_beyond_its_end(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    for said, sorted_us, missed in (
        ({"histogram": {2: 2, 5: 1, 700: 1}, "cycles": 6, "max": 3_000_000}, [2, 2, 5, 700, 1e5, 3e6], 1 + 200 + 6000),
        ({"histogram": {2: 2}, "cycles": 2, "max": 2}, [2, 2], 0),
    ):
        told = json.dumps({"thread": {"0": said}})
        path = "[word[7:] for word in sys.argv if word.startswith('--json=')][0]"
        (tmp_path / "cyclictest").write_text(f"#!{sys.executable}\nimport sys\nopen({path}, 'w').write({told!r})\n")
        (tmp_path / "cyclictest").chmod(0o755)
        found = cyclictest.cyclictest(2000.0, 0.2)
        assert (found.sorted_us.tolist(), found.missed) == (sorted_us, missed)


def trial(p999, compute=5.0, missed=0):
    return {"p999": p999, "compute": compute, "missed": missed, "ticks": 10000}


def test_the_rate_chosen_is_the_last_whose_forces_are_written_within_half_a_period():
    assert machine_trial.fastest({1000: trial(20.0), 4000: trial(119.9), 10000: trial(50.1)}) == 4000
    assert machine_trial.fastest({1000: trial(20.0), 4000: trial(120.1), 10000: trial(50.1)}) == 1000
    assert machine_trial.fastest({1000: trial(9000.0), 4000: trial(9000.0)}) == 1000
    assert machine_trial.fastest({1000: trial(20.0), 4000: trial(20.0, missed=10)}) == 4000
    assert machine_trial.fastest({1000: trial(20.0), 4000: trial(20.0, missed=11)}) == 1000


def test_the_exchange_is_no_faster_than_the_answers_the_servo_and_the_cores_allow():
    trials = {1000: trial(10.0), 4000: trial(10.0)}
    assert machine_trial.exchange_rate(4000, 100.0, trials, 4) == 2000
    assert machine_trial.exchange_rate(4000, 300.0, trials, 4) == 1000
    assert machine_trial.exchange_rate(1000, 100.0, trials, 4) == 1000
    assert machine_trial.exchange_rate(4000, 100.0, trials, 1) == 500


def test_every_check_of_the_machine_that_is_not_good_says_how_to_get_more():
    checks = machine.checks(80)
    assert {"kernel preemption", "real-time priority", "timer slack", "cores"} <= {check.name for check in checks}
    for check in checks:
        assert check.found
        assert check.good or check.advice


START = {"scene": "wall", "first": {"haptic_driver": 10.0}, "again": [{"haptic_driver": 2.0}, {"haptic_driver": 3.0}]}
FACTS = {"machine": {"cores": 2, "processor": "P", "system": "Linux-6-with-glibc"}, "length": "short"}
FACTS |= {"program": {"python": "3"}, "packages": {"numba": "0"}}


def folder(path, first):
    path.mkdir()
    (path / "machine.json").write_text(json.dumps(FACTS))
    (path / "start.json").write_text(json.dumps(START | {"first": {"haptic_driver": first}}))
    return path


def test_the_table_has_the_worst_of_the_hard_cases_and_the_least_speed_ratio(tmp_path):
    kept = folder(tmp_path / "kept", 10.0)
    hard = {"world": "partitioned", "letters": "", "tried": 2, "survives": True, "created": None}
    cases = [
        hard | {"scene": "light_tool", "overlap_m": 2e-6, "created": 0.0},
        hard | {"scene": "zeno_ball", "world": "impulse", "overlap_m": 1e-6, "created": 1e-5},
        hard | {"scene": "light_tool", "world": "impulse", "letters": "P", "overlap_m": 1e-3, "survives": False},
        hard | {"scene": "zeno_ball", "world": "box2d", "letters": "N", "overlap_m": None, "survives": False},
    ]
    run = {"scene": "wall", "kind": "single contact", "step_us": 1000, "created_j": 0.0, "scale_j": 1.0}
    run |= {"penetration_m": 0.0, "status": "stable"}
    runs = [
        run | {"method": "closed_form", "wall": 1e-5, "error": 1e-3},
        run | {"method": "pymunk", "wall": 8e-5, "error": 1e-2},
        run | {"method": "box2d", "wall": None, "error": None, "status": "cannot: a wall"},
    ]
    (kept / "hard_cases.json").write_text(json.dumps({"verdicts": cases}))
    (kept / "speed_error.json").write_text(json.dumps({"runs": runs, "equal_error": [], "versions": {}}))
    table = results.markdown(kept)
    assert "| hard cases survived by the method chosen | 2 of 2 | all |" in table
    assert "| deepest overlap of these | 2 µm | ≤ 100 µm |" in table
    assert "| energy created in these, of the largest energy | 0.001 % | ≤ 1 % |" in table
    assert "| least error, worst of 1 scenes | 0.1 % of the distance moved |" in table
    assert "| least speed ratio at equal error, single contact, to pymunk | 8 × | ≥ 5 |" in table
    (kept / "hard_cases.json").write_text(json.dumps({"verdicts": [cases[0] | {"overlap_m": None, "survives": False}]}))
    assert "| deepest overlap of these | – µm |" in results.markdown(kept)


def test_all_measures_only_what_is_missing_and_puts_the_table_between_the_marks(tmp_path):
    page, kept = tmp_path / "page.md", folder(tmp_path / "kept", 10.0)
    page.write_text(f"before\n{every.MARKS[0]}\nold\n{every.MARKS[1]}\nafter\n")
    done = bench("all", "--only", "start", "--out", kept, "--insert", page)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert "| very first start, all nodes at work | 10 s | ≤ 20 s |" in text


def test_a_measurement_that_is_none_of_them_is_refused_in_one_sentence():
    done = bench("all", "--only", "speed")
    assert done.returncode == 1 and "benchmark is 'speed'; it must be one of start" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_there_is_is_listed_and_what_is_not_is_refused():
    listed = bench()
    assert listed.returncode == 0 and "speed_error " in listed.stdout
    refused = bench("speed-error")
    assert refused.returncode == 1 and "measurement is 'speed-error'; it must be one of all, " in refused.stderr


def test_haptic_bench_says_in_one_sentence_where_the_measurements_are():
    done = haptic("bench", "servo", "--rate", "1000")
    assert done.returncode == 1 and "python -m bench" in done.stderr and len(done.stderr.splitlines()) == 1
