# SPDX-License-Identifier: Apache-2.0
"""The servo's tick: what it commands, when it engages, and that it can be computed again."""

import math

import numpy as np
import pytest
from fault_table import FREE, PERIOD, WALL, Servo, pressing
from hypothesis import given, settings
from hypothesis import strategies as st
from lockstep_systems import device, values

from haptic_device.config.parameters import EXCHANGE_METHODS, MOST_WALLS
from haptic_device.control import controller_config, enable_state, faults, records
from haptic_device.device import loopback_config, simulated_device
from haptic_device.realtime import servo_loop


def test_in_free_space_without_a_tool_the_motor_stays_at_zero():
    row = Servo(**FREE).move((0.05, 0.02, 1.0))
    assert row.state == enable_state.ENGAGED and row.motor.tolist() == [0.0, 0.0, 0.0] and row.fault == faults.NONE


def test_sixty_four_walls_round_the_handle_each_push_by_their_own_depth():
    turns = 2.0 * np.pi * np.arange(MOST_WALLS) / MOST_WALLS
    normals, stiffness = -np.column_stack([np.cos(turns), np.sin(turns)]), np.linspace(500.0, 1500.0, MOST_WALLS)
    ring = {"wall__normals": tuple(normals.ravel()), "wall__stiffness": tuple(stiffness)}
    ring |= {"wall__offsets": (-0.02,) * MOST_WALLS, "wall__damping": (0.0,) * MOST_WALLS}
    place = 0.021 * np.array([math.cos(0.3), math.sin(0.3)])
    depth = np.maximum(0.0, -0.02 - normals @ place)
    row = Servo(**ring, **FREE).move((*place, 0.0))
    assert np.count_nonzero(depth) > 4
    assert row.force_on_handle[:2] == pytest.approx((stiffness * depth) @ normals, abs=0.01)


def test_the_coupling_pulls_the_handle_to_the_tool_and_swapping_the_two_turns_the_force():
    forces = []
    for handle, tool in ((0.0, 0.0005), (0.0005, 0.0)):
        runner = Servo(settled=False, coupling__stiffness=1000.0, coupling__rotational_stiffness=2.0)
        runner.position = np.full(3, handle)
        runner.tool((tool, tool, tool))
        forces.append(runner.run(1.5).force_on_handle.copy())
    assert forces[0] == pytest.approx([0.5, 0.5, 0.001], rel=1e-3)
    assert forces[1] == pytest.approx(-forces[0])


def test_a_tool_that_grows_old_loses_its_pull_and_a_fresh_one_gets_it_back_slowly():
    runner = Servo(coupling__stiffness=500.0)
    runner.tool((0.001, 0.0, 0.0))
    hold, fade = (float(runner.settings["exchange"][name][0]) for name in ("hold", "fade"))
    assert runner.run(fade + 0.01).force_on_handle[0] == pytest.approx(0.5)
    assert runner.tick(tool_age=hold - 1e-6).force_on_handle[0] == pytest.approx(0.5)
    few = 4 * PERIOD  # as fast as the slew allows
    assert runner.run(few, tool_age=hold + fade / 2).force_on_handle[0] == pytest.approx(0.25)
    assert runner.run(few, tool_age=hold + fade + 1e-6).force_on_handle[0] == 0.0
    forces = [runner.tick().force_on_handle[0] for _ in range(round(fade / PERIOD) + 2)]
    assert np.max(np.diff(forces)) <= 0.5 * PERIOD / fade * 1.001 and forces[-1] == pytest.approx(0.5)


def test_scaling_feels_a_world_stiffness_by_its_square():
    for scale in (0.5, 2.0):
        runner = Servo(scale=(scale, 1.0), coupling__stiffness=100.0)
        runner.tool((0.0, 0.0, 0.0))
        runner.run(0.2)
        row = runner.move((0.002, 0.0, 0.0))
        assert row.force_on_handle[0] == pytest.approx(-100.0 * scale**2 * 0.002, rel=1e-4)


def test_force_limits_hold_in_both_directions():
    limits = {"force__limit": 2.0, "force__limit_rotational": 0.05}
    runner = Servo(coupling__stiffness=1000.0, exchange__budget=0.1, exchange__tank=0.1, **limits)  # which pays for all
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    for tool, force in (((0.01, -0.01, 0.2), [2.0, -2.0, 0.05]), ((-0.0019, 0.0, 0.0), [-1.9, 0.0, 0.0])):
        runner.tool(tool)
        assert runner.run(0.2).force_on_handle.tolist() == pytest.approx(force)


