# SPDX-License-Identifier: Apache-2.0
"""The device as physics: its motion against closed forms, its sensors and motor, and where the energy goes."""

import math

import numpy as np
import pytest
from examples import few
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from haptic_device.description import SUB_STEP
from haptic_device.device import plant

SECOND = 1_000_000_000


def device(axes=1, **changes):
    """PLANT record of three equal axes without hand, friction, delays or noise."""
    record = np.zeros(1, plant.PLANT)
    record["axes"], record["mass"], record["position_per_count"] = axes, 0.1, 1e-6
    record["force_per_motor"], record["force_limit"] = 1.0, 100.0
    for name, value in changes.items():
        record[name] = value
    return record


def state(**changes):
    record = np.zeros(1, plant.PLANT_MEMORY)
    for name, value in changes.items():
        record[name] = value
    return record


def run(record, memory, seconds, target=lambda t: (0.0, 0.0, 0.0), grip=0.0, step=SUB_STEP):
    """Integrates by sub-steps; yields after each."""
    end = int(memory["time"][0]) + round(seconds * SECOND)
    while memory["time"][0] < end:
        following = min(end, int(memory["time"][0]) + step)
        plant.sub_step(record[0], memory[0], following, np.array(target(following * 1e-9), float), grip)
        yield memory[0]


def finish(*arguments, **options):
    for _ in run(*arguments, **options):
        continue


def push(record, memory, force, when=0):
    plant.push_motor(record[0], memory[0], when, np.array([force, 0.0, 0.0]))
    plant.take_motor(memory[0])


def exact(mass, damping, stiffness, force, rate, position, velocity, time):
    """By the matrix exponential of the state (x, v, force, rate)."""
    matrix = np.zeros((4, 4))
    matrix[0, 1], matrix[2, 3] = 1.0, 1.0
    matrix[1] = [-stiffness / mass, -damping / mass, 1.0 / mass, 0.0]
    return (expm(matrix * time) @ [position, velocity, force, rate])[:2]


PUSHED = st.floats(-20.0, 20.0), st.floats(-1e4, 1e4)
MOVING = st.floats(-0.1, 0.1), st.floats(-3.0, 3.0)


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


def test_a_mass_on_spring_and_damper_rings_as_its_closed_form():
    mass, damping, stiffness = 0.3, 1.2, 500.0
    record = device(mass=0.1, damping=0.4, hand_mass=0.2, hand_damping=0.8, hand_stiffness=stiffness)
    memory = state(position=0.01)
    decay, ringing = damping / (2 * mass), math.sqrt(stiffness / mass - (damping / (2 * mass)) ** 2)
    for now in run(record, memory, 0.2, grip=1.0):
        t = now["time"] * 1e-9
        wanted = 0.01 * math.exp(-decay * t) * (math.cos(ringing * t) + decay / ringing * math.sin(ringing * t))
        assert now["position"][0] == pytest.approx(wanted, abs=1e-13)


def test_a_constant_motor_force_against_the_damper_ends_at_its_terminal_velocity():
    record, memory = device(damping=3.0), state()
    push(record, memory, 1.5)
    finish(record, memory, 0.5)
    assert memory["velocity"][0, 0] == pytest.approx(0.5 * -math.expm1(-0.5 * 3.0 / 0.1), rel=1e-12)


@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_coulomb_friction_stops_a_sliding_mass_after_v_squared_over_twice_the_deceleration(speed):
    record, memory = device(coulomb=0.2), state(velocity=[speed, 0.0, 0.0])
    finish(record, memory, 0.3 * 0.1 / 0.2 + 0.001)
    assert memory["velocity"][0, 0] == 0.0
    assert memory["position"][0, 0] == pytest.approx(math.copysign(0.3**2 / (2 * 0.2 / 0.1), speed), rel=1e-10)
    assert memory["energy_given"][0] == pytest.approx(0.0, abs=1e-14)


