# SPDX-License-Identifier: Apache-2.0
"""Measurements: what is compared is the same problem, figures are those of what was measured, results are kept; and
which rates the product chooses by what it measures of a machine."""

import json

import pytest
from in_process import bench, haptic

from bench import all as every
from bench.jobs import read_csv
from bench.methods import table, world
from bench.methods.measure import Run, run
from bench.reference.case import case
from bench.reference.reference import reference
from bench.servo import costs
from haptic_device.realtime import machine
from haptic_display.run import machine_trial
from haptic_sim.lockstep.error_metrics import STABLE, judge


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


def made(method="partitioned", error=1e-3, wall=1.0, scene="wall"):
    return Run(scene, "single contact", method, 100, wall, error, 0.0, 1.0, 0.0, STABLE)


def test_a_peer_that_cannot_model_a_scene_or_blows_up_is_marked_and_not_counted():
    cannot = run(case("zeno_ball"), reference("zeno_ball"), "mujoco_rk4", 100)
    assert (cannot.status, cannot.counts) == ("cannot: no restitution", False)
    assert table.ratios([cannot, made(scene="zeno_ball")]) == []
    # An undamped explicit coupling of 2000 N/m on 0.1 kg at 50 ms: far beyond 2/omega.
    unstable = run(case("pendulum"), reference("pendulum"), "pymunk", 50000)
    assert (unstable.status, unstable.counts) == ("unstable", False)


def test_a_stack_of_any_height_is_the_shipped_scene_without_its_task():
    assert [len(costs.stack(blocks).bodies) for blocks in (1, 3)] == [2, 4]


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


def test_what_cannot_be_measured_is_refused_in_one_sentence(monkeypatch, tmp_path):
    (tmp_path / "b.csv").write_text("x,y\n1,2\n")
    with pytest.raises(ValueError, match=r"b\.csv has not the columns scene, kind"):
        read_csv(tmp_path / "b.csv", Run)
    monkeypatch.setenv("PATH", "/nowhere")
    for words, sentence in (
        (("speed_error", "--scenes", "walls"), "scene is 'walls'; those that have a reference are free_space"),
        (("hard_cases", "--scenes", "dune"), "scene is 'dune'; it must be one of collinear_1e3, "),
        (("reference", "wall"), "scene 'wall' has a closed form; there is nothing to store"),
        (("speed-error",), "measurement is 'speed-error'; it must be one of all, "),
        (("link", "--rate", "1000", "--seconds", "0.2", "--turns", "1"), "link_pair.c cannot be compiled: "),
    ):
        done = bench(*words)
        assert done.returncode == 1 and sentence in done.stderr and "Traceback" not in done.stderr
    assert "speed_error " in bench().stdout
    done = haptic("bench", "servo", "--rate", "1000")
    assert done.returncode == 1 and "python -m bench" in done.stderr and len(done.stderr.splitlines()) == 1


START = {"scene": "wall", "first": {"haptic_driver": 10.0}, "again": [{"haptic_driver": 2.0}, {"haptic_driver": 3.0}]}
MACHINE = {"machine": {"cores": 2, "processor": "P", "system": "Linux-6-with-glibc"}, "length": "short"}
MACHINE |= {"program": {"python": "3"}, "packages": {"numba": "0"}}


def test_all_measures_only_what_is_missing_and_puts_the_table_of_all_that_is_kept_between_the_marks(tmp_path):
    page, kept = tmp_path / "page.md", tmp_path / "kept"
    ran = made()._asdict() | {"method": "closed_form", "wall": 1e-5}
    runs = [ran, ran | {"method": "pymunk", "wall": 8e-5, "error": 1e-2}]
    kept.mkdir()
    for name, found in (
        ("machine", MACHINE),
        ("start", START),
        ("speed_error", {"runs": runs, "equal_error": [], "versions": {}}),
    ):
        (kept / f"{name}.json").write_text(json.dumps(found))
    page.write_text(f"before\n{every.MARKS[0]}\nold\n{every.MARKS[1]}\nafter\n")
    done = bench("all", "--only", "start", "--out", kept, "--insert", page)
    text = page.read_text()
    assert done.returncode == 0 and text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert "| very first start, all nodes at work | 10 s | ≤ 20 s |" in text
    assert "| least error, worst of 1 scenes | 0.1 % of the distance moved |" in text
    assert "| least speed ratio at equal error, single contact, to pymunk | 8 × | ≥ 5 |" in text


def test_a_peer_is_told_ahead_only_at_errors_at_which_it_is_faster_than_the_best_of_ours():
    made = (("event_driven", 1e-3, 0.02), ("partitioned", 1e-6, 0.05), ("pymunk", 1e-3, 0.01), ("pymunk", 1e-5, 0.06))
    runs = [Run("wall", "single contact", name, 100, wall, error, 0.0, 1.0, 0.0, STABLE) for name, error, wall in made]
    assert [lead[1:] for lead in table.leads(runs)] == [("pymunk", 1e-3, 1e-3, 2.0)]
    assert table.leads(runs[2:])[0].times == float("inf")
    for wall, count in ((0.02 / 1.04, 0), (0.02 / 1.06, 1)):
        assert len(table.leads([runs[0], runs[2]._replace(wall=wall)])) == count
