# SPDX-License-Identifier: Apache-2.0
"""Contacts as springs and dampers: order, limits of stability from both sides, coupling and contacts together."""

import pytest

from haptic_sim.method.penalty_explicit import PenaltyExplicit
from haptic_sim.method.penalty_implicit import PenaltyImplicit
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

M, K, CONTACT = 0.1, 2000.0, 1e4
STILL = (0.0, 0.0, 0.0)
BOTH = [PenaltyExplicit, PenaltyImplicit]
BALL, GROUND = [{"circle": {"radius": 0.01}}], [{"half_plane": {"normal": [0.0, 1.0]}}]


def pressed(kind, h, stiffness=CONTACT, damping=0.0, gap=0.0, gains=K, **more):
    """A round tool at a wall to the left of x = 0, its centre at 10 mm plus the gap."""
    wall = {"name": "wall", "fixed": True, "shapes": [{"half_plane": {"normal": [1.0, 0.0]}}]}
    scene = {"name": "t", "bodies": [wall], "tool": {"mass": M, "pose": [0.01 + gap, 0.0, 0.0], "shapes": BALL, **more}}
    method = kind(reduce_scene(Scene.model_validate(scene)), h, stiffness, damping)
    method.couple(Coupling(gains))
    return method


def overlap(method, stretch, count):
    """Overlap [m] after `count` sub-steps with the handle `stretch` inside the wall."""
    method.step(held((0.01 - stretch, 0.0, 0.0)), count)
    return 0.01 - method.position[0]


@pytest.mark.parametrize("kind", BOTH)
def test_at_rest_contact_and_coupling_are_springs_in_series(kind):
    method = pressed(kind, 1e-4, damping=20.0)
    assert overlap(method, 1e-3, 20000) == pytest.approx(1e-3 * K / (K + CONTACT), rel=1e-6)
    [contact] = method.contacts()
    assert contact.force_on_a[0] == pytest.approx(1e-3 * K * CONTACT / (K + CONTACT), rel=1e-6)
    assert method.force_on_tool[0] == pytest.approx(-contact.force_on_a[0], rel=1e-6)


@pytest.mark.parametrize("damping", [0.0, 0.5])
@pytest.mark.parametrize(("part", "bounded"), [(0.97, True), (1.03, False)])
def test_explicit_steps_are_stable_just_below_their_limit_and_not_above(part, bounded, damping):
    """k h²/m + 2 c h/m < 4 with c = damping · m/h, a tenth off the place where a steady push keeps it in contact."""
    h, gains = 1e-3, 1e-3
    stiffness = (4.0 * part - 2.0 * damping) * M / h**2
    push = 0.1  # [m] that the handle is inside the wall
    settled = gains * push / (gains + stiffness)
    method = pressed(PenaltyExplicit, h, stiffness, damping * M / h, gap=-0.9 * settled, gains=gains)
    swings = [abs(overlap(method, push, 1) - settled) for _ in range(400)]
    assert (max(swings[-50:]) <= 1.01 * max(swings[:50])) == bounded


@pytest.mark.parametrize("stiffness", [1e5, 4e7, 4e10])
def test_implicit_steps_are_stable_far_beyond_the_limit_of_explicit_ones_and_tend_to_a_rigid_contact(stiffness):
    method = pressed(PenaltyImplicit, 1e-3, stiffness)
    assert overlap(method, 5e-3, 1) >= 0.0
    assert overlap(method, 5e-3, 3000) == pytest.approx(5e-3 * K / (K + stiffness), rel=1e-6, abs=1e-15)


def worst_gain(kind, stiffness, h=1e-3):
    """Largest speed of rebound by speed of impact, over the phase of the contact."""
    gains = []
    for phase in range(20):
        method = pressed(kind, h, stiffness, 0.0, (1.0 + phase / 20.0) * 0.1 * h, 0.0, velocity=[-0.1, 0.0, 0.0])
        method.step(held(STILL), 60)
        gains.append(method.velocity[0] / 0.1)
    return max(gains)


def test_an_explicit_contact_gives_back_more_than_it_took_at_some_phases_and_an_implicit_one_never():
    """At k h²/m = 0.5 restitution exceeds 1.06 though the step is far from its limit of stability."""
    stiffness = 0.5 * M / 1e-3**2
    assert worst_gain(PenaltyExplicit, stiffness) > 1.06
    assert worst_gain(PenaltyImplicit, stiffness) <= 1.0 + 1e-9


def thrown(kind, floor, ball):
    """A ball over a floor, of these restitutions, and a tool that nothing can reach."""
    materials = {"of_floor": {"restitution": floor}, "of_ball": {"restitution": ball}}
    bodies = [
        {"name": "floor", "fixed": True, "material": "of_floor", "shapes": GROUND},
        {"name": "ball", "mass": M, "pose": [0.0, 0.1, 0.0], "material": "of_ball", "shapes": BALL},
    ]
    tool = {"mass": M, "pose": [0.0, 9.0, 0.0], "shapes": BALL}
    scene = {"name": "t", "materials": materials, "bodies": bodies, "tool": tool, "gravity": [0.0, -9.81]}
    return kind(reduce_scene(Scene.model_validate(scene)), 1e-3)


@pytest.mark.parametrize("kind", BOTH)
def test_a_pair_with_restitution_is_refused_by_name_and_one_of_which_one_has_none_is_not(kind):
    with pytest.raises(
        ValueError, match=r"'ball' and 'floor' have a restitution of 0\.5, .* set it to 0 .* or take method"
    ):
        thrown(kind, 0.5, 0.5)
    thrown(kind, 0.0, 0.5)
