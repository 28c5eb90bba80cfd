# SPDX-License-Identifier: Apache-2.0
"""The servo's tick: what it commands, when it engages, every fault it latches, and that it can be computed again."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lockstep_systems import device, values
from ticks import tick

from haptic_device import controller_config
from haptic_device.control import enable_state, faults, records
from haptic_device.device import loopback_config, simulated_device
from haptic_device.parameters import EXCHANGE_METHODS, MOST_WALLS
from haptic_device.realtime import servo_loop

PERIOD = 1 / 4000.0
WALL = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (1000.0,), "wall__damping": (0.0,)}
FREE = {f"coupling__{turning}{gain}": 0.0 for turning in ("", "rotational_") for gain in ("stiffness", "damping")}
COUNTS = 1e7  # per metre
SETTLED = {}  # memory and row after a second at rest, for each settings there were: the second is the same each time


class Servo:
    """The servo with its inputs in a test's hands; ticks follow each other on time unless told otherwise."""

    def __init__(self, axes=3, scale=(1.0, 1.0), gravity=(0.0, 0.0), settled=True, **given):
        self.device = device(damping=3.0, counts=COUNTS, axes=axes, scale=scale, gravity=gravity)
        given = {"exchange__method": "direct"} | given  # the tool as it is; the other methods have tests of their own
        self.settings = controller_config.settings_from(self.device, values("haptic_driver", **given))
        self.memory, self.now, self.command = np.zeros(1, records.STATE), 10**12, enable_state.ENABLE
        self.inputs = {"tool_age": -1.0, "device_status": faults.FRESH}
        self.left = {}  # in the outputs of each row, of a tick before
        self.position = np.zeros(3)
        self.rows, self.known = [], self.settings.tobytes()
        if settled:
            self._settle()

    def _settle(self):
        known = self.settings.tobytes()
        if known not in SETTLED:
            self.run(1.0)
            SETTLED[known] = self.memory.copy(), self.rows[-1], self.now
        memory, row, self.now = SETTLED[known]
        self.memory[:], self.rows = memory, [row.copy()]

    def tick(self, stale=False, **changes):
        """One tick; inputs in changes last for this tick only. The device is at self.position."""
        row = np.zeros(1, records.TRACE_ROW)
        self.now += round(PERIOD * 1e9)
        counts = np.round(self.position / self.settings["hardware"]["position_per_count"][0, :3].clip(1e-12))
        given = {"deadline": self.now, "latched": self.now, "counts": counts, "command": self.command}
        given |= self.left | self.inputs | changes
        if stale:
            given["latched"] = self.memory["motion"]["sample_time"][0]
        for name, value in given.items():
            row[name] = value
        if self.settings.tobytes() != self.known:  # as a driver counts what it hands on
            self.settings["version"] += 1
            self.known = self.settings.tobytes()
        tick(self.settings, self.memory, row)
        self.rows.append(row)
        return row.view(np.recarray)[0]

    def run(self, seconds, **changes):
        for _ in range(round(seconds / PERIOD)):
            row = self.tick(**changes)
        return row

    def move(self, position, seconds=0.1):
        """Takes the handle somewhere smoothly and waits there."""
        path = np.linspace(self.position, position, round(seconds / PERIOD) + 1)[1:]
        for self.position in path:
            self.tick()
        return self.run(0.002)

    def tool(self, position, velocity=(0.0, 0.0, 0.0), age=0.001):
        self.inputs |= {"tool_position": position, "tool_velocity": velocity, "tool_age": age, "tool_sequence": 1.0}


