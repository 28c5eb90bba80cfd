# SPDX-License-Identifier: Apache-2.0
"""The device as physics, in Python and in the firmware: closed forms, sensors and motor, and where the energy goes."""

import ctypes
import math

import numpy as np
import pytest
from examples import few
from hypothesis import example, given
from hypothesis import strategies as st
from plants import FREE, InC, InPython
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from haptic_device.config.description import SUB_STEP
from haptic_device.device import plant

# both libraries


@pytest.fixture(params=[InPython, InC], ids=["python", "c"])
def made(request):
    """made(x=…, y=…, theta=…, sensing=…, actuation=…) makes the plant, of either library."""
    return request.param


def test_a_constant_motor_against_damping_ends_at_its_terminal_velocity_and_gravity_pulls(made):
    moved = made(y=(0.2, 0.5, 0.0, -1.962, 0.0, 0.0, 0.0, 0.1), theta=(0.1, 0.0, 0.0, -0.981, 0.0, 0.0, 0.0, 0.0))
    moved.push(0.0, 1.0)
    for t in (0.001, 0.0123456, 0.2):
        state, lag = moved.at(t), 0.1 / 3.0
        assert state.position[0] == pytest.approx((t - lag * (1 - math.exp(-t / lag))) / 3.0, abs=1e-13)
        assert state.velocity[0] == pytest.approx((1 - math.exp(-t / lag)) / 3.0, abs=1e-12)
        lag = 0.4
        assert state.position[1] == pytest.approx(0.1 - 3.924 * (t - lag * (1 - math.exp(-t / lag))), abs=1e-13)
        assert state.position[2] == pytest.approx(-9.81 * t**2 / 2, abs=1e-13)
        assert state.energy == pytest.approx(0.0, abs=1e-14)


def test_a_hand_that_holds_is_a_damped_oscillator_and_bears_the_motors_force_in_the_end(made):
    m, b, k, force = 0.2, 11.0, 500.0, 2.0
    held = made(x=(0.1, 3.0, 0.0, 0.0, 0.1, 8.0, k, 0.02))
    held.push(0.0, force)
    decay = b / (2 * m)
    ringing = math.sqrt(k / m - decay**2)
    for t in (0.003, 0.05, 0.3):
        swing = math.exp(-decay * t) * (math.cos(ringing * t) + decay / ringing * math.sin(ringing * t))
        assert held.at(t).position[0] == pytest.approx(0.02 + force / k * (1 - swing), abs=1e-12)
    assert held.at(1.0).operator[0] == pytest.approx(-force, rel=1e-9)


