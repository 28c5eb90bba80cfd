# SPDX-License-Identifier: Apache-2.0
"""The notebooks of examples/notebooks: each runs as a script, and finds what is known of the run that it makes."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "examples/notebooks"
NAMES = "compare_two_bags", "energy_at_the_port", "speed_against_error", "wall_stiffness", "zwidth_map"


@pytest.fixture
def found(monkeypatch, tmp_path):
    """found(name): what the cells of this notebook define, as marimo's App.run gives it."""
    monkeypatch.syspath_prepend(str(NOTEBOOKS))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["notebook"])

    def run(name):
        spec = importlib.util.spec_from_file_location(name, NOTEBOOKS / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.app.run()[1]

    return run


def script(name, *words, folder):
    command = [sys.executable, str(NOTEBOOKS / f"{name}.py"), *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("name", NAMES)
def test_each_notebook_runs_as_a_script_says_what_it_found_and_leaves_no_file(name, tmp_path):
    done = script(name, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() and not done.stderr
    assert list(tmp_path.iterdir()) == []


def test_every_notebook_of_the_folder_is_tried():
    apps = {path.stem for path in NOTEBOOKS.glob("*.py") if "marimo.App" in path.read_text(encoding="utf-8")}
    assert apps == set(NAMES)


def test_the_stiffness_of_the_wall_lies_within_its_interval(found):
    said = found("wall_stiffness")
    assert abs(said["stiffness"] - 1000.0) < said["half_width"] < 10.0
    assert len(said["contacts"]) == 3
    # a damper of 1 N s/m less K T: the force is held for a period
    assert abs(said["damping"] - (1.0 - 1000.0 / 4000.0)) < 0.05


def test_the_energy_by_hand_is_that_which_the_nodes_book(found):
    said = found("energy_at_the_port")
    greatest = abs(said["booked"]).max()
    assert greatest > 1e-3
    assert said["difference"] < 1e-9 * greatest
    assert said["tool_booked"] > 1e-4
    assert said["tool_difference"] < 0.01 * said["tool_booked"]
    assert said["by_hand"].max() <= 1e-12  # the operator never gets what was not put in


def test_no_passive_wall_of_the_map_shakes_and_some_others_do(found):
    said = found("zwidth_map")
    assert said["passive_cells"] > 0 and said["passive_shaking"] == 0
    assert 0 < said["shaking_cells"] < said["plane"].outcome.assessment.size


def test_a_front_rises_in_error_as_it_falls_in_time(found):
    said = found("speed_against_error")
    assert "impulse" in said["fronts"] and "mujoco_rk4" in said["fronts"]
    for front in said["fronts"].values():
        errors, walls = zip(*front, strict=True)
        assert list(errors) == sorted(errors) and list(walls) == sorted(walls, reverse=True)


def test_the_stiffer_coupling_stretches_less_and_neither_gives_energy(found):
    said = found("compare_two_bags")
    (soft, stiff), (soft_way, stiff_way) = said["greatest_force"], said["greatest_stretch"]
    assert stiff > soft and stiff_way < soft_way
    for force, way, stiffness in ((soft, soft_way, 1000.0), (stiff, stiff_way, 2000.0)):
        assert abs(force - stiffness * way) < 0.1 * force  # what is left is the damper's
    assert all(energy < 0.0 for energy in said["energy"])


@pytest.mark.parametrize(
    "words, said",
    [
        (("wall_stiffness", "--bag", "nothere"), "bag nothere does not exist"),
        (("compare_two_bags", "--other", "nothere"), "bag nothere does not exist"),
        (("zwidth_map", "--rate", "499"), "rate is 499 Hz; the servo takes 500 to 10000 Hz"),
        (("zwidth_map", "--rate", "10001"), "rate is 10001 Hz; the servo takes 500 to 10000 Hz"),
        (("speed_against_error", "--scene", "moon"), "--scene is moon; "),
        (("speed_against_error", "--csv", __file__), "test_notebooks.py has no column "),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(words, said, tmp_path):
    done = script(*words, folder=tmp_path)
    assert done.returncode == 1 and done.stdout == ""
    assert said in done.stderr and "Traceback" not in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize("rate", ["500", "10000"])
def test_the_slowest_and_the_fastest_servo_have_a_map(rate, tmp_path):
    done = script("zwidth_map", "--rate", rate, folder=tmp_path)
    assert done.returncode == 0 and " passive walls 0 shake" in done.stdout