def test_gravity_is_compensated_only_while_engaged_and_disabling_takes_all_force_away_in_the_next_tick():
    runner = Servo(gravity=(0.0, -10.0), **WALL, **FREE)
    assert runner.run(0.01).force_on_handle.tolist() == [0.0, pytest.approx(1.0), 0.0]
    assert runner.move((-0.002, 0.0, 0.0)).motor[:2] == pytest.approx([2.0, 1.0], rel=1e-3)
    runner.command = 0
    row = runner.tick()
    assert row.force_on_handle.tolist() == row.motor.tolist() == [0.0, 0.0, 0.0]
    assert row.state == enable_state.IDLE and row.fault == faults.NONE


def test_forces_rise_over_the_engage_time_from_a_small_wanted_force():
    runner = Servo(settled=False, coupling__stiffness=400.0, engage__time=0.2, exchange__fade=0.001)
    runner.command = 0
    runner.tool((0.002, 0.0, 0.0))
    runner.run(0.05)
    runner.command, before = enable_state.ENABLE, len(runner.rows)
    runner.run(0.3)
    forces = np.array([row["force_on_handle"][0, 0] for row in runner.rows[before:]])
    assert forces[-1] == pytest.approx(0.8) and np.diff(forces).max() == pytest.approx(0.8 * PERIOD / 0.2, rel=0.01)


@pytest.mark.parametrize(("share", "engages"), [(0.999, True), (1.001, False)])
@pytest.mark.parametrize(("axis", "limit"), [(0, 0.001), (2, 0.1)])  # 1 N at 1000 N/m, 0.1 N m at 1 N m/rad
def test_engaging_begins_just_below_the_limits_of_force_and_torque_and_not_just_above(axis, limit, share, engages):
    gains = {"coupling__stiffness": 1000.0, "coupling__rotational_stiffness": 1.0}
    runner = Servo(settled=False, engage__force=1.0, engage__torque=0.1, exchange__fade=0.001, **gains)
    runner.command = 0
    runner.tool(tuple(share * limit * (np.arange(3) == axis)))
    runner.run(0.05)
    runner.command = enable_state.ENABLE
    row = runner.run(1.0)
    assert (row.state == enable_state.ENGAGED) == (row.motor[axis] != 0.0) == engages
    runner.tool((0.0, 0.0, 0.0))
    assert runner.run(1.0).state == enable_state.ENGAGED


@pytest.mark.parametrize("method", EXCHANGE_METHODS)
@pytest.mark.parametrize("far", [0.015, 0.05])  # 15 N and 50 N at 1000 N/m
def test_no_force_comes_of_a_far_tool_whose_samples_are_missing_for_a_while_or_that_comes_after_enabling(method, far):
    """The samples are missing for 0.1 s of each 0.2 s, then for a second in which the handle is in free space."""
    runner = Servo(settled=False, exchange__method=method, coupling__stiffness=1000.0, coupling__damping=1.0)
    for age in [*np.tile(np.arange(0.0, 0.2, PERIOD) % 0.1 * 2.0, 5), *np.arange(0.0, 1.0, PERIOD)]:
        runner.tool((far, 0.0, 0.0), age=age)
        row = runner.tick()
        assert row.motor.tolist() == [0.0, 0.0, 0.0]
    assert row.state == enable_state.ENGAGED  # and so walls push
    runner.tool((far, 0.0, 0.0))
    assert runner.run(1.0).motor.tolist() == [0.0, 0.0, 0.0]
    runner.move((far, 0.0, 0.0), 0.5)
    assert runner.run(0.3).exchange_fade == 1.0


def test_under_an_open_clutch_the_handle_stays_in_the_world_without_force_and_goes_on_from_there():
    runner = Servo(scale=(2.0, 1.0), **FREE)
    runner.move((0.01, 0.0, 0.0))
    runner.command = enable_state.ENABLE | enable_state.CLUTCH
    runner.tick()
    row = runner.move((-0.03, 0.0, 0.0))
    assert row.position[0] == pytest.approx(0.02, abs=1e-6) and row.velocity[0] == 0.0
    assert row.state == enable_state.IDLE and row.motor[0] == 0.0
    runner.command = enable_state.ENABLE
    assert runner.move((-0.02, 0.0, 0.0)).position[0] == pytest.approx(0.04, abs=1e-6)


@pytest.mark.parametrize("back", [0.0, 3.0])
def test_counts_that_change_without_a_newer_time_move_nothing_and_their_way_is_booked_with_the_next(back):
    runner, speed = pressing(), 1e-2
    first, latched, held = runner.rows[-1], runner.memory["motion"]["sample_time"][0], 3
    for _ in range(held - 1):
        runner.position = runner.position + [speed * PERIOD, 0.0, 0.0]
        row = runner.tick(latched=latched - back * PERIOD * 1e9)
        assert (row.position == first["position"]).all() and (row.motor == first["motor"]).all()
        assert (row.energy_given == first["energy_given"]).all()
    runner.position = runner.position + [speed * PERIOD, 0.0, 0.0]
    row, force = runner.tick(), first["force_on_handle"][0, 0]
    assert row.fault == faults.NONE and row.velocity[0] == pytest.approx(speed)
    way = held * speed * PERIOD
    booked = row.energy_given[0] - first["energy_given"][0, 0]
    assert booked == pytest.approx(force * way - 3.0 * way**2 / (held * PERIOD), rel=1e-6)


