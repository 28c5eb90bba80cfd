# SPDX-License-Identifier: Apache-2.0
"""Stamps are times of one clock plus one offset: they never go back, and come back to a system clock that was set."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.realtime import session_clock
from haptic_device.realtime.session_clock import STEP, TOLERATED, SessionClock

SHORTEST_TICK = 100_000  # [ns] at 10 kHz


class Clocks:
    """Both clocks as the test sets them [ns]; the system clock's reading comes `held_up` later than asked for."""

    def __init__(self, patch):
        self.now, self.ahead, self.held_up = 10**12, 10**18, 0
        patch.setattr(session_clock.time, "monotonic_ns", lambda: self.now)
        patch.setattr(session_clock.time, "time_ns", self._system)

    def _system(self):
        self.now += self.held_up
        return self.now + self.ahead


@pytest.fixture
def clocks(monkeypatch):
    return Clocks(monkeypatch)


def test_a_thread_that_is_held_up_between_the_clocks_does_not_falsify_the_offset(clocks, monkeypatch):
    delays = iter((7_000_000, 0, 5_000_000, 0, 9_000_000))
    system = session_clock.time.time_ns

    def held_up():
        clocks.held_up = next(delays)
        return system()

    monkeypatch.setattr(session_clock.time, "time_ns", held_up)
    assert session_clock.difference() == clocks.ahead


@given(st.integers(-(10**10), 10**10), st.lists(st.integers(0, 10**9), min_size=1, max_size=50))
def test_stamps_never_go_back_nor_meet_whatever_the_system_clock_is_set_to(step, waits):
    with pytest.MonkeyPatch.context() as patch:
        clocks = Clocks(patch)
        clock = SessionClock()
        clocks.ahead += step
        last = clock.stamp(clocks.now)
        for wait in waits:
            clock.follow()
            assert clock.stamp(clocks.now + SHORTEST_TICK) > last
            clocks.now += wait + SHORTEST_TICK
            last = clock.stamp(clocks.now)


def test_a_clock_that_was_set_beyond_tolerance_is_reached_again_and_not_overshot(clocks):
    clock = SessionClock()
    before = clock.offset
    clocks.ahead += TOLERATED
    assert clock.follow() == before
    clocks.ahead += 20 * STEP
    for _ in range(100):
        clocks.now += 10**9
        clock.follow()
    assert before < clock.offset and 0 <= clocks.ahead - clock.offset <= TOLERATED
