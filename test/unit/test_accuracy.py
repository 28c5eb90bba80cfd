# SPDX-License-Identifier: Apache-2.0
"""Figures that a haptics researcher would check with a calculator, at sub-steps of 0.1 ms.

Pendulum, impacts, incline and four-bar stand in test_partitioned.py, restitution and sliding in test_world.py.
"""

import math

import pytest

from haptic_sim.method.partitioned import Partitioned
from haptic_sim.method.penalty_implicit import PenaltyImplicit
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene, load

H = 1e-4
STILL = (0.0, 0.0, 0.0)
STIFFNESS, ABOVE = 1e4, 0.1  # N/m of a contact; m from the mouth up to the grip


def peg(inserted, clearance):
    """A peg 20 mm wide in a deep hole, centred; the mouth is at y = 0, the grip 100 mm above it."""
    walls = [
        {
            "name": name,
            "fixed": True,
            "shapes": [
                {
                    "vertices": [
                        [side * (0.01 + clearance), -0.4],
                        [side * 0.1, -0.4],
                        [side * 0.1, 0.0],
                        [side * (0.01 + clearance), 0.0],
                    ]
                }
            ],
        }
        for name, side in (("left", -1.0), ("right", 1.0))
    ]
    low = -ABOVE - inserted
    shaft = {"vertices": [[-0.01, low], [0.01, low], [0.01, 0.01 - ABOVE], [-0.01, 0.01 - ABOVE]]}
    return Scene.model_validate(
        {
            "name": "peg",
            "bodies": walls,
            "tool": {"mass": 0.1, "inertia": 1e-3, "pose": [0.0, ABOVE, 0.0], "shapes": [shaft]},
        }
    )


def pushed(method, way, gains):
    """(x of the grip, force on it) after a second with the handle `way` beside the axis, no moment at the grip."""
    method.couple(gains)
    method.step(held((way, ABOVE, 0.0)), 10000)
    return method.position[0], method.force_on_tool[0]


@pytest.mark.parametrize(("inserted", "apparent"), [(0.02, 163.93), (0.05, 769.23), (0.1, 2000.0), (0.2, 4000.0)])
def test_a_peg_held_by_contacts_of_stiffness_k_feels_as_stiff_as_the_lever_makes_it(inserted, apparent):
    """K_app = k/((1 + λ)² + λ²), λ = h/L, contacts at the mouth and at the tip."""
    gains = Coupling(2000.0, 50.0)
    (x0, f0), (x1, f1) = (
        pushed(PenaltyImplicit(reduce_scene(peg(inserted, 1e-5)), H, STIFFNESS, 50.0), way, gains)
        for way in (2e-3, 3e-3)
    )
    assert (f1 - f0) / (x1 - x0) == pytest.approx(apparent, rel=0.02)


@pytest.mark.parametrize("inserted", [0.02, 0.05, 0.1])
def test_a_peg_in_a_rigid_hole_has_its_free_play_and_then_nothing_gives(inserted):
    """Free play of the grip ±c (1/2 + h/L), c the whole clearance: mouth and tip touch on opposite sides."""
    clearance = 1e-4
    play = 2.0 * clearance * (0.5 + ABOVE / inserted)
    gains = Coupling(2000.0, 50.0)
    (x0, f0), (x1, f1) = (
        pushed(Partitioned(reduce_scene(peg(inserted, clearance)), H), play + more, gains) for more in (5e-4, 1e-3)
    )
    assert (x0, x1) == pytest.approx((play, play), rel=0.01)
    assert f1 - f0 == pytest.approx(2000.0 * 5e-4, rel=0.01)


def test_a_wrench_turns_freely_as_far_as_jaw_and_nut_let_it():
    """±(30° − acos((1 + c/s) cos 30°)), across flats s = 17 mm, jaw wider by c = 0.1 mm: ±0.58901°."""
    turned = []
    for side in (-1.0, 1.0):
        method = Partitioned(reduce_scene(load("wrench_on_nut")), H)
        method.couple(Coupling(100.0, 10.0))
        handle = 0.1, side * 0.004, 0.0
        method.step(held(handle), 10000)
        turned.append(math.degrees(method.pose("tool")[2] - method.pose("nut")[2]))
    assert turned == pytest.approx([-0.58901, 0.58901], rel=0.01)
