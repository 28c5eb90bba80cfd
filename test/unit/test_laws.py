# SPDX-License-Identifier: Apache-2.0
"""Each law alone: its sign, its closed form, and both sides of its bounds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import fault_watch, faults, motor, rows, sensing, virtual_wall

number = st.floats(-100.0, 100.0)
gain = st.floats(0.0, 1e4)


def row(stiffness, low, high, angle=0.0, offset=0.0, damping=0.0):
    """A row of this normal angle [rad]; a wall has low = 0."""
    one = np.zeros(1, rows.ROW).view(np.recarray)[0]
    one.normal[:2], one.offset, one.stiffness = (math.cos(angle), math.sin(angle)), offset, stiffness
    one.low, one.high, one.weight, one.damping = low, high, 1.0, damping
    return one


@given(gain, gain, st.floats(-0.1, 0.1), number)
def test_a_wall_never_pulls_and_does_nothing_outside(stiffness, damping, depth, rate):
    force = virtual_wall.wall_force(stiffness, damping, depth, rate)
    assert force >= 0.0
    assert depth > 0.0 or force == 0.0


def test_inside_a_wall_spring_and_damper_add_and_the_leaving_handle_is_not_held():
    assert virtual_wall.wall_force(1000.0, 5.0, 0.002, 0.1) == pytest.approx(2.5)
    assert virtual_wall.wall_force(1000.0, 5.0, 0.002, -0.3) == pytest.approx(0.5)
    assert virtual_wall.wall_force(1000.0, 5.0, 0.002, -0.5) == 0.0
    assert virtual_wall.wall_force(1000.0, 5.0, 0.0, 1.0) == 0.0
    assert virtual_wall.wall_force(1000.0, 5.0, 1e-12, 1.0) > 5.0 - 1e-9


@given(st.floats(0.0, 2 * math.pi), st.floats(-1.0, 1.0), number, number)
def test_depth_in_a_wall_is_the_way_back_along_its_normal(angle, offset, x, y):
    nx, ny = math.cos(angle), math.sin(angle)
    wall = row(1.0, 0.0, 1.0, angle, offset)
    depth = rows.stretch(wall, np.array([x, y, 0.0]))
    assert abs(rows.stretch(wall, np.array([x + depth * nx, y + depth * ny, 0.0]))) < 1e-9


@given(gain, st.floats(0.1, 50.0), st.sampled_from([0.0, -1.0]), st.floats(-0.1, 0.1))
def test_a_springs_force_is_the_slope_of_its_store_within_its_limit_and_beyond(stiffness, limit, side, stretch):
    spring, step = row(stiffness, side * limit, limit), 1e-6
    store = [rows.pull(spring, stretch + change, 0.0)[2] for change in (-step, step)]
    force = max(side * limit, min(limit, stiffness * stretch))
    assert (store[1] - store[0]) / (2 * step) == pytest.approx(force, abs=stiffness * step + 1e-6)
    assert rows.pull(spring, stretch, 0.0)[0] == pytest.approx(force)


@given(number, number, number, st.floats(0.01, 10.0), number)
def test_scaling_between_device_and_world_keeps_power(position, velocity, force, scale, offset):
    step = 1e-3
    moved = sensing.to_world(position + step, scale, offset) - sensing.to_world(position, scale, offset)
    assert moved == pytest.approx(scale * step, rel=1e-6)
    power_in_world = force * scale * velocity
    assert motor.to_device_force(force, scale) * velocity == pytest.approx(power_in_world, rel=1e-9, abs=1e-12)


def motion(position=0.0, velocity=0.0, displacement=0.0, elapsed=0.001):
    return fault_watch.motion_fault(position, velocity, -0.1, 0.2, 3.0, displacement, elapsed)


def test_workspace_velocity_and_jump_are_faults_just_outside_their_limits_and_fine_just_inside():
    inside, outside = 1.0 - 1e-9, 1.0 + 1e-9
    assert motion(-0.1 * inside) == motion(0.2 * inside) == faults.NONE
    assert motion(-0.1 * outside) == motion(0.2 * outside) == faults.POSITION
    assert motion(velocity=3.0 * inside) == motion(velocity=-3.0 * inside) == faults.NONE
    assert motion(velocity=3.0 * outside) == motion(velocity=-3.0 * outside) == faults.VELOCITY
    assert motion(displacement=0.006 * inside) == faults.NONE
    assert motion(displacement=0.006 * outside) == motion(displacement=-0.006 * outside) == faults.ENCODER_JUMP
    assert motion(displacement=1.0, elapsed=0.0) == faults.NONE


def test_a_motion_that_is_not_a_number_is_a_fault():
    for value in (math.nan, math.inf, -math.inf, 1e300):
        assert motion(position=value) == motion(velocity=value) == faults.NOT_A_NUMBER


def test_the_fault_table_names_each_code_once_in_words_without_services():
    assert sorted(entry.code for entry in faults.TABLE) == list(range(1, len(faults.TABLE) + 1))
    assert len({entry.name for entry in faults.TABLE}) == len(faults.TABLE)
    assert all(entry.title and entry.cause and "zero" in entry.motor for entry in faults.TABLE)
    assert not any("~/" in text for entry in faults.TABLE for text in (entry.title, entry.cause, entry.first))
