# SPDX-License-Identifier: Apache-2.0
"""Velocity estimators and damping cancellation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values, wall_system

from haptic_device.control import damping_compensation, velocity_estimator
from haptic_sim.lockstep.lockstep import Lockstep

TICK, STEP = 1 / 4000.0, 1e-5


def velocity_from(positions, longest=16):
    """Adaptive-window velocity at the last of these positions, one a tick, quantized to STEP."""
    times, errors, ring = np.zeros((3, velocity_estimator.KEPT))
    for index, position in enumerate(positions):
        times[index % velocity_estimator.KEPT] = index * TICK
        ring[index % velocity_estimator.KEPT] = math.floor(position / STEP + 0.5) * STEP
    count = min(len(positions), velocity_estimator.KEPT)
    return velocity_estimator.adaptive_velocity(
        times, errors, ring, (len(positions) - 1) % velocity_estimator.KEPT, count, longest, 1.01 * STEP
    )


def test_velocity_is_the_papers_difference_behind_its_lowpass_and_a_missing_sample_keeps_the_estimate():
    assert velocity_estimator.velocity_of(0.3, 2e-4, 1e-3, 0.0) == pytest.approx(0.2)
    assert velocity_estimator.velocity_of(0.3, 0.0, 0.0, 0.0) == 0.3
    velocity = velocity_estimator.velocity_of(0.0, 0.2 * TICK, TICK, 3.0 * TICK)
    assert velocity == pytest.approx(0.2 / 4.0)
    for _ in range(200):
        velocity = velocity_estimator.velocity_of(velocity, 0.2 * TICK, TICK, 3.0 * TICK)
    assert velocity == pytest.approx(0.2)


@given(speed=st.floats(-0.5, 0.5), phase=st.floats(0.0, 1.0))
def test_adaptive_window_at_constant_speed_errs_less_than_two_steps_over_its_window(speed, phase):
    positions = [speed * TICK * k + phase * STEP for k in range(60)]
    assert abs(velocity_from(positions) - speed) <= 2.0 * STEP / (16 * TICK)


def test_adaptive_window_is_quieter_than_the_difference_on_a_slow_quantized_motion():
    def noise(estimator):
        hand = {"motion__name": "circle", "motion__radius": 0.005, "motion__turns": 1.0, "motion__duration": 2.0}
        driver = values("haptic_driver", velocity__estimator=estimator, coupling__stiffness=0.0, coupling__damping=0.0)
        rows = Lockstep(device(1.0, 1e5), driver, values("haptic_loopback", **hand), None).run(2.0)
        return np.std(np.diff(rows.velocity[3000:, 0]))

    assert noise("adaptive_window") < 0.2 * noise("backward_difference")


def circle(ratio, source="model", described=1.0, estimator="backward_difference", **sensor):
    """Apparent damping [N s/m] in free space of a device of damping 1 N s/m that is described with `described`."""
    hand = {"motion__name": "circle", "motion__radius": 0.03, "motion__turns": 3.0, "motion__duration": 3.0}
    cancelled = {"cancellation__ratio": ratio, "cancellation__source": source, "engage__time": 0.05}
    cancelled["velocity__estimator"] = estimator
    driver = values("haptic_driver", coupling__stiffness=0.0, coupling__damping=0.0, **cancelled)
    system = Lockstep(device(described, 2e5), driver, values("haptic_loopback", **hand), None)
    system.plant["damping"][0, :2] = 1.0
    for name, value in sensor.items():
        system.plant[name] = value
    rows = system.run(3.0)[3000:]
    speed = np.sum(rows.velocity[:, :2] ** 2)
    return 1.0 - np.sum(rows.force_on_handle[:, :2] * rows.velocity[:, :2]) / speed


def test_cancellation_leaves_what_its_ratio_leaves_and_a_measured_one_needs_no_exact_damping():
    assert circle(0.0) == pytest.approx(1.0, rel=1e-6)
    for estimator in ("backward_difference", "lowpass", "adaptive_window"):
        assert circle(0.92, estimator=estimator) == pytest.approx(0.08, abs=0.01)
    for described in (0.7, 1.3):
        sensor = {"drag_bandwidth": 2.0 * math.pi * 500.0, "drag_noise": 0.005, "drag_bias": 0.01}
        assert abs(circle(0.92, "measured", described, **sensor)) < 0.15


@given(drag=st.floats(-10, 10), velocity=st.floats(-2, 2))
def test_measured_cancellation_only_ever_pushes_along_the_motion(drag, velocity):
    assert damping_compensation.measured_cancellation_force(0.9, drag, 1.0, velocity) * velocity >= 0.0


def test_cancellation_is_gone_at_the_wall_and_comes_without_a_step():
    rows = wall_system(2000.0, 0.1, cancellation__ratio=0.9, cancellation__band=0.005).run(1.2)
    inside = rows.position[:, 1] < 0.0
    assert np.any(inside)
    assert np.all(rows.force_cancellation[inside] == 0.0)
    assert np.abs(np.diff(rows.cancellation_fade)).max() < 0.1
