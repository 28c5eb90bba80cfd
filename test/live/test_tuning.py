# SPDX-License-Identifier: Apache-2.0
"""Tools on a live driver: gains are left as found, strangers and faults given way to."""

import contextlib

import pytest
from live_nodes import DISPLAY

from haptic_display.device_tools.tuning import Tuning
from haptic_display.run.processes import NAMESPACE

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
FREE = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
FREE += ("cancellation.ratio",)
WALL = {"wall__normals": (1.0, 0.0), "wall__offsets": (-0.05,), "wall__stiffness": (300.0,), "wall__damping": (0.1,)}
NODES = {name: DISPLAY[name] for name in ("haptic_loopback", "haptic_driver")}


@pytest.fixture
def tuning(display, ros_domain):
    """A tool on an engaged driver."""
    display.engaged()
    with contextlib.closing(Tuning(ros_domain, NAMESPACE)) as tuning:
        tuning.wait_engaged()
        yield tuning


def test_gains_that_the_policy_would_not_take_any_more_are_put_back_too(tuning):
    tuning.set(passivity__policy="off", coupling__stiffness=50000.0)
    tuning.set(passivity__policy="enforce")
    beyond = tuning.get(GAINS)
    with tuning.as_found(GAINS):
        tuning.set(coupling__stiffness=10.0)
    assert tuning.get(GAINS) == beyond


def test_a_tool_gives_way_to_somebody_else_who_changes_its_gains(tuning, ros_domain):
    before, other = tuning.get(GAINS), Tuning(ros_domain, NAMESPACE)
    try:
        with pytest.raises(ValueError, match="something else set wall.stiffness"), tuning.as_found(GAINS):
            tuning.set(**WALL, passivity__policy="off")
            other.set(wall__stiffness=(250.0,))
            tuning.set(wall__stiffness=(400.0,))
    finally:
        other.close()
    assert tuning.get(GAINS) == before


def test_under_enforce_nothing_beyond_a_walls_bound_is_taken_and_a_soft_wall_is_with_cancellation_before_it(tuning):
    bound = 2.0 * (3.0 - 0.1) * 1000.0
    with tuning.as_found((*GAINS, *FREE, "cancellation.band")):
        tuning.set(**{name.replace(".", "__"): 0.0 for name in FREE}, passivity__policy="enforce")
        tuning.set(cancellation__ratio=0.7, cancellation__band=0.02)
        with pytest.raises(ValueError, match=f"wall.stiffness {1.01 * bound:g} N/m .* needs b > .* the device has 3: "):
            tuning.set(**WALL | {"wall__stiffness": (1.01 * bound,)})
        tuning.set(**WALL | {"wall__stiffness": (1.0,)})  # which writes of any lateness leave passive
        found = {"wall.stiffness": (1.0,), "cancellation.ratio": 0.7}
        assert tuning.get(found) == found


def test_a_driver_in_fault_is_refused(tuning):
    tuning.trigger("estop")
    try:
        with pytest.raises(ValueError, match="haptic_driver is in fault estop: clear it first"):
            tuning.watch(3.0)
    finally:
        tuning.recover()


def test_a_namespace_without_nodes_is_told_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr("haptic_display.run.news.LIMIT", 0.3)
    tuning = Tuning(ros_domain, "/nobody")
    try:
        with pytest.raises(ValueError, match="no engaged driver with a loopback is heard in /nobody, .*; start both"):
            tuning.wait_engaged()
    finally:
        tuning.close()
