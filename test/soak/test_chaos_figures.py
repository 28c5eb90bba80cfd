# SPDX-License-Identifier: Apache-2.0
"""What chaos says of a run, on made-up records."""

import numpy as np
import pytest

from fault_injection import chaos_figures
from fault_injection.listener import ROW, TRUTH
from fault_injection.soak import _row

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