def test_in_free_space_without_a_tool_the_motor_stays_at_zero():
    row = Servo(**FREE).move((0.05, 0.02, 1.0))
    assert row.state == enable_state.ENGAGED and row.motor.tolist() == [0.0, 0.0, 0.0] and row.fault == faults.NONE


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 200.0, 315.0])
def test_a_wall_pushes_along_its_normal_by_its_stiffness_times_the_depth(angle):
    normal = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    walls = {**WALL, "wall__normals": tuple(normal), "wall__stiffness": (2000.0,)}
    runner = Servo(**walls, **FREE)
    row = runner.move((*(-0.002 * normal), 0.0))
    assert row.force_on_handle[:2] == pytest.approx(4.0 * normal, abs=2 * 2000.0 / COUNTS)
    assert runner.move((*(0.001 * normal), 0.0)).force_on_handle[:2].tolist() == [0.0, 0.0]


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
    for handle, tool in ((0.0, 0.001), (0.001, 0.0)):
        runner = Servo(settled=False, coupling__stiffness=1000.0, coupling__rotational_stiffness=2.0)
        runner.position = np.full(3, handle)
        runner.tool((tool, tool, tool))
        forces.append(runner.run(1.5).force_on_handle.copy())
    assert forces[0] == pytest.approx([1.0, 1.0, 0.002], rel=1e-3)
    assert forces[1] == pytest.approx(-forces[0])


def test_a_tool_that_grows_old_loses_its_pull_and_a_fresh_one_gets_it_back_slowly():
    runner = Servo(coupling__stiffness=500.0)
    runner.tool((0.001, 0.0, 0.0))
    hold, fade = (float(runner.settings["exchange"][name][0]) for name in ("hold", "fade"))
    assert runner.run(fade + 0.01).force_on_handle[0] == pytest.approx(0.5)
    assert runner.tick(tool_age=hold - 1e-6).force_on_handle[0] == pytest.approx(0.5)
    assert runner.tick(tool_age=hold + fade / 2).force_on_handle[0] == pytest.approx(0.25)
    assert runner.tick(tool_age=hold + fade + 1e-6).force_on_handle[0] == 0.0
    forces = [runner.tick().force_on_handle[0] for _ in range(round(fade / PERIOD) + 2)]
    assert np.max(np.diff(forces)) <= 0.5 * PERIOD / fade * 1.001 and forces[-1] == pytest.approx(0.5)


def test_cancellation_changes_by_a_ticks_share_at_most_as_a_tool_with_the_coupling_stretched_comes_and_goes():
    runner = Servo(coupling__stiffness=50.0, cancellation__ratio=0.9)
    hold, fade = (float(runner.settings["exchange"][name][0]) for name in ("hold", "fade"))
    ticks = round(fade / PERIOD) + 2
    assert runner.rows[-1]["cancellation_fade"] == 1.0
    runner.tool((0.005, 0.0, 0.0))
    came = [1.0, *(runner.tick().cancellation_fade for _ in range(ticks))]
    left = [0.0, *(runner.tick(tool_age=hold + k * PERIOD).cancellation_fade for k in range(1, ticks))]
    assert came[-1] == 0.0 and left[-1] == 1.0
    assert np.abs(np.diff([*came, *left])).max() <= 1.001 * PERIOD / fade
    assert runner.tick(tool_age=-1.0, tool_position=(math.nan,) * 3).cancellation_fade == 1.0


def test_scaling_feels_a_world_stiffness_by_its_square():
    for scale in (0.5, 2.0):
        runner = Servo(scale=(scale, 1.0), coupling__stiffness=100.0)
        runner.tool((0.0, 0.0, 0.0))
        runner.run(0.2)
        row = runner.move((0.002, 0.0, 0.0))
        assert row.position[0] == pytest.approx(scale * 0.002)
        assert row.force_on_handle[0] == pytest.approx(-100.0 * scale**2 * 0.002, rel=1e-4)


def test_force_limits_hold_in_both_directions():
    runner = Servo(coupling__stiffness=1000.0, force__limit=2.0, force__limit_rotational=0.05)
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    runner.tool((0.01, -0.01, 0.2))
    assert runner.run(0.2).force_on_handle.tolist() == [2.0, -2.0, 0.05]
    runner.tool((-0.0019, 0.0, 0.0))
    assert runner.run(0.2).force_on_handle[0] == pytest.approx(-1.9)


def test_gravity_is_compensated_only_while_engaged():
    runner = Servo(gravity=(0.0, -10.0), **FREE)
    assert runner.run(0.01).force_on_handle.tolist() == [0.0, pytest.approx(1.0), 0.0]
    runner.command = 0
    assert runner.run(0.01).force_on_handle.tolist() == [0.0, 0.0, 0.0]


