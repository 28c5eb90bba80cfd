# SPDX-License-Identifier: Apache-2.0
"""How stiff a peg feels as it goes in (Colgate, Stanley & Brown 1995, Fig. 5), and how far a wrench turns."""

import math

import pytest

from bench.reference import peg
from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

GAIN = 2.0  # N m/rad


@pytest.mark.parametrize(
    ("insertion", "expected"), [(0.005, 11.89), (0.02, 163.93), (0.05, 769.23), (0.1, 2000.0), (0.2, 4000.0)]
)
def test_apparent_stiffness_has_the_closed_form_of_two_contacts(insertion, expected):
    ratio = peg.HEIGHT / insertion
    assert peg.apparent_stiffness(insertion) == pytest.approx(1e4 / ((1 + ratio) ** 2 + ratio**2), rel=1e-12)
    assert peg.apparent_stiffness(insertion) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("method", peg.PENALTY)
@pytest.mark.parametrize("insertion", [0.005, 0.02, 0.1, 0.2])
@pytest.mark.parametrize("gain", [0.0, GAIN])
def test_elastic_contacts_feel_as_stiff_as_theory_says(method, insertion, gain):
    felt, exact = peg.felt(method, insertion, gain), peg.apparent_stiffness(insertion, gain)
    assert felt.peg == pytest.approx(exact, rel=0.02)
    assert felt.handle == pytest.approx(peg.behind_coupling(exact), rel=0.02)


@pytest.mark.parametrize(("method", "wider"), [("partitioned", 0.0), ("impulse", 1e-5)])
@pytest.mark.parametrize("insertion", [0.02, 0.1])
def test_rigid_contacts_show_the_free_play_and_then_the_coupling_alone(method, wider, insertion):
    """`wider`: Chipmunk leaves an overlap of its slop, half a thousandth of the finest feature, at either contact."""
    clearance = 1e-4
    felt, play = peg.felt(method, insertion, 0.0, clearance), peg.free_play(insertion, clearance)
    assert felt.handle == pytest.approx(peg.COUPLING, rel=0.01)
    assert play * 0.995 <= felt.play <= peg.free_play(insertion, clearance + 2.0 * wider) * 1.005


def test_a_rotation_gain_lets_a_short_insertion_feel_stiff():
    """Without it the peg turns in its hole; with it the coupling holds the angle and the depth is hardly felt."""
    free, held = (peg.felt("penalty_implicit", 0.005, gain).handle for gain in (0.0, GAIN))
    assert held > 10.0 * free
    deep = peg.felt("penalty_implicit", 0.2, GAIN).handle
    assert deep / held < 10.0 < peg.felt("penalty_implicit", 0.2).handle / free


@pytest.mark.parametrize("gain", [0.0, GAIN])
def test_a_rigid_peg_pulls_nothing_then_its_tilt_then_the_coupling(gain):
    places, deep, clearance = (0.5e-4, 6e-4, 1.4e-3, 1.8e-3), 0.02, 2e-4
    exact = [peg.pull_over(place, deep, clearance, gain) for place in places]
    assert peg.force_at("partitioned", places, deep, clearance, gain) == pytest.approx(exact, abs=5e-3)


def test_a_wrench_turns_freely_as_far_as_jaw_and_nut_let_it():
    """±(30° − acos((1 + c/s) cos 30°)), across flats s = 17 mm, jaw wider by c = 0.1 mm: ±0.58901°."""
    turned = []
    for side in (-1.0, 1.0):
        method = Partitioned(reduce_scene(load("wrench_on_nut")), 1e-4)
        method.couple(Coupling(100.0, 10.0))
        handle = 0.1, side * 0.004, 0.0
        method.step(held(handle), 10000)
        turned.append(math.degrees(method.pose("tool")[2] - method.pose("nut")[2]))
    assert turned == pytest.approx([-0.58901, 0.58901], rel=0.01)
