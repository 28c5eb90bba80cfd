# SPDX-License-Identifier: Apache-2.0
"""Z-width in lock-step: the cell against the whole servo, its boundary against eigenvalues, passivity against both."""

import itertools

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from bench.reference.boundary import CASES, boundary_stiffness
from haptic_device.config.description import Axis, Device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATING_POINT, OPERATOR
from haptic_device.control import controller_config, enable_state, records
from haptic_device.device import loopback_config, operator_hand, plant, simulated_device, wall_tapping
from haptic_device.realtime import servo_loop
from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.stability import largest_stable_stiffness
from haptic_device.theory.zwidth import (
    GIVING,
    OPERATORS,
    QUIET,
    SHAKING,
    Operator,
    Setup,
    operators_of,
    record_of,
    run_cells,
    theory,
)
from haptic_device.theory.zwidth_map import Request, boundaries, draw_map, write_csv

PRESSED = (Operator(pressed=True),)
SMALL = Request(Setup(0.1, 0.5, 1e-3, seconds=0.2), "none", np.linspace(100.0, 2000.0, 12), np.linspace(-0.5, 1.0, 40))


def whole_servo(setup, start, stiffness, damping):
    """Most energy given in the same tap by the servo's tick and the plant's integration; gravity pushes as the hand."""
    limits = {"motor_limit": 1e6, "workspace": (-1.0, 1.0), "velocity_limit": 1e3}
    own = {"mass": setup.mass, "damping": setup.physical_damping, "coulomb": setup.coulomb}
    axis = Axis(name="x", counts_per_unit=1.0 / setup.resolution, **limits, **own)
    device = Device(name="one axis", axes=(axis,), gravity=(-start.push / setup.mass, 0.0), gravity_compensation=False)
    values = defaults(OPERATING_POINT)
    values |= {"servo.rate": 1.0 / setup.period, "force.limit": 1e6, "velocity.lag": setup.velocity_lag}
    values |= {"velocity.estimator": "lowpass", "passivity.control": False, "passivity.policy": "off"}
    values |= {"exchange.budget": 1.0, "exchange.slew": 1e6}  # all that they change is paid
    values |= {"coupling.stiffness": 0.0, "coupling.damping": 0.0, "fault.saturation": 60.0}
    values |= {"wall.normals": (1.0, 0.0), "wall.offsets": (0.0,)}
    values |= {"wall.stiffness": (stiffness,), "wall.damping": (damping,)}
    settings = controller_config.settings_from(device, values, version=1).view(np.recarray)
    memory = np.zeros(1, records.STATE).view(np.recarray)
    memory.enable.state, memory.enable.ramp = enable_state.ENGAGED, 1.0
    body, state = loopback_config.plant_of(device).view(np.recarray), np.zeros(1, plant.PLANT_MEMORY).view(np.recarray)
    body.actuation_delay = round(setup.delay_samples * setup.period * 1e9)
    state.position[0, 0], state.velocity[0, 0] = -start.position, -start.velocity
    motion = operator_hand.script(defaults(OPERATOR)).view(np.recarray)
    tool, most, period = np.zeros(1, servo_loop.TOOL).view(np.recarray), 0.0, round(setup.period * 1e9)
    for k in range(round(setup.seconds / setup.period) + 1):
        row = np.zeros(1, records.TRACE_ROW).view(np.recarray)
        simulated_device.run_lockstep(
            settings, memory, row, tool, body, state, motion, k * period, k, 0, enable_state.ENABLE
        )
        most = max(most, float(state.energy_given[0] + start.push * (state.position[0, 0] + start.position)))
    return most


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("coulomb, lag", [(0.0, 0.0), (0.05, 2e-3)])
def test_a_cell_gives_the_energy_that_servo_and_plant_give(delay, coulomb, lag):
    setup = Setup(0.1, 0.5, 1e-3, coulomb, 1e-5, delay, lag, seconds=0.3)
    start = record_of(setup, Operator()).view(np.recarray)[0]
    outcome = run_cells(setup, (Operator(),), 1500.0, 0.3)
    most = whole_servo(setup, start, 1500.0, 0.3)
    budget = 0.5 * setup.mass * start.velocity**2
    assert outcome.energy_given == pytest.approx(most - budget, rel=1e-6, abs=1e-10)


