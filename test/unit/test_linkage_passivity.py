# SPDX-License-Identifier: Apache-2.0
"""How stiff a linkage may be: at one pose by its closed form, at the worst of the workspace, and what is refused."""

import json

import numpy as np
import pytest
from in_process import haptic

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.control import gain_check
from haptic_device.control.controller_config import settings_from
from haptic_device.digits import plain
from haptic_device.theory.felt import felt_at
from haptic_sim.node.parameters import NODES

PERIOD = 0.001
PNG = b"\x89PNG"


def passivity(*words, device="haply_2diy_gen3", stiffness=30, damping=0):
    given = f"--period={PERIOD} --stiffness={stiffness} --damping={damping} --device={device}"
    return haptic("passivity", *given.split(), *words)


def judged(*words, **options):
    result = passivity(*words, "--json", **options)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_a_pose_carries_twice_its_damping_over_period_and_the_square_of_the_largest_gain_of_its_joints():
    found = judged("--joints=120,60", "--physical-damping=1e-4")
    jacobian = np.reshape(load_device("haply_2diy_gen3").kinematics.pose(*np.radians([120.0, 60.0]))[2:6], (2, 2))
    largest = np.linalg.svd(jacobian)[1][0]
    assert found["stiffness_max_passive"] == pytest.approx(2e-4 / (PERIOD * largest**2), rel=1e-6)
    inverse = np.linalg.inv(jacobian)
    assert np.array(found["pose"]["damping"]) == pytest.approx(1e-4 * inverse.T @ inverse, rel=1e-6, abs=1e-9)
    assert found["pose"]["joints"] == pytest.approx([120.0, 60.0])
    for stiffness, passive in ((34.7, True), (34.8, False)):
        assert judged("--joints=120,60", stiffness=stiffness)["passive"] is passive
    at_place = judged(f"--position={','.join(map(str, found['pose']['position']))}")
    assert at_place["pose"]["joints"] == pytest.approx([120.0, 60.0])


def test_unlike_joints_are_passive_just_below_the_limit_in_every_direction_and_active_just_above_in_the_worst():
    device, dampings = load_device("serial_2r"), (0.01, 0.002)
    pairs = zip(device.joints, dampings, strict=True)
    arms = device.model_copy(update={"joints": tuple(each.model_copy(update={"damping": b}) for each, b in pairs)})
    pose = felt_at(arms, joints="40,80")
    jacobian = np.reshape(arms.kinematics.pose(*pose.joints)[2:6], (2, 2))
    for share, sign in ((0.999, 1.0), (1.001, -1.0)):
        left = np.diag(dampings) - share * pose.damping * jacobian.T @ jacobian
        assert np.sign(np.linalg.eigvalsh(left)[0]) == sign


def test_without_a_pose_it_is_the_worst_one_of_the_workspace_by_which_the_driver_goes_too():
    found, device = judged(), load_device("haply_2diy_gen3")
    assert found["stiffness_max_passive"] == pytest.approx(2.0 * device.axes[0].damping / PERIOD)
    said = " ".join(passivity().stdout.split())
    assert "worst pose of the workspace, this one" in said and "use_workspace" in said
    elsewhere, limit = passivity("--joints=120,60"), plain(found["stiffness_max_passive"], "N/m", digits=4)
    assert f"where K < {limit}" in " ".join(elsewhere.stdout.split()) and "use_workspace" in elsewhere.stderr
    for share, fits in ((0.999, True), (1.001, False)):
        gains = {"servo.rate": 1.0 / PERIOD, "coupling.damping": 0.0, "passivity.policy": "off"}
        gains["coupling.stiffness"] = share * found["stiffness_max_passive"]
        settings = settings_from(device, defaults(NODES["haptic_driver"]) | gains)[0]
        assert (gain_check.refusal(settings) == "") is fits


def test_what_is_given_overrides_the_description_and_damping_is_of_each_joint():
    one, twice = (judged("--joints=120,60", f"--physical-damping={b}") for b in (1e-4, 2e-4))
    assert twice["physical_damping"] == pytest.approx(2.0 * one["physical_damping"])
    other = judged("--mass=0.3", "--resolution=1e-5", "--coulomb=0.01", "--delay-samples=1")
    assert [other[name] for name in ("mass", "resolution", "coulomb", "delay_samples")] == [0.3, 1e-5, 0.01, 1.0]
    described = judged(device="desktop")
    assert (described["physical_damping"], described["mass"], described["resolution"]) == (3.0, 0.1, 5e-6)
    assert judged("--physical-damping=2", device="desktop")["physical_damping"] == 2.0
    without = haptic("passivity", "--stiffness=1", "--damping=0", "--period=0.001")
    assert without.returncode == 2 and without.stderr.endswith("Error: Missing option '--physical-damping'.\n")


def test_friction_hides_limit_cycles_up_to_twice_itself_over_the_encoder_step_and_relaxes_nothing():
    found = judged("--resolution=1e-4", "--coulomb=0.002", "--joints=120,60")
    assert found["stiffness_max_friction"] == pytest.approx(40.0)
    assert found["stiffness_max_passive"] == pytest.approx(judged("--joints=120,60")["stiffness_max_passive"])
    radius = load_device("hapkit").kinematics.travel
    felt = felt_at(load_device("hapkit"))
    assert (felt.coulomb, felt.step) == pytest.approx((2.0e-4 / radius, radius / 162.97466))


def test_the_map_of_the_workspace_is_written_by_passivity_and_by_zwidth(tmp_path):
    assert passivity(f"--plot={tmp_path / 'map.png'}").returncode == 0
    assert (tmp_path / "map.png").read_bytes().startswith(PNG)
    result = haptic("zwidth", "--device=serial_2r", "--points=2", "--seconds=0.05", f"--out={tmp_path}", "--json")
    found = json.loads(result.stdout)
    assert (tmp_path / "workspace.png").read_bytes().startswith(PNG)
    assert found["physical_damping"] == pytest.approx(load_device("serial_2r").axes[0].damping)
