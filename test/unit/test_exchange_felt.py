# SPDX-License-Identifier: Apache-2.0
"""What of an exchange the hand feels: stiffness, drag and mass of a late tool, at any rates; one that falls silent."""

import numpy as np
import pytest
from examples import searching
from exchange_systems import demo_system
from in_process import bench

from bench import results
from bench.exchange import exchange as bench_exchange
from bench.exchange import felt as local_felt
from bench.exchange import local as bench_local
from bench.exchange.exchange import Case, Figures, measure
from haptic_sim.lockstep.lockstep import PERFECT, Network

pytestmark = pytest.mark.timeout(600)  # kernels that nobody has used yet are compiled

STIFFNESS = 2000.0  # [N/m] of the demo's operating point
BUDGET = 0.005  # [J]


@pytest.fixture(scope="module")
def felt():
    cases = ("direct", 0.0), ("direct", 5e-3), ("pspm", 0.0), ("pspm", 0.02)
    return {case: measure(Case(*case, 0.0, 0.0, 1000.0)) for case in cases}


def test_a_late_tool_held_drags_by_about_stiffness_times_age(felt):
    assert felt["direct", 5e-3].damping == pytest.approx(STIFFNESS * 5.6e-3, rel=0.15)  # half a period older on average


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_foretold_it_drags_by_less_than_a_fifth_of_that_and_the_wall_is_as_stiff(felt, late):
    age = late + 0.6e-3
    assert abs(felt["pspm", late].damping) <= 0.2 * STIFFNESS * age
    assert felt["pspm", late].stiffness == pytest.approx(felt["direct", 0.0].stiffness, rel=0.02)
    assert felt["pspm", late].given <= BUDGET
    assert abs(felt["pspm", 0.02].mass) <= 0.12  # a tool of 0.1 kg; first order made 0.49 kg of one of 0.05 kg


@pytest.mark.parametrize(("given", "passive"), [(BUDGET, True), (1.001 * BUDGET, False)])
def test_what_gave_more_than_the_budget_is_shown_as_active_and_not_as_stiff(given, passive, monkeypatch, tmp_path):
    one = Figures(STIFFNESS, 1e-4, 0.1, 0.1, given, 0.0, 1.0)
    monkeypatch.setattr(bench_exchange, "measure", lambda *case: one)
    words = "exchange", "--method", "direct", "--delay", "20", "--workers", "1"
    shown = bench(*words).stdout
    assert (one.passive, "active" in shown, "2000" in shown) == (passive, not passive, passive)
    (tmp_path / results.MACHINE).write_text("{}")
    (tmp_path / "exchange.json").write_text(bench(*words, "--json").stdout)
    assert [figure.value for figure in results.figures(tmp_path)] == [STIFFNESS if passive else None]


@pytest.mark.parametrize(("swing", "shown"), [(0.099, "2000"), (0.101, "unsteady")])
def test_a_force_that_swings_by_more_than_a_tenth_of_its_mean_is_no_stiffness(swing, shown, monkeypatch):
    felt = local_felt.Felt(2000.0, 2000.0, 0.1, 0.1, 0.0, 0.0, 1e-3, 7, 0, swing)
    monkeypatch.setattr(bench_local, "measure", lambda *job, live: felt)
    said = bench("local", "--only", "felt", "--rate", "1000").stdout
    assert [line.split(" | ")[3] for line in said.splitlines() if "direct" in line] == [shown]


@pytest.mark.parametrize("servo", [1000.0, 4000.0] if searching() else [1000.0])  # `python -m bench local`: 10 kHz too
def test_a_coupling_as_stiff_as_the_device_covers_does_not_shake_a_free_tool_1_ms_away(servo):
    """An old force of the tool, believed whole, is K · age of negative damping: it shook, and dragged by 61 N s/m."""
    felt = local_felt.measure(servo, "pspm")
    assert abs(felt.drag) <= 0.02 and 0.0 <= felt.mass <= 0.1
    assert felt.stiffness == pytest.approx(felt.coupling, rel=1e-3)
    assert felt.given <= BUDGET


def test_with_no_delay_added_the_tool_is_as_near_the_handle_as_with_direct_exchange(felt):
    assert felt["pspm", 0.0].tool_error <= 1.2 * felt["direct", 0.0].tool_error
    assert felt["pspm", 0.0].impedance_ratio > 10.0 * felt["direct", 0.0].impedance_ratio


@pytest.mark.parametrize(("servo", "exchange"), [(1000.0, 100.0), (3000.0, 1300.0), (1000.0, 2000.0)])
def test_servo_and_exchange_run_at_any_rates_and_the_wall_stays_steady_stiff_and_passive(servo, exchange):
    motion = {"start": (0.03, 0.0, 0.0), "target": (0.004, 0.0, 0.0), "duration": 2.0}
    system = demo_system(
        "pspm", "wall", Network(), motion, servo__rate=servo, exchange__rate=exchange, coupling__damping=1.0
    )
    rows = system.run(1.6)
    end = rows[int(0.75 * len(rows)) : int(0.85 * len(rows))]
    force = end.force_coupling[:, 0]
    assert force.mean() / (0.01 - end.position[:, 0].mean()) == pytest.approx(STIFFNESS, rel=0.02)
    assert np.ptp(force) < 0.1
    assert system.plant_memory["energy_given"][0] <= BUDGET
    assert system.simulation.counters.rejoined == 0
    assert rows.handle_sequence[-1] == pytest.approx(1.6 * min(servo, exchange), rel=0.02)


@pytest.mark.parametrize("late", [0.0, 1.5e-3, 20e-3])
def test_samples_are_found_at_their_own_tick_and_a_late_tool_is_behind_the_handle_by_the_way_there_and_no_more(late):
    """A free tool on a circle, whose own lag is a millisecond."""
    system, errors, speeds = demo_system("pspm", "free_space", Network(late)), [], []
    rows = system.run(1.5)[200:]
    new = np.flatnonzero(np.diff(rows.tool_answered)) + 1
    assert np.all(np.diff(new) == 4)
    assert rows.tool_age[new] == pytest.approx(max(late, 0.25e-3), abs=1e-9)
    for _ in range(200):
        row = system.run(1e-3)[-1]
        errors.append(np.hypot(*(system.simulation.method.position[:2] - row.position[:2])))
        speeds.append(np.hypot(*row.velocity[:2]))
    assert 0.5 * late <= np.mean(errors) / np.mean(speeds) <= 0.5 * late + 1.2e-3


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
    assert np.all(np.abs(np.diff(rows.force_coupling[:, :2], axis=0)) <= 0.125 + 2000.0 * moved + noise + 1e-12)
