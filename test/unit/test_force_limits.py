# SPDX-License-Identifier: Apache-2.0
"""Limits of the force keep the promise of docs/passivity.md: no way of the hand gains from walls and a spring."""

import math

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import wall_system
from ticks import tick

from adversary import exchange_search
from haptic_device import gain_check
from haptic_device.control import enable_state, faults

TICK = 1 / 4000.0
COUNTS = 1e9  # per metre, of a handle whose steps are not the matter
ROUNDING = 1e-9  # [J]
OBLIQUE = (0.9, 0.436, 8000.0)  # normal and stiffness
STEEP = (0.3, 0.954, 5000.0)
ASIDE = (-0.6, 0.8, 4000.0)
HELD = {"coupling__stiffness": 3000.0, "coupling__damping": 0.0, "exchange__method": "direct"}


class Led:
    """A servo whose handle is led in the plane; the walls' surfaces meet at the origin, with the free side above.

    share: the damping that the device has of what the gains need. given: energy [J] that the hand got at the most,
    from the forces held and less what the device's damper took for certain; most: the largest that this ever was.
    """

    def __init__(self, walls, limit, share=1.02, damping=0.0, tool=None, **driver):
        normals = np.array([(x, y) / np.hypot(x, y) for x, y, _ in walls])
        given = {
            "wall__normals": tuple(normals.ravel()),
            "wall__offsets": (0.0,) * len(walls),
            "wall__stiffness": tuple(stiffness for *_, stiffness in walls),
            "wall__damping": (damping,) * len(walls),
            "force__limit": limit,
            "passivity__policy": "off",
            **(HELD if tool is not None else {}),
            **driver,
        }
        ample = wall_system(0.0, 0.0, physical_damping=1000.0, counts=COUNTS, **given)
        self.damping = share * (1000.0 - gain_check.margins(ample.settings[0], 0.0)[1])
        self.settings = wall_system(0.0, 0.0, physical_damping=self.damping, counts=COUNTS, **given).settings
        self.memory, self.row = exchange_search.engaged()
        self.place, self.time, self.given, self.most, self.limit = np.zeros(2), 0.0, 0.0, 0.0, limit
        self.found, self.tool, self.forces = 0.0, tool, []
        self.go((0.0, 0.0))

    def go(self, place):
        """Leads the handle there in one hold; the force from then on [N]."""
        to = np.round(np.array(place) * COUNTS) / COUNTS
        way, row = to - self.place, self.row
        self.given += row["force_on_handle"][0, :2] @ way - self.damping * way @ way / TICK
        self.place, self.time = to, self.time + TICK * 1e9
        row["latched"] = row["deadline"] = self.time
        row["command"], row["device_status"] = enable_state.ENABLE, faults.FRESH
        row["counts"][0, :2] = np.round(to * COUNTS)
        if self.tool is not None:
            row["tool_age"], row["tool_position"][0, :2] = 0.001, self.tool
        tick(self.settings, self.memory, row)
        assert row["fault"][0] == faults.NONE
        force = row["force_on_handle"][0, :2].copy()
        assert np.abs(force).max() <= self.limit
        self.most, self.found = max(self.most, self.given), max(self.found, row["generated"][0].sum())
        self.forces.append(force)
        return force

    def follow(self, places):
        for place in places:
            self.go(place)
        return self

    def at_limit(self, axis):
        return bool((np.abs(np.array(self.forces)[:, axis]) > self.limit * (1.0 - 1e-9)).any())


def line(start, end, ticks=100):
    return [np.array(start) + (np.array(end) - np.array(start)) * k / ticks for k in range(1, ticks + 1)]


def loops(centre, radius, way, number=4, ticks=400):
    """From the origin to a circle, round it as often as told, and back."""
    turns = way * 2.0 * np.pi * np.arange(number * ticks + 1) / ticks
    circle = np.array(centre) + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    return [*line((0.0, 0.0), circle[0]), *circle[1:], *line(circle[-1], (0.0, 0.0))]


