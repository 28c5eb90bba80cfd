# SPDX-License-Identifier: Apache-2.0
"""The device's clock from answers: exact without jitter, right to µs with it, and a step is found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.link import clock_fit

MS, SECOND = 1_000_000, 1_000_000_000
BEGIN = 5000 * SECOND  # of the host's clock


class Clock:
    """A device's clock, and answers of it by ways that take `there` and `back` [ns]."""

    def __init__(self, ahead=0, skew=0.0):
        self.ahead, self.skew, self.fit = ahead, skew, np.zeros(clock_fit.WORDS, np.int64)

    def at(self, host):
        return host + self.ahead + round(self.skew * (host - BEGIN))

    def ask(self, host, there, back, thinks=2000):
        came = host + there
        return clock_fit.answer(self.fit, host, self.at(came), self.at(came + thinks), came + thinks + back)

    def answers(self, questions, there, back):
        """What becomes of answers to questions at these times."""
        return [self.ask(host, there, back) for host in questions]

    def error(self, host):
        return clock_fit.error(self.fit, host)

    def wrong_by(self, host):
        return abs(clock_fit.to_device(self.fit, host) - self.at(host))


def questions(seconds, first=BEGIN):
    """Times of the host at which the link asks."""
    fast = [first + i * 10 * MS for i in range(10)]
    return fast + list(range(first + 100 * MS, first + int(seconds * SECOND), 20 * MS))


def jittering(seed):
    """Ways that take together 65 µs at the median and 300 µs at 99 %."""
    random = np.random.default_rng(seed)
    return lambda: int(20_000 + 9000 * np.exp(1.3 * random.standard_normal()))


@pytest.mark.parametrize(
    "ahead, skew",
    [(0, 0.0), (-3 * SECOND, 30e-6), (10**18, -200e-6), (-(10**18), 200e-6), (7, 500e-6), (7, -1e-3), (0, 1e-3)],
)
def test_equal_ways_give_offset_and_skew(ahead, skew):
    clock = Clock(ahead, skew)
    assert set(clock.answers(questions(3.0), 30_000, 30_000)) == {clock_fit.TAKEN}
    now = BEGIN + 3 * SECOND
    assert clock.wrong_by(now) <= 200
    assert clock_fit.skew(clock.fit) == pytest.approx(skew, abs=0.1e-6)
    assert clock.error(now) <= 35_000


@pytest.mark.parametrize("seed", range(3))
def test_jitter_leaves_less_than_ten_microseconds_in_99_of_100(seed):
    clock, way = Clock(7 * SECOND, 30e-6), jittering(seed)
    wrong = []
    for host in questions(12.0):
        clock.ask(host, way(), way())
        now = [clock.wrong_by(host + ahead) for ahead in (0, 10 * MS, 20 * MS)]
        wrong += now if host > BEGIN + 2 * SECOND else []
        assert not clock_fit.known(clock.fit) or max(now) <= clock.error(host + 25 * MS)
    assert np.percentile(wrong, 99) <= 10_000


def test_a_line_that_has_become_slower_is_taken_in_the_end():
    clock = Clock(0, 30e-6)
    clock.answers(questions(2.0), 30_000, 30_000)
    later = questions(6.0, BEGIN + 2 * SECOND)
    took = clock.answers(later, 300_000, 300_000)
    assert took[0] == clock_fit.LEFT_OUT and took[-1] == clock_fit.TAKEN
    assert clock.wrong_by(later[-1]) <= 1000


@pytest.mark.parametrize("step", [200_000, -200_000, 10**9, -(10**15)])
def test_a_step_is_found_within_a_few_answers_and_counted_once(step):
    clock, way = Clock(10**12, 30e-6), jittering(1)
    times = questions(5.0)
    for host in times:
        clock.ask(host, way(), way())
    assert clock.fit[clock_fit.STEPS] == 0
    clock.ahead += step
    found = None
    for i in range(1, 61):
        host = times[-1] + i * 20 * MS
        assert clock_fit.known(clock.fit)
        clock.ask(host, way(), way())
        if clock.fit[clock_fit.STEPS] and found is None:
            found = i
            assert clock.wrong_by(host) <= 25_000
    assert clock_fit.ENOUGH <= found < 3 * clock_fit.ENOUGH
    assert clock.fit[clock_fit.STEPS] == 1 and clock.wrong_by(host) <= 10_000


def test_while_answers_contradict_the_fit_the_error_says_by_how_much():
    clock = Clock()
    clock.answers(questions(1.0), 30_000, 30_000)
    now = BEGIN + SECOND
    assert clock.error(now) < 50_000
    clock.ahead += 200_000
    clock.ask(now, 30_000, 30_000)
    assert clock.error(now) == pytest.approx(230_000, abs=1000)


def test_what_was_long_ago_is_forgotten():
    clock = Clock()
    clock.answers(questions(5.0), 10_000, 50_000)
    clock.ahead, clock.skew = -round(20e-6 * 5 * SECOND), 20e-6  # warmer from here on
    clock.answers(questions(12.0, BEGIN + 5 * SECOND), 30_000, 30_000)
    assert clock.wrong_by(BEGIN + 17 * SECOND) <= 1000
    assert clock_fit.skew(clock.fit) == pytest.approx(20e-6, abs=0.3e-6)
    assert clock.error(BEGIN + 17 * SECOND) <= 34_000  # half of the least round trip, and little more


