# SPDX-License-Identifier: Apache-2.0
"""Contacts with friction on one body in one tick: closed forms, the conditions themselves, what has no answer."""

import numpy as np
import pytest

from haptic_device.control import contact_solver as law
from haptic_device.jit import kernel

solve = kernel(law.solve.py_func)  # kept in the cache
MOST = law.EXACT + law.BRAKED
SOFT = 0.016  # [1/kg] of 1e-9 m/N at 4 kHz


def contact(normal, arm, gap_rate, friction=0.0, soft=SOFT):
    """A row: normal and arm (x, y), rate of the gap that there is already [m/s]."""
    row, (nx, ny), (ax, ay) = np.zeros(law.COLUMNS), normal, arm
    row[law.N_X : law.N_TURN + 1] = nx, ny, ax * ny - ay * nx
    row[law.T_X : law.T_TURN + 1] = -ny, nx, ax * nx + ay * ny
    row[law.B_N], row[law.E_N], row[law.E_T], row[law.MU] = gap_rate, soft, 1e-3 * soft, friction
    return row


def solved(mass, velocity, *contacts):
    rows, found = np.array(contacts), np.zeros(3)
    mass = np.array(mass, float)
    turns = solve(rows, mass, mass * velocity, np.zeros((3, 4)), found, MOST)
    return turns, found, rows


def test_a_body_that_falls_on_a_floor_stops_but_for_the_compliance_and_a_lifted_one_goes_on():
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.3, -1.0, 0.0), contact((0, 1), (0, 0), 0.0))
    force = 1.0 / (1.0 / 0.1 + SOFT)
    assert turns == 2 and rows[0, law.IMPULSE] == pytest.approx(force, rel=1e-12)
    np.testing.assert_allclose(velocity, (0.3, -SOFT * force, 0.0), atol=1e-12)
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.3, 1.0, 0.0), contact((0, 1), (0, 0), 0.0))
    assert turns == 1 and rows[0, law.IMPULSE] == 0.0 and velocity[1] == 1.0


@pytest.mark.parametrize("friction, sticks", [(0.29, False), (0.31, True)])
def test_it_sticks_just_above_the_friction_that_stops_it_and_slides_just_below(friction, sticks):
    _, velocity, rows = solved((0.1, 0.1, 1e9), (0.3, -1.0, 0.0), contact((0, 1), (0, 0), 0.0, friction, 1e-6))
    if sticks:
        assert abs(velocity[0]) < 1e-6
    else:
        assert velocity[0] == pytest.approx(0.3 - friction, rel=1e-4)
        assert rows[0, law.SLIP_IMPULSE] == pytest.approx(friction * rows[0, law.IMPULSE])  # against the slip


def test_a_wedge_of_two_planes_holds_in_every_direction_they_face():
    planes = contact((0.6, 0.8), (0, 0), 0.0, soft=1e-6), contact((-0.6, 0.8), (0, 0), 0.0, soft=1e-6)
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.0, -1.0, 0.0), *planes)
    assert turns <= 3 and np.abs(velocity).max() < 1e-6
    assert rows[0, law.IMPULSE] == pytest.approx(0.1 / 1.6, rel=1e-4) == rows[1, law.IMPULSE]


def test_a_peg_between_both_flanks_is_held_by_three_or_four_corners_alike():
    flanks = [contact((s, 0), (-0.01 * s, y), 0.0, 0.2) for s in (1, -1) for y in (-0.02, 0.02)]
    turns, velocity, rows = solved((0.1, 0.1, 1e-5), (0.0, 0.0, 2.0), *flanks)
    assert 0 < turns <= law.EXACT and abs(velocity[2]) < 0.2
    assert (rows[:, law.IMPULSE] >= 0.0).all() and (rows[:, law.IMPULSE] > 0.0).sum() == 2


def random_contacts(random, count):
    for _ in range(count):
        angle, arm = random.uniform(0, 2 * np.pi), random.uniform(-0.03, 0.03, 2)
        normal = np.cos(angle), np.sin(angle)
        yield contact(normal, arm, random.uniform(-0.02, 0.1), random.choice([0.0, 0.2, 0.6]))


def violation(mass, given, velocity, rows):
    """Largest violation of the complementarity conditions and of the balance of momentum, relative."""
    pushed, worst = np.zeros(3), 0.0
    for row in rows:
        normal, slip = row[: law.T_X], row[law.T_X : law.B_N]
        impulse, along = row[law.IMPULSE], row[law.SLIP_IMPULSE]
        rate = normal @ velocity + row[law.B_N] + row[law.E_N] * impulse
        sliding = slip @ velocity + row[law.B_T] + row[law.E_T] * along
        bound = row[law.MU] * impulse
        worst = max(worst, -impulse, -rate, min(impulse, abs(rate)), abs(along) - bound)
        if abs(along) < bound * (1 - 1e-9):
            worst = max(worst, abs(sliding))
        elif bound > 0.0:
            worst = max(worst, sliding * np.sign(along) - row[law.E_T] * bound)
        pushed += normal * impulse + slip * along
    return max(worst, np.abs((mass * velocity - mass * given - pushed) / mass).max())


def test_what_is_found_exactly_fulfils_the_conditions_of_contact():
    random, mass, exact = np.random.default_rng(1), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(200):
        given = random.normal(size=3) * (0.3, 0.3, 10.0)
        turns, velocity, rows = solved(mass, given, *random_contacts(random, 4))
        if turns <= law.EXACT:
            exact += 1
            assert violation(mass, given, velocity, rows) < 1e-6
    assert exact > 130


def test_an_answer_is_nearly_always_found_and_takes_energy_from_contacts_that_do_not_move():
    random, mass, none = np.random.default_rng(3), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(100):
        given, contacts = random.normal(size=3) * (0.3, 0.3, 10.0), list(random_contacts(random, 6))
        for row in contacts:
            row[law.B_N] = abs(row[law.B_N])
            row[law.BOUND] = row[law.MU] * random.uniform(0.0, 0.05)
        turns, velocity, rows = solved(mass, given, *contacts)
        none += turns < 0
        assert turns <= law.EXACT + law.BRAKED
        assert turns < 0 or mass @ velocity**2 <= mass @ given**2 * (1.0 + 1e-9)
    assert none < 10  # for which the tool stays where it is


def test_warm_started_with_its_own_answer_one_solution_is_enough():
    random, mass, found = np.random.default_rng(2), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(50):
        given = random.normal(size=3) * (0.3, 0.3, 10.0)
        turns, velocity, rows = solved(mass, given, *random_contacts(random, 4))
        if turns <= law.EXACT:
            found += 1
            assert solve(rows, mass, mass * given, np.zeros((3, 4)), velocity, MOST) == 1
    assert found > 20


@pytest.mark.parametrize("most", [1, 5, 20])
def test_it_takes_no_more_solutions_than_it_may_and_says_where_that_was_too_few(most):
    random, mass, found = np.random.default_rng(4), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(100):
        given, rows = random.normal(size=3) * (0.3, 0.3, 10.0), np.array(list(random_contacts(random, 6)))
        turns = solve(rows, mass, mass * given, np.zeros((3, 4)), np.zeros(3), most)
        assert turns == -1 or 0 < turns <= most
        found += turns > 0
    assert 0 < found < 100