def test_forces_rise_over_the_engage_time_from_a_small_wanted_force():
    runner = Servo(settled=False, coupling__stiffness=400.0, engage__time=0.2, exchange__fade=0.001)
    runner.command = 0
    runner.tool((0.002, 0.0, 0.0))
    runner.run(0.05)
    runner.command, before = enable_state.ENABLE, len(runner.rows)
    runner.run(0.3)
    forces = np.array([row["force_on_handle"][0, 0] for row in runner.rows[before:]])
    states = [int(row["state"][0]) for row in runner.rows[before:]]
    assert states[0] == enable_state.WAITING and states[-1] == enable_state.ENGAGED
    assert forces[-1] == pytest.approx(0.8) and np.diff(forces).max() == pytest.approx(0.8 * PERIOD / 0.2, rel=0.01)
    assert np.sum((forces > 0.0) & (forces < 0.8)) == pytest.approx(0.2 / PERIOD, abs=3)


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


def test_disabling_takes_the_force_away_in_the_next_tick():
    runner = Servo(**WALL, **FREE)
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)
    runner.command = 0
    row = runner.tick()
    assert row.motor.tolist() == [0.0, 0.0, 0.0] and row.state == enable_state.IDLE and row.fault == faults.NONE


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


# How each fault of the table comes about, on a servo that presses a wall with 2 N.
def _estop(runner):
    runner.command |= enable_state.ESTOP
    return runner.tick()


def _device_silent(runner):
    return [runner.tick(stale=True) for _ in range(round(0.02 / PERIOD) + 1)][-1]


def _device_watchdog(runner):
    return runner.tick(device_status=faults.WATCHDOG)


def _device_estop(runner):
    return runner.tick(device_status=faults.FRESH | faults.BUTTON)


def _device_hot(runner):
    return runner.tick(device_status=faults.FRESH | faults.HOT)


def _device_limit(runner):
    return runner.tick(device_status=faults.FRESH | faults.END_SWITCH)


def _device_encoder(runner):
    return runner.tick(device_status=faults.FRESH | faults.BROKEN_ENCODER)


def _encoder_jump(runner):
    runner.position = runner.position + [0.005, 0.0, 0.0]
    runner.settings["hardware"]["velocity_limit"] = 9.0
    return runner.tick()


def _velocity(runner):
    runner.settings["hardware"]["velocity_limit"] = 2.0
    runner.position = runner.position + [0.75e-3, 0.0, 0.0]
    return runner.tick()


def _position(runner):
    runner.settings["hardware"]["position_low"] = -0.0019
    return runner.tick()


def _saturation(runner):
    runner.settings["hardware"]["motor_limit"] = 1.9
    return runner.run(1.0 + 3 * PERIOD)


def _not_a_number(runner):
    runner.settings["coupling"]["stiffness"] = 1.0
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    runner.tool((math.nan, 0.0, 0.0))
    return [runner.tick() for _ in range(2)][-1]


def _duty(runner):
    force, limit = runner.rows[-1]["force_on_handle"][0, 0], runner.settings["hardware"]["motor_limit"][0, 0]
    runner.settings["fault"]["duty"] = 0.5 * force / limit
    runner.settings["fault"]["duty_kept"] = math.exp(-PERIOD / 0.05)
    return runner.run(0.05)


def _unattended(runner):
    return runner.tick(command=enable_state.ENABLE | enable_state.UNATTENDED)


PROVOKE = {
    name.removeprefix("_"): function
    for name, function in list(globals().items())
    if name.removeprefix("_") in {entry.name for entry in faults.TABLE}
}


def pressing():
    runner = Servo(**WALL, **FREE, engage__time=0.1)
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)
    return runner


def test_each_fault_of_the_table_has_a_way_to_provoke_it():
    assert set(PROVOKE) == {entry.name for entry in faults.TABLE}


