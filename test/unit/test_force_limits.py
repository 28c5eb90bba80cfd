# SPDX-License-Identifier: Apache-2.0
"""Limits of the force keep what docs/theory/passivity.md promises: no way of the hand gains from walls and spring."""

import math

import numpy as np
import pytest
from examples import few, tries
from hypothesis import given
from hypothesis import strategies as st
from led import Led, line, store
from lockstep_systems import wall_system

from haptic_device.control import gain_check

TICK = 1 / 4000.0
COUNTS = 1e9  # per metre, of a handle whose steps are not the matter
ROUNDING = 1e-9  # [J]
OBLIQUE = (0.9, 0.436, 8000.0)  # normal and stiffness
STEEP = (0.3, 0.954, 5000.0)
HELD = {"coupling__stiffness": 3000.0, "coupling__damping": 0.0, "exchange__method": "direct"}


class Limited(Led):
    """The walls' surfaces meet at the origin, with the free side above; share: the damping that the device has of what
    the gains need."""

    def __init__(self, walls, limit, share=1.02, damping=0.0, tool=None, **driver):
        normals = np.array([(x, y) / np.hypot(x, y) for x, y, _ in walls])
        given = {
            "wall__normals": tuple(normals.ravel()),
            "wall__offsets": (0.0,) * len(walls),
            "wall__stiffness": tuple(stiffness for *_, stiffness in walls),
            "wall__damping": (damping,) * len(walls),
            "force__limit": limit,
            "passivity__policy": "off",
            "engage__time": TICK,
            "exchange__fade": TICK,
            **(HELD if tool is not None else {}),
            **driver,
        }
        ample = wall_system(0.0, 0.0, physical_damping=1000.0, counts=COUNTS, **given)
        enough = share * (1000.0 - gain_check.margins(ample.settings[0], 0.0)[1])
        settings = wall_system(0.0, 0.0, physical_damping=enough, counts=COUNTS, **given).settings
        self.limit = limit
        super().__init__(settings, tool)

    def go(self, place, **inputs):
        force = super().go(place, **inputs)[:2]
        assert np.abs(force).max() <= self.limit
        return force

    def at_limit(self, axis):
        return bool((np.abs(np.array(self.forces)[:, axis]) > self.limit * (1.0 - 1e-9)).any())


def loops(centre, radius, way, number=4, ticks=400):
    """From the origin to a circle, round it as often as told, and back."""
    turns = way * 2.0 * np.pi * np.arange(number * ticks + 1) / ticks
    circle = np.array(centre) + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    return [*line((0.0, 0.0), circle[0]), *circle[1:], *line(circle[-1], (0.0, 0.0))]


INSIDE = (-0.0012, -0.0012)  # [m] the centre of a circle that stays in the walls


@pytest.mark.parametrize(
    ("walls", "limit", "at", "tool", "way"),
    [
        ([OBLIQUE], 15.0, (True, False), None, 1),
        ([OBLIQUE, STEEP], 9.0, (False, True), None, -1),
        ([OBLIQUE], 14.0, (True, False), (0.0, 0.0), -1),
        ([STEEP], 7.0, (True, True), (0.0, 0.0), 1),
        ([OBLIQUE, STEEP], 9.0, (True, True), (-0.003, 0.003), 1),
    ],
)
def test_round_a_circle_in_walls_at_a_limit_the_hand_gains_nothing(walls, limit, at, tool, way):
    hand = Limited(walls, limit, tool=tool, engage__force=100.0, exchange__budget=0.05)
    held = 0.5 * HELD["coupling__stiffness"] * np.sum(np.square(tool)) if tool is not None else 0.0
    for turn in range(4):
        before = hand.free
        hand.follow(loops(INSIDE, 0.0012, way, 1))
        assert turn == 0 or hand.free >= before - ROUNDING
    assert (hand.at_limit(0), hand.at_limit(1)) == at
    assert hand.most <= held + ROUNDING


def test_a_limit_that_only_one_axis_of_an_oblique_wall_is_at_turns_no_force():
    """n = (.9, .436), 8000 N/m, 15 N: 15/.9 N along the normal is the most, so that no axis is beyond its limit."""
    hand, normal = Limited([OBLIQUE], 15.0), np.array(OBLIQUE[:2]) / np.hypot(*OBLIQUE[:2])
    for place in loops(INSIDE, 0.0012, 1, 1):
        force = min(8000.0 * max(0.0, -normal @ np.round(np.array(place) * COUNTS) / COUNTS), 15.0 / normal[0])
        assert hand.go(place) == pytest.approx(force * normal, abs=1e-9)
    assert hand.at_limit(0)


@pytest.mark.parametrize(("share", "gains"), [(1.02, False), (0.97, True)])
def test_at_the_corner_of_its_limit_a_wall_gives_energy_below_the_damping_it_needs_and_none_above(share, gains):
    """To and fro by a tick's way, up to the depth at which the force is at its limit."""
    hand, corner, step = Limited([(1.0, 0.0, 8000.0)], 15.0, share=share), 15.0 / 8000.0, 1e-4
    hand.follow(line((0.0, 0.0), (step - corner, 0.0)))
    begun, before = hand.given, hand.free
    for _ in range(200):
        hand.go((-corner, 0.0))
        hand.go((step - corner, 0.0))
    assert (hand.given > begun) == gains
    assert (hand.free < before - 1e-6) == gains


