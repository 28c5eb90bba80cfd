# SPDX-License-Identifier: Apache-2.0
"""Linkages: places and Jacobians in closed form, their command, and what a description of one may not say."""

import json
import math
from functools import cache

import numpy as np
import pytest
from codec_host import DEVICES
from in_process import haptic

from haptic_device.config import yaml_reader
from haptic_device.config.description import load_device, parse
from haptic_device.config.files import ConfigError
from haptic_device.config.kinematics import Kinematics
from haptic_device.control import linkage

LINKAGES = "haply_2diy_gen2", "haply_2diy_gen3", "pantograph_mk2", "hapkit", "serial_2r"
ARMS = {"type": "five_bar", "base": 0.038, "proximal": 0.07, "distal": 0.09}
GEN3, GEN2 = Kinematics(**ARMS), Kinematics(**ARMS | {"base": 0.0})
each = pytest.mark.parametrize("name", LINKAGES)


def described(name="haply_2diy_gen3", **changed):
    """A shipped description with these parts changed: mappings key by key, and left out where None."""
    content = yaml_reader.load(DEVICES / f"{name}.yaml")
    for part, new in changed.items():
        content[part] = content[part] | new if isinstance(content.get(part), dict) and new else new
    return parse({part: of for part, of in content.items() if of is not None}, "own")


@cache
def poses(name):
    """(joint angles, pose) of 10⁴ poses in the joints' limits that are not near a singular one."""
    device, random, found = load_device(name), np.random.default_rng(72), []
    while len(found) < 10_000:
        joints = [float(random.uniform(*joint.limits)) for joint in device.joints]
        pose = device.kinematics.pose(*joints)
        if pose[6] > 0.15:
            found.append((joints, pose))
    return found


@pytest.mark.parametrize(
    "arms, joints, place, jacobian",
    [
        (GEN3, (168, 12), (19, 35.742046), (-15.569807, -15.569807, -64.276076, 64.276076)),
        (GEN3, (150, 45), (8.506641, 92.630388), (-33.853469, -46.239177, -61.997058, 55.464510)),
        (GEN2, (180, 0), (0, 56.568542), (-28.284271, -28.284271, -35, 35)),
        (GEN2, (150, 45), (-14.806405, 112.465809), (-50.427798, -62.038011, -51.497361, 36.690957)),
    ],
)
def test_five_bars_have_their_place_and_jacobian(arms, joints, place, jacobian):
    pose = [1e3 * each for each in arms.pose(*map(math.radians, joints))]  # [mm], [mm/rad]
    assert pose[:2] == pytest.approx(place, abs=6e-7)
    assert pose[2:6] == pytest.approx(jacobian, abs=6e-7)


def test_two_links_in_a_row_turn_by_the_product_of_their_lengths_and_a_sector_pulley_by_its_radii():
    x, y, *j, c = Kinematics(type="serial_2r", proximal=0.1, distal=0.1).pose(math.radians(30), math.radians(60))
    assert (x, y) == pytest.approx((0.08660254, 0.15), abs=6e-9)
    assert j[0] * j[3] - j[1] * j[2] == pytest.approx(0.00866025, abs=6e-9)  # l² sin 60°
    assert c == pytest.approx(math.sin(math.radians(60)))
    hapkit = load_device("hapkit").kinematics
    assert hapkit.pose(2.0)[2] ** -2 == pytest.approx(70668.9, abs=0.05)  # [1/m²] (r_s / (r_p r_h))²
    assert hapkit.pose(2.0)[0] == 2.0 * hapkit.pose(2.0)[2]


@each
def test_places_move_by_the_jacobian_lead_back_to_their_angles_and_are_the_same_compiled(name):
    device, small = load_device(name), 1e-6
    link = np.zeros(1, linkage.LINKAGE)[0]
    linkage.fill(link, device.kinematics)
    for joints, pose in poses(name):
        for i, way in enumerate(small * np.eye(len(joints))):
            more, less = (device.kinematics.pose(*(joints + side))[:2] for side in (way, -way))
            slope = np.subtract(more, less) / (2.0 * small)  # [m/rad]
            assert np.abs(slope - (pose[2 + i], pose[4 + i])).max() < 1e-7
        found, c = device.kinematics.angles(*pose[: len(joints)])
        whole = found if len(joints) == 1 else [j.turned(a) for j, a in zip(device.joints, found, strict=True)]
        assert [*whole, c] == pytest.approx([*joints, pose[6]], abs=1e-12, rel=0.0)
        x, y, *same = linkage.pose(link, *[*joints, 0.0][:2])
        at = x + device.kinematics.origin[0], y + device.kinematics.origin[1]
        assert (*at, *same) == pytest.approx(pose, abs=1e-14)
        *angles, near = linkage.angles(link, x, y)
        assert [*angles[: len(joints)], near] == pytest.approx([*found, c], abs=1e-12)


