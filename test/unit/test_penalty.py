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


@pytest.mark.parametrize("stiffness", [4e5, 4e7, 4e10])
def test_implicit_steps_are_stable_far_beyond_the_limit_of_explicit_ones(stiffness):
    method = pressed(PenaltyImplicit, 1e-3, stiffness)
    first = overlap(method, 5e-3, 1)
    assert 0.0 <= overlap(method, 5e-3, 3000) <= 5e-3 * K / (K + stiffness) * (1.0 + 1e-6) + 1e-15
    assert first >= 0.0


def on_the_ground(kind, h, body, joints=()):
    """A body with a mass of 1 kg under gravity, on a belt at y = 0 that runs at 0.5 m/s; the tool far off."""
    belt = {"name": "belt", "fixed": True, "material": "m", "surface_velocity": [0.5, 0.0], "shapes": GROUND}
    load = {"name": "load", "mass": 1.0, "material": "m", "shapes": [{"box": {"size": [0.2, 0.1]}}], **body}
    scene = {"name": "t", "materials": {"m": {"friction": 0.4}}, "gravity": [0.0, -9.81], "bodies": [belt, load]}
    scene |= {"joints": joints, "tool": {"mass": M, "pose": [9.0, 9.0, 0.0], "shapes": BALL}}
    return kind(reduce_scene(Scene.model_validate(scene)), h, 1e5, 500.0)


@pytest.mark.parametrize("kind", BOTH)
def test_a_block_on_a_belt_has_its_speed_after_v_over_mu_g_and_keeps_it(kind):
    method = on_the_ground(kind, 1e-4, {"pose": [0.0, 0.05, 0.0]})
    for time, way in ((0.1, 0.5 * 0.4 * 9.81 * 0.1**2), (0.3, 0.5 * (0.3 - 0.25 / (0.4 * 9.81)))):
        method.reset()
        method.step(held(STILL), round(time / 1e-4))
        assert method.pose("load")[0] == pytest.approx(way, rel=0.01)
    assert method.bodies()[1][1][0] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(("part", "rises"), [(1.01, True), (0.99, False)])
def test_a_sliders_motor_lifts_its_load_at_its_speed_if_its_force_is_more_than_the_weight(kind, part, rises):
    """The explicit one takes up the slip by the contacts' damper, which may be short of the speed by force/damping."""
    guide = {"type": "slider", "bodies": ["world", "load"], "at": [0.0, 5.0], "axis": [0.0, 1.0], "limits": [0.0, 1.0]}
    guide["motor"] = {"speed": 0.05, "max_force": part * 9.81}
    method = on_the_ground(kind, 1e-4, {"pose": [0.0, 5.0, 0.0]}, [guide])
    method.step(held(STILL), 10000)
    short = 9.81 / 500.0 if kind is PenaltyExplicit else 0.0
    assert method.bodies()[1][1][1] == pytest.approx(0.05 - short if rises else 0.0, abs=1e-5)
    assert (method.pose("load")[1] > 5.01) == rises


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


def test_an_implicit_contact_tends_to_a_rigid_one_as_it_stiffens():
    depths = [overlap(pressed(PenaltyImplicit, 1e-3, k), 5e-3, 2000) for k in (1e5, 1e6, 1e7)]
    assert depths == pytest.approx([5e-3 * K / (K + k) for k in (1e5, 1e6, 1e7)], rel=1e-6)


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