@pytest.mark.parametrize("axes", [1, 3])
@pytest.mark.parametrize("method", EXCHANGE_METHODS)
def test_a_row_that_is_used_again_keeps_nothing_of_the_tick_it_held_before(method, axes):
    outputs = list(records.OUTPUT.names)
    outputs = [name for name in outputs if name not in ("margin", "surplus")]  # which recomputing takes from the row
    quick = {"exchange__method": method, "engage__time": 0.01, "exchange__fade": 0.01}
    clean, used = (Servo(axes=axes, settled=False, **WALL, **quick) for _ in range(2))
    for runner, left in ((clean, 0.0), (used, math.nan)):
        runner.left = {name: left for name in outputs}
        for name in ("number", "mass", "inertia", "trust"):
            runner.memory["virtual_tool"]["contacts"][name] = 1.0
        runner.tool((0.0005, 0.0, 0.0))
        runner.inputs |= {"contact_set": 1.0, "contact_age": 0.001}
        runner.run(0.05)
        runner.tick(stale=True)
        runner.tick(tool_position=(math.nan, 0.0, 0.0))
        runner.inputs |= {"contact_age": 1e3}
        runner.run(0.01)
    acted = np.array([row["local"][0] for row in clean.rows])
    assert acted.any() == (method == "local")
    for one, other in zip(clean.rows, used.rows, strict=True):
        assert [name for name in outputs if one[name].tobytes() != other[name].tobytes()] == []


ANY = st.floats(allow_nan=True, allow_infinity=True)
WORD = st.integers(-(2**63), 2**63 - 1)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.tuples(WORD, WORD, WORD), st.tuples(ANY, ANY, ANY), WORD, WORD), min_size=1, max_size=8))
def test_whatever_stands_in_the_page_the_motor_stays_finite_within_its_limit_and_zero_in_a_fault(samples):
    runner = Servo(settled=False, **WALL, cancellation__ratio=0.5, cancellation__source="measured")
    runner.memory["enable"]["ramp"], runner.memory["enable"]["state"] = 1.0, enable_state.ENGAGED
    for counts, drag, status, latched in samples:
        row = runner.tick(counts=counts, drag=drag, device_status=status, latched=latched)
        assert np.isfinite(row.motor).all()
        assert (abs(row.force_on_handle) <= runner.settings["hardware"]["motor_limit"][0]).all()
        assert row.fault == faults.NONE or not row.motor.any()


class Press:
    """A hand pressing into a wall, in lock-step with the plant: all records, at their beginning."""

    def __init__(self, motion=None, **driver):
        described = device(damping=3.0, counts=2e5, coulomb=0.02, axes=3, sensing_delay=130e-6, actuation_delay=60e-6)
        driver = {**WALL, **FREE, "engage__time": 0.05, **driver}
        script = {"motion__name": "press_wall", "motion__start": (0.005, 0.0, 0.0), "motion__duration": 0.4}
        script |= {"motion__target": (-0.01, 0.004, 0.1), **(motion or {})}
        self.settings = controller_config.settings_from(described, values("haptic_driver", **driver))
        self.hand = loopback_config.hand_from(described, values("haptic_loopback", **script))
        self.plant = self.hand[1]
        self.plant["time"] = self.start = 10**12
        self.memory, self.ticks = np.zeros(1, records.STATE), 0

    def run(self, seconds=0.5, delay=5000):
        """Rows of the next ticks, whose motor values are written this much [ns] after each deadline."""
        rows, tool = np.zeros(round(seconds / PERIOD), records.TRACE_ROW), np.zeros(1, servo_loop.TOOL)
        now = self.start + self.ticks * round(PERIOD * 1e9)
        whole = self.settings, self.memory, rows, tool, *self.hand
        simulated_device.run_lockstep(*whole, now, self.ticks, delay, enable_state.ENABLE)
        self.ticks += len(rows)
        return rows


def test_lockstep_twice_gives_the_same_bits_in_one_piece_or_in_two():
    one, two = Press(), Press()
    rows = one.run()
    assert np.abs(rows["force_walls"]).max() > 1.0
    assert rows.tobytes() == np.concatenate([two.run(0.2), two.run(0.3)]).tobytes()
    assert one.plant.tobytes() == two.plant.tobytes()
    assert Press().run(delay=6000).tobytes() != rows.tobytes()
