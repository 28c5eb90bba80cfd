# SPDX-License-Identifier: Apache-2.0
"""Device descriptions: read from YAML, refused in one sentence, and the same device for servo and plant."""

import copy
import itertools

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from haptic_device import controller_config
from haptic_device.config_files import find
from haptic_device.control import velocity_estimator
from haptic_device.description import Device, load_device
from haptic_device.device import loopback_config, plant


@pytest.fixture
def content():
    return yaml.safe_load(find("devices", "desktop").read_text())


@pytest.fixture
def load(tmp_path):
    def load(content):
        path = tmp_path / "device.yaml"
        path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
        return load_device(path)

    return load


def test_the_shipped_device_has_three_axes_and_damping_on_each():
    device = load_device("desktop")
    assert [axis.name for axis in device.axes] == ["x", "y", "theta"]
    assert all(axis.damping > 0.0 for axis in device.axes)


def put(content, path, value):
    *folders, last = path
    for part in folders:
        content = content[part]
    content[last] = value


MISTAKES = [
    (("axes", 0, "mass"), 0.0, ["axes[0].mass is 0.0", "greater than 0"]),
    (("axes", 0, "mass"), -1.0, ["axes[0].mass is -1.0", "greater than 0"]),
    (("axes", 1, "mass"), float("nan"), ["axes[1].mass is nan", "finite"]),
    (("axes", 1, "damping"), float("inf"), ["axes[1].damping is inf"]),
    (("axes", 0, "counts_per_unit"), "many", ["axes[0].counts_per_unit is 'many'", "number"]),
    (("axes", 0, "motor_limit"), "15.0", ["axes[0].motor_limit is '15.0'"]),
    (("axes", 0, "encoder_sign"), 2, ["axes[0].encoder_sign", "1 or -1"]),
    (("axes", 0, "workspace"), [0.1, -0.1], ["axes[0].workspace is [0.1, -0.1]: write [low, high]"]),
    (("axes", 0, "workspace"), [0.1], ["axes[0].workspace"]),
    (("axes", 2, "mass"), 1e-7, ["damping/mass is 40000 1/s; the limit is 20000 1/s"]),
    (("axes", 0, "name"), "y", ["axes are y, y, theta; write x, or x and y, or x, y and theta"]),
    (("axes",), [], ["axes", "at least 1"]),
    (("sensing_delay",), 0.2, ["sensing_delay is 0.2", "0.1"]),
    (("actuation_delay",), -0.001, ["actuation_delay is -0.001"]),
    (("gravity",), [0.0], ["gravity"]),
    (("homing",), "never", ["homing is 'never'", "absolute"]),
    (("scale",), [0.0, 1.0], ["scale[0] is 0.0"]),
    (("drag_sensor",), {"noise": -1.0}, ["drag_sensor.noise is -1.0"]),
    (("axes", 0, "dampin"), 3.0, ["axes[0]: has no key 'dampin'; did you mean 'damping'?"]),
    (("sensing_dely",), 0.0, ["has no key 'sensing_dely'; did you mean 'sensing_delay'?"]),
]


@pytest.mark.parametrize(("path", "value", "words"), MISTAKES)
def test_a_mistake_in_the_description_is_refused_in_one_sentence(load, content, path, value, words):
    put(content, path, value)
    with pytest.raises(ValueError) as refusal:
        load(content)
    assert "\n" not in str(refusal.value) and "device.yaml" in str(refusal.value)
    assert all(word in str(refusal.value) for word in words), refusal.value


@pytest.mark.parametrize("text", ["", "[1, 2]", "name: [", "5", "\0", "axes: {x: 1}\nname: a\n"])
def test_a_file_that_is_no_description_is_refused_in_one_sentence(load, text):
    with pytest.raises(ValueError) as refusal:
        load(text)
    assert "\n" not in str(refusal.value)


def test_a_device_nobody_knows_is_refused_with_the_ones_there_are():
    with pytest.raises(FileNotFoundError, match=r"desktp is neither a file nor a name .* desktop"):
        load_device("desktp")


def test_damping_may_be_just_as_stiff_as_the_plants_series_allows(load, content):
    content["axes"][0] |= {"mass": 1.0, "damping": 20000.0}
    assert load(content).axes[0].damping == 20000.0
    content["axes"][0]["damping"] = 20001.0
    with pytest.raises(ValueError, match="damping/mass"):
        load(content)


def test_a_device_may_have_one_two_or_three_axes(content):
    for count in (1, 2, 3):
        part = copy.deepcopy(content) | {"axes": content["axes"][:count]}
        device = Device.model_validate(part)
        assert controller_config.settings_of(device)["axes"] == loopback_config.plant_of(device)["axes"] == count


def changed(**changes):
    device = load_device("desktop")
    axes = {key: changes.pop(key) for key in list(changes) if key in type(device.axes[0]).model_fields}
    return device.model_copy(update={"axes": tuple(axis.model_copy(update=axes) for axis in device.axes), **changes})


@given(
    st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    st.sampled_from([1, -1]),
    st.floats(-0.05, 0.05),
    st.floats(1e3, 1e7),
)
def test_the_servo_reads_from_the_encoder_where_the_plant_is(position, sign, zero, counts_per_unit):
    device = changed(encoder_sign=sign, zero=zero, counts_per_unit=counts_per_unit)
    body, memory, settings = (
        loopback_config.plant_of(device),
        np.zeros(1, plant.PLANT_MEMORY),
        controller_config.settings_of(device)[0],
    )
    memory["position"] = position
    counts, drag = np.zeros(3), np.zeros(3)
    plant.sense(body[0], memory[0], 0, counts, drag)
    read = [
        velocity_estimator.position_of(
            counts[i], settings["hardware"]["position_per_count"][i], settings["hardware"]["zero"][i]
        )
        for i in range(3)
    ]
    assert read == pytest.approx(position, abs=0.5001 / counts_per_unit)


def test_count_zero_is_at_the_devices_zero():
    settings = controller_config.settings_of(changed(zero=0.02))[0]
    assert (
        velocity_estimator.position_of(
            0.0, settings["hardware"]["position_per_count"][0], settings["hardware"]["zero"][0]
        )
        == 0.02
    )


@pytest.mark.parametrize(("constant", "sign", "force"), [*itertools.product([1.0, 4.0], [1, -1], [3.0, -2.0])])
def test_the_force_the_servo_wants_is_the_force_the_plants_motor_makes(constant, sign, force):
    device = changed(motor_constant=constant, motor_sign=sign)
    body, memory = loopback_config.plant_of(device), np.zeros(1, plant.PLANT_MEMORY)
    motor = force * controller_config.settings_of(device)["hardware"]["motor_per_force"][0]
    plant.push_motor(body[0], memory[0], 0, motor)
    plant.take_motor(memory[0])
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