@pytest.mark.parametrize("mass, physical_damping, damping, period, delay", CASES)
def test_walls_begin_to_shake_where_the_eigenvalues_say(mass, physical_damping, damping, period, delay):
    setup = Setup(mass, physical_damping, period, delay_samples=delay, seconds=10.0)
    exact = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
    assert run_cells(setup, PRESSED, 0.98 * exact, damping).assessment == QUIET
    assert run_cells(setup, PRESSED, 1.02 * exact, damping).assessment == SHAKING


@pytest.mark.parametrize("name", OPERATORS)
@pytest.mark.parametrize("delay", [0.0, 0.5, 1.0])
def test_no_operator_shakes_or_draws_energy_from_a_wall_just_inside_the_passive_region(name, delay):
    damping = np.linspace(-0.45, 0.45, 13)
    limit = np.array([largest_passive_stiffness(0.5, B, 1e-3, 0.0, delay) for B in damping])
    setup = Setup(0.1, 0.5, 1e-3, delay_samples=delay)
    outcome = run_cells(setup, operators_of(name), 0.98 * limit, damping)
    assert np.all(outcome.assessment[limit > 0.0] == QUIET)


@pytest.mark.parametrize("damping", [-0.3, -0.1, 0.0])
def test_the_worst_of_the_grid_shakes_just_outside_the_passive_region_while_a_hand_still_calms_the_wall(damping):
    limit = largest_passive_stiffness(0.5, damping, 1e-3)
    setup = Setup(0.1, 0.5, 1e-3, seconds=4.0)
    assert run_cells(setup, operators_of("worst"), 1.03 * limit, damping).assessment == SHAKING
    assert run_cells(setup, operators_of("firm"), 1.03 * limit, damping).assessment == QUIET


def test_a_hand_may_get_energy_from_a_wall_that_it_keeps_from_shaking():
    outcome = run_cells(Setup(0.1, 0.5, 1e-3), operators_of("firm"), 5000.0, 0.0)
    assert outcome.assessment == GIVING
    assert outcome.energy_given > 1e-5


def test_friction_calms_what_an_encoder_step_keeps_alive():
    rough = Setup(0.1, 0.5, 1e-3, resolution=5e-5, seconds=4.0)
    assert run_cells(rough, PRESSED, 1100.0, 0.0).assessment == SHAKING
    assert run_cells(rough._replace(coulomb=0.1), PRESSED, 1100.0, 0.0).assessment == QUIET


def test_a_handle_that_friction_holds_does_not_shake():
    """Beside the equilibrium, where it shook by the energy that friction kept in the springs."""
    for resolution, name in itertools.product((0.0, 5e-6), ("none", "firm", "worst")):
        setup = Setup(0.1, 3.0, 1e-3, coulomb=0.02, resolution=resolution)
        assert np.all(run_cells(setup, operators_of(name), [100.0, 1000.0, 2500.0], 0.5).assessment == QUIET)
    stuck = run_cells(setup._replace(coulomb=0.5), PRESSED, [100.0, 1000.0, 1e4], 0.0)
    assert np.all(stuck.growth == 0.0)
    assert np.all(stuck.assessment == QUIET)


@few(40)
@given(
    friction=st.floats(1e-3, 0.3),
    physical_damping=st.floats(0.5, 5.0),
    damping=st.floats(0.0, 1.0),
    hand=st.sampled_from(("none", "firm")),
)
def test_friction_lowers_no_limit(friction, physical_damping, damping, hand):
    smooth = Setup(0.1, physical_damping, 1e-3)
    rough = smooth._replace(coulomb=friction)
    limits = [boundary_stiffness(setup, operators_of(hand), damping, 2e4, 1e-2) for setup in (smooth, rough)]
    assert limits[1] >= limits[0] - 0.02 * 2e4


