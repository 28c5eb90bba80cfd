# SPDX-License-Identifier: Apache-2.0
"""Device descriptions: the same device for servo and plant."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_device.control import controller_config, velocity_estimator
from haptic_device.device import loopback_config, plant

DESKTOP = load_device("desktop")


def changed(**changes):
    device = DESKTOP
    axes = {key: changes.pop(key) for key in list(changes) if key in type(device.axes[0]).model_fields}
    return device.model_copy(update={"axes": tuple(axis.model_copy(update=axes) for axis in device.axes), **changes})


@given(st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.sampled_from([1, -1]), st.floats(-0.05, 0.05), st.floats(1e3, 1e7))
def test_the_servo_reads_from_the_encoder_where_the_plant_is(position, sign, zero, counts_per_unit):
    device = changed(encoder_sign=sign, zero=zero, counts_per_unit=counts_per_unit)
    body, memory = loopback_config.plant_of(device), np.zeros(1, plant.PLANT_MEMORY)
    memory["position"] = position
    counts, drag = np.zeros(3), np.zeros(3)
    plant.sense(body[0], memory[0], 0, counts, drag)
    hardware = controller_config.settings_of(device)[0]["hardware"]
    read = [*map(velocity_estimator.position_of, counts, hardware["position_per_count"], hardware["zero"])]
    assert read == pytest.approx(position, abs=0.5001 / counts_per_unit)


def test_the_force_the_servo_wants_is_the_force_the_plants_motor_makes():
    for constant, sign, force in itertools.product([1.0, 4.0], [1, -1], [3.0, -2.0]):
        device = changed(motor_constant=constant, motor_sign=sign)
        body, memory = loopback_config.plant_of(device), np.zeros(1, plant.PLANT_MEMORY)
        motor = force * controller_config.settings_of(device)["hardware"]["motor_per_force"][0]
        plant.push_motor(body[0], memory[0], 0, motor)
        plant.take_motor(body[0], memory[0])
        assert memory["motor_force"][0, :2].tolist() == pytest.approx([force, force])
        assert motor[0] == pytest.approx(force * sign / constant)


def test_gravity_is_compensated_against_its_pull_and_only_if_wanted():
    device = changed(gravity=(0.0, -9.81))
    assert loopback_config.plant_of(device)["gravity"][0].tolist() == pytest.approx([0.0, -0.981, 0.0])
    assert controller_config.settings_of(device)["hardware"]["gravity"][0].tolist() == pytest.approx([0.0, 0.981, 0.0])
    carried = controller_config.settings_of(changed(gravity=(0.0, -9.81), gravity_compensation=False))
    assert not carried["hardware"]["gravity"].any()


def test_delays_limits_and_scale_arrive_in_the_records_units():
    device = changed(sensing_delay=0.001, actuation_delay=0.00025, scale=(2.0, 3.0))
    body, settings = loopback_config.plant_of(device)[0], controller_config.settings_of(device)[0]
    assert (body["sensing_delay"], body["actuation_delay"]) == (1_000_000, 250_000)
    assert settings["hardware"]["scale"].tolist() == [2.0, 2.0, 3.0]
    assert settings["hardware"]["motor_limit"].tolist() == body["force_limit"].tolist() == [15.0, 15.0, 1.0]
    assert body["drag_bandwidth"] == pytest.approx(2 * np.pi * 500.0)
