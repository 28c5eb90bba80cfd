# SPDX-License-Identifier: Apache-2.0
"""When the driver looks for an answer: hardly later than it comes, and few times, whatever the round trip becomes."""

import numpy as np
import pytest

from haptic_device.realtime.answer_looks import LOOK, PART, POLL, SHARE, STEP, first_after, next_look

US = 1000
SENT = 10**15
MANY = 4000  # answers after which the times are where they rest


def test_an_answer_is_looked_for_when_it_can_be_there_then_often_and_the_seldomer_the_longer_it_is_due():
    due = SENT + 200 * US
    for now in (SENT, SENT + 199 * US):
        assert next_look(now, SENT, 200 * US, True) == due
    gaps = [next_look(due + late * US, SENT, 200 * US, True) - due - late * US for late in (0, 8, 80, 720, 800, 5000)]
    assert gaps == [LOOK, LOOK + US, LOOK + 10 * US, POLL, POLL, POLL]
    assert next_look(SENT, SENT, 200 * US, False) == SENT + POLL  # where none comes in time


class Looks:
    """The law in a closed loop, by a clock that stands still but for the looks."""

    def __init__(self):
        self.first = 0

    def find(self, trip):
        """(looks it took, time [ns] that the answer waited) of an answer that comes `trip` [ns] after its sample."""
        now, looks, before = SENT, 0, SENT
        while now < SENT + trip:
            before, now, looks = now, next_look(now, SENT, self.first, True), looks + 1
        self.first = first_after(self.first, before < SENT + self.first)
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


def found_in_a_few(looks, about):
    """Whether answers wait for no more than a look, and it takes a few: as many as their spread has, and some."""
    count, waited = looks.median(trips(about))
    return waited <= LOOK and count <= 6


def test_answers_that_come_earlier_than_ever_are_found_as_those_before_when_the_steps_have_taken_it_there(looks):
    looks.median(trips(100, 2 * 200 * US // ((SHARE - 1) * STEP)))
    assert found_in_a_few(looks, 100)


def test_answers_that_come_later_than_ever_wait_for_a_part_of_that_and_soon_for_no_more_than_any(looks):
    _, waited = looks.find(500 * US)
    assert waited <= LOOK + 220 * US // PART
    looks.median(trips(500, 2 * 200 * US // STEP))
    assert found_in_a_few(looks, 500)