@pytest.mark.parametrize("name", [name for name in LINKAGES if name != "hapkit"])
def test_the_other_assembly_is_the_mirror_image_and_is_told_apart(name):
    arms = load_device(name).kinematics
    other = arms.model_copy(update={"assembly": -arms.assembly})
    for (a, b), (x, y, xa, xb, ya, yb, c) in poses(name)[:1000]:
        assert other.pose(-a, -b) == pytest.approx((x, -y, -xa, -xb, ya, yb, c), abs=1e-12)
        assert other.angles(x, -y)[1] == pytest.approx(c)
        there = other.pose(a, b)  # the same joints: of five bars the handle on the other side of the elbows
        back, near = arms.angles(*there[:2])
        apart = math.hypot(*(math.remainder(back[i] - (a, b)[i], math.tau) for i in range(2)))
        assert there[6] == -c if arms.type == "serial_2r" else there[6] <= 0.0 or near <= 0.0 or apart > 0.1


def test_a_place_out_of_reach_and_elbows_that_fold_inwards_are_no_pose():
    for arms, place in ((GEN3, (0.019, 0.2)), (GEN3, (0.0, 0.0)), (GEN3, (0.019, 0.0)), (GEN2, (0.161, 0.0))):
        assert arms.angles(*place)[1] <= 0.0
    assert load_device("pantograph_mk2").kinematics.pose(math.pi, 0.0)[6] <= 0.0  # elbows 151 mm apart, links of 75 mm
    assert GEN3.pose(math.radians(190), math.radians(-30))[6] < 0.0


