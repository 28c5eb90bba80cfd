# SPDX-License-Identifier: Apache-2.0
"""`haptic passivity`: a assessment one can read, one object with --json, and a sentence for what cannot be."""

import json
import math

import pytest
from in_process import haptic

from haptic_device.analysis.assessment import Display, advise, assess

PROMISED = {"passive", "stable", "margin", "b_required", "mu_passive", "mu_margin"}
PROMISED |= {f"stiffness_max_{kind}" for kind in ("passive", "stable", "mu")}


def passivity(*words, **options):
    """Run the subcommand on a device of 0.8 N s/m at 4 kHz, with options changed or added."""
    device = {"stiffness": 5000, "damping": 0.05, "physical-damping": 0.8, "period": 0.00025}
    return haptic("passivity", *words, *(f"--{name}={value}" for name, value in {**device, **options}.items()))


def judged(**options):
    result = passivity("--json", **options)
    assert result.returncode == 0
    return json.loads(result.stdout)


def test_json_is_one_object_with_the_promised_keys():
    assessment = judged()
    assert assessment.keys() >= PROMISED
    assert assessment["passive"] and assessment["stable"] and assessment["mu_passive"]
    assert assessment["b_required"] == pytest.approx(0.675)
    assert assessment["margin"] == pytest.approx(0.125)
    assert assessment["stiffness_max_passive"] == pytest.approx(6000.0)


@pytest.mark.parametrize("stiffness, passive", [(5999, True), (6001, False)])
def test_the_verdict_turns_at_the_largest_passive_stiffness(stiffness, passive):
    assessment = judged(stiffness=stiffness)
    assert assessment["passive"] is assessment["mu_passive"] is passive
    assert (assessment["mu_margin"] > 0.0) is passive


def test_the_verdict_on_stability_turns_at_the_largest_stable_stiffness():
    boundary = judged()["stiffness_max_stable"]
    assert judged(stiffness=0.999 * boundary)["stable"] is True
    assert judged(stiffness=1.001 * boundary)["stable"] is False
    assert boundary > judged()["stiffness_max_passive"]


@pytest.mark.parametrize("coulomb, passive", [(0.0269, False), (0.0271, True)])
def test_friction_must_cover_the_encoder_step(coulomb, passive):
    assert judged(resolution=1e-5, coulomb=coulomb)["passive"] is passive


def test_the_largest_passive_stiffness_counts_friction_too():
    limit = judged(resolution=1e-5, coulomb=0.01)["stiffness_max_passive"]
    assert judged(stiffness=0.999 * limit, resolution=1e-5, coulomb=0.01)["passive"] is True
    assert judged(stiffness=1.001 * limit, resolution=1e-5, coulomb=0.01)["passive"] is False


def test_delay_and_lag_count():
    assert judged(**{"delay-samples": 0.5})["b_required"] > judged(**{"delay-samples": 0.1})["b_required"] > 0.675
    assert judged(**{"velocity-lag": 0.001})["b_required"] < 0.675


def test_a_need_without_end_is_null():
    assessment = judged(damping=-0.7)
    assert assessment["b_required_mu"] is None
    assert assessment["mu_passive"] is False


def test_the_table_ends_with_a_sentence_that_says_what_to_change():
    result = passivity(stiffness=12000)
    assert result.returncode == 0
    assert "needs b > 1.55 N s/m and the device has 0.8" in result.stdout
    assert "lower the stiffness below 6000 N/m" in result.stdout


@pytest.mark.parametrize(
    "display, words",
    [
        (Display(5000.0, 0.05, 0.8, 2.5e-4), "Passive with 0.125 N s/m of physical damping to spare"),
        (Display(5000.0, -0.1, 0.8, 2.5e-4), "the stiffness could rise"),
        (Display(1000.0, -0.3, 0.8, 2.5e-4), "Passive as a wall"),
        (Display(100.0, 2.0, 0.8, 2.5e-4), "no stiffness is passive with it"),
        (Display(5000.0, 0.05, 0.8, 2.5e-4, resolution=1e-5), "needs 0.027 N of friction and the device has 0"),
        (Display(6200.0, 0.05, 0.8, 2.5e-4), "only an operator would find out"),
        (Display(9000.0, 0.05, 0.8, 2.5e-4), "not even stable on its own"),
    ],
)
def test_the_sentence_names_what_is_lacking(display, words):
    assert words in advise(display, assess(display))


def test_the_stiffness_that_is_promised_is_passive_as_a_coupling_too():
    display = Display(100.0, 0.0, 0.5, 1e-3, delay_samples=1.0)
    assessment = assess(display)
    assert assessment.stiffness_max_passive == pytest.approx(1000.0 / 3.0)
    assert assessment.stiffness_max_mu == pytest.approx(250.0)
    assert "could rise to 250 N/m as a coupling, to 333.33 N/m as a wall" in advise(display, assessment)


@pytest.mark.parametrize("damping", [0.7, 0.05, 0.0, -0.05, -0.19])
def test_the_largest_stiffness_of_a_coupling_is_the_root_of_its_closed_form(damping):
    b, period = 0.8, 2.5e-4
    half = b - damping if damping >= 0.0 else 0.5 * (b + math.sqrt(b**2 + 4.0 * b * damping))
    assert judged(damping=damping)["stiffness_max_mu"] == pytest.approx(2.0 * half / period, rel=1e-9)


@pytest.mark.parametrize(
    "damping, lag, delay", [(0.2, 0.0, 1.0), (0.2, 1e-3, 0.3), (-0.05, 2e-4, 0.5), (-0.1, 0.0, 0.0)]
)
def test_a_coupling_is_passive_just_below_its_largest_stiffness_and_active_just_above(damping, lag, delay):
    others = {"damping": damping, "velocity-lag": lag, "delay-samples": delay}
    limit = judged(**others)["stiffness_max_mu"]
    assert limit > 0.0
    assert judged(stiffness=0.999 * limit, **others)["b_required_mu"] < 0.8
    assert judged(stiffness=1.001 * limit, **others)["b_required_mu"] > 0.8


def test_no_stiffness_of_a_coupling_covers_a_negative_damping_beyond_a_quarter_of_the_devices():
    assert judged(damping=-0.21)["stiffness_max_mu"] == 0.0


def test_plot_writes_a_png(tmp_path):
    assert passivity(plot=tmp_path / "map.png").returncode == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"physical-damping": 0}, "physical_damping is 0 N s/m, but it must be a finite number greater than 0"),
        ({"physical-damping": -1}, "physical_damping is -1 N s/m"),
        ({"period": 0}, "period is 0 s"),
        ({"period": math.nan}, "period is nan s"),
        ({"stiffness": -1}, "stiffness is -1 N/m"),
        ({"stiffness": math.nan}, "stiffness is nan N/m"),
        ({"stiffness": math.inf}, "stiffness is inf N/m"),
        ({"damping": math.nan}, "damping is nan N s/m"),
        ({"mass": 0}, "mass is 0 kg"),
        ({"delay-samples": -0.5}, "delay_samples is -0.5 samples"),
        ({"delay-samples": 1e9}, "it must lie between 0 and 100 samples"),
        ({"velocity-lag": -1}, "velocity_lag is -1 s"),
        ({"resolution": -1}, "resolution is -1 m"),
        ({"coulomb": -1}, "coulomb is -1 N"),
        ({"plot": "/nowhere/map.png"}, "No such file"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_exit_code_2(options, sentence):
    result = passivity(**options)
    assert result.returncode == 2
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_a_word_for_a_number_is_refused():
    assert passivity(stiffness="stiff").returncode == 2
