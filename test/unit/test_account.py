# SPDX-License-Identifier: Apache-2.0
"""The account of energy: searches on the servo's own tick, its condition, and what it costs those who use it."""

import numpy as np
import pytest
from examples import tries

from adversary import account_search
from haptic_device.control import passivity
from haptic_device.control.records import STATE, TICK
from haptic_device.theory.delay import largest_passive_stiffness, wall_damping_needed

NOTHING = 1e-9  # [J] that a force gives in the rounding of times
FINE, CLEAR = 2e-5, 1e-6  # [J] a small budget, and a leak that is one
LATENESS = pytest.mark.parametrize("least, most", account_search.LATENESS)


@LATENESS
def test_whatever_hand_tool_settings_and_lateness_do_what_is_given_stored_promised_and_left_never_grows(least, most):
    for seed, over, budget in ((1, 1.0, FINE), (2, 3.0, 5e-3)):
        (given, held, owed, grown), *_ = account_search.attack(seed, least, most, over, budget, 1, 2, tries(250))
        assert given < 0.0 and max(held, owed, grown) <= NOTHING


@LATENESS
def test_nor_is_more_given_by_missed_late_or_old_samples_or_stops_on_a_coarse_encoder(least, most):
    more = {"step": 5e-6, "events": 0.05, "cancel": True}
    (_, held, *_), *_ = account_search.attack(3, least, most, 1.3, 5e-3, 1, 2, tries(250), **more)
    assert held <= NOTHING


@pytest.mark.parametrize("step", (2e-6, 5e-6, 10e-6))
def test_friction_that_covers_the_encoders_step_leaves_nothing_for_changes_to_hide(step):
    for least, most in ((0.0, 0.0), (4.0, 4.0), (0.0, 1.0)):
        (given, held, *_), *_ = account_search.attack(4, least, most, 1.0, FINE, 1, 2, tries(250), step=step)
        assert given < 0.0 and held <= NOTHING


def test_stamps_with_an_error_hide_nothing_either():
    for least, most in ((0.0, 0.0), (0.5, 0.5), (0.0, 1.0)):
        (given, held, *_), *_ = account_search.attack(5, least, most, 1.3, FINE, 1, 2, tries(250), unsure=0.1)
        assert given < 0.0 and held <= NOTHING


@pytest.mark.parametrize(
    "late, over, wrong",
    ((0.0, 1.0, {"damping": 0.7}), (1.0, 1.0, {"damping": 0.7}), (1.0, 1.3, {"step": 5e-6, "blind": True})),
)
def test_the_same_search_leaks_where_the_device_has_less_damping_than_told_or_a_coarser_encoder(late, over, wrong):
    (_, held, *_), *_ = account_search.attack(8, late, late, over, FINE, 1, 6, 2500, **wrong)
    assert held > CLEAR


def test_without_the_promise_of_what_is_on_its_way_the_account_is_overdrawn():
    (*_, owed, _), *_ = account_search.attack(7, 1.25, 1.25, 1.0, FINE, 2, 4, 2500, forget=True)
    assert owed > CLEAR


def test_the_condition_is_the_exact_one_of_a_late_spring_within_a_hundredth_and_never_below_it():
    for late in np.linspace(0.0, 4.0, 33):
        need, exact = passivity.least_damping(1.0, 0.0, 1.0, late, late), wall_damping_needed(1.0, 0.0, 1.0, 0.0, late)
        assert exact.damping * (1.0 - 1e-9) <= need <= 1.013 * exact.damping


@pytest.mark.parametrize("b, damping", ((3.0, 0.0), (3.0, 0.5), (2.5, 2.0)))
def test_a_constant_lateness_allows_no_more_than_a_wall_may_have_and_more_than_one_that_varies(b, damping):
    for late in (0.25, 0.5, 1.0, 4.0):
        constant, varied = (
            passivity.largest_stiffness(b, damping, 1e-3, 1e-3 * late, least) for least in (1e-3 * late, 0.0)
        )
        assert varied <= constant <= largest_passive_stiffness(b, damping, 1e-3, 0.0, late) * (1.0 + 1e-9)


@pytest.mark.parametrize("speed, least", ((0.02, 0.6), (0.05, 0.8), (0.1, 0.88)))
def test_a_hand_that_moves_fills_the_account_by_what_the_device_dissipates_beyond_the_need(speed, least):
    """As far as an encoder step of 5 µm lets it be seen."""
    step, ticks = 5e-6, account_search.TICKS
    choices = account_search.settings_for(1, 0.0, 0.0, 1.0, 1.0, step, walls=0)
    choices["coupling"]["stiffness"], choices["coupling"]["damping"] = (2000.0, 0.0, 0.0), 0.0
    choices["hardware"]["damping"] = choices["port"]["damping"] = (1.25, 1.0, 1.0)  # twice K T/2 + 1 along x
    choices["hardware"]["damping"][:, 0] = choices["port"]["damping"][:, 0] = 2000.0 * 250e-6 / 2.0 + 1.0
    path, state = np.zeros(1, account_search.PATH).view(np.recarray), np.zeros(1, STATE).view(np.recarray)
    path.velocity[0, :, 0] = speed
    out, seen, row = np.zeros(5), np.zeros((ticks, 4)), np.zeros(1, TICK).view(np.recarray)
    choices = choices[:1].repeat(account_search.CHOICES).view(np.recarray)
    account_search.run(choices, path[0], state, row, np.zeros(3), np.array((step, 0.0, 0.0)), 0.0, 1.0, out, seen)
    credited, lost = seen[-1, 2] - seen[6, 2], 1.0 * speed**2 * 250e-6 * (ticks - 7)
    assert least * lost < credited < lost