TWO = yaml_reader.load(DEVICES / "haply_2diy_gen3.yaml")["joints"]
HIGH = {"handle": {"workspace": [[-0.045, 0.045], [0.03, 0.2]]}}
WRONG = {
    "distal is missing; a five_bar needs base, proximal, distal": {"kinematics": {"distal": None}},
    "a five_bar has no pulley_radius": {"kinematics": {"pulley_radius": 0.01}},
    "base is 0.5 m; arms of 0.16 m": {"kinematics": {"base": 0.5}},
    "at -122.1°, and its limits are -60.73° to 111.7°; with assembly -1 or with the joints swapped it fits": {
        "joints": TWO[::-1]
    },
    "joint_1 is at 23.92°, and its limits are 68.75° to 240.6°; with assembly 1": {"kinematics": {"assembly": -1}},
    "x = -0.045 m, y = 0.132 m, where the handle cannot be": HIGH,
    "x = -0.02 m, y = 0.14 m, where the linkage is near a singular pose (a sine of 0.092": {
        "handle": {"workspace": [[-0.02, 0.02], [0.1, 0.14]]}
    },
    "use_workspace is [[-0.05, 0.045], [0.03, 0.1]] m; it must lie in workspace, [[-0.045, 0.045], [0.015, 0.12]] m": {
        "handle": {"use_workspace": [[-0.05, 0.045], [0.03, 0.1]]}
    },
    "handle: joints and handle are of a linkage; write the type of its kinematics": {"kinematics": None},
    "five_bar need 2 joints and a handle; given are 1 joint and a handle": {"joints": TWO[:1]},
    "joints: it should have at most 2 items and has 3": {"joints": [*TWO, TWO[0]]},
    "workspace is [[-0.045, 0.045]]": {"handle": {"workspace": [[-0.045, 0.045]]}},
    "gravity is [0.0, -9.81] m/s²; a linkage lies flat: leave it out": {"gravity": [0.0, -9.81]},
    "limits of joint_1 are 11 rad apart; at most a turn, 6.283 rad": {"joints": [TWO[0] | {"limits": [-4, 7]}, TWO[1]]},
    "home has 0 m; with homing at_start it is where the handle is then, within the workspace, 0.015 to 0.12 m": {
        "homing": "at_start"
    },
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_description_that_does_not_fit_together_is_refused_with_its_numbers(sentence):
    with pytest.raises(ConfigError) as refused:
        described(**WRONG[sentence])
    assert str(refused.value).startswith("own: ") and sentence in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_smaller_use_workspace_makes_a_workspace_with_singular_places_good():
    smaller = HIGH["handle"] | {"use_workspace": [[-0.04, 0.04], [0.03, 0.1]]}
    assert described(handle=smaller).axes[1].workspace == (0.03, 0.1)


def test_axes_of_one_pose_are_what_is_felt_there():
    """J = [[−0.15, −0.1], [√0.0075, 0]] m/rad of two links of 0.1 m at 30° and 60°."""
    two = yaml_reader.load(DEVICES / "serial_2r.yaml")["joints"]
    joints = [joint | {"counts_per_rad": 8.0e7, "coulomb": 0.02} for joint in two]
    place = [[value - 5e-7, value + 5e-7] for value in (0.1 * math.cos(math.pi / 6), 0.15 - 0.04)]
    x, y = described("serial_2r", joints=joints, handle={"workspace": place}).axes
    assert x.motor_limit == pytest.approx(1.5 / math.sqrt(0.03), rel=1e-4)  # along the longer column
    assert x.coulomb == pytest.approx(0.02 / math.sqrt(0.03), rel=1e-4)
    assert x.damping == pytest.approx(0.01 / (0.02 + math.sqrt(0.0004 - 7.5e-5)), rel=1e-4)  # b / λ_max(J Jᵀ)
    assert x.mass == pytest.approx(0.1 + 1.0 / (25.0 + math.sqrt(17.5**2 + 168.75)), rel=1e-4)
    assert x.counts_per_unit == pytest.approx(8.0e7 / 0.25, rel=1e-4)
    assert y.counts_per_unit == pytest.approx(8.0e7 / math.sqrt(0.0075), rel=1e-4)
    assert (y.motor_limit, y.mass, y.damping, y.velocity_limit) == (x.motor_limit, x.mass, x.damping, 2.0)


@each
def test_a_shipped_linkage_gives_its_force_in_every_direction_all_over_its_workspace_and_nowhere_more_everywhere(name):
    device, random = load_device(name), np.random.default_rng(1)
    places = device.kinematics.grid(list(device.handle.used))
    inside = random.uniform(*np.transpose(device.handle.used), (3000, len(device.joints)))

    def share(place):
        """Of the joints' torques that the force takes in its worst direction, and how far from singular it is there."""
        joints, c = device.kinematics.angles(*(a + b for a, b in zip(device.kinematics.origin, place, strict=False)))
        pose, force = device.kinematics.pose(*joints), device.axes[0].motor_limit
        return max(force * math.hypot(*pose[2 + i : 6 : 2]) / joint.limit for i, joint in enumerate(device.joints)), c

    assert max(share(place)[0] for place in places) == pytest.approx(1.0, rel=1e-9)
    for place in inside:
        most, c = share(place)
        assert most < 1.001 and c > 0.14  # between the places that are looked at, some 5 mm apart


@pytest.mark.parametrize("name, angles", [("haply_2diy_gen3", (168, 12)), ("serial_2r", (30, 60)), ("hapkit", (-900,))])
def test_the_command_tells_place_and_jacobian_of_joints_and_the_joints_of_a_place(name, angles):
    x, y, xa, xb, ya, yb, _ = load_device(name).kinematics.pose(*map(math.radians, angles))
    place, jacobian = ((x, y), [[xa, xb], [ya, yb]]) if len(angles) == 2 else ((x,), [[xa]])
    for option, given in (("--joints", angles), ("--position", place)):
        ended = haptic("device", "kinematics", name, option, ",".join(map(str, given)), "--json")
        assert ended.returncode == 0, ended.stderr
        found = json.loads(ended.stdout)
        assert list(found) == ["position", "jacobian", "joints"]
        assert found["position"] == pytest.approx(place) and found["joints"] == pytest.approx(angles)
        assert np.array(found["jacobian"]) == pytest.approx(np.array(jacobian))


def test_the_commands_table_tells_the_place_from_the_origin_and_how_far_from_singular_the_pose_is():
    told = haptic("device", "kinematics", "serial_2r", "--joints", "30,60").stdout
    rows = {cells[1].strip(): cells[2].strip() for line in told.splitlines() if len(cells := line.split("│")) > 3}
    assert rows["y"] == "0.15" and rows["y from origin"] == "0.11"  # the origin is at 0.04 m
    assert rows["from singular (0: at it, 1: far)"] == "0.866"  # sin 60°
