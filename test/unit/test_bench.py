# SPDX-License-Identifier: Apache-2.0
"""Measurements: what is compared is the same problem, figures are those of what was measured, results are kept; and
which rates the product chooses by what it measures of a machine."""

import json
import signal
import sys

import numpy as np
import pytest
from in_process import bench, haptic

from bench import all as every
from bench import results
from bench.jobs import read_csv
from bench.methods import speed_error, table, world
from bench.methods.measure import Run, run
from bench.reference.case import case
from bench.reference.reference import reference
from bench.servo import cyclictest, link
from bench.servo import servo as bench_servo
from haptic_device.realtime import machine
from haptic_sim.error_metrics import STABLE, judge
from haptic_sim.supervision import lateness, machine_trial


def trial(p999, missed=0):
    return {"p999": p999, "compute": 5.0, "missed": missed, "ticks": 10000}


def test_the_rate_chosen_is_the_last_whose_forces_are_written_within_half_a_period_and_the_exchange_is_no_faster():
    for trials, fastest in (
        ({1000: trial(20.0), 4000: trial(119.9), 10000: trial(50.1)}, 4000),
        ({1000: trial(20.0), 4000: trial(120.1), 10000: trial(50.1)}, 1000),
        ({1000: trial(9000.0), 4000: trial(9000.0)}, 1000),
        ({1000: trial(20.0), 4000: trial(20.0, missed=10)}, 4000),
        ({1000: trial(20.0), 4000: trial(20.0, missed=11)}, 1000),
    ):
        assert machine_trial.fastest(trials) == fastest
    trials = {1000: trial(10.0), 4000: trial(10.0)}
    for rate, answer_us, cores, exchange in (
        (4000, 100.0, 4, 2000),
        (4000, 300.0, 4, 1000),
        (1000, 100.0, 4, 1000),
        (4000, 100.0, 1, 500),
    ):
        assert machine_trial.exchange_rate(rate, answer_us, trials, cores) == exchange


def test_every_check_of_the_machine_that_is_not_good_says_how_to_get_more():
    checks = machine.checks(80)
    assert {"kernel preemption", "real-time priority", "timer slack", "cores"} <= {check.name for check in checks}
    assert all(check.found and (check.good or check.advice) for check in checks)


@pytest.mark.parametrize("method", ["partitioned", "closed_form", "penalty_implicit", "pymunk", "mujoco_implicit"])
def test_the_whole_path_in_one_call_ends_where_sample_by_sample_does(method):
    of, places = case("wall"), []
    path = of.path()[:401]
    for chunk in (1, 100):
        made_of = world.make(method, of.scene, 1e-4)
        made_of.couple(of.gains)
        for k in range(0, 400, chunk):
            made_of.step(path[k : k + chunk + 1], 10)
        places.append(made_of.pose("tool"))
    assert places[0] == pytest.approx(places[1], abs=1e-9)


def made(method="partitioned", error=1e-3, wall=1.0, scene="wall"):
    return Run(scene, "single contact", method, 100, wall, error, 0.0, 1.0, 0.0, STABLE)


def test_a_peer_that_cannot_model_a_scene_or_blows_up_is_marked_and_not_counted():
    cannot = run(case("zeno_ball"), reference("zeno_ball"), "mujoco_rk4", 100)
    assert (cannot.status, cannot.counts) == ("cannot: no restitution", False)
    assert table.ratios([cannot, made(scene="zeno_ball")]) == []
    # An undamped explicit coupling of 2000 N/m on 0.1 kg at 50 ms: far beyond 2/omega.
    unstable = run(case("pendulum"), reference("pendulum"), "pymunk", 50000)
    assert (unstable.status, unstable.counts) == ("unstable", False)


def test_energy_from_nowhere_and_overlap_are_seen():
    """Explicit springs let bodies sink in visibly, the direct solve does not and creates nothing."""
    of, found = case("push_block"), []
    for name in ("penalty_explicit", "partitioned"):
        made_of = world.make(name, of.scene, 0.25e-3)
        made_of.couple(of.gains)
        found.append(judge(of, reference("push_block"), made_of, 4))
    soft, rigid = found
    assert soft.penetration > 1e-4 > 1e-6 > rigid.penetration
    assert rigid.created <= 1e-12 * rigid.scale