def random_walls(dice, number):
    """Walls that lean to the same side, on either side of the y axis."""
    angles = dice.uniform(0.0, 0.5 * math.pi, number) + 0.5 * math.pi * dice.integers(0, 2)
    return [(math.cos(a), math.sin(a), k) for a, k in zip(angles, dice.uniform(500.0, 9000.0, number), strict=True)]


def random_way(dice, rounds=3):
    """A closed way from the origin, the same in each round but for the speed."""
    corners = [np.zeros(2), *dice.uniform(-0.004, 0.002, (4, 2)), np.zeros(2)]
    for _ in range(rounds):
        for start, end in zip(corners[:-1], corners[1:], strict=True):
            yield from line(start, end, int(dice.integers(5, 60)))


PLACES = st.integers(0, 10**6)
NUMBER = st.integers(1, 4)
LIMITS = st.floats(2.0, 15.0)
PAID = {"exchange__method": "direct", "passivity__policy": "warn"}
TOOLS = st.sampled_from([None, (0.0, 0.0)])


@few(30)
@given(seed=PLACES, number=NUMBER, limit=LIMITS, damping=st.sampled_from([0.0, 0.3]), tool=TOOLS)
def test_no_closed_way_through_walls_at_their_limits_gains_or_costs_the_account_anything(
    seed, number, limit, damping, tool
):
    dice = np.random.default_rng(seed)
    hand = Limited(random_walls(dice, number), limit, damping=damping, tool=tool)
    before = hand.free
    hand.follow(random_way(dice))
    assert hand.most <= ROUNDING and hand.free >= before - ROUNDING


@few(30)
@given(seed=PLACES, number=NUMBER, limit=LIMITS, share=st.floats(0.2, 0.95), tool=TOOLS)
def test_of_what_a_way_gains_at_limits_below_the_damping_needed_the_account_misses_nothing(
    seed, number, limit, share, tool
):
    dice, off = np.random.default_rng(seed), {"passivity__control": False}
    hand = Limited(random_walls(dice, number), limit, share, tool=tool, **off)
    for place in random_way(dice):
        hand.go(place)
        assert hand.missing >= hand.given - ROUNDING


def test_a_walls_damper_at_a_limit_acts_along_its_normal():
    hand, normal = Limited([OBLIQUE], 12.0, damping=2.0), np.array(OBLIQUE[:2]) / np.hypot(*OBLIQUE[:2])
    for place in random_way(np.random.default_rng(3)):
        force = hand.go(place)
        assert force @ (-normal[1], normal[0]) == pytest.approx(0.0, abs=1e-9) and force @ normal >= 0.0
    assert hand.at_limit(0)


def test_where_a_walls_damper_fills_the_limit_all_that_is_held_is_a_number():
    """To within a rounding, which may leave less than nothing for all other dampers."""
    for damping in np.linspace(5.0, 50.0, tries(12)):
        hand = Limited([(-1.0, 0.0, 1000.0)], 15.0, damping=damping).follow([(3e-4, 0.0), (8e-4, 0.0)])
        assert np.isfinite(np.frombuffer(hand.memory.tobytes())).all()
    assert hand.at_limit(0)


def raised(hand, limit):
    """The hand, which stays, after a second with another limit of force wished for; what that costs [J]."""
    before = hand.free
    for group in ("force", "coupling"):
        hand.settings[group]["limit"][0, :2] = limit
    hand.settings["version"] += 1
    hand.limit = limit
    return before - hand.follow([hand.place[:2]] * 4000).free


def test_a_limit_that_rises_at_a_wall_costs_what_its_clamped_spring_gains_and_waits_for_what_is_not_there():
    """From 5 N to 6 N, 1.5 mm deep; to 15 N at 4 mm would cost 30 mJ."""
    normal = np.array(OBLIQUE[:2]) / np.hypot(*OBLIQUE[:2])
    hand = Limited([OBLIQUE], 5.0, **PAID).follow(line((0.0, 0.0), -0.0015 * normal))
    stored = [store(8000.0, limit / normal[0], 0.0015) for limit in (5.0, 6.0)]
    hides = sum(normal) / normal[0] / COUNTS  # [J/N] of the force along x that changes: a step of way on either axis
    assert raised(hand, 6.0) == pytest.approx(stored[1] - stored[0] + hides, rel=1e-6)
    assert hand.forces[-1][:2] == pytest.approx(6.0 / normal[0] * normal)
    poor = Limited([OBLIQUE], 5.0, **PAID).follow(line((0.0, 0.0), -0.004 * normal))
    there, before = poor.free, float(poor.row.stored[0])
    paid = raised(poor, 15.0)
    assert 5.1 < poor.forces[-1][0] < 14.0
    rise, hidden = poor.row.stored[0] - before, hides * (poor.forces[-1][0] - 5.0)
    assert rise <= paid <= rise + 3.0 * hidden  # weight and limit both move: the force changes by more than it rises
    assert 0.99 * there < paid <= there + ROUNDING
    poor.follow(line(-0.004 * normal, 0.001 * normal))
    raised(poor, 15.0)
    poor.follow(line(0.001 * normal, -0.004 * normal))
    assert poor.forces[-1][:2] == pytest.approx(15.0 / normal[0] * normal)
