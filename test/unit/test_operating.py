# SPDX-License-Identifier: Apache-2.0
"""Operating points: parameter values become the servo's and the loopback's records, or a sentence."""

import numpy as np
import pytest
from lockstep_systems import device, values

from haptic_device.config.description import load_device
from haptic_device.config.parameters import OPERATING_POINT
from haptic_device.control import controller_config, exchange_samples
from haptic_device.device import loopback_config, operator_hand

DESKTOP = load_device("desktop")


def point(**given):
    return controller_config.settings_from(DESKTOP, values("haptic_driver", **given), version=7)[0]


CHOICES = ("exchange.method", "cancellation.source", "velocity.estimator", "passivity.policy")


def test_every_parameter_arrives_in_its_field():
    coupling = {"stiffness": 500.0, "damping": 1.5, "rotational_stiffness": 2.5, "rotational_damping": 0.004}
    coupling = {f"coupling__{name}": value for name, value in coupling.items()}
    settings = point(servo__rate=2000.0, force__limit=3.0, force__limit_rotational=0.2, **coupling)
    assert (settings["version"], settings["period"], settings["axes"]) == (7, 0.0005, 3)
    assert settings["force"]["limit"].tolist() == [3.0, 3.0, 0.2]
    assert settings["coupling"]["stiffness"].tolist() == [500.0, 500.0, 2.5]
    assert settings["coupling"]["damping"].tolist() == [1.5, 1.5, 0.004]
    numbers = [one.name for one in OPERATING_POINT if tuple(one.name.split(".")) in controller_config.SAME]
    numbers = [name for name in numbers if name not in CHOICES]
    assert len(numbers) == 24
    for i, name in enumerate(numbers):
        given, (group, field) = 0.03125 + i / 64, name.split(".")
        assert point(**{name.replace(".", "__"): given})[group][field] == given


def test_walls_arrive_in_order_with_unit_normals():
    lists = {"offset": (0.01, -0.02), "stiffness": (300.0, 400.0), "damping": (1.0, 2.0)}
    given = {f"wall__{name.replace('offset', 'offsets')}": values for name, values in lists.items()}
    wall = point(wall__normals=(0.6004, 0.8, -1.0, 0.0), **given)["wall"]
    assert wall["count"] == 2
    assert np.hypot(wall["x"], wall["y"])[:2] == pytest.approx([1.0, 1.0], abs=1e-15)
    assert {name: tuple(wall[name][:2]) for name in lists} == lists


ONE = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (1.0,), "wall__damping": (0.0,)}
TOGETHER = ": set the four lists of wall together"


def test_walls_that_do_not_fit_together_are_refused_in_a_sentence():
    for change, sentence in (
        ({"wall__normals": (1.0,)}, "wall.normals has 1 numbers; 1 walls (wall.offsets) need 2" + TOGETHER),
        ({"wall__stiffness": (1.0, 2.0)}, "wall.stiffness has 2 numbers; 1 walls (wall.offsets) need 1" + TOGETHER),
        ({"wall__damping": ()}, "wall.damping has 0 numbers; 1 walls (wall.offsets) need 1" + TOGETHER),
        ({"wall__offsets": (0.0,) * 65}, "wall.offsets names 65 walls; the limit is 64"),
        ({"wall__normals": (1.0, 1.0)}, "wall.normals of wall 0 is [1, 1], of length 1.41421; write a unit vector"),
        ({"wall__normals": (1.0011, 0.0)}, "wall.normals of wall 0 is [1.0011, 0], of length 1.0011; write a unit"),
    ):
        with pytest.raises(ValueError) as refusal:
            point(**ONE | change)
        assert str(refusal.value).startswith(sentence)
    assert point(**ONE | {"wall__normals": (1.0009, 0.0)})["wall"]["x"][0] == 1.0
    most = {"wall__normals": (1.0, 0.0) * 64} | {
        f"wall__{each}": (1.0,) * 64 for each in ("offsets", "stiffness", "damping")
    }
    assert point(**most)["wall"]["count"] == 64


def test_both_sides_of_the_coupling_are_told_the_same_gains():
    given = values("haptic_driver", coupling__stiffness=500.0, coupling__rotational_damping=0.004)
    gains = controller_config.gains_from(given, controller_config.settings_from(device(axes=2), given))[0]
    assert (gains["stiffness"], gains["rotational_damping"]) == (500.0, 0.004)
    assert gains["limit"].tolist() == [15.0, 15.0, 0.0]  # what the motors hold of force.limit
    assert gains["hash"] == exchange_samples.gains_hash(500.0, 1.0, 1.0, 0.004)


def hand(scale=(1.0, 1.0), **given):
    described = device(axes=3, scale=scale)
    return loopback_config.hand_from(described, values("haptic_loopback", **given))


def test_hand_and_handle_begin_at_the_start_of_the_motion_in_the_devices_own_units():
    body, memory, motion = hand((2.0, 4.0), motion__name="press_wall", motion__start=(0.2, 0.1, 4.0))
    assert memory["position"][0].tolist() == memory["target"][0].tolist() == [0.1, 0.05, 1.0]
    assert motion["points"][0, 0].tolist() == [0.1, 0.05, 1.0]
    assert body["hand_stiffness"][0].tolist() == [500.0, 500.0, 1.0]


def test_the_circle_shrinks_with_the_scale():
    _, _, motion = hand((2.0, 1.0), motion__name="circle", motion__radius=0.03)
    target = np.zeros(3)
    operator_hand.target_at(motion[0], 0.0, target)
    assert motion["radius"][0] == 0.015 and target.tolist() == [0.0, 0.0, 0.0]


def test_a_start_outside_the_workspace_is_refused_just_outside_and_taken_just_inside():
    low, high = DESKTOP.axes[0].workspace
    for inside in (low, high):
        assert hand(motion__start=(inside, 0.0, 0.0))[1]["position"][0, 0] == inside
        assert hand((2.0, 1.0), motion__start=(2.0 * inside, 0.0, 0.0))[1]["position"][0, 0] == inside
    with pytest.raises(ValueError, match=r"motion.start x is at 0.121 m of the device; its workspace is -0.12 to 0.12"):
        hand(motion__start=(0.121, 0.0, 0.0))


def test_an_axis_that_is_not_there_begins_at_zero():
    described = device(axes=1)
    _, memory, _ = loopback_config.hand_from(described, values("haptic_loopback", motion__start=(0.01, 5.0, 5.0)))
    assert memory["position"][0].tolist() == [0.01, 0.0, 0.0]