def test_energy_of_motion_is_above_the_place_where_friction_holds():
    """Wall of 1000 N/m, hand of 200 N/m, push 3 N, friction 0.5 N: at rest from 2.083 to 2.917 mm."""
    short = Setup(0.1, 1.0, 1e-9, seconds=8e-9)

    def energy(friction, x, v=0.0):
        cell, found = record_of(short, Operator(0.1, 0.0, 200.0, 3.0)), np.zeros(1, wall_tapping.OUTCOME)
        cell["coulomb"], cell["position"], cell["velocity"] = friction, x, v
        wall_tapping.cells(cell.view(np.recarray), np.full(1, 1000.0), np.zeros(1), found.view(np.recarray))
        return found["vibration"][0]

    for x in (2.5e-3 - 0.4 / 1200.0, 2.5e-3 + 1e-6, 2.5e-3 + 0.4 / 1200.0):
        assert energy(0.5, x) == 0.0
    assert energy(0.0, 4e-3) == pytest.approx(0.5 * 1200.0 * 1.5e-3**2)
    assert energy(0.5, 4e-3) == pytest.approx(0.5 * (1200.0 * 1.5e-3 - 0.5) ** 2 / 1200.0)
    assert energy(0.5, -1e-3) == pytest.approx(0.5 * 2.5**2 / 1200.0 + 2.5e-3 + 0.5 * 200.0 * 1e-6)
    assert energy(3.4, -1e-3) == 0.0 and energy(3.4, -4e-3) == pytest.approx(0.5 * 200.0 * 2e-3**2)
    assert energy(0.5, 2.5e-3, 0.3) == pytest.approx(0.5 * 0.2 * 0.09)
    assert energy(0.5, 1e-9) == pytest.approx(energy(0.5, -1e-9), rel=1e-5)


def test_the_line_of_late_writes_never_lies_above_what_a_delay_as_long_allows_and_is_near_it_without_damper():
    damping = np.linspace(-0.4, 0.4, 9)
    for delay in (0.0, 0.7, 1.0, 1.6):
        lines = theory(Setup(0.1, 0.5, 1e-3, delay_samples=delay), damping, lateness=2e-4)
        late, passive = lines["late writes"], lines["passive"]
        delayed = np.array([largest_passive_stiffness(0.5, B, 1e-3, 0.0, delay + 0.2) for B in damping])
        assert np.all(late <= delayed * (1.0 + 1e-9)) and np.all((late < passive) & (passive <= lines["stable"]))
        assert late[4] >= (1.0 - 0.012) * delayed[4]


@pytest.fixture(scope="module")
def whole():
    return draw_map(SMALL, 2)


def test_the_map_is_the_same_with_one_thread_and_with_two(whole):
    for one, two in zip(draw_map(SMALL, 1).outcome, whole.outcome, strict=True):
        np.testing.assert_array_equal(one, two)


def test_boundaries_and_csv_tell_what_the_cells_did(tmp_path, whole):
    write_csv(tmp_path / "map.csv", SMALL, whole)
    table = np.loadtxt(tmp_path / "map.csv", delimiter=",", skiprows=1)
    assert table.shape == (480, 5)
    limit = boundaries(SMALL, whole)["not shaking"]
    shaking = table[table[:, 2] == SHAKING]
    for damping, stiffness in zip(SMALL.damping, limit, strict=True):
        row = shaking[np.isclose(shaking[:, 0], damping), 1]
        assert row.size == 0 or row.min() > stiffness


def test_impossible_devices_a_wall_that_pulls_and_an_operator_nobody_knows_are_refused():
    for change, sentence in (
        ({"mass": 0.0}, "mass is 0 kg"),
        ({"physical_damping": -1.0}, "physical_damping is -1 N s/m"),
        ({"period": 0.0}, "period is 0 s"),
        ({"coulomb": np.nan}, "coulomb is nan N"),
        ({"delay_samples": -1.0}, "delay_samples is -1 samples"),
        ({"seconds": 1e-3}, "seconds/period is 1 ticks"),
    ):
        with pytest.raises(ValueError, match=sentence):
            run_cells(SMALL.setup._replace(**change), PRESSED, 100.0, 0.0)
    with pytest.raises(ValueError, match="stiffness is -1 N/m, but it must be a finite number, at least 0"):
        run_cells(SMALL.setup, PRESSED, -1.0, 0.0)
    with pytest.raises(ValueError, match="operator is 'strong', but it must be one of none, light, firm, worst"):
        operators_of("strong")


def test_the_smallest_run_has_two_ticks_in_each_quarter():
    assert wall_tapping.FEWEST_TICKS == 8
    assert run_cells(SMALL.setup._replace(seconds=8e-3), PRESSED, 100.0, 0.0).assessment == QUIET
