# SPDX-License-Identifier: Apache-2.0
"""Hard cases: the method that a scene gets by default survives them; the direct solver keeps far closer bounds.

Finite, nothing passed through, no overlap beyond 0.1 mm measured with the shapes themselves, no energy from nowhere.
"""

import functools
import math

import numpy as np
import pytest
from examples import searching

from bench.methods import hard_cases
from bench.reference.trial import attempt, jump
from haptic_sim.lockstep.rollout import FAR, GAINS, rollout
from haptic_sim.method_registry import make
from haptic_sim.protocol import StepResult, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import framed
from haptic_sim.scene.language import Scene, load

OVERLAP = 1e-4
TOUCHING = 1e-12  # m; gap up to which the direct solver takes two shapes for touching
TURNS = [(0.0, 0.0), (0.7, 0.37), (2.9, 0.81)]  # angle of the whole plane [rad], phase of the contact in sub-steps
TRIED = range(len(TURNS)) if searching() else (0, 2)
LONG = {
    "four_bar_singular": 2,
    "light_tool": 2,
    "peg_in_hole": 1,
    "peg_jammed": 2,
    "peg_tight": 1,
    "peg_wedged": 0,
    "spinning_wrench": 0,
    "stack_20": 1,
}
"""Scenes of many steps or bodies, and which of TURNS they are tried at."""
SECONDS = hard_cases.SECONDS | {"four_bar_singular": 3.4, "peg_in_hole": 3.6, "stack_20": 1.2}
PUSHED = {"peg_jammed": 5.0, "peg_wedged": 10.0}
"""N; what the hand has come to push with at the end."""
STIFF = (100.0 * 0.1 / 0.25e-3**2, 0.0, 100.0 * 6.7e-6 / 0.25e-3**2, 0.0)  # 100 m/h², undamped
HARD = sorted(hard_cases.SECONDS)
DIRECT = ["collinear_1e3", "collinear_1e6", "heavy_on_light_1e3", "heavy_on_light_1e6", "light_tool", "stack_20"]
"""Those that get the direct solver by default."""
SLOW = [] if searching() else ["spinning_wrench", "peg_jammed"]
"""With `impulse`: in `make soak` alone."""


def turned(*names):
    """(name, angle, phase) of every trial of these scenes."""
    return [(name, *TURNS[i]) for name in names for i in ([LONG[name]] if name in LONG else TRIED)]


@functools.cache
def tried(name, angle, phase, method="partitioned"):
    """The outcome, which tests share: none of them steps its simulation on."""
    scene, more = load(name), {"method": method}
    if name == "handle_jump":
        more["way"] = jump(scene, angle, 0.02)
    if name == "stiff_coupling":
        more |= {"gains": STIFF, "sub_step": 0.25e-3}
    look = 40 if name == "stack_20" else 5  # it has 231 pairs to be looked at
    return attempt(scene, SECONDS.get(name, 1.2), angle=angle, phase=phase, look_every=look, **more)


@pytest.mark.parametrize("name", sorted({*HARD} - {*SLOW}))
def test_a_hard_case_is_survived_by_the_method_that_it_gets_by_default(name):
    """The direct solver, where it is that: what is asked of it below is far more than to survive."""
    assert reduce_scene(load(name)).method == ("partitioned" if name in DIRECT else "impulse")
    if name not in DIRECT:
        found = hard_cases.verdict(name, "impulse", 1 if name in LONG else 2)
        assert found.survives, found


@pytest.mark.parametrize(("name", "angle", "phase"), turned(*HARD))
def test_the_direct_solver_keeps_a_hard_case_finite_apart_and_creates_no_energy(name, angle, phase):
    """Beyond rounding: to put an overlap of rounding right takes the contacts' force times it, at each contact.

    A peg that is pressed all the time sinks in that deep again once a second (`lcp.SOFT`).
    """
    outcome = tried(name, angle, phase)
    times = SECONDS[name] if name in PUSHED else 1.0
    assert outcome.finite
    assert outcome.overlap <= 10.0 * TOUCHING
    force = outcome.simulation.counters.max_contact_force
    contacts = max(4, len(outcome.simulation.method.contacts()))
    assert outcome.created <= contacts * force * TOUCHING * times + 1e-13 * max(outcome.scale, 1e-6)
    assert outcome.simulation.counters.left_out == 0
    if name in PUSHED:
        assert math.hypot(*outcome.simulation.method.force_on_tool[:2]) > PUSHED[name]
    if name == "spinning_wrench":
        assert outcome.simulation.method.position[2] - angle > 19.98 * math.pi