@pytest.mark.parametrize("entry", faults.TABLE, ids=lambda entry: entry.name)
def test_a_fault_zeroes_the_motor_in_its_tick_stays_latched_and_is_cleared_by_reset_alone(entry):
    runner = pressing()
    before, inputs = runner.settings.copy(), dict(runner.inputs)
    row = PROVOKE[entry.name](runner)
    assert faults.name_of(row.fault) == entry.name
    assert row.motor.tolist() == row.force_on_handle.tolist() == [0.0, 0.0, 0.0]
    assert all(np.array_equal(row["motor"], np.zeros((1, 3))) for row in runner.rows if row["fault"][0])
    runner.settings, runner.inputs = before, inputs
    runner.run(0.1)  # past a jump's own velocity
    runner.command = enable_state.ENABLE
    for _ in range(100):
        row = runner.tick()
        assert faults.name_of(row.fault) == entry.name and not row.motor.any() and row.state == enable_state.FAULT
    runner.position[:] = 0.0
    runner.memory["motion"]["device_position"] = 0.0  # the handle was carried back
    runner.command = enable_state.RESET
    runner.run(0.1)
    runner.command = enable_state.RESET | enable_state.ENABLE
    assert runner.run(0.2).state == enable_state.ENGAGED
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)


def test_the_first_fault_stays_whatever_follows():
    runner = pressing()
    _estop(runner)
    for follow in (_encoder_jump, _device_watchdog, _device_silent, _not_a_number):
        assert faults.name_of(follow(runner).fault) == "estop"


def test_silence_and_saturation_just_within_their_times_are_no_faults():
    runner = pressing()
    rows = [runner.tick(stale=True) for _ in range(round(0.02 / PERIOD) - 1)]
    assert rows[-1].fault == faults.NONE and runner.tick().fault == faults.NONE
    runner = pressing()
    runner.settings["hardware"]["motor_limit"] = 1.9
    assert runner.run(1.0 - 3 * PERIOD).fault == faults.NONE
    assert runner.rows[-1]["force_on_handle"][0, 0] == 1.9


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_motor_may_hold_its_duty_for_ever_and_a_little_more_until_it_is_warm(share):
    runner, time = pressing(), 0.1
    force, limit = runner.rows[-1]["force_on_handle"][0, 0], runner.settings["hardware"]["motor_limit"][0, 0]
    runner.settings["fault"]["duty"] = force / limit / share
    runner.settings["fault"]["duty_kept"] = math.exp(-PERIOD / time)
    began, row = len(runner.rows), runner.run(10 * time)
    assert faults.name_of(row.fault) == ("" if share < 1.0 else "duty")
    if share > 1.0:
        held = next(k for k, row in enumerate(runner.rows[began:]) if row["fault"][0]) * PERIOD
        assert held == pytest.approx(-time * math.log(1.0 - 1.0 / share**2), rel=0.01)


def test_an_axis_that_the_device_lacks_is_not_saturated_by_a_wall_whose_normal_leans_by_rounding():
    leaning = WALL | {"wall__normals": (1.0, math.sin(math.pi))}
    runner = Servo(axes=1, **leaning, **FREE)
    runner.move((-0.002, 0.0, 0.0))
    row = runner.run(1.0 + 0.2)
    assert row.force_walls[1] > 0.0 and faults.name_of(row.fault) == ""
    assert row.force_on_handle == pytest.approx([2.0, 0.0, 0.0], rel=1e-3)


@pytest.mark.parametrize("back", [0.0, 0.4, 3.0])
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


def test_a_device_whose_time_was_far_ahead_once_is_silent_from_then_on():
    runner = pressing()
    runner.tick(latched=runner.now + 10**9)
    assert runner.run(0.02 - PERIOD).fault == faults.NONE
    assert faults.name_of(runner.run(2 * PERIOD).fault) == "device_silent" and not runner.rows[-1]["motor"].any()


def test_a_cut_motor_is_no_fault_before_the_servo_has_engaged():
    runner = Servo(settled=False, **FREE)
    assert runner.tick(device_status=faults.WATCHDOG).fault == faults.NONE


