# SPDX-License-Identifier: Apache-2.0
"""What people see of a linkage: its links and reach in the world, and what tools for devices make of its joints."""

import math

import pytest

from haptic_device.config.description import load_device
from haptic_device.config.kinematics import SINGULAR
from haptic_display.device_tools.device_page import Glance
from haptic_display.device_tools.figures import figures
from haptic_display.page.linkage import linkage_facts
from haptic_display.run.device_programs import device_programs


def test_a_stretched_or_folded_arm_is_the_edge_of_the_reach_in_the_world():
    device = load_device("serial_2r").model_copy(update={"scale": (2.0, 1.0)})
    facts = linkage_facts(device)
    assert facts["arms"] == [{"motor": [0.0, -0.08], "side": -1}]
    assert (facts["proximal"], facts["distal"]) == (0.2, 0.2)
    assert facts["workspace"] == [[-0.1, 0.1], [0.06, 0.24]]
    for x, y in facts["reach"]:
        assert math.hypot(x, y + 0.08) == pytest.approx(0.4, abs=1e-6)


def test_a_five_bar_reaches_to_where_an_arm_is_straight_or_the_distal_links_are():
    device = load_device("haply_2diy_gen3")
    facts, kinematics, (ox, oy) = linkage_facts(device), device.kinematics, device.kinematics.origin
    assert [arm["side"] for arm in facts["arms"]] == [1, -1]
    assert facts["arms"][0]["motor"] == pytest.approx([-0.019, -0.015])
    assert facts["arms"][1]["motor"] == pytest.approx([0.019, -0.015])
    for x, y in facts["reach"]:
        assert 0.0 < kinematics.angles(x + ox, y + oy)[1] < SINGULAR
        beyond = [m + 1.0001 * (at - m) for m, at in zip((0.0, 0.075), (x, y), strict=True)]
        assert kinematics.angles(beyond[0] + ox, beyond[1] + oy)[1] <= 0.0


def test_a_sector_has_a_pivot_and_no_edge_and_a_device_without_joints_no_links():
    facts = linkage_facts(load_device("hapkit"))
    assert facts["sector"] == {"pivot": [0.0, -0.065659], "radii": [0.065659, 0.073152, 0.004191]}
    assert facts["arms"] == [] and facts["reach"] == [] and facts["workspace"] == [[-0.06, 0.06]]
    assert linkage_facts(load_device("desktop")) is None and linkage_facts(None) is None


def test_counts_and_angles_of_a_linkage_are_shown_by_the_names_of_its_joints():
    page = Glance(0, (5, -7, 0), (0.0, 0.0, 0.0), 0.0)
    told = figures({}, page, {"shoulder": 0.25, "elbow": 1.5})
    shown = {name: one for name, one in told.items() if name.startswith(("counts", "position"))}
    assert shown == {
        "counts shoulder": ("5", ""),
        "counts elbow": ("-7", ""),
        "position shoulder": ("+0.250000", "rad"),
        "position elbow": ("+1.500000", "rad"),
    }
    assert figures({}, page, {"x": 0.1, "theta": 0.2})["position x"] == ("+0.100000", "m")
    assert list(figures({}, page, {}))[:3] == ["counts x", "counts y", "counts theta"]


def test_the_simulated_hand_of_a_linkage_begins_in_the_middle_of_its_workspace_where_nothing_else_is_said(tmp_path):
    [loopback] = device_programs("serial_2r", {}, tmp_path)
    assert loopback.parameters["motion.start"] == pytest.approx([0.0, 0.075, 0.0])
    [led] = device_programs("serial_2r", {"motion.start": [0.0, 0.1, 0.0]}, tmp_path)
    assert led.parameters["motion.start"] == [0.0, 0.1, 0.0]
    [straight] = device_programs("desktop", {}, tmp_path)
    assert straight.parameters == {"device": "desktop"}
