# SPDX-License-Identifier: Apache-2.0
"""Settings that change under a hand: the force changes by the slew, and what a store gains by it is paid first."""

import itertools

import numpy as np
import pytest
from changing_settings import FORCE, NO_COUPLING, NO_WALL, RATE, WALL, Changing, pressing, stretching
from examples import half, searching, tries

from haptic_device.control import enable_state

METHODS = ("pspm", "direct")
ALONE = [{"late": 0.0005}, {"delay": 0.001}] if searching() else []
TIMES = [{}, *ALONE, {"late": 0.0005, "delay": 0.001}]
HANDS = [500.0, 50.0]
WITH = list(itertools.product(HANDS, TIMES)) if searching() else list(zip(HANDS, TIMES, strict=True))
BOTH = pytest.mark.parametrize("method", METHODS)
SHOWN = 0.0005  # [J] that the account falls by, where a millijoule and more was paid
STIFF = {"damping": 12.0}  # [N s/m]: 5000 N/m at 1 kHz need 10.2 if forces are 1.5 ms late
PAID = {  # what is wished for, one after the other, and what else the start has
    "a wall stiffens tenfold": ([{"wall__stiffness": (5000.0,)}], {}),
    "ten times": ([{"wall__stiffness": (5000.0,)}, {"wall__stiffness": (500.0,)}] * 10, {}),
    "a wall comes nearer by 9 mm": ([{"wall__offsets": (0.009,)}], {}),
    "the limit of the force rises": ([{"force__limit": 15.0}], {"force__limit": 0.5}),
}
STRETCHED = [{"coupling__stiffness": 5000.0}, {"coupling__stiffness": 500.0}]


def changed(system, wishes, each=0.05, after=1.5):
    """The system after these wishes, one after the other, and a while."""
    for wish in wishes:
        system.wish(**wish)
        system.go(each)
    return system.go(after)


def is_paid(system, there=True):
    """Judges slew and energy, and that in the end everything is as wished, or not yet."""
    assert np.max(system.beyond) <= system.slew
    assert max(system.given) <= system.budget and system.forged <= system.budget
    assert system.there == there and system.rows[-1].fault == 0.0


def is_paid_and_shown(system, wishes):
    is_paid(changed(system, wishes))
    assert system.paid > SHOWN


@half("what, method, given", list(PAID), METHODS, WITH)
def test_what_pushes_more_under_a_hand_pushes_no_further_than_is_paid(what, method, given):
    (wishes, start), (hand, times) = PAID[what], given
    is_paid_and_shown(pressing(hand=hand, exchange__method=method, **STIFF | start, **times), wishes)


@half("method, hand, number", METHODS, HANDS, [1, 20])
def test_a_stretched_coupling_that_stiffens_tenfold_is_paid(method, hand, number):
    is_paid_and_shown(stretching(hand, exchange__method=method), (STRETCHED * 10)[:number])


@half("method, times", METHODS, TIMES)
def test_a_wall_that_appears_50_mm_deep_stands_at_the_handle_at_first(method, times):
    system = pressing(hand=50.0, exchange__method=method, **STIFF, **times, **NO_WALL)
    there, begin = system.rows[-1].position[0], len(system.rows)
    system.wish(**WALL | {"wall__offsets": (there + 0.05,)})
    system.go(0.01)
    assert max(row.force_walls[0] for row in system.rows[begin:]) <= 10.0 * system.slew
    is_paid(system.go(1.0))
    assert system.paid > SHOWN


@half("turned, method, times", [(0.6, 0.8), (-1.0, 0.0)], METHODS, TIMES)
def test_a_wall_that_turns_lets_the_hand_in_by_the_slew_before_it_stands_elsewhere(method, turned, times):
    system = pressing(axes=2, exchange__method=method, **STIFF, **times)
    is_paid(changed(system, [{"wall__normals": turned, "wall__offsets": (-0.02,)}]))


@BOTH
def test_a_wall_that_vanishes_lets_go_by_the_slew_and_at_once_no_more_than_that(method):
    system = pressing(exchange__method=method)
    begin = len(system.rows)
    system.wish(**NO_WALL)
    is_paid(system.go(0.1))
    force = np.array([row.force_walls[0] for row in system.rows[begin - 1 :]])
    assert force[0] == pytest.approx(FORCE, rel=1e-2) and force[1] >= force[0] - system.slew
    assert (force[int(FORCE / system.slew) + 2 :] == 0.0).all()


@BOTH
def test_of_two_walls_that_soften_at_once_the_sum_keeps_the_slew(method):
    two = {"wall__normals": (1.0, 0.0, 1.0, 0.0), "wall__offsets": (0.0, 0.0), "wall__damping": (0.0, 0.0)}
    system = pressing(exchange__method=method, **two | {"wall__stiffness": (250.0, 250.0)})
    is_paid(changed(system, [{"wall__stiffness": (0.0, 0.0)}]))


@BOTH
def test_cancellation_that_begins_and_ends_while_the_handle_moves_does_so_by_the_slew(method):
    circle = {"motion__name": "circle", "motion__turns": 20.0, "motion__duration": 6.0}
    system = Changing(circle, axes=2, exchange__method=method, **NO_COUPLING).go(1.0)
    is_paid(changed(system, [{"cancellation__ratio": 0.9}, {"cancellation__ratio": 0.0}] * 5, 0.3, 1.0))


