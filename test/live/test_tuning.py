# SPDX-License-Identifier: Apache-2.0
"""Tools on a live driver: gains are left as found, strangers and faults given way to."""

import contextlib
import re

import pytest
from live_tuning import GAINS, PAIR, disturbed, engaged_pair, sentence_of, zwidth_live
from lockstep_systems import values
from waiting import until

from haptic_device import controller_config, gain_check
from haptic_device.description import load_device
from haptic_sim.supervision.pair import on_pair
from haptic_sim.supervision.tuning import Tuning

pytestmark = pytest.mark.timeout(900)

FREE = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
FREE += ("cancellation.ratio",)
WALL = {
    "wall__normals": (1.0, 0.0),
    "wall__offsets": (-0.05,),
    "wall__stiffness": (300.0,),
    "wall__damping": (0.1,),
}


@pytest.fixture(scope="module")
def pair():
    """(tuning, domain, namespace) of driver and loopback."""
    with engaged_pair() as pair:
        yield pair


def test_gains_are_as_they_were_after_an_interrupt(pair):
    tuning = pair[0]
    before = tuning.get(GAINS)
    with pytest.raises(KeyboardInterrupt), tuning.as_found(GAINS):
        tuning.set(**WALL, passivity__policy="off", coupling__stiffness=10.0)
        assert tuning.get(["wall.stiffness"]) == {"wall.stiffness": (300.0,)}
        raise KeyboardInterrupt
    assert tuning.get(GAINS) == before


def test_gains_that_the_policy_would_not_take_any_more_are_put_back_too(pair):
    tuning = pair[0]
    before = tuning.get(GAINS)
    tuning.set(passivity__policy="off", coupling__stiffness=50000.0)
    tuning.set(passivity__policy="enforce")
    beyond = tuning.get(GAINS)
    with tuning.as_found(GAINS):
        tuning.set(coupling__stiffness=10.0)
    assert tuning.get(GAINS) == beyond
    tuning.set(**{name.replace(".", "__"): value for name, value in before.items()})


def test_zwidth_live_gives_way_to_somebody_else_who_changes_its_gains(pair, start):
    tuning = pair[0]
    before = tuning.get(GAINS)
    ended = disturbed(
        pair,
        start,
        lambda: tuning.get(["coupling.stiffness"]) == {"coupling.stiffness": 0.0},
        lambda process: tuning.set(coupling__stiffness=250.0),
    )
    told = "something else set coupling.stiffness to 250.0 meanwhile, this command had set 0.0"
    assert ended == (2, f"haptic zwidth: {told}")
    assert tuning.get(GAINS) == before


def test_zwidth_live_refuses_a_driver_in_fault(pair, start):
    tuning = pair[0]
    tuning.trigger("estop")
    try:
        ended = sentence_of(zwidth_live(pair, start))
    finally:
        tuning.recover()
    assert ended[0] == 2
    assert re.fullmatch(r"haptic zwidth: haptic_driver is in fault \w+: clear it first .*", ended[1])


def test_a_tool_gives_way_to_somebody_else_who_changes_its_gains(pair):
    tuning, domain, namespace = pair
    before, other = tuning.get(GAINS), Tuning(domain, namespace)
    try:
        with pytest.raises(ValueError, match="something else set wall.stiffness"), tuning.as_found(GAINS):
            tuning.set(**WALL, passivity__policy="off")
            other.set(wall__stiffness=(250.0,))
            tuning.set(wall__stiffness=(400.0,))
    finally:
        other.close()
    assert tuning.get(GAINS) == before


def test_a_refusal_of_the_driver_is_its_sentence_and_changes_nothing(pair):
    tuning = pair[0]
    with tuning.as_found(GAINS), pytest.raises(ValueError, match="haptic_driver refused: .*wall.stiffness"):
        tuning.set(**{**WALL, "wall__stiffness": (90000.0,)})


def test_under_enforce_nothing_beyond_a_walls_bound_is_taken_and_a_soft_wall_is_with_cancellation_before_it(pair):
    tuning, bound = pair[0], 2.0 * (3.0 - 0.1) * 1000.0
    with tuning.as_found((*GAINS, *FREE, "cancellation.band")):
        tuning.set(**{name.replace(".", "__"): 0.0 for name in FREE}, passivity__policy="enforce")
        tuning.set(cancellation__ratio=0.7, cancellation__band=0.02)
        with pytest.raises(ValueError, match=f"wall.stiffness {1.01 * bound:g} N/m .* needs b > .* the device has 3: "):
            tuning.set(**WALL | {"wall__stiffness": (1.01 * bound,)})
        tuning.set(**WALL | {"wall__stiffness": (1.0,)})  # which writes of any lateness leave passive
        found = {"wall.stiffness": (1.0,), "cancellation.ratio": 0.7}
        assert tuning.get(found) == found


def test_just_within_the_bound_a_late_driver_names_a_wall_is_taken_with_cancellation_before_it():
    def refused(stiffness, late):
        walls = {"wall__normals": (1.0, 0.0), "wall__offsets": (-0.05,), "wall__damping": (0.1,)}
        gains = values(
            "haptic_driver", **walls, wall__stiffness=(stiffness,), **{name.replace(".", "__"): 0.0 for name in FREE}
        ) | {"servo.rate": 1000.0, "cancellation.ratio": 0.7, "cancellation.band": 0.02}
        return gain_check.refusal(controller_config.settings_from(load_device("desktop"), gains)[0], late)

    for late in (0.0, 1e-4, 5e-4):
        most = float(re.search(r"the device has 3: at most (\d+) N/m", refused(90000.0, late))[1])
        assert refused(0.999 * most, late) == "" and refused(1.01 * most, late)


def test_a_driver_in_fault_is_refused(pair):
    tuning = pair[0]
    tuning.trigger("estop")
    try:
        with pytest.raises(ValueError, match="haptic_driver is in fault estop: clear it first"):
            tuning.watch(3.0)
    finally:
        tuning.recover()


def test_a_tool_whose_own_driver_falls_into_a_fault_goes_on_with_a_new_pair(capsys, monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID")  # else it would be in the other pair's
    domains = []

    def work(domain, namespace, check):
        domains.append(domain)
        with contextlib.closing(Tuning(domain, namespace)) as tuning:
            tuning.wait_engaged(check)
            if len(domains) == 1:
                tuning.trigger("estop")
            tuning.watch(1.0)
            return tuning.said("state")

    assert on_pair(None, None, *PAIR, work) == "engaged" and len(domains) == 2
    fell = "haptic_driver fell into fault estop (~/estop was called); both nodes are started anew"
    assert capsys.readouterr().err.splitlines() == [fell]


def test_the_hand_goes_where_it_is_aimed(pair):
    tuning = pair[0]
    for x, y in ((0.02, 0.01), (0.0, 0.0)):

        def there(x=x, y=y):
            tuning.aim((x, y, 0.0))
            tuning.look()
            return abs(tuning.truths[-1]["x"][0] - x) < 2e-3 and abs(tuning.truths[-1]["y"][0] - y) < 2e-3

        until(there, f"the hand at {x}, {y}")


def test_a_namespace_without_nodes_is_told_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr("haptic_sim.supervision.news.LIMIT", 0.3)
    tuning = Tuning(ros_domain, "/nobody")
    try:
        with pytest.raises(ValueError, match="no engaged driver with a loopback is heard in /nobody, .*; start both"):
            tuning.wait_engaged()
    finally:
        tuning.close()