def test_times_are_compared_at_the_smallest_error_that_both_reach():
    ours = [made(error=1e-2, wall=0.1), made(error=1e-4, wall=1.0), made("impulse", 1e-5, 0.1)]
    (ratio,) = table.ratios([*ours, made("pymunk", 1e-3, 20.0), made("pymunk", 1e-1, 2.0)])
    assert (ratio.method, ratio.peer) == ("partitioned", "pymunk")
    assert (ratio.error, ratio.wall, ratio.peer_wall, ratio.ratio) == (1e-3, 1.0, 20.0, 20.0)
    assert ratio.reached
    assert not table.ratios([made(wall=1.0), made("pymunk", wall=4.9)])[0].reached


def test_interrupted_it_keeps_what_it_has(tmp_path, monkeypatch):
    measured, asked = speed_error.measured, []

    def interrupted(*job):
        asked.append(job)
        if len(asked) == 2:
            signal.raise_signal(signal.SIGINT)
        return measured(*job)

    monkeypatch.setattr(speed_error, "measured", interrupted)
    words = ["--short", "--scenes", "wall,zeno_ball", "--methods", "partitioned,closed_form", "--out", tmp_path]
    done = bench("speed_error", *words)
    assert done.returncode == 130 and "interrupted; 1 of 10 runs are kept" in done.stderr
    kept = read_csv(tmp_path / "speed_error.csv", Run)
    assert [(one.scene, one.method, one.step_us) for one in kept] == asked[:1]
    assert (tmp_path / "pareto.png").exists()


