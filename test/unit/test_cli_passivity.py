# SPDX-License-Identifier: Apache-2.0
"""`haptic passivity`: a assessment one can read, one object with --json, and a sentence for what cannot be."""

import json
import math

import pytest
from in_process import haptic

from haptic_device.theory.assessment import Display, advise, assess

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


def test_each_verdict_turns_at_the_largest_stiffness_that_is_told_for_it():
    for stiffness, passive in ((5999, True), (6001, False)):
        assessment = judged(stiffness=stiffness)
        assert assessment["passive"] is assessment["mu_passive"] is passive
        assert (assessment["mu_margin"] > 0.0) is passive
    boundary = judged()["stiffness_max_stable"]
    assert boundary > 6000.0
    with_friction = {"resolution": 1e-5, "coulomb": 0.01}
    limit = judged(**with_friction)["stiffness_max_passive"]
    for factor, fits in ((0.999, True), (1.001, False)):
        assert judged(stiffness=factor * boundary)["stable"] is fits
        assert judged(stiffness=factor * limit, **with_friction)["passive"] is fits


def test_friction_must_cover_the_encoder_step_and_delay_and_lag_count():
    for coulomb, passive in ((0.0269, False), (0.0271, True)):
        assert judged(resolution=1e-5, coulomb=coulomb)["passive"] is passive
    assert judged(**{"delay-samples": 0.5})["b_required"] > judged(**{"delay-samples": 0.1})["b_required"] > 0.675
    assert judged(**{"velocity-lag": 0.001})["b_required"] < 0.675


def test_a_need_without_end_is_null():
    assessment = judged(damping=-0.7)
    assert assessment["b_required_mu"] is None
    assert assessment["mu_passive"] is False


def test_the_sentence_names_what_is_lacking():
    for given, words in (
        ((5000.0, 0.05, 0.8), "Passive with 0.125 N s/m of physical damping to spare"),
        ((5000.0, -0.1, 0.8), "the stiffness could rise"),
        ((1000.0, -0.3, 0.8), "Passive as a wall"),
        ((100.0, 2.0, 0.8), "no stiffness is passive with it"),
        ((6200.0, 0.05, 0.8), "only an operator would find out"),
        ((9000.0, 0.05, 0.8), "not even stable on its own"),
        ((12000.0, 0.05, 0.8), "needs b > 1.55 N s/m and the device has 0.8"),
        ((12000.0, 0.05, 0.8), "lower the stiffness below 6000 N/m"),
    ):
        display = Display(*given, 2.5e-4)
        assert words in advise(display, assess(display))
    rough = Display(5000.0, 0.05, 0.8, 2.5e-4, resolution=1e-5)
    assert "needs 0.027 N of friction and the device has 0" in advise(rough, assess(rough))


def test_the_stiffness_that_is_promised_is_passive_as_a_coupling_too():
    display = Display(100.0, 0.0, 0.5, 1e-3, delay_samples=1.0)
    assessment = assess(display)
    assert assessment.stiffness_max_passive == pytest.approx(1000.0 / 3.0)
    assert assessment.stiffness_max_mu == pytest.approx(1000.0 / 3.0)
    assert "could rise to 333.33 N/m as a coupling, to 333.33 N/m as a wall" in advise(display, assessment)


def test_the_largest_stiffness_of_a_coupling_is_the_root_of_its_closed_form():
    b, period = 0.8, 2.5e-4
    for damping in (0.7, 0.05, 0.0, -0.05, -0.19):
        half = b - damping if damping >= 0.0 else 0.5 * (b + math.sqrt(b**2 + 4.0 * b * damping))
        assert judged(damping=damping)["stiffness_max_mu"] == pytest.approx(2.0 * half / period, rel=1e-9)
    assert judged(damping=-0.21)["stiffness_max_mu"] == 0.0  # no stiffness covers more than a quarter of b


def test_a_coupling_is_passive_just_below_its_largest_stiffness_and_active_just_above():
    for damping, lag, delay in ((0.2, 0.0, 1.0), (0.2, 1e-3, 0.3), (-0.05, 2e-4, 0.5), (-0.1, 0.0, 0.0)):
        others = {"damping": damping, "velocity-lag": lag, "delay-samples": delay}
        limit = judged(**others)["stiffness_max_mu"]
        assert judged(stiffness=0.999 * limit, **others)["b_required_mu"] < 0.8
        assert judged(stiffness=1.001 * limit, **others)["b_required_mu"] > 0.8


def test_plot_writes_a_png(tmp_path):
    assert passivity(plot=tmp_path / "map.png").returncode == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