def place(outcome, body, angle):
    """Where a body is in the plane as it was before it was turned."""
    return framed(outcome.simulation.method.pose(body)[:2], (0.0, 0.0, angle))


@pytest.mark.parametrize(("angle", "phase"), [TURNS[i] for i in TRIED])
@pytest.mark.parametrize(
    ("name", "body", "axis", "low"),
    [
        ("thin_plate", "shot", (-1.0, 0.0), -0.045),
        ("handle_jump", "tool", (1.0, 0.0), 0.0099),
        ("stiff_coupling", "tool", (1.0, 0.0), 0.0099),
        ("light_tool", "tool", (1.0, 0.0), 0.0099),
        ("corner_overlap", "tool", (1.0, 0.0), 0.0099),
        ("corner_overlap", "tool", (0.0, 1.0), 0.0099),
    ],
)
def test_nothing_comes_out_on_the_other_side_of_a_thin_wall(name, body, axis, low, angle, phase):
    x, y = place(tried(name, angle, phase), body, angle)
    assert x * axis[0] + y * axis[1] >= low


@pytest.mark.parametrize(("name", "ratio"), [("collinear_1e3", 1e3), ("collinear_1e6", 1e6)])
def test_a_heavy_disc_on_a_light_one_parts_at_the_speeds_of_the_closed_form(name, ratio):
    outcome, e = attempt(load(name), SECONDS[name], "partitioned", phase=0.37), 0.5
    method = outcome.simulation.method
    before = {body: method.pose(body)[0] for body in ("striker", "struck")}
    hold = outcome.simulation.scene.tool.pose
    for _ in range(40):
        method.step(held(hold), 1)
    speed = {body: (method.pose(body)[0] - before[body]) / (40 * method.sub_step) for body in before}
    assert speed["striker"] == pytest.approx((ratio - e) / (ratio + 1), rel=1e-6)
    assert speed["struck"] == pytest.approx(ratio * (1 + e) / (ratio + 1), rel=1e-6)


def test_a_zeno_ball_rests_at_its_zeno_time():
    """sqrt(2 h/g) (1 + e)/(1 - e) = 1.354571 s: it still hops 10 ms before, by e^n, and rests afterwards."""
    outcome = tried("zeno_ball", 0.0, 0.0)
    method = outcome.simulation.method
    assert method.pose("ball")[1] == pytest.approx(-0.08, abs=1e-6)
    kinetic, _ = method.energy()
    assert kinetic < 1e-8
    early = attempt(load("zeno_ball"), 1.0, "partitioned")
    assert early.simulation.method.pose("ball")[1] > -0.08 + 1e-4


def test_a_wedged_peg_carries_the_hands_push_by_its_own_friction_and_stands_still():
    """The hand wants 10 mm; two contacts within their friction cones hold 15 N straight down with nothing below."""
    earlier = attempt(load("peg_wedged"), 2.8, "partitioned", look_every=50).simulation
    later = tried("peg_wedged", 0.0, 0.0).simulation
    assert later.method.force_on_tool[1] < -10.0
    assert later.measure()["insertion_fraction"] < 0.3
    assert later.method.position == pytest.approx(earlier.method.position, abs=1e-9)


def test_ten_turns_of_a_wrench_are_counted_and_take_the_nut_along():
    outcome = tried("spinning_wrench", 0.0, 0.0)
    nut, tool = (outcome.simulation.method.pose(body)[2] for body in ("nut", "tool"))
    play = math.radians(1.80058)
    assert 19.98 * math.pi < tool < 20.0 * math.pi
    assert tool - nut == pytest.approx(0.0, abs=1.05 * play + math.radians(0.01))


def test_a_coupling_a_hundred_times_too_stiff_is_survived_by_a_tool_of_a_gram_too():
    outcome = attempt(load("light_tool"), 0.4, "partitioned", gains=STIFF, sub_step=0.25e-3, look_every=3)
    assert outcome.finite
    assert outcome.overlap <= OVERLAP


