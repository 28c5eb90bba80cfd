# SPDX-License-Identifier: Apache-2.0
"""The plant and the hand of the reference device against closed forms."""

import ctypes
import math
from types import SimpleNamespace

import firmware_builds
import numpy as np
import pytest


@pytest.fixture(scope="session")
def library():
    """The ports' functions."""
    return firmware_builds.ports()


FREE = (0.1, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # m, b, f_c, g, m_h, b_h, k_h, start


class Plant:
    """The reference device's plant; each axis by (m, b, f_c, g, m_h, b_h, k_h, start)."""

    PARTS = ("position", "velocity", "motor", "operator", "target", "target_velocity", "sensed")

    def __init__(self, library, x=FREE, y=FREE, theta=FREE, sensing=0.0, actuation=0.0):
        self.port = library
        delays = (ctypes.c_int64(round(sensing * 1e9)), ctypes.c_int64(round(actuation * 1e9)))
        library.plant_port_begin((ctypes.c_double * 8 * 3)(x, y, theta), *delays)

    def push(self, time, *force):
        values = (ctypes.c_double * 3)(*force, *[0.0] * (3 - len(force)))
        return self.port.plant_port_push(ctypes.c_int64(round(time * 1e9)), values) * 1e-9

    def cut(self, time):
        self.port.plant_port_cut(ctypes.c_int64(round(time * 1e9)))

    def waypoint(self, *numbers):
        self.port.plant_port_waypoint(*map(ctypes.c_double, numbers))

    def at(self, time):
        """The state at this time [s]: arrays of 3, and energy."""
        self.port.plant_port_advance(ctypes.c_int64(round(time * 1e9)))
        state = (ctypes.c_double * 22)()
        self.port.plant_port_state(state)
        parts = {name: np.array(state[3 * i : 3 * i + 3]) for i, name in enumerate(self.PARTS)}
        return SimpleNamespace(energy=state[21], **parts)


def test_a_constant_motor_against_damping(library):
    plant = Plant(library, y=(0.2, 0.5, 0.0, -1.962, 0.0, 0.0, 0.0, 0.1))
    plant.push(0.0, 1.0)
    for t in (0.001, 0.0123456, 0.2):
        state, lag = plant.at(t), 0.1 / 3.0
        assert state.position[0] == pytest.approx((t - lag * (1 - math.exp(-t / lag))) / 3.0, abs=1e-13)
        assert state.velocity[0] == pytest.approx((1 - math.exp(-t / lag)) / 3.0, abs=1e-12)
        lag = 0.4
        assert state.position[1] == pytest.approx(0.1 - 3.924 * (t - lag * (1 - math.exp(-t / lag))), abs=1e-13)
        assert state.energy == 0.0


def test_a_hand_that_holds_is_a_damped_oscillator(library):
    m, b, k, force = 0.2, 11.0, 500.0, 2.0
    plant = Plant(library, x=(0.1, 3.0, 0.0, 0.0, 0.1, 8.0, 500.0, 0.02))
    plant.push(0.0, force)
    decay = b / (2 * m)
    ringing = math.sqrt(k / m - decay**2)
    for t in (0.003, 0.05, 0.3):
        swing = math.exp(-decay * t) * (math.cos(ringing * t) + decay / ringing * math.sin(ringing * t))
        assert plant.at(t).position[0] == pytest.approx(0.02 + force / k * (1 - swing), abs=1e-12)


def test_friction_holds_what_is_at_most_as_strong(library):
    plant = Plant(library, x=(0.1, 3.0, 0.5, 0.0, 0.1, 8.0, 500.0, 0.0))
    plant.push(0.0, 0.5)
    assert plant.at(0.1).position[0] == 0.0
    plant.push(0.1, -0.5)
    assert plant.at(0.2).position[0] == 0.0
    plant.push(0.2, 0.501)
    state = plant.at(2.0)
    assert 0.0 < state.position[0] <= 0.002 / 500.0


def test_friction_alone_ends_a_motion_where_its_energy_is_gone(library):
    plant = Plant(library, x=(0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    plant.push(0.0, 1.2)
    speed, way = 10.0 * 0.05, 0.5 * 10.0 * 0.05**2
    assert plant.at(0.05).velocity[0] == pytest.approx(speed, abs=1e-12)
    plant.push(0.05, 0.0)
    stopped = 0.05 + speed / 2.0  # at 0.2/0.1 m/s²
    moving, standing = plant.at(stopped - 1e-5), plant.at(stopped + 1e-4)
    assert moving.velocity[0] == pytest.approx(2e-5, rel=1e-6) and standing.velocity[0] == 0.0
    assert standing.position[0] == pytest.approx(way + 0.1 * speed**2 / (2 * 0.2), abs=1e-12)
    assert plant.at(5.0).position[0] == standing.position[0]


def test_friction_takes_the_same_from_each_half_swing(library):
    """A spring swings about its new rest, 11.3 dead bands away, by 2 f_c/k less each time, and then sticks."""
    m, k, friction = 0.2, 800.0, 0.16
    band, half = friction / k, math.pi * math.sqrt(m / k)
    plant = Plant(library, x=(m, 0.0, friction, 0.0, 0.0, 0.0, k, 0.0))
    plant.push(0.0, 11.3 * friction)  # from 0 it swings about 11.3 bands
    peaks = [plant.at(half * (i + 1)).position[0] / band - 11.3 for i in range(7)]
    assert peaks[:5] == pytest.approx([9.3, -7.3, 5.3, -3.3, 1.3], abs=1e-7)
    assert peaks[5:] == pytest.approx([0.7, 0.7], abs=1e-7)


def test_energy_is_what_the_motor_gives_less_what_is_kept_and_lost(library):
    """A hand throws the handle at a wall, which the motor renders late: all books, once round the bounce."""
    m, b, friction = 0.1, 0.4, 0.02
    plant = Plant(library, x=(m, b, friction, 0.0, 0.1, 2.0, 120.0, 0.0))
    for when, place in ((0.0, 0.0), (0.15, 0.06), (0.6, 0.0)):
        plant.waypoint(when, place, 0.0, 0.0, 1.0)
    plant.port.plant_port_script()
    work = lost = 0.0
    before, touched, last = plant.at(0.0), False, 0.0
    for i in range(700):
        force = min(0.0, -900.0 * (before.position[0] - 0.03)) if i % 2 == 0 else last
        plant.push(i * 1e-3, force)
        last, touched = force, touched or force < -3.0
        for j in range(1, 21):
            now = plant.at(i * 1e-3 + j * 5e-5)
            middle = 0.5 * (before.velocity[0] + now.velocity[0])
            way = now.position[0] - before.position[0]
            work += force * way
            lost += friction * abs(way) + b * (middle * way if way else 0.0)
            before = now
    kept = 0.5 * m * before.velocity[0] ** 2
    assert touched
    assert before.energy == pytest.approx(work - lost - kept, abs=2e-7)


def test_a_motor_at_zero_gives_nothing(library):
    plant = Plant(
        library, x=(0.1, 3.0, 0.02, 0.0, 0.1, 8.0, 500.0, 0.0), theta=(1e-4, 4e-3, 1e-4, 0.0, 1e-4, 0.02, 1.0, 0.0)
    )
    for when, x, theta in ((0.0, 0.0, 0.0), (0.1, 0.05, 1.0), (0.2, -0.05, -2.0), (0.3, 0.0, 0.0)):
        plant.waypoint(when, x, 0.0, theta, 1.0)
    plant.port.plant_port_script()
    energies = [plant.at(0.001 * i).energy for i in range(500)]
    assert max(energies) == 0.0 and energies[-1] < -0.01


def test_delays_shift_the_motor_and_the_encoder(library):
    plant = Plant(library, sensing=0.0015, actuation=0.002)
    assert plant.push(0.001, 1.0) == pytest.approx(0.003, abs=1e-12)
    assert plant.push(0.002, -1.0) == pytest.approx(0.004, abs=1e-12)
    assert plant.at(0.003).position[0] == 0.0 and plant.at(0.003).motor[0] == 1.0
    middle = plant.at(0.0036)
    assert plant.at(0.0051).sensed[0] == pytest.approx(middle.position[0], abs=1e-10)
    assert plant.at(0.0051).motor[0] == -1.0
    plant.push(0.0051, 1.0)
    plant.cut(0.0052)
    assert plant.at(0.0052).motor[0] == 0.0 and plant.at(0.01).motor[0] == 0.0


def test_the_hand_goes_by_minimum_jerk_and_lets_go(library):
    held = (0.1, 0.0, 0.0, 0.0, 0.1, 60.0, 9000.0, 0.0)
    plant = Plant(library, x=held, y=held)
    for when, x, grip in ((0.0, 0.0, 1.0), (0.2, 0.04, 1.0), (0.4, -0.04, 0.0), (0.5, -0.04, 0.0)):
        plant.waypoint(when, x, 0.0, 0.0, grip)
    assert plant.at(0.1).target[0] == 0.0  # not begun
    plant.port.plant_port_script()
    middle = plant.at(0.2)
    assert middle.target[0] == pytest.approx(0.02) and middle.target_velocity[0] == pytest.approx(0.04 * 1.875 / 0.2)
    assert plant.at(0.25).target[0] == pytest.approx(0.04 * (10 * 0.75**3 - 15 * 0.75**4 + 6 * 0.75**5))
    assert not plant.port.plant_port_done()
    gone = plant.at(0.5001)
    plant.push(0.5001, 1.0)
    later = plant.at(0.5501)
    assert later.operator[0] == 0.0
    assert later.velocity[0] - gone.velocity[0] == pytest.approx(1.0 / 0.1 * 0.05, abs=1e-12)
    plant.at(0.61)
    assert plant.port.plant_port_done()


def test_the_hand_goes_round_at_an_even_rate_between_its_easing(library):
    plant = Plant(library, x=(*FREE[:7], 0.05))
    plant.port.plant_port_circle(ctypes.c_double(0.03), ctypes.c_double(2.0), ctypes.c_double(4.0))
    plant.port.plant_port_script()
    for when in (0.4, 1.0, 2.5, 3.6):
        state = plant.at(when)
        assert math.hypot(*(state.target[:2] - (0.02, 0.0))) == pytest.approx(0.03)
        assert math.hypot(*state.target_velocity[:2]) == pytest.approx(0.03 * 2 * math.pi * 2.0 / (0.9 * 4.0))
    ahead, behind = plant.at(3.9999), plant.at(4.0)
    assert behind.target[:2] == pytest.approx([0.05, 0.0], abs=1e-12)
    assert math.hypot(*ahead.target_velocity[:2]) < 1e-3


def test_a_following_hand_lags(library):
    plant = Plant(library)
    plant.port.plant_port_follow(ctypes.c_double(0.02))
    plant.port.plant_port_script()
    plant.at(0.1)
    plant.port.plant_port_goal((ctypes.c_double * 3)(0.05, -0.05, 1.0))
    state = plant.at(0.12)
    assert state.target == pytest.approx(np.array([0.05, -0.05, 1.0]) * (1 - math.exp(-1.0)))
    assert state.target_velocity == pytest.approx(np.array([0.05, -0.05, 1.0]) * math.exp(-1.0) / 0.02)
