# SPDX-License-Identifier: Apache-2.0
"""The links of a device on the page: from its motors to the handle, wherever that is led."""

import math

import pytest
from conftest import Tab
from made_up_viewer import VALUES, MadeUpViewer

from haptic_device.config.description import load_device
from haptic_display.page.linkage import linkage_facts

pytestmark = pytest.mark.timeout(600)
DEVICES = "haply_2diy_gen3", "serial_2r", "hapkit"


def elbows(device, x, y):
    """Where the ends of the links at the motors are, by the joint angles of the description [m]."""
    kinematics, (ox, oy) = device.kinematics, device.kinematics.origin
    angles = kinematics.angles(x + ox, y + oy)[0]
    motors = [(0.0, 0.0), (kinematics.base, 0.0)] if kinematics.type == "five_bar" else [(0.0, 0.0)]
    return [
        (at + kinematics.proximal * math.cos(angle) - ox, up + kinematics.proximal * math.sin(angle) - oy)
        for (at, up), angle in zip(motors, angles, strict=False)
    ]


@pytest.mark.parametrize("name", DEVICES)
def test_elbows_are_drawn_where_the_joint_angles_of_the_handles_place_put_them(chromium, name):
    device = load_device(name)
    facts = linkage_facts(device)
    workspace = facts["workspace"]
    viewer = MadeUpViewer(values=VALUES | {"device": name, "workspace": workspace, "linkage": facts})
    tab = Tab(chromium, expert=False)
    try:
        viewer.show()
        tab.page.goto(viewer.address)
        for share in (0.25, 0.8):
            place = [low + share * (high - low) for low, high in workspace] + [0.0] * (2 - len(workspace))
            viewer.show_drawn(tab, handle=[*place, 0.0], tool=None, target=None)
            given = [facts, place]
            drawn = tab.page.evaluate("async (given) => (await import('./linkage.js')).links(...given)", given)
            assert [places[-1] for places in drawn] == [place] * len(drawn)
            if name != "hapkit":
                assert [places[1] for places in drawn] == [pytest.approx(at, abs=1e-9) for at in elbows(device, *place)]
        tab.page.click("#fit")
        tab.page.wait_for_timeout(100)
        tab.shot(f"linkage_{name}")
        assert tab.complaints == []
    finally:
        tab.page.close()
        viewer.close()
