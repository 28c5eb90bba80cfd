# SPDX-License-Identifier: Apache-2.0
"""When the driver looks for an answer: hardly later than it comes, and few times, whatever the round trip becomes."""

import numpy as np
import pytest

from haptic_device.realtime.answer_looks import (
    LOOK,
    POLL,
    SHARE,
    STEP,
    WINDOW,
    first_after,
    last_after,
    next_look,
)

US = 1000
SENT = 10**15
MANY = 4000  # answers after which the times are where they rest


def test_before_an_answer_can_be_there_the_next_look_is_when_it_can():
    for now in (SENT, SENT + 199 * US):
        assert next_look(now, SENT, 200 * US, 260 * US, True) == SENT + 200 * US


@pytest.mark.parametrize("now", [SENT + 200 * US, SENT + 260 * US])
def test_while_it_is_due_it_is_looked_for_often(now):
    assert next_look(now, SENT, 200 * US, 260 * US, True) == now + LOOK


def test_overdue_it_is_looked_for_the_seldomer_the_longer_and_never_more_seldom_than_while_it_may_come_at_any_time():
    overdue = np.array([4, 40, 200, 400, 5000]) * US
    gaps = [
        next_look(SENT + 260 * US + late, SENT, 200 * US, 260 * US, True) - SENT - 260 * US - late for late in overdue
    ]
    assert gaps == [LOOK + US, LOOK + 10 * US, LOOK + 50 * US, POLL, POLL]


def test_what_varies_by_much_is_looked_for_often_for_a_while_only():
    end = SENT + 200 * US + WINDOW
    assert next_look(end, SENT, 200 * US, 900 * US, True) == end + LOOK
    assert next_look(end + 400 * US, SENT, 200 * US, 900 * US, True) == end + 400 * US + POLL


def test_where_no_answer_comes_in_time_it_is_looked_for_seldom_from_the_beginning():
    assert next_look(SENT, SENT, 200 * US, 260 * US, False) == SENT + POLL


class Looks:
    """The law in a closed loop, by a clock that stands still but for the looks."""

    def __init__(self):
        self.first = self.last = 0

    def find(self, trip):
        """(looks it took, time [ns] that the answer waited) of an answer that comes `trip` [ns] after its sample."""
        now, looks, before = SENT, 0, SENT
        while now < SENT + trip:
            before, now, looks = now, next_look(now, SENT, self.first, self.last, True), looks + 1
        self.first = first_after(self.first, before < SENT + self.first)
        self.last = last_after(self.last, now - SENT)
        return looks, now - SENT - trip

    def median(self, trips):
        """Medians of both over these answers."""
        return np.median([self.find(int(trip)) for trip in trips], axis=0)


def trips(about, count=MANY):
    """So many round trips [ns], within 20 us of `about` [us]."""
    return np.random.default_rng(0).uniform(about - 20, about + 20, count) * US


@pytest.fixture
def looks():
    looks = Looks()
    looks.median(trips(300))
    return looks


def test_at_rest_an_answer_waits_for_less_than_a_look_and_takes_a_few(looks):
    count, waited = looks.median(trips(300))
    assert waited <= LOOK and count <= 40 * US // LOOK + 2


def test_of_some_answers_one_is_there_at_the_first_look_and_one_comes_after_the_last(looks):
    few = trips(300)
    firsts, lasts = [], []
    for trip in few:
        firsts.append(trip <= looks.first)
        lasts.append(trip > looks.last)
        looks.find(int(trip))
    assert np.mean(firsts) == pytest.approx(1 / SHARE, rel=0.5)
    assert np.mean(lasts) <= 1.5 / SHARE


def test_answers_that_come_earlier_than_ever_are_found_as_soon_as_any_within_as_many_as_the_steps_take(looks):
    looks.median(trips(100, 2 * 200 * US // ((SHARE - 1) * STEP)))
    count, waited = looks.median(trips(100))
    assert waited <= LOOK and count <= 40 * US // LOOK + 2


def test_answers_that_come_later_than_ever_wait_for_a_part_of_their_lateness_and_soon_for_no_more_than_any(looks):
    _, waited = looks.find(500 * US)
    assert waited <= LOOK + 220 * US // 4
    looks.median(trips(500, 2 * 200 * US // STEP))
    count, waited = looks.median(trips(500))
    assert waited <= LOOK and count <= 40 * US // LOOK + 2
