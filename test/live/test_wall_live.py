# SPDX-License-Identifier: Apache-2.0
"""A rigid wall on live nodes, by the tool in the servo: felt, without energy, also where its sets stop.

How steady and stiff it is, and a wall behind a bad network, is judged in lock-step (test/unit/test_local.py,
test_exchange_passive.py), and over two network namespaces (test/soak/test_real_network.py).
"""

import threading

import pytest
from exchange_systems import GAINS
from live_nodes import DISPLAY

from haptic_device.nodes import messages
from haptic_device.recording.layouts import CLOUD

pytestmark = pytest.mark.realtime
OUT, IN = 0.02, 0.005  # [m] of the hand; the wall's tool touches at 0.01
PRESSED, BUDGET = 1.0, 0.005  # [N] and more is the wall, [J]
NODES = {"haptic_loopback": DISPLAY["haptic_loopback"]}


def given(ear):
    """Most energy [J] that the hand was given since the ear listens."""
    return max(truth.position[2 * ear.axes] for truth in ear.truths) - ear.truths[0].position[2 * ear.axes]


@pytest.fixture
def carrying(nodes, ear):
    """While this is set, the sets of the simulation come to the driver."""
    carrying = threading.Event()
    publisher = ear.node.create_publisher(messages.PointCloud2, "local_contacts", messages.LATEST)
    carry = lambda data: publisher.publish(data) if carrying.is_set() else None  # noqa: E731
    ear.hear("far_local_contacts", carry, messages.LATEST, CLOUD, raw=True)
    ear.go_to(OUT)
    nodes.start(
        "haptic_simulation", scene="wall", exchange__method="local", renamed=("local_contacts:=far_local_contacts",)
    )
    nodes.start("haptic_driver", exchange__method="local", auto_enable=True, servo__rate=2000.0, **GAINS)
    carrying.set()
    return carrying


def said(ear, what, condition):
    """Values of the next diagnostics of an engaged driver for which the condition holds."""

    def good(level, message, values):
        return values["state"] == "engaged" and condition(values)

    return ear.news("haptic_driver", good, what=what)[2]


def felt(ear, what):
    """Waits until the wall pushes the hand."""
    return ear.truth(lambda truth: ear.motor(truth)[0] > PRESSED, what=what)


def test_where_sets_stop_modulation_takes_over_is_counted_and_gives_way_when_they_come_again(carrying, ear):
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
    assert given(ear) <= BUDGET