@half("method, comes", METHODS, [True, False])
def test_a_wall_beside_a_moving_handle_changes_cancellation_by_the_slew(method, comes):
    beside = WALL | {"wall__normals": (0.0, 1.0), "wall__offsets": (-0.001,)}
    tap = {"motion__name": "tap", "motion__start": (-0.05, 0.0, 0.0), "motion__target": (0.05, 0.0, 0.0)}
    gains = NO_COUPLING | {"cancellation__ratio": 0.9} | (NO_WALL if comes else beside)
    system = Changing(tap, axes=2, exchange__method=method, **gains).go(0.26)
    assert abs(system.rows[-1].velocity[0]) > 0.4
    is_paid(changed(system, [beside if comes else NO_WALL], 0.1, 0.0))


@BOTH
def test_engaging_while_the_hand_presses_is_paid_where_the_tank_can_and_else_waits(method):
    for depth, waits in ((0.0018, False), (0.02, True)):
        hand = {"motion__name": "hold", "motion__start": (-depth, 0.0, 0.0), "motion__target": (-depth, 0.0, 0.0)}
        system = Changing(hand, exchange__method=method, engage__force=100.0 if waits else 1.0, **NO_COUPLING | WALL)
        is_paid(system.go(0.5), there=not waits)
        assert system.paid > 0.25 * SHOWN


@BOTH
def test_while_no_force_is_on_everything_counts_at_once(method):
    system = pressing(axes=2, exchange__method=method)
    system.command = 0
    system.go(1.0 / RATE)
    two = {"wall__normals": (0.6, 0.8, 0.0, 1.0), "wall__offsets": (0.05, -0.02), "wall__damping": (0.1, 0.2)}
    gains = {"coupling__stiffness": 700.0, "coupling__damping": 0.1, "cancellation__ratio": 0.1, "force__limit": 7.0}
    system.wish(**two, wall__stiffness=(300.0, 400.0), **gains)
    assert system.go(1.0 / RATE).there and not system.rows[-1].force_on_handle.any()


def random_change(dice):
    """Parameters that change, or the word of the clutch."""
    kind = dice.integers(0, 6)
    if kind == 0:
        return {"cancellation__ratio": float(dice.choice([0.0, 0.1, 0.2]))}
    if kind == 1:
        return {"force__limit": float(dice.choice([0.5, 3.0, 15.0]))}
    if kind in (2, 3):
        return enable_state.ENABLE | (enable_state.CLUTCH if kind == 2 else 0)
    if kind == 5:
        return {"coupling__stiffness": float(dice.choice([0.0, 300.0, 800.0])), "coupling__damping": 0.1}
    count = dice.integers(0, 4)
    angles = dice.uniform(0.0, 2.0 * np.pi, count)
    return {
        "wall__normals": tuple(np.ravel([np.cos(angles), np.sin(angles)], order="F").tolist()),
        "wall__offsets": tuple(dice.uniform(-0.02, 0.03, count).tolist()),
        "wall__stiffness": tuple(dice.choice([0.0, 300.0, 800.0], count).tolist()),
        "wall__damping": tuple(dice.choice([0.0, 0.1, 0.3], count).tolist()),
    }


@half("method, times", METHODS, TIMES)
def test_many_changes_of_walls_gains_cancellation_limit_and_clutch_under_a_hand_keep_slew_and_budget(method, times):
    dice, done = np.random.default_rng(len(method)), 0
    hand = {"motion__name": "circle", "motion__radius": 0.015, "motion__turns": 40.0, "motion__duration": 16.0}
    hand["hand__stiffness"] = dice.choice([100.0, 500.0, 2000.0])
    own = {"exchange__method": method, "fault__saturation": 60.0, "engage__force": 100.0}
    system = Changing(hand, 0.0, axes=2, damping=5.0, **times, **own, **NO_COUPLING).go(0.1)
    while done < tries(40):
        change = random_change(dice)
        if isinstance(change, int):
            system.command = change
        elif min(system.settings_by(**change)["passivity"]["margin"][0, :2]) <= 0.0:
            continue  # the driver would refuse it
        else:
            system.wish(**change)
        system.go(dice.uniform(0.02, 0.08))
        done += 1
    assert system.rows[-1].fault == 0.0
    assert max(system.given) <= system.budget and system.forged <= system.budget
    assert np.max(system.beyond) <= system.slew


@pytest.mark.parametrize("times", [{"late": 0.0005}, {"delay": 0.001}])
def test_a_wall_stiffens_under_a_resting_hand_on_a_device_of_one_axis_where_the_tank_can_pay_it(times):
    """From 500 to 560 N/m, 6 mm deep: 1.1 mJ, and what is late; an axis that is not there has no price."""
    system = pressing(axes=1, exchange__method="pspm", **STIFF, **times)
    system.wish(wall__stiffness=(560.0,))
    assert system.go(0.5).there and system.rows[-1].exchange_tank > 0.0


@BOTH
def test_an_axis_that_may_not_turn_holds_up_no_change(method):
    """force.limit_rotational 0: its gains change at once, and those of the others as they are paid."""
    still = {"force__limit_rotational": 0.0, "coupling__rotational_stiffness": 2.0, "exchange__method": method}
    system = stretching(stretch=0.002, axes=3, **still)
    for turning, pulling in ((0.5, 600.0), (1.5, 500.0)):
        system.wish(coupling__rotational_stiffness=turning, coupling__stiffness=pulling)
        assert system.go(0.5).there
    assert max(row.engage for row in system.rows) == 1.0 and system.rows[-1].fault == 0.0