def test_a_mass_at_rest_sticks_just_below_coulomb_friction_and_slides_just_above():
    for share, moves in ((1.0 - 1e-6, False), (1.0 + 1e-6, True), (-1.0 + 1e-6, False), (-1.0 - 1e-6, True)):
        record, memory = device(coulomb=0.2), state()
        push(record, memory, 0.2 * share)
        finish(record, memory, 0.01)
        assert (memory["position"][0, 0] != 0.0) == moves
        assert memory["position"][0, 0] * share >= 0.0


def test_friction_turns_with_the_motion():
    """Thrown up against a force beyond friction: the way up decelerates by f + f_c, the way down by f − f_c."""
    record, memory = device(coulomb=0.2), state(velocity=[0.1, 0.0, 0.0])
    push(record, memory, -0.5)
    up, down = (0.5 + 0.2) / 0.1, (0.5 - 0.2) / 0.1
    finish(record, memory, 0.1 / up + 0.02)
    nanosecond = down * 1e-9
    assert memory["velocity"][0, 0] == pytest.approx(-down * 0.02, abs=nanosecond)
    assert memory["position"][0, 0] == pytest.approx(0.1**2 / (2 * up) - down * 0.02**2 / 2, abs=0.1 * nanosecond)


def swing(t):
    return (0.004 * math.sin(40.0 * t), 0.0, 0.0)


@pytest.mark.parametrize("coulomb", [0.0, 0.05])
def test_energy_given_is_minus_the_work_of_the_hand_on_the_handle(coulomb):
    """The hand's work apart from the plant's ledger: of its spring and damper, less what its own mass keeps."""
    record = device(damping=2.0, coulomb=coulomb, hand_mass=0.1, hand_damping=8.0, hand_stiffness=500.0, gravity=-0.3)
    memory, work, step = state(), 0.0, 5_000
    push(record, memory, 0.8)
    x, v, s = 0.0, 0.0, 0.0
    for now in run(record, memory, 0.1, swing, 1.0, step):
        rate = (now["target"][0] - s) / (step * 1e-9)
        powers = [
            (500.0 * (at - position) + 8.0 * (rate - speed)) * speed
            for at, position, speed in ((s, x, v), (now["target"][0], now["position"][0], now["velocity"][0]))
        ]
        work += sum(powers) / 2 * step * 1e-9 - 0.1 * (now["velocity"][0] ** 2 - v**2) / 2
        x, v, s = now["position"][0], now["velocity"][0], now["target"][0]
    assert abs(work) > 1e-4
    assert memory["energy_given"][0] == pytest.approx(-work, rel=1e-6)