WAYS = pytest.mark.parametrize("way", [1, -1])
INSIDE = (-0.0012, -0.0012)  # [m] the centre of a circle that stays in the walls


@WAYS
@pytest.mark.parametrize(
    ("walls", "limit", "at", "tool"),
    [
        ([OBLIQUE], 15.0, (True, False), None),
        ([STEEP], 6.0, (False, True), None),
        ([OBLIQUE, STEEP], 9.0, (True, True), None),
        ([OBLIQUE, STEEP, ASIDE], 9.0, (True, True), None),
        ([OBLIQUE], 9.0, (True, False), (0.0, 0.0)),
        ([STEEP], 7.0, (True, True), (0.0, 0.0)),
        ([OBLIQUE, STEEP], 9.0, (True, True), (0.001, -0.002)),
    ],
)
def test_round_a_circle_in_walls_at_a_limit_the_hand_gains_nothing(walls, limit, at, tool, way):
    hand = Led(walls, limit, tool=tool)
    held = 0.5 * HELD["coupling__stiffness"] * np.sum(np.square(tool)) if tool is not None else 0.0
    hand.follow(loops(INSIDE, 0.0012, way))
    assert (hand.at_limit(0), hand.at_limit(1)) == at
    assert hand.most <= held + ROUNDING


@WAYS
def test_a_limit_that_only_one_axis_of_an_oblique_wall_is_at_turns_no_force(way):
    """n = (.9, .436), 8000 N/m, 15 N: 15/.9 N along the normal is the most, so that no axis is beyond its limit."""
    hand, normal = Led([OBLIQUE], 15.0), np.array(OBLIQUE[:2]) / np.hypot(*OBLIQUE[:2])
    for place in loops(INSIDE, 0.0012, way, 1):
        force = min(8000.0 * max(0.0, -normal @ np.round(np.array(place) * COUNTS) / COUNTS), 15.0 / normal[0])
        assert hand.go(place) == pytest.approx(force * normal, abs=1e-9)
    assert hand.at_limit(0)


@pytest.mark.parametrize(("share", "gains"), [(1.02, False), (0.97, True)])
def test_at_the_corner_of_its_limit_a_wall_gives_energy_below_the_damping_it_needs_and_none_above(share, gains):
    """To and fro by a tick's way along the normal, up to the depth at which the force is at its limit."""
    hand, normal = Led([OBLIQUE], 15.0, share=share), np.array(OBLIQUE[:2]) / np.hypot(*OBLIQUE[:2])
    corner, step = 15.0 / normal[0] / 8000.0, 1e-4
    hand.follow(line((0.0, 0.0), -(corner - step) * normal))
    begun = hand.given
    for _ in range(200):
        hand.go(-corner * normal)
        hand.go(-(corner - step) * normal)
    assert (hand.given > begun) == gains
    assert (hand.found > 1e-6) == gains


@few(30)
@given(
    seed=st.integers(0, 10**6),
    number=st.integers(1, 4),
    limit=st.floats(2.0, 15.0),
    damping=st.sampled_from([0.0, 0.3]),
    tool=st.sampled_from([None, (0.0, 0.0)]),
)
def test_no_closed_way_through_walls_at_their_limits_gains_and_the_observer_finds_nothing(
    seed, number, limit, damping, tool
):
    dice = np.random.default_rng(seed)
    angles = dice.uniform(-1.0, 4.1, number)
    walls = [(math.cos(a), math.sin(a), k) for a, k in zip(angles, dice.uniform(500.0, 9000.0, number), strict=True)]
    hand = Led(walls, limit, damping=damping, tool=tool)
    corners = dice.uniform(-0.004, 0.002, (4, 2))
    for _ in range(3):
        before = np.zeros(2)
        for corner in [*corners, np.zeros(2)]:
            hand.follow(line(before, corner, int(dice.integers(5, 60))))
            before = corner
    assert hand.most <= ROUNDING
    assert hand.found <= ROUNDING
