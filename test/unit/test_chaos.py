# SPDX-License-Identifier: Apache-2.0
"""Figures of chaos on made-up records; the limits of diagnostics; the keys of `haptic status`."""

import os
import pty
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from waiting import until

from fault_injection import chaos_figures
from fault_injection.listener import ROW, TRUTH
from fault_injection.soak import _row
from haptic_device.nodes import diagnostics
from haptic_device.parameters import DRIVER_FIGURES, LOOPBACK_FIGURES
from haptic_sim.cli.keys import ESTOP, keys
from haptic_sim.node.parameters import FIGURES

ROOT = Path(__file__).resolve().parents[2]
PERIOD = 250_000  # ns


def rows(forces, engage=1.0):
    """Ticks with these forces along x."""
    found = np.zeros(len(forces), ROW)
    found["exchange_fade"] = 1.0
    found["deadline"], found["engage"] = 1e12 + PERIOD * np.arange(len(forces)), engage
    found["force_on_handle"][:, 0] = forces
    return found


def test_a_force_that_changes_by_a_newton_in_two_milliseconds_changes_by_half_a_newton_a_millisecond():
    ramp = np.interp(np.arange(100), [40, 48], [0.0, 1.0])
    assert chaos_figures.fastest_change(rows(ramp)) == pytest.approx(0.5, rel=1e-6)
    assert chaos_figures.fastest_change(rows(-ramp)) == pytest.approx(0.5, rel=1e-6)


def test_a_cut_off_to_zero_is_no_change_but_a_jump_of_an_engaged_motor_is():
    forces = np.where(np.arange(100) < 50, 5.0, 0.0)
    cut = rows(forces, engage=np.where(np.arange(100) < 50, 1.0, 0.0))
    assert chaos_figures.fastest_change(cut) == 0.0
    assert chaos_figures.fastest_change(rows(forces, engage=0.0)) is None
    assert chaos_figures.fastest_change(rows(forces)) == pytest.approx(5.0)


def test_only_what_changes_while_a_force_fades_or_returns_is_a_step():
    ramp = rows(np.interp(np.arange(4000), [100, 108, 3000, 3016], [0.0, 1.0, 1.0, 0.0]))
    assert chaos_figures.fastest_change(ramp, chaos_figures.fading(ramp)) is None
    ramp["exchange_fade"] = np.where(np.arange(4000) < 2990, 1.0, 0.5)
    assert chaos_figures.fastest_change(ramp, chaos_figures.fading(ramp)) == pytest.approx(0.25)
    assert chaos_figures.fastest_change(ramp) == pytest.approx(0.5)


def test_energy_counts_from_the_beginning_of_each_session():
    truths = np.zeros(4, TRUTH)
    truths["time"], truths["energy"] = [0.0, 1.0, 2.0, 3.0], [0.0, -0.2, -0.15, -0.14]
    assert chaos_figures.energy_given(truths) == 0.0
    assert chaos_figures.energy_given(truths, (0.5,)) == pytest.approx(0.06)


def test_the_motor_is_off_when_the_last_truth_with_a_force_was():
    truths = np.zeros(30, TRUTH)
    truths["time"] = 10.0 + 1e-3 * np.arange(30)
    truths["motor"][:15, 0] = 5.0
    assert chaos_figures.motor_off(truths, 10.002) == pytest.approx(12.0, abs=1e-6)
    assert chaos_figures.motor_off(truths, 10.02) == 0.0


def test_memory_that_grows_by_more_than_two_percent_is_told():
    looks = [(float(second), 100e6 * (1.0 + 0.021 * (second > 100)), 9, 30) for second in range(200)]
    row = _row("haptic_driver", looks)
    assert row["grown"] == pytest.approx(0.021) and row["threads"] == (9, 9) and row["files"] == (30, 30)


@pytest.mark.parametrize("watched", [*DRIVER_FIGURES, *LOOPBACK_FIGURES, *FIGURES], ids=lambda each: each.name)
def test_a_figure_is_ok_at_its_limit_and_warns_or_errs_just_beyond(watched):
    beyond = 1e-9 if watched.error >= watched.warn else -1e-9
    for figure, level in (
        (watched.warn, "ok"),
        (watched.warn + beyond, "warn"),
        (watched.error, "warn"),
        (watched.error + beyond, "error"),
        (float("nan"), "ok"),
    ):
        assert diagnostics.level_of(watched, figure, watched.warn, watched.error) == level


def test_of_the_keys_the_e_stop_counts_whatever_is_typed_with_it(monkeypatch):
    control, terminal = pty.openpty()
    with os.fdopen(terminal) as stdin, keys_of(monkeypatch, stdin) as pressed:
        assert pressed() == ""
        for typed, key in ((b"r", "r"), (b"ab d", ESTOP)):
            os.write(control, typed)
            assert until(pressed, f"the key {key!r}") == key
    os.close(control)


def keys_of(monkeypatch, stdin):
    monkeypatch.setattr("sys.stdin", stdin)
    return keys()


def test_without_a_terminal_there_are_no_keys(monkeypatch):
    with open(os.devnull) as stdin, keys_of(monkeypatch, stdin) as pressed:
        assert pressed() == ""


def test_the_policy_for_sros2_names_every_topic_of_the_model_and_nothing_else():
    policy = ElementTree.parse(ROOT / "docs/sros2/policy.xml")
    named = {topic.text for topic in policy.iter("topic")}
    table = (ROOT / "docs/model.md").read_text(encoding="utf-8").split("## Topics\n")[1].split("\n\n")[1]
    topics = {line.split("`")[1] for line in table.splitlines() if line.startswith("| `")}
    assert named == topics - {"/parameter_events"}
    for included in policy.iter("{http://www.w3.org/2001/XInclude}include"):
        assert ElementTree.parse(ROOT / "docs/sros2" / included.get("href")).getroot().tag == "profile"