def test_a_fit_needs_enough_answers():
    clock = Clock()
    for i, host in enumerate(questions(0.2)[: clock_fit.ENOUGH]):
        assert not clock_fit.known(clock.fit), i
        clock.ask(host, 30_000, 30_000)
    assert clock_fit.known(clock.fit)


def test_answers_that_cannot_be_are_refused():
    fit = np.zeros(clock_fit.WORDS, np.int64)
    least, most = -clock_fit.FARTHEST, clock_fit.FARTHEST
    assert clock_fit.answer(fit, 0, 500, 600, 99) == clock_fit.REFUSED  # it thought for longer than it took
    assert clock_fit.answer(fit, 0, 600, 500, 1000) == clock_fit.REFUSED
    for t2, t3 in ((least, least + 1), (most - 1, most), (-(2**63), 2**63 - 1), (2**63 - 1, 2**63 - 1)):
        assert clock_fit.answer(fit, 0, t2, t3, 1000) == clock_fit.REFUSED
    assert not fit.any()
    assert clock_fit.answer(fit, 0, 500, 600, 100) == clock_fit.TAKEN
    for far in (least + 1, most - 1):
        clock_fit.restart(fit)
        assert clock_fit.answer(fit, 0, far, far, 100) == clock_fit.TAKEN


@given(
    st.integers(-(10**18), 10**18),
    st.floats(-200e-6, 200e-6),
    st.lists(st.integers(10_000, 10**6), min_size=10, max_size=40),
    st.integers(-SECOND, SECOND),
)
def test_both_ways_are_inverse(ahead, skew, ways, away):
    clock = Clock(ahead, skew)
    for i, way in enumerate(ways):
        clock.ask(BEGIN + i * 20 * MS, way, ways[-i])
    host = BEGIN + away
    assert abs(clock_fit.to_host(clock.fit, clock_fit.to_device(clock.fit, host)) - host) <= 1


DELAYS = st.tuples(st.integers(5_000, 800_000), st.integers(5_000, 800_000), st.integers(1, 60 * MS))
STEPS = st.just(0) | st.integers(-300_000, 300_000) | st.integers(-SECOND, SECOND)


@given(st.floats(-0.05, 0.05), st.lists(st.tuples(DELAYS, st.integers(0, 9), STEPS), min_size=5, max_size=60))
def test_the_error_is_never_less_than_the_truth_when_an_answer_has_come_and_without_steps_not_until_the_next(
    skew, said
):
    clock, host, stepped = Clock(10**12, skew), BEGIN, False
    for (there, back, pause), dice, step in said:
        if dice == 0:
            clock.ahead, stepped = clock.ahead + step, True
        clock.ask(host, there, back)
        now = host + there + 2000 + back
        host = now + pause
        if clock_fit.known(clock.fit):
            assert clock.wrong_by(now) <= clock.error(now)
            assert stepped or clock.wrong_by(host) <= clock_fit.steady_error(clock.fit, host) <= clock.error(host)


@given(st.floats(-1e-3, 1e-3), st.integers(0, 2**32 - 1))
def test_a_clock_within_a_thousandth_is_fine_whatever_the_jitter_that_is_borne(skew, seed):
    random, clock = np.random.default_rng(seed), Clock(-(10**12), skew)
    for host in questions(3.0):
        clock.ask(host, *random.integers(10_000, 450_000, 2))
        assert clock_fit.trouble(clock.fit) == clock_fit.FINE
    assert clock.fit[clock_fit.STEPS] == 0


@pytest.mark.parametrize("skew", [1.1e-3, -1.1e-3, 0.01, -0.01, 1.0, -0.999])
def test_a_clock_that_drifts_more_is_told_with_its_skew_and_never_as_a_step(skew):
    clock, way = Clock(10**12, skew), jittering(3)
    for host in questions(3.0):
        clock.ask(host, way(), way(), thinks=0)
    assert clock_fit.trouble(clock.fit) == clock_fit.DRIFT
    assert clock_fit.skew(clock.fit) == pytest.approx(skew, rel=0.02)
    assert clock.fit[clock_fit.STEPS] == 0


@pytest.mark.parametrize("step, trouble", [(90_000, clock_fit.FINE), (300_000, clock_fit.STEP)])
def test_a_step_is_a_trouble_from_the_first_answer_on_until_it_is_followed(step, trouble):
    clock = Clock(0, 300e-6)
    clock.answers(questions(2.0), 30_000, 30_000)
    clock.ahead -= step
    for i in range(5):
        assert clock_fit.trouble(clock.fit) == (trouble if i else clock_fit.FINE)
        clock.ask(BEGIN + 2 * SECOND + i * 10 * MS, 30_000, 30_000)
    assert clock_fit.trouble(clock.fit) == clock_fit.FINE
    assert clock.fit[clock_fit.STEPS] == 1 and clock.fit[clock_fit.STEPPED] == pytest.approx(-step, abs=31_000)


@pytest.mark.parametrize("half, trouble", [(400_000, clock_fit.FINE), (600_000, clock_fit.JITTER)])
def test_answers_that_tell_the_clock_to_half_a_millisecond_are_borne_and_to_more_not(half, trouble):
    clock = Clock()
    clock.answers(questions(2.0), half, half)
    assert clock_fit.trouble(clock.fit) == trouble