def test_friction_holds_what_is_at_most_as_strong(made):
    for push, moves in ((0.5, False), (-0.5, False), (0.5 + 1e-6, True), (-0.5 - 1e-6, True)):
        rough = made(x=(0.1, 3.0, 0.5, 0.0, 0.1, 8.0, 500.0, 0.0))
        rough.push(0.0, push)
        position = rough.at(0.1).position[0]
        assert (position != 0.0) == moves and position * push >= 0.0 and abs(position) <= 2e-6 / 500.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_friction_alone_ends_a_motion_where_its_energy_is_gone(made, sign):
    sliding = made(x=(0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    sliding.push(0.0, 1.2 * sign)
    speed, way = 10.0 * 0.05, 0.5 * 10.0 * 0.05**2
    assert sliding.at(0.05).velocity[0] == pytest.approx(sign * speed, abs=1e-12)
    sliding.push(0.05, 0.0)
    stopped = 0.05 + speed / 2.0  # at 0.2/0.1 m/s²
    moving, standing = sliding.at(stopped - 1e-5), sliding.at(stopped + 1e-4)
    assert moving.velocity[0] == pytest.approx(2e-5 * sign, rel=1e-6) and standing.velocity[0] == 0.0
    assert standing.position[0] == pytest.approx(sign * (way + 0.1 * speed**2 / (2 * 0.2)), abs=1e-12)
    later = sliding.at(1.0)
    assert later.position[0] == standing.position[0] and later.energy == pytest.approx(0.0, abs=1e-14)


def test_energy_is_what_the_motor_gives_less_what_is_kept_and_lost(made):
    """A hand throws the handle at a wall, which the motor renders late: all books, once round the bounce."""
    m, b, friction = 0.1, 0.4, 0.02
    thrown = made(x=(m, b, friction, 0.0, 0.1, 2.0, 120.0, 0.0))
    thrown.script(*((when, place, 0.0, 0.0, 1.0) for when, place in ((0.0, 0.0), (0.15, 0.06), (0.6, 0.0))))
    work = lost = 0.0
    before, touched, last = thrown.at(0.0), False, 0.0
    for i in range(700):
        force = min(0.0, -900.0 * (before.position[0] - 0.03)) if i % 2 == 0 else last
        thrown.push(i * 1e-3, force)
        last, touched = force, touched or force < -3.0
        for j in range(1, 21):
            now = thrown.at(i * 1e-3 + j * 5e-5)
            middle = 0.5 * (before.velocity[0] + now.velocity[0])
            way = now.position[0] - before.position[0]
            work += force * way
            lost += friction * abs(way) + b * (middle * way if way else 0.0)
            before = now
    kept = 0.5 * m * before.velocity[0] ** 2
    assert touched
    assert before.energy == pytest.approx(work - lost - kept, abs=2e-7)


def test_motion_and_energy_are_those_of_an_independent_integration_of_hand_and_handle(made):
    drawn = made(x=(0.1, 2.0, 0.0, -0.3, 0.1, 8.0, 500.0, 0.0))
    drawn.script((0.0, 0.0, 0.0, 0.0, 1.0), (0.2, 0.04, 0.0, 0.0, 1.0))
    drawn.push(0.0, 0.8)

    def rates(t, now):
        x, v, _ = now
        s = t / 0.2
        target, rate = 0.04 * s**3 * (10 - 15 * s + 6 * s**2), 0.04 * 30 * s**2 * (1 - s) ** 2 / 0.2
        spring = 500.0 * (target - x) + 8.0 * (rate - v)
        acceleration = (0.8 - 0.3 - 2.0 * v + spring) / 0.2
        return [v, acceleration, -(spring - 0.1 * acceleration) * v]

    end = solve_ivp(rates, (0.0, 0.1), [0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    state = drawn.at(0.1)
    assert [state.position[0], state.velocity[0], state.energy] == pytest.approx(end, rel=1e-6)
    assert state.target[0] == pytest.approx(0.02) and state.target_velocity[0] == pytest.approx(0.04 * 1.875 / 0.2)


@pytest.mark.parametrize("sensing, actuation", [(0.0, 0.0), (1.5e-3, 2e-3), (333_333e-9, 130_001e-9), (7e-9, 25e-5)])
def test_the_motor_acts_and_the_encoder_shows_exactly_a_delay_later(made, sensing, actuation):
    delayed = made(x=(0.1, *FREE[1:7], 0.05), sensing=sensing, actuation=actuation)
    assert delayed.at(0.0).sensed[0] == pytest.approx(0.05, abs=1e-12)  # as before it came
    assert delayed.push(0.0, 1.0) == pytest.approx(actuation, abs=1e-12)
    delayed.push(0.001, -1.0)

    def way(t):
        lag = 0.1 / 3.0
        return 0.05 + (t - lag * -math.expm1(-t / lag)) / 3.0 if t > 0.0 else 0.05

    for t in (0.001, 0.0029, 0.0051):
        state = delayed.at(t)
        assert state.motor[0] == (0.0 if t < actuation else 1.0 if t < 0.001 + actuation else -1.0)
        acted, shown = t - actuation, t - actuation - sensing
        wanted = way(acted) - 2 * (way(acted - 0.001) - 0.05), way(shown) - 2 * (way(shown - 0.001) - 0.05)
        assert state.position[0] == pytest.approx(wanted[0], abs=1e-12)
        assert state.sensed[0] == pytest.approx(wanted[1], abs=made.SENSED)


def test_a_cut_of_the_firmware_waits_for_no_delay_and_forgets_what_was_pushed():
    delayed = InC(actuation=0.002)
    delayed.push(0.0, 1.0)
    delayed.push(0.0021, -1.0)
    assert delayed.at(0.0021).motor[0] == 1.0
    delayed.port.plant_port_cut(ctypes.c_int64(2_200_000))
    assert delayed.at(0.0022).motor[0] == 0.0 and delayed.at(0.01).motor[0] == 0.0


# of Python alone

PUSHED = st.floats(-20.0, 20.0), st.floats(-1e4, 1e4)
MOVING = st.floats(-0.1, 0.1), st.floats(-3.0, 3.0)


def exact(mass, damping, stiffness, force, rate, position, velocity, time):
    """By the matrix exponential of the state (x, v, force, rate)."""
    matrix = np.zeros((4, 4))
    matrix[0, 1], matrix[2, 3] = 1.0, 1.0
    matrix[1] = [-stiffness / mass, -damping / mass, 1.0 / mass, 0.0]
    return (expm(matrix * time) @ [position, velocity, force, rate])[:2]


@few(60)
@given(st.floats(1e-4, 1.0), *[st.floats(0.0, 1.0)] * 2, *PUSHED, *MOVING, st.floats(1e-7, SUB_STEP * 1e-9))
@example(1.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0, 5e-5)  # through the spring's centre
@example(0.1, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 5e-5)  # at rest, and a force that only begins
def test_drift_is_the_matrix_exponential(mass, damped, sprung, force, rate, position, velocity, time):
    damping, stiffness = damped * mass / time, sprung * mass / time**2
    found = plant.drift(mass, damping, stiffness, force, rate, position, velocity, time)
    wanted = exact(mass, damping, stiffness, force, rate, position, velocity, time)
    speed = abs(velocity) + abs(force) * time / mass + abs(rate) * time**2 / mass + abs(position) * sprung / time
    speed += 1e-280  # numbers below 1e-308 have fewer digits
    assert found[0] == pytest.approx(wanted[0], rel=1e-12, abs=1e-12 * (abs(position) + speed * time))
    assert found[1] == pytest.approx(wanted[1], rel=1e-12, abs=1e-12 * speed)


@few(20)
@given(st.floats(-0.1, 0.1), st.sampled_from([5e-6, -5e-6, 1e-4]), st.floats(-0.01, 0.01))
def test_an_encoder_counts_to_the_nearest_step_with_sign_and_zero(position, per_count, zero):
    counts, _ = InPython(x=(*FREE[:7], position), position_per_count=per_count, zero=zero).sense()
    assert counts[0] == round(counts[0])
    assert abs(counts[0] * per_count - zero - position) <= abs(per_count) / 2 * (1 + 1e-9)


WALL, HAND, MASS, DAMPING = 500.0, 500.0, 0.03, 1.0  # N/m, N/m, kg, N s/m
FROM, SPEED = -0.01, 0.1  # m, m/s of the place that the hand aims at, straight
PERIOD, TICKS = 1_000_000, 250


def pressed(delay, resolution, hand_damping):
    """Positions each period while a hand draws the handle into a sampled wall at 0."""
    axis = (MASS, DAMPING, 0.0, 0.0, 0.0, hand_damping, HAND, FROM)
    drawn = InPython(x=axis, actuation=delay * 1e-9, position_per_count=resolution)
    drawn.script((0.0, FROM, 0.0, 0.0, 1.0), (10.0, FROM + 10.0 * SPEED, 0.0, 0.0, 1.0))
    drawn.motion["kind"] = 3  # straight
    for tick in range(TICKS):
        drawn.push(tick * 1e-3, -WALL * max(0.0, drawn.sense()[0][0] * resolution))
        yield drawn.at((tick + 1) * 1e-3).position[0]


def integrated(force, start, times, hand_damping):
    """The state (x, v) after these two times [s] by scipy, under this force of the wall."""

    def rates(t, now):
        spring = HAND * (FROM + SPEED * t - now[0]) + hand_damping * (SPEED - now[1])
        return [now[1], (force - DAMPING * now[1] + spring) / MASS]

    return solve_ivp(rates, times, start, "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]


@pytest.mark.parametrize(
    "delay, resolution, hand_damping",
    [(0, 1e-13, 0.0), (2_000_000, 1e-13, 0.0), (500_000, 1e-4, 10.0)],
    ids=["sampled", "two periods late", "half a period late, coarse encoder, damped hand"],
)
def test_a_hand_presses_into_a_sampled_wall_as_scipy_integrates_it(delay, resolution, hand_damping):
    now, waiting, held, wanted = [FROM, 0.0], [], 0.0, []
    for begin in range(0, TICKS * PERIOD, PERIOD):
        waiting.append((begin + delay, -WALL * max(0.0, math.floor(now[0] / resolution + 0.5) * resolution)))
        marks = sorted({begin, begin + PERIOD, *(when for when, _ in waiting if begin < when < begin + PERIOD)})
        for start, end in zip(marks, marks[1:], strict=False):
            held = next((force for when, force in reversed(waiting) if when <= start), held)
            now = integrated(held, now, np.array([start, end]) * 1e-9, hand_damping)
        wanted.append(now[0])
    assert max(wanted) > 0.004
    assert list(pressed(delay, resolution, hand_damping)) == pytest.approx(wanted, rel=1e-9, abs=1e-11)


def test_the_motor_gives_no_more_than_its_limit_in_either_direction():
    for motor, force in ((1.0, -2.0), (1.4999, -2.9998), (1.6, -3.0), (-50.0, 3.0)):
        limited = InPython(force_limit=3.0, force_per_motor=-2.0)
        limited.push(0.0, motor)
        assert limited.at(0.0).motor[0] == pytest.approx(force)


def test_the_drag_sensor_follows_the_damper_behind_its_bandwidth_with_its_bias():
    bandwidth = 2 * math.pi * 100.0
    moving = InPython(damping=2.0, drag_bandwidth=bandwidth, drag_bias=0.25, mass=1e6)
    moving.memory["velocity"] = 0.5
    moving.at(0.002)
    assert moving.sense()[1][0] == pytest.approx(0.25 + 1.0 * -math.expm1(-bandwidth * 0.002), rel=1e-6)
    moving.record["drag_bandwidth"] = 0.0
    moving.at(0.0021)
    assert moving.sense()[1][0] == pytest.approx(1.25, rel=1e-6)
