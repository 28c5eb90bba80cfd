# SPDX-License-Identifier: Apache-2.0
"""A rigid wall on live nodes, behind 20 ± 10 ms and 10 % loss, and by the tool in the servo: felt, without energy.

How steady and stiff it is, and what `direct` gives in its place, is judged in lock-step (test_exchange_passive.py,
test_local.py).
"""

import itertools
import threading

import pytest
from live_nodes import DISPLAY

from haptic_device.nodes import messages
from haptic_sim.supervision.system import FAR

OUT, IN = 0.02, 0.005  # [m] of the hand; the wall's tool touches at 0.01
PRESSED, BUDGET = 1.0, 0.005  # [N] and more is the wall, [J]
NETWORK = {"delay": 0.02, "jitter": 0.01, "loss": 0.1}
GAINS = {
    "coupling__stiffness": 2000.0,
    "coupling__damping": 2.0,
    "coupling__rotational_stiffness": 2.0,
    "coupling__rotational_damping": 0.002,
    "servo__rate": 2000.0,
}


NODES = {"haptic_loopback": DISPLAY["haptic_loopback"]}


@pytest.fixture
def far(nodes, ear):
    """Driver and simulation with a relay between."""
    ear.go_to(OUT)
    nodes.start("haptic_relay", **NETWORK)
    nodes.start("haptic_simulation", scene="wall", renamed=[f"{near}:={far}" for near, far in FAR.items()])
    nodes.start("haptic_driver", **GAINS)
    yield
    nodes.lack("haptic_driver", "haptic_simulation", "haptic_relay")


def test_a_wall_behind_a_bad_network_is_felt_and_gives_no_energy_beyond_the_budget(far, ear):
    ear.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 0, what="an answer")
    ear.engaged()
    ear.go_to(IN)
    pushes = itertools.count(1)

    def felt(truth):
        return ear.motor(truth)[0] > PRESSED and next(pushes) > 500  # truths, which are a second of the plant's

    ear.truth(felt, "the wall pushes the hand for a while")
    values = ear.news("haptic_driver", lambda *said: True)[2]
    assert 0 < int(values["exchange_answered"]) < 0.95 * int(values["exchange_sent"])  # a tenth is lost either way
    assert given(ear) <= BUDGET


def given(ear):
    """Most energy [J] that the hand was given since the ear listens."""
    return max(truth.position[2 * ear.axes] for truth in ear.truths) - ear.truths[0].position[2 * ear.axes]


@pytest.fixture
def carrying(nodes, ear):
    """While this is set, the sets of the simulation come to the driver."""
    carrying = threading.Event()
    publisher = ear.node.create_publisher(messages.PointCloud2, "local_contacts", messages.LATEST)
    ear.node.create_subscription(
        messages.PointCloud2,
        "far_local_contacts",
        lambda data: publisher.publish(data) if carrying.is_set() else None,
        messages.LATEST,
        raw=True,
    )
    ear.go_to(OUT)
    nodes.start(
        "haptic_simulation", scene="wall", exchange__method="local", renamed=("local_contacts:=far_local_contacts",)
    )
    nodes.start("haptic_driver", exchange__method="local", auto_enable=True, **GAINS)
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