def test_a_peer_that_is_not_installed_is_left_out_with_a_sentence(monkeypatch):
    for module in ("mujoco", "bench.methods.peer_mujoco", "bench.methods.mujoco_model"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    done = bench("speed_error", "--short", "--scenes", "wall", "--methods", "closed_form,mujoco_rk4")
    assert done.returncode == 0 and "closed_form" in done.stdout
    assert "mujoco_rk4 is left out: package mujoco is not installed; pip install '.[bench]'" in done.stderr


def test_what_cannot_be_measured_is_refused_in_one_sentence(monkeypatch, tmp_path):
    (tmp_path / "b.csv").write_text("x,y\n1,2\n")
    with pytest.raises(ValueError, match=r"b\.csv has not the columns scene, kind"):
        read_csv(tmp_path / "b.csv", Run)
    monkeypatch.setenv("PATH", "/nowhere")
    for words, sentence in (
        (("speed_error", "--scenes", "walls"), "scene is 'walls'; those that have a reference are free_space"),
        (("speed_error", "--methods", "magic"), "method is 'magic'; it must be one of impulse"),
        (("hard_cases", "--scenes", "wall"), "scene is 'wall'; it must be one of collinear_1e3"),
        (("growth", "--worlds", "dune"), "world is 'dune'; it must be one of row, heap"),
        (("reference", "wall"), "scene 'wall' has a closed form; there is nothing to store"),
        (("all", "--only", "speed"), "benchmark is 'speed'; it must be one of start"),
        (("speed-error",), "measurement is 'speed-error'; it must be one of all, "),
        (("link", "--rate", "1000", "--seconds", "0.2", "--turns", "1"), "link_pair.c cannot be compiled: "),
    ):
        done = bench(*words)
        assert done.returncode == 1 and sentence in done.stderr and "Traceback" not in done.stderr
    assert "speed_error " in bench().stdout
    done = haptic("bench", "servo", "--rate", "1000")
    assert done.returncode == 1 and "python -m bench" in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_turn_without_cyclictest_takes_no_part_in_the_ratio_and_the_others_do(monkeypatch):
    def late(microseconds):
        return lateness.Lateness(np.array([microseconds]), 0, "test")

    ours, theirs = [late(us) for us in (8.0, 6.0, 4.0, 8.0, 8.0, 8.0)], [None, late(2.0), late(4.0), None, None, None]
    monkeypatch.setattr(lateness, "alone", lambda *_: (ours.pop(0), None))
    monkeypatch.setattr(cyclictest, "cyclictest", lambda *_: theirs.pop(0))
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


def test_the_ratio_of_a_link_is_the_median_of_the_turns_and_what_came_late_is_counted_apart():
    ours = [np.array([60_000, 60_000, -1, -1]), np.array([90_000] * 4), np.array([10_000] * 4)]
    pair = [np.array([30_000] * 4), np.array([30_000] * 4), np.array([20_000] * 4)]
    found = link.of_turns(zip(ours, pair, strict=True))
    assert found["ours"] == {"p50": 60.0, "p99": 60.0, "late": 0.0} and found["pair"]["p50"] == 30.0
    assert found["p50_ratio"] == found["p99_ratio"] == pytest.approx(2.0)
    assert link.of_turns([(ours[0], pair[0])])["ours"]["late"] == 0.5
    found = link.of_turns([(np.array([-1, -1]), np.array([30_000, 30_000]))])
    assert (found["ours"]["p50"], found["ours"]["late"], found["p50_ratio"]) == (None, 1.0, None)


@pytest.mark.parametrize(
    ("error_after", "again", "p99"),
    [
        (lambda when: -2.0, pytest.approx(0.1, abs=0.011), 2.0),
        (lambda when: 11.0 if when < 3.5 else 9.0, pytest.approx(0.5, abs=0.011), 9.0),  # relapsed
        (lambda when: 11.0, None, 1.0),  # never: what came before the step counts
        (lambda when: 50.0 if when > 5.0 else 1.0, pytest.approx(0.1, abs=0.011), 50.0),  # later
    ],
)
def test_the_clock_is_known_again_when_its_error_stays_small(error_after, again, p99):
    """Each 10 ms for 6 s: 1 µs off, 200 µs for 0.1 s after the step, then `error_after`(time)."""
    when = np.arange(0.0, 6.0, 0.01)
    error = np.where(when < 3.0, 1.0, np.where(when < 3.1, 200.0, [error_after(one) for one in when]))
    found = link.of_looks(np.column_stack([when, error, when >= 3.1]))
    assert (found["again"], found["steps"], found["p99"]) == (again, 1, p99)


START = {"scene": "wall", "first": {"haptic_driver": 10.0}, "again": [{"haptic_driver": 2.0}, {"haptic_driver": 3.0}]}
FACTS = {"machine": {"cores": 2, "processor": "P", "system": "Linux-6-with-glibc"}, "length": "short"}
FACTS |= {"program": {"python": "3"}, "packages": {"numba": "0"}}


def test_all_measures_only_what_is_missing_and_puts_the_table_of_all_that_is_kept_between_the_marks(tmp_path):
    page, kept = tmp_path / "page.md", tmp_path / "kept"
    hard = {"world": "partitioned", "letters": "", "tried": 2, "survives": True, "overlap_m": 2e-6, "created": 0.0}
    failed = hard | {"scene": "zeno_ball", "world": "box2d", "letters": "N", "overlap_m": None, "survives": False}
    verdicts = [
        hard | {"scene": "light_tool"},
        hard | {"scene": "zeno_ball", "world": "impulse", "overlap_m": 1e-6, "created": 1e-5},
        hard | {"scene": "light_tool", "world": "impulse", "letters": "P", "overlap_m": 1e-3, "survives": False},
        failed,
    ]
    ran = made()._asdict() | {"method": "closed_form", "wall": 1e-5}
    runs = [ran, ran | {"method": "pymunk", "wall": 8e-5, "error": 1e-2}]
    kept.mkdir()
    for name, found in (
        ("machine", FACTS),
        ("start", START),
        ("hard_cases", {"verdicts": verdicts}),
        ("speed_error", {"runs": runs, "equal_error": [], "versions": {}}),
    ):
        (kept / f"{name}.json").write_text(json.dumps(found))
    page.write_text(f"before\n{every.MARKS[0]}\nold\n{every.MARKS[1]}\nafter\n")
    done = bench("all", "--only", "start", "--out", kept, "--insert", page)
    text = page.read_text()
    assert done.returncode == 0 and text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    for row in (
        "| very first start, all nodes at work | 10 s | ≤ 20 s |",
        "| hard cases survived by the method chosen | 2 of 2 | all |",
        "| deepest overlap of these | 2 µm | ≤ 100 µm |",
        "| energy created in these, of the largest energy | 0.001 % | ≤ 1 % |",
        "| least error, worst of 1 scenes | 0.1 % of the distance moved |",
        "| least speed ratio at equal error, single contact, to pymunk | 8 × | ≥ 5 |",
    ):
        assert row in text
    waits = {"ours": {"p50": 50.0, "p99": 80.0}, "p50_ratio": 1.5, "p99_ratio": None}
    clock = {"transport": "pty", "p99": 4.0, "steps": 1, "again": 0.1}
    shown = results.READERS["link"]({"waits": [{"transport": "udp", "rate": 1000.0} | waits], "clock": [clock]})
    assert {
        results.Figure("sample in hand p50 to a bare pair's, udp, 1000 Hz", 1.5, "×", "≤ 2"),
        results.Figure("sample in hand p99 to a bare pair's, udp, 1000 Hz", None, "×", "≤ 2"),
        results.Figure("error of the device's clock p99, pty", 4.0, "µs", "≤ 10 µs"),
    } <= {*shown}
