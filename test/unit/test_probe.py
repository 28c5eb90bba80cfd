# SPDX-License-Identifier: Apache-2.0
"""What the gestures of the Z-width search tell: shaking from rest, a boundary from both sides, damping on a circle."""

import numpy as np
import pytest

from haptic_device.config.description import load_device
from haptic_device.control import faults
from haptic_device.theory import probe
from haptic_display.device_tools.zwidth import TRIES, LiveDisplay
from haptic_display.device_tools.zwidth_lockstep import DEPTH, PHASES, WALL, LockstepDisplay


def circling(damping=3.0, coulomb=0.02, mass=0.1, every=0.002, radius=0.02):
    """Truth of a hand that takes a device of these figures round the circle."""
    time = np.arange(0.0, probe.CIRCLE, every)
    x, y = probe.circle(time, radius)
    v_x, v_y = np.gradient(x, time), np.gradient(y, time)
    square = v_x**2 + v_y**2
    loss = np.concatenate([[0.0], np.cumsum((damping * square + coulomb * np.sqrt(square))[1:] * every)])
    return probe.GroundTruth(time, x, v_x, v_y, -loss - 0.5 * mass * square)


def test_damping_is_told_from_friction_and_mass_on_a_circle_that_grows_faster():
    for damping in (0.01, 0.15, 3.0):
        assert probe.apparent_damping(circling(damping), 0.0) == pytest.approx(damping, rel=1e-3, abs=1e-5)


def test_truths_that_were_lost_do_not_move_the_damping_and_too_few_are_refused():
    whole = circling()
    kept = np.ones(whole.time.size, bool)
    for lost in (0.7, 1.31, 2.0, 3.2):
        kept &= (whole.time < lost) | (whole.time > lost + 0.05)
    holed = probe.GroundTruth(*(column[kept] for column in whole))
    assert probe.apparent_damping(holed, 0.0) == pytest.approx(3.0, rel=2e-3)
    with pytest.raises(ValueError, match="only 0 tenths of a second of the circle came whole"):
        probe.apparent_damping(probe.GroundTruth(*(column[::20] for column in whole)), 0.0)


def pressed(amplitude, power, decay=0.0):
    """Truth of a pressed handle that oscillates at 40 Hz, dying at this rate [1/s], giving this power [W]."""
    time = np.arange(0.0, probe.GESTURE, 0.002)
    x = -0.02 + amplitude * np.exp(-decay * time) * np.sin(2.0 * np.pi * 40.0 * time)
    still = np.zeros(time.size)
    return probe.GroundTruth(time, x, still, still, power * time)


def test_a_handle_shakes_while_it_keeps_moving_and_giving_energy():
    assert probe.shakes(pressed(1e-4, 1e-4), 0.0, 5e-6)
    assert not probe.shakes(pressed(1e-4, -1e-4), 0.0, 5e-6)
    assert not probe.shakes(pressed(1e-4, 1e-4, decay=1.0), 0.0, 5e-6)
    assert not probe.shakes(pressed(1e-5, 1e-4), 0.0, 5e-6)
    assert probe.shakes(pressed(2e-3, -1e-4, decay=0.2), 0.0, 5e-6)


def test_the_boundary_lies_between_a_quiet_and_a_shaking_wall_two_per_cent_apart_or_one_side_stays_open():
    for begin in (100.0, 1000.0, 5000.0):
        found = probe.find_boundary(lambda stiffness: stiffness > 1234.0, begin, 1e5)
        assert found.quiet <= 1234.0 < found.shaking <= found.quiet * 1.021
    assert probe.find_boundary(lambda stiffness: False, 100.0, 200.0).shaking is None
    assert probe.find_boundary(lambda stiffness: True, 100.0, 200.0).quiet is None


def test_the_twin_feels_the_damper_of_the_device_and_what_cancellation_leaves_of_it():
    twin = LockstepDisplay(load_device("desktop"), 1000.0, 0.0)
    assert twin.turn(0.0) == pytest.approx(3.0, rel=1e-3)
    assert twin.turn(0.95) < 0.1 * 3.0


def test_a_wall_at_95_per_cent_of_the_passive_stiffness_is_quiet_and_one_beyond_the_hands_damping_too_shakes():
    twin = LockstepDisplay(load_device("undamped"), 1000.0, 0.0)
    assert not twin.show(0.95 * 300.0)
    assert twin.show(2.0 * (0.15 + 0.5) * 1000.0)


class Hand:
    """In place of the nodes: after a gesture to some share of the depth, `answer(share)` is whether the handle shakes;
    None: the machine stalled."""

    def __init__(self, answer):
        self._answer, self.truths, self.touched = answer, [said(0.0, 0.0, 0.0)], []

    def watch(self, seconds, aim):
        if seconds != probe.GESTURE:
            return
        self.touched.append(round((WALL - aim(probe.GESTURE)[0]) / DEPTH, 6))
        if (shaking := self._answer(self.touched[-1])) is None:
            raise ValueError("a fault has latched")
        truth, now = pressed(1e-4, 1e-4 if shaking else -1e-4), self.truths[-1]["time"][0]
        self.truths += map(said, now + truth.time, truth.position, truth.energy_given)

    def said(self, entry):
        return faults.name_of(faults.DEVICE_SILENT)

    def look(self):
        """What comes is in `truths` already."""

    set = recover = lambda self, **values: None


def said(time, x, energy_given):
    """A truth as the loopback says it."""
    return {"time": (time, 0.0, 0.0), "x": (x, 0.0, 0.0), "energy_given": (energy_given, 0.0, 0.0)}


def test_a_live_wall_shakes_if_it_does_twice_at_any_depth():
    """Friction calms small oscillations: one touch that stays still shows only its own phase."""
    for shaking in (None, *PHASES):
        hand = Hand(lambda share, shaking=shaking: share == shaking)
        assert LiveDisplay(hand, 0.0, 5e-6).show(1000.0) is (shaking is not None)
        looked = PHASES if shaking is None else (*PHASES[: PHASES.index(shaking) + 1], shaking)
        assert hand.touched == list(looked)


def test_a_live_wall_that_shakes_once_only_stands_still():
    answers = iter([False, True, False, *[False] * len(PHASES)])
    assert not LiveDisplay(Hand(lambda share: next(answers)), 0.0, 5e-6).show(1000.0)


def test_a_touch_during_which_the_machine_stalled_says_nothing_and_is_tried_again():
    for stalls in (0, 1, TRIES - 1):
        answers = iter(([None] * stalls + [True]) * 2)
        assert LiveDisplay(Hand(lambda share, answers=answers: next(answers)), 0.0, 5e-6).show(1000.0)
    with pytest.raises(ValueError, match=f"{TRIES} touches of a wall of 1000 N/m ended as the machine stalled"):
        LiveDisplay(Hand(lambda share: None), 0.0, 5e-6).show(1000.0)
