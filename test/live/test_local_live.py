# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo on live nodes: sets come over DDS, are taken and used; without them set-position modulation.

What it feels like is judged in lock-step (test_local.py).
"""

import threading

import pytest
from live_nodes import Ear, Nodes

from haptic_device.node import wire

pytestmark = pytest.mark.timeout(600)

BUDGET = 0.005  # [J]
OUT, IN = 0.02, 0.005  # [m] of the hand; the wall's tool touches at 0.01
PRESSED = 1.0  # [N] and more is the wall


@pytest.fixture
def carrier(ros_domain, tmp_path):
    """An ear that carries the sets from the simulation to the driver while `carrying` is set."""
    ear, carrying = Ear(ros_domain), threading.Event()
    publisher = ear.node.create_publisher(wire.PointCloud2, "local_contacts", wire.LATEST)
    ear.node.create_subscription(
        wire.PointCloud2, "far_local_contacts", lambda data: publisher.publish(data) if carrying.is_set() else None,
        wire.LATEST, raw=True,
    )  # fmt: skip
    with Nodes(tmp_path) as nodes:
        nodes.start("haptic_loopback", motion__name="follow", motion__start=(OUT, 0.0, 0.0))
        nodes.start("haptic_simulation", scene="wall", exchange__method="local",
                    renamed=("local_contacts:=far_local_contacts",))
        nodes.start("haptic_driver", exchange__method="local", coupling__stiffness=2000.0, coupling__damping=2.0,
                    auto_enable=True)  # fmt: skip
        carrying.set()
        yield ear, carrying
    ear.close()


def said(ear, what, condition):
    """Values of the next diagnostics of an engaged driver for which the condition holds."""

    def good(level, message, values):
        return values["state"] == "engaged" and condition(values)

    return ear.news("haptic_driver", good, what=what)[2]


def felt(ear, what):
    """Waits until the wall pushes the hand."""
    return ear.truth(lambda truth: ear.motor(truth)[0] > PRESSED, what=what)


def test_where_sets_stop_modulation_takes_over_is_counted_and_gives_way_when_they_come_again(carrier):
    ear, carrying = carrier

    def acts(values):
        return values["local"] == "acts"

    said(ear, "the servo's own tool", acts)
    ear.go_to(IN)
    pressed = said(ear, "a hundred sets", lambda values: acts(values) and int(values["local_sets"]) > 100)
    felt(ear, "the wall by the servo's own tool")
    carrying.clear()
    alone = said(ear, "modulation in its place", lambda values: not acts(values))
    assert int(alone["local_fallbacks"]) > int(pressed["local_fallbacks"])
    felt(ear, "the wall by modulation")
    later = said(ear, "more of the same", lambda values: True)
    assert not acts(later) and int(later["exchange_answered"]) > int(alone["exchange_answered"])
    carrying.set()
    again = said(ear, "the servo's own tool again", acts)
    assert int(again["local_sets"]) > int(later["local_sets"])
    felt(ear, "the wall by the servo's own tool again")
    assert max(truth.position[2 * ear.axes] for truth in ear.truths) <= BUDGET