@pytest.mark.parametrize("field", ["tool_position", "tool_velocity", "drag"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_input_that_is_not_a_number_becomes_a_force(field, value):
    runner = Servo(cancellation__ratio=0.5, cancellation__source="measured", engage__time=0.1)
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    row = runner.tick(**{field: (0.0, value, 0.0)})
    assert faults.name_of(row.fault) == "not_a_number" and not row.motor.any()
    assert row.state == enable_state.FAULT  # the device is told by it whether the display is engaged
    runner.command = enable_state.RESET
    runner.run(0.01)
    runner.command |= enable_state.ENABLE
    row = runner.run(0.2)
    assert row.state == enable_state.ENGAGED and np.isfinite(runner.memory["compensation"]["drag"]).all()


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
        runner.tool((0.001, 0.0, 0.0))
        runner.inputs |= {"contact_set": 1.0, "contact_age": 0.001}
        runner.run(0.05)
        runner.tick(stale=True)
        runner.tick(tool_position=(math.nan, 0.0, 0.0))
        runner.inputs |= {"contact_age": 1e3}
        runner.run(0.01)
    acted = np.array([row["local"][0] for row in clean.rows])
    assert acted.any() == (method == "local") and acted[-1] == 0.0
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


def test_lockstep_twice_gives_the_same_bits():
    one, two = Press(), Press()
    rows = one.run()
    assert np.abs(rows["force_walls"]).max() > 1.0
    assert rows.tobytes() == two.run().tobytes() and one.plant.tobytes() == two.plant.tobytes()
    assert Press().run(delay=6000).tobytes() != rows.tobytes()


def test_lockstep_in_two_pieces_is_lockstep_in_one():
    pieces = Press()
    assert np.concatenate([pieces.run(0.2), pieces.run(0.3)]).tobytes() == Press().run(0.5).tobytes()


def replay(rows, settings):
    """The rows computed again from their inputs alone."""
    memory, again = np.zeros(1, records.STATE), np.zeros(len(rows), records.TRACE_ROW)
    inputs = [name for name in records.TRACE_ROW.names if name not in records.OUTPUT.names]
    for name in inputs:
        again[name] = rows[name]
    for k in range(len(again)):
        tick(settings, memory, again[k : k + 1])
    return again


@pytest.mark.parametrize("estimator", ["backward_difference", "lowpass", "adaptive_window"])
def test_a_trace_holds_all_that_is_needed_to_compute_its_ticks_again_bit_for_bit(estimator):
    press = Press(velocity__estimator=estimator, cancellation__ratio=0.3)
    rows = press.run()
    again = replay(rows, press.settings)
    assert np.abs(again["motor"]).max() > 1.0
    assert again.tobytes() == rows.tobytes()


def test_a_hand_pressing_a_wall_comes_to_rest_where_both_springs_balance():
    """Hand k_h at target −10 mm against wall K: x = k_h t/(k_h + K), f = −K x, but for friction."""
    press = Press(motion={"motion__duration": 1.2})
    rows = press.run(0.85)
    share = 500.0 / (500.0 + 1000.0)
    friction, step = 0.02 / 1500.0, 5e-6
    assert press.plant["position"][0, 0] == pytest.approx(-0.01 * share, abs=friction + step)
    assert press.plant["operator_force"][0, 0] == pytest.approx(-1000.0 * 0.01 * share, abs=0.05)
    assert rows["force_on_handle"][-1, 0] == pytest.approx(1000.0 * 0.01 * share, abs=0.05)


def test_the_wall_never_pulls_while_a_hand_taps_it():
    rows = Press(motion={"motion__name": "tap"}, wall__damping=(1.0,)).run()
    assert rows["force_walls"][:, 0].max() > 1.0 and rows["force_walls"][:, 0].min() == 0.0


def test_a_tool_that_joins_an_engaged_handle_from_afar_waits_until_its_pull_is_small():
    runner = Servo(settled=True, **FREE)
    runner.settings["coupling"]["stiffness"][0, :2] = 1000.0
    runner.settings["exchange"]["fade"] = 0.01
    runner.tool((0.0011, 0.0, 0.0))
    assert runner.run(0.1).exchange_fade == 0.0 and not runner.rows[-1]["motor"].any()
    runner.tool((0.0009, 0.0, 0.0))
    assert runner.run(0.1).exchange_fade == 1.0
    assert runner.rows[-1]["motor"][0, 0] > 0.0