def test_trial_sees_overlap_and_energy_where_they_are():
    """The judge itself: heavy on light by sweeping impulses sinks in visibly, by the direct solve it does not."""
    sinking = attempt(load("heavy_on_light_1e6"), 0.3, method="impulse", look_every=5)
    standing = attempt(load("heavy_on_light_1e6"), 0.3, gains=GAINS, look_every=5)
    assert sinking.overlap > 1e-3
    assert standing.overlap <= OVERLAP


def test_more_contacts_than_can_be_solved_for_are_counted_not_passed_over():
    """Three courses of bricks side by side."""
    brick = {"mass": 1.0, "material": "m", "shapes": [{"box": {"size": [0.1, 0.1]}}]}
    crowd = [brick | {"name": f"b{i}", "pose": [0.1 * (i % 13), 0.05 + 0.1 * (i // 13), 0.0]} for i in range(38)]
    floor = {"name": "floor", "fixed": True, "material": "m", "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [0.0, 9.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    content = {"name": "crowd", "gravity": [0.0, -9.81], "materials": {"m": {"friction": 0.3}}, "method": "partitioned"}
    scene = Scene.model_validate(content | {"bodies": [floor, *crowd], "tool": tool})
    assert attempt(scene, 0.002).simulation.counters.left_out > 0


@pytest.mark.parametrize(("name", "angle", "phase"), turned("corner", "peg_in_hole"))
def test_the_impulse_method_overlaps_by_micrometres_and_gains_no_more_than_pushing_that_out_takes(name, angle, phase):
    outcome = tried(name, angle, phase, method="impulse")
    counters = outcome.simulation.counters
    assert outcome.finite
    assert outcome.overlap <= OVERLAP
    assert outcome.created <= counters.max_contact_force * counters.max_penetration


PALLET = {
    "name": "pallet",
    "gravity": [0.0, -9.81],
    "tool": {"mass": 0.1, "pose": [0.0, 0.1, 0.0], "shapes": [{"circle": {"radius": 0.005}}]},
}
FLOOR = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}


@pytest.mark.parametrize("mass", [0.01, 700.0, 1e5])
@pytest.mark.parametrize("method", ["partitioned", "impulse"])
def test_a_load_at_rest_is_no_explosion_however_heavy_it_is(method, mass):
    load_at_rest = {"name": "load", "mass": mass, "pose": [1.0, 0.15, 0.0], "shapes": [{"box": {"size": [0.8, 0.3]}}]}
    scene = Scene.model_validate(PALLET | {"bodies": [FLOOR, load_at_rest]})
    world = make(method, reduce_scene(scene, method), 0.001)
    world.couple(GAINS)
    found = rollout(world, held((0.0, 0.1, 0.0)).repeat(25, axis=0), gains=GAINS)
    assert found.finite and len(found.spent) == 49
    assert found.created <= 1e-12 * found.scale


class Blown:
    """A world of this energy at its start [J]; a step later so many times as much more, its tool there."""

    def __init__(self, start, times, at=0.0):
        self._energies, self._tool = (
            [(0.0, start), (0.0, start + times * max(1.0, start))],
            [(0.0, 0.0, 0.0), (at, 0.0, 0.0)],
        )

    def step(self, target, n):
        self._energies, self._tool = self._energies[1:], self._tool[1:]
        return StepResult(0.0)

    def energy(self):
        return self._energies[0]

    def pose(self, body):
        return self._tool[0]


@pytest.mark.parametrize("start", [0.0, 1e4])
@pytest.mark.parametrize(("share", "finite"), [(0.99, True), (1.01, False)])
def test_a_run_ends_where_a_thousand_times_the_energy_of_its_start_has_come_from_nowhere(start, share, finite):
    far = math.sqrt(2.0 * share * FAR * max(1.0, start) / GAINS.stiffness)  # of the tool from the handle [m]
    for world in Blown(start, share * FAR), Blown(start, 0.0, far):
        assert rollout(world, np.zeros((2, 6)), gains=GAINS).finite is finite
    assert not rollout(Blown(start, math.nan), np.zeros((2, 6)), gains=GAINS).finite
