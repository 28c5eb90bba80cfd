# SPDX-License-Identifier: Apache-2.0
"""The comparison itself: what is measured is what happens, peers stand where they should, and interrupting keeps it."""

import signal
import sys
from pathlib import Path

import pytest
from in_process import bench

from bench.jobs import read_csv
from bench.methods import hard_cases, speed_error, table, world
from bench.methods.measure import Run, run
from haptic_sim.error_metrics import STABLE, judge
from reference.case import case
from reference.reference import reference

ROOT = Path(__file__).parents[2]


def made(method="partitioned", error=1e-3, wall=1.0, scene="wall", kind="single contact", status=STABLE, step=100):
    return Run(scene, kind, method, step, wall, error, 0.0, 1.0, 0.0, status)


@pytest.mark.parametrize("method", ["partitioned", "closed_form", "penalty_implicit", "pymunk", "mujoco_implicit"])
def test_the_whole_path_in_one_call_ends_where_sample_by_sample_does(method):
    pytest.importorskip("mujoco" if method == "mujoco_implicit" else "pymunk")
    of, places = case("wall"), []
    for chunk in (1, 100):
        made_of = world.make(method, of.scene, 1e-4)
        made_of.couple(of.gains)
        path = of.path()[:401]
        for k in range(0, 400, chunk):
            made_of.step(path[k : k + chunk + 1], 10)
        places.append(made_of.pose("tool"))
    assert places[0] == pytest.approx(places[1], abs=1e-9)


def test_a_peer_that_cannot_model_a_scene_is_marked_and_not_counted():
    pytest.importorskip("mujoco")
    found = run(case("zeno_ball"), reference("zeno_ball"), "mujoco_rk4", 100)
    assert found.status == "cannot: no restitution"
    assert not found.counts
    assert table.ratios([found, made(scene="zeno_ball")]) == []


def test_a_run_that_blows_up_is_unstable_and_not_counted():
    """An undamped explicit coupling of 2000 N/m on 0.1 kg at 50 ms: far beyond 2/omega."""
    of = case("pendulum")
    found = run(of, reference("pendulum"), "pymunk", 50000)
    assert found.status == "unstable"
    assert not found.counts


def test_energy_from_nowhere_and_overlap_are_seen():
    """Explicit springs let bodies sink in visibly, the direct solve does not and creates nothing."""
    of = case("push_block")
    soft, rigid = (
        judge(of, reference("push_block"), _ready(of, name), 4) for name in ("penalty_explicit", "partitioned")
    )
    assert soft.penetration > 1e-4 > 1e-6 > rigid.penetration
    assert rigid.created <= 1e-12 * rigid.scale


def _ready(of, name):
    made_of = world.make(name, of.scene, 0.25e-3)
    made_of.couple(of.gains)
    return made_of


def test_times_are_compared_at_the_smallest_error_that_both_reach():
    runs = [
        made(error=1e-2, wall=0.1),
        made(error=1e-4, wall=1.0),
        made("pymunk", 1e-3, 20.0),
        made("pymunk", 1e-1, 2.0),
    ]
    (ratio,) = table.ratios([*runs, made("impulse", 1e-5, 0.1)])
    assert ratio.method == "partitioned"
    assert (ratio.peer, ratio.error, ratio.wall, ratio.peer_wall, ratio.ratio) == ("pymunk", 1e-3, 1.0, 20.0, 20.0)
    assert ratio.reached
    assert not table.ratios([made(wall=1.0), made("pymunk", wall=4.9)])[0].reached


def test_a_table_of_other_columns_is_refused(tmp_path):
    (tmp_path / "b.csv").write_text("x,y\n1,2\n")
    with pytest.raises(ValueError, match="b.csv has not the columns scene, kind"):
        read_csv(tmp_path / "b.csv", Run)


def test_the_table_in_the_documents_is_that_of_the_stored_runs():
    folder = ROOT / "docs" / "benchmarks"
    shown = (folder / "speed_error.md").read_text(encoding="utf-8").split("\n\n")[2].splitlines()
    of_runs = table.markdown(read_csv(folder / "speed_error.csv", Run)).splitlines()
    assert shown[1:] == of_runs[1:]  # the head has the versions of the peers that ran


def test_interrupted_it_keeps_what_it_has(tmp_path, monkeypatch):
    measured, asked = speed_error.measured, []

    def interrupted(*job):
        asked.append(job)
        if len(asked) == 5:
            signal.raise_signal(signal.SIGINT)
        return measured(*job)

    monkeypatch.setattr(speed_error, "measured", interrupted)
    words = ["--short", "--scenes", "wall,zeno_ball", "--methods", "partitioned,closed_form", "--out", tmp_path]
    done = bench("speed_error", *words)
    assert done.returncode == 130 and "interrupted; 4 of 10 runs are kept" in done.stderr
    kept = read_csv(tmp_path / "speed_error.csv", Run)
    assert [(one.scene, one.method, one.step_us) for one in kept] == asked[:4]
    assert (tmp_path / "pareto.png").exists()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("speed_error", "--scenes", "walls"), "scene is 'walls'; those that have a reference are free_space"),
        (("speed_error", "--methods", "magic"), "method is 'magic'; it must be one of impulse"),
        (("hard_cases", "--scenes", "wall"), "scene is 'wall'; it must be one of collinear_1e3"),
        (("growth", "--worlds", "dune"), "world is 'dune'; it must be one of row, heap"),
        (("reference", "wall"), "scene 'wall' has a closed form; there is nothing to store"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(words, sentence):
    done = bench(*words)
    assert done.returncode != 0
    assert sentence in done.stderr


def test_a_peer_that_is_not_installed_is_left_out_with_a_sentence(monkeypatch):
    for module in ("mujoco", "bench.methods.peer_mujoco", "bench.methods.mujoco_model"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    done = bench("speed_error", "--short", "--scenes", "wall", "--methods", "closed_form,mujoco_rk4")
    assert done.returncode == 0, done.stderr
    assert "mujoco_rk4 is left out: package mujoco is not installed; pip install '.[bench]'" in done.stderr
    assert "closed_form" in done.stdout


def test_explicit_penalties_fail_hard_cases_that_the_direct_solve_survives():
    """Where section 5 of the paper says they would: a light block under a heavy one, a coupling that is too stiff."""
    for name in ("heavy_on_light_1e6", "stiff_coupling"):
        assert "N" in hard_cases.verdict(name, "penalty_explicit", 1).letters
    survivor = hard_cases.verdict("heavy_on_light_1e6", "partitioned", 2)
    assert survivor.survives
    assert survivor.tried == 2


def test_a_shot_that_came_through_a_thin_plate_is_seen():
    assert "T" in hard_cases.verdict("thin_plate", "pymunk", 2).letters
    assert hard_cases.verdict("thin_plate", "partitioned", 2).letters == ""
