# SPDX-License-Identifier: Apache-2.0
"""A tool that falls silent is held, let go and comes back, without a kick."""

import numpy as np
import pytest
from exchange_systems import demo_system

from haptic_sim.replay.lockstep import PERFECT, Network

CUT = Network(loss=1.0)
PRESS = {"start": [0.03, 0.0, 0.0], "target": [0.005, 0.0, 0.0], "duration": 8.0}


def test_cut_in_contact_a_tool_is_held_and_let_go_over_its_time_and_is_back_within_a_second_without_a_kick():
    system = demo_system("pspm", motion=PRESS)
    pressed = system.run(3.4)
    system.network = CUT
    cut = system.run(0.6)
    system.network = PERFECT
    back = system.run(1.2)
    assert np.mean(pressed[-100:].force_coupling[:, 0]) > 1.0
    held, gone = cut.tool_age <= 0.06, cut.tool_age >= 0.2
    assert np.all(cut.exchange_fade[held] == 1.0) and np.all(cut.exchange_fade[gone] == 0.0) and gone[-1]
    between = ~held & ~gone
    assert held[0] and between.any()
    assert cut.exchange_fade[between] == pytest.approx(1.0 - (cut.tool_age[between] - 0.06) / 0.14, abs=0.01)
    assert cut.force_on_handle[-1, 0] == pytest.approx(0.0, abs=0.05)
    for rows in (cut, back):
        force = rows.force_coupling[:, 0]
        assert np.abs(force[4:] - force[:-4]).max() <= 0.5  # in a millisecond
    before, after = pressed[-1], back[-1]
    assert after.exchange_fade == 1.0
    assert after.force_coupling[0] == pytest.approx(before.force_coupling[0], rel=0.05)
    assert system.plant_memory["energy_given"][0] <= 0.005


def test_the_free_tool_is_back_at_a_handle_that_went_on_without_it_within_a_second():
    system = demo_system("pspm", "free_space")
    system.run(1.5)
    system.network = CUT
    system.run(0.5)
    system.network = PERFECT
    rows = system.run(1.0)
    assert np.hypot(*(rows[-1].tool_position - rows[-1].position)[:2]) < 5e-4
    moved, noise = np.abs(np.diff(rows.position[:, :2], axis=0)), 2.0 * 2.0 * 5e-6 * 4000.0
    assert np.all(np.abs(np.diff(rows.force_coupling[:, :2], axis=0)) <= 0.125 + 2000.0 * moved + noise)