def test_energy_given_agrees_with_an_independent_integration_of_hand_and_handle():
    record = device(damping=2.0, hand_mass=0.1, hand_damping=8.0, hand_stiffness=500.0)
    memory = state()
    push(record, memory, 0.8)
    finish(record, memory, 0.1, lambda t: (0.2 * t, 0.0, 0.0), 1.0)

    def rates(t, now):
        x, v, _ = now
        spring = 500.0 * (0.2 * t - x) + 8.0 * (0.2 - v)
        acceleration = (0.8 - 2.0 * v + spring) / 0.2
        return [v, acceleration, -(spring - 0.1 * acceleration) * v]

    end = solve_ivp(rates, (0.0, 0.1), [0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert memory["position"][0, 0] == pytest.approx(end[0], rel=1e-10)
    assert memory["energy_given"][0] == pytest.approx(end[2], rel=1e-7)


def test_a_held_handle_bears_the_motor_force_and_is_given_no_energy():
    record = device(hand_stiffness=1e6, hand_damping=100.0, damping=2.0)
    memory = state()
    push(record, memory, 2.0)
    finish(record, memory, 0.2, grip=1.0)
    assert memory["operator_force"][0, 0] == pytest.approx(-2.0, rel=1e-6)
    assert memory["position"][0, 0] == pytest.approx(2e-6, rel=1e-3)


def test_a_handle_that_was_let_go_feels_no_hand():
    record = device(hand_mass=0.1, hand_stiffness=500.0, hand_damping=8.0)
    memory = state(position=0.01)
    finish(record, memory, 0.01, grip=0.0)
    assert memory["position"][0, 0] == 0.01 and memory["operator_force"][0, 0] == 0.0


def test_gravity_alone_makes_the_handle_fall_freely():
    record, memory = device(gravity=-0.981), state()
    finish(record, memory, 0.1)
    assert memory["position"][0, 0] == pytest.approx(-0.5 * 9.81 * 0.1**2, rel=1e-12)


def sense(record, memory, latched):
    counts, drag = np.zeros(3), np.zeros(3)
    plant.sense(record[0], memory[0], latched, counts, drag)
    return counts, drag


def test_a_handle_that_was_never_moved_is_sensed_where_it_is():
    counts, _ = sense(device(sensing_delay=50_000), state(position=0.05), 0)
    assert counts[0] == 50_000


@pytest.mark.parametrize("delay", [0, 250_000, 1_000_000, 130_000, 333_333, 7])
def test_sensing_lags_by_whole_and_fractional_delays(delay):
    record = device(damping=2.0, sensing_delay=delay, position_per_count=1e-12)
    memory = state(velocity=[0.2, 0.0, 0.0])
    finish(record, memory, 0.005)
    t = 0.005 - delay * 1e-9
    counts, _ = sense(record, memory, 5_000_000)
    assert counts[0] * 1e-12 == pytest.approx(0.2 * 0.1 / 2.0 * -math.expm1(-2.0 / 0.1 * t), abs=2e-12)


@few(20)
@given(st.floats(-0.1, 0.1), st.sampled_from([5e-6, -5e-6, 1e-4]), st.floats(-0.01, 0.01))
def test_an_encoder_counts_to_the_nearest_step_with_sign_and_zero(position, per_count, zero):
    record = device(position_per_count=per_count, zero=zero)
    counts, _ = sense(record, state(position=position), 0)
    assert counts[0] == round(counts[0])
    assert abs(counts[0] * per_count - zero - position) <= abs(per_count) / 2 * (1 + 1e-9)


@pytest.mark.parametrize("delay", [0, 250_000, 130_001])
def test_a_motor_value_acts_exactly_after_the_actuation_delay(delay):
    record, memory = device(actuation_delay=delay), state()
    plant.push_motor(record[0], memory[0], 0, np.array([1.0, 0.0, 0.0]))
    while memory["time"][0] < 1_000_000:
        end = plant.next_change(memory[0], min(1_000_000, int(memory["time"][0]) + SUB_STEP))
        if end > memory["time"][0]:
            plant.sub_step(record[0], memory[0], end, np.zeros(3), 0.0)
        plant.take_motor(memory[0])
    moved = 1e-3 - delay * 1e-9
    assert memory["position"][0, 0] == pytest.approx(0.5 * 10.0 * moved**2, rel=1e-12)


LIGHT_HANDLE = {"mass": 0.03, "damping": 1.0}
HAND, WALL = 500.0, 500.0  # N/m
FROM, SPEED = -0.01, 0.1  # m, m/s of the place that the hand aims at


def pressed(period, delay, resolution, hand_damping, seconds):
    """Positions each period [ns] while a hand draws the handle into a sampled wall at 0."""
    record = device(
        **LIGHT_HANDLE,
        hand_stiffness=HAND,
        hand_damping=hand_damping,
        position_per_count=resolution,
        actuation_delay=delay,
    )
    memory = state(position=[FROM, 0.0, 0.0], target=[FROM, 0.0, 0.0])
    positions = []
    for tick in range(0, round(seconds * SECOND), period):
        counts, _ = sense(record, memory, tick)
        plant.push_motor(record[0], memory[0], tick, np.array([-WALL * max(0.0, counts[0] * resolution), 0.0, 0.0]))
        while memory["time"][0] < tick + period:
            plant.take_motor(memory[0])
            end = plant.next_change(memory[0], min(tick + period, int(memory["time"][0]) + SUB_STEP))
            plant.sub_step(record[0], memory[0], end, np.array([FROM + SPEED * end * 1e-9, 0.0, 0.0]), 1.0)
        positions.append(memory["position"][0, 0])
    return np.array(positions)


def integrated(force, start, times, hand_damping):
    """States at the times [s] by scipy; force: of the wall, (time, position) -> N."""

    def rates(t, now):
        spring = HAND * (FROM + SPEED * t - now[0]) + hand_damping * (SPEED - now[1])
        return [now[1], (force(t, now[0]) - LIGHT_HANDLE["damping"] * now[1] + spring) / LIGHT_HANDLE["mass"]]

    return solve_ivp(rates, times[[0, -1]], start, "DOP853", times[1:], rtol=1e-12, atol=1e-15, max_step=1e-3).y.T


@pytest.mark.parametrize(
    ("delay", "resolution", "hand_damping"),
    [(0, 1e-13, 0.0), (2_000_000, 1e-13, 0.0), (500_000, 1e-13, 0.0), (0, 1e-4, 0.0), (0, 1e-13, 10.0)],
    ids=["sampled", "two periods late", "half a period late", "coarse encoder", "damped hand"],
)
def test_a_hand_presses_into_a_sampled_wall_as_scipy_integrates_it(delay, resolution, hand_damping):
    period, ticks = 1_000_000, 250
    now, waiting, held, wanted = [FROM, 0.0], [], 0.0, []
    for tick in range(ticks):
        begin = tick * period
        waiting.append((begin + delay, -WALL * max(0.0, math.floor(now[0] / resolution + 0.5) * resolution)))
        marks = sorted({begin, begin + period, *(when for when, _ in waiting if begin < when < begin + period)})
        for start, end in zip(marks, marks[1:], strict=False):
            held = next((force for when, force in reversed(waiting) if when <= start), held)
            now = integrated(lambda t, x, held=held: held, now, np.array([start, end]) * 1e-9, hand_damping)[-1]
        wanted.append(now[0])
    found = pressed(period, delay, resolution, hand_damping, ticks * period * 1e-9)
    assert max(wanted) > 0.004
    assert found == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-11)


@pytest.mark.parametrize("hand_damping", [0.0, 10.0])
def test_a_wall_that_is_sampled_twice_as_often_is_half_as_far_from_the_continuous_one(hand_damping):
    times = np.arange(0.0, 0.2501, 1e-3)
    smooth = integrated(lambda t, x: -WALL * max(0.0, x), [FROM, 0.0], times, hand_damping)[:, 0]
    coarse, fine = (
        np.abs(
            pressed(period, 0, 1e-13, hand_damping, 0.25)[1_000_000 // period - 1 :: 1_000_000 // period] - smooth
        ).max()
        for period in (50_000, 25_000)
    )
    assert coarse < 2e-4
    assert fine == pytest.approx(0.5 * coarse, rel=0.1)


def test_the_motor_gives_no_more_than_its_limit_in_either_direction():
    record = device(force_limit=3.0, force_per_motor=-2.0)
    for motor, force in ((1.0, -2.0), (1.4999, -2.9998), (1.6, -3.0), (-50.0, 3.0)):
        memory = state()
        push(record, memory, motor)
        assert memory["motor_force"][0, 0] == pytest.approx(force)


def test_the_drag_sensor_follows_the_damper_behind_its_bandwidth_with_its_bias():
    bandwidth = 2 * math.pi * 100.0
    record = device(damping=2.0, drag_bandwidth=bandwidth, drag_bias=0.25, mass=1e6)
    memory = state(velocity=[0.5, 0.0, 0.0])
    finish(record, memory, 0.002)
    _, drag = sense(record, memory, 2_000_000)
    assert drag[0] == pytest.approx(0.25 + 1.0 * -math.expm1(-bandwidth * 0.002), rel=1e-6)
    record["drag_bandwidth"] = 0.0
    finish(record, memory, 0.0001)
    assert sense(record, memory, 2_100_000)[1][0] == pytest.approx(1.25, rel=1e-6)


def test_the_drag_sensors_noise_has_its_standard_deviation_and_comes_again_the_same():
    record = device(drag_noise=0.01)
    runs = []
    for _ in range(2):
        memory = state()
        runs.append([sense(record, memory, 0)[1][0] for _ in range(4000)])
    assert runs[0] == runs[1]
    assert np.std(runs[0]) == pytest.approx(0.01, rel=0.05)
    assert np.mean(runs[0]) == pytest.approx(0.0, abs=0.0005)
