# SPDX-License-Identifier: Apache-2.0
"""What a world makes up in one answer: what fits into the exchange's period, whatever it takes and whoever was late."""

import math

import pytest
from handle_samples import MS, handle
from made_up_clock import Clock
from slow_method import Slow

from haptic_sim.exchange import endpoint, left_out_time
from haptic_sim.exchange.endpoint import MEDIAN, SILENCE_NS, ExchangeEndpoint, Pace
from haptic_sim.exchange.left_out_time import NOTICED, SHARE, left_out_sentence
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.method_registry import METHODS, Entry
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load, parse

SCENE = {"name": "slow", "method": "slow", "tool": {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}}
GAINS = (2000.0, 2.0, 2.0, 0.002)
STEP = MS // 4  # [ns] sub-step


def sample(time_ns, x=0.0):
    return HandleSample(time_ns, (x, 0.0, 0.0), (0.0, 0.0, 0.0), *GAINS)


@pytest.mark.parametrize(("most", "made", "waited"), [(None, 20, 0), (20, 20, 0), (19, 19, STEP), (1, 1, 19 * STEP)])
def test_a_world_makes_at_most_so_many_sub_steps_and_says_how_long_it_waited_for_the_rest(most, made, waited):
    simulation = Simulation(reduce_scene(load("free_space")))
    simulation.exchange(sample(0))
    simulation.exchange(sample(5 * MS + 100_000, 0.01), most)
    rest = 100_000 if made == 20 else 0  # goes on with the next exchange, or is left out with the others
    assert (simulation.counters.sub_steps, simulation.counters.waited_ns) == (made, waited + (waited > 0) * 100_000)
    simulation.exchange(sample(6 * MS, 0.01))
    assert simulation.counters.sub_steps == made + (MS - 100_000 + rest) // STEP


class System:
    """A world that takes time on a made-up clock behind an endpoint, and a device that sends a sample each period."""

    def __init__(self, clock, period, sub_step=STEP):
        self.clock, self.period, self.sent, self.begin = clock, period, 0, clock.now
        self.end = ExchangeEndpoint(self.world(sub_step), (0.0, 0.0, 0.0))
        self.answers = []  # (sub-steps, seconds it took, age of the sample when it is answered [s])

    def world(self, sub_step=STEP):
        return Simulation(reduce_scene(parse(SCENE, "here")), sub_step * 1e-9, port=port_of("pspm"))

    def answer(self, session=77.0, **tail):
        """The newest sample is answered, as soon as there is one that was not."""
        due = self.begin + (self.sent + 1) * self.period
        if due > self.clock.now:
            self.clock.sleep(due - self.clock.now)
        self.sent = max(self.sent + 1, math.floor((self.clock.now - self.begin) / self.period + 1e-9))
        stamp, before = round(self.sent * self.period * 1e9), self.end.simulation.counters.sub_steps
        began, message = self.clock.now, handle(float(self.sent), session, stamp_ns=stamp, **tail)
        said = self.end.answer([message], self.clock.perf_counter_ns())
        made = self.end.simulation.counters.sub_steps - before
        self.answers.append((made, self.clock.now - began, self.clock.now - self.begin - self.sent * self.period))
        return said

    def run(self, times):
        """(sub-steps, time taken, age) of these answers."""
        for _ in range(times):
            self.answer()
        return self.answers[-times:]


@pytest.fixture
def system(monkeypatch):
    """system(period [s], load, fixed): a world that takes load seconds for a second of its own, and fixed an answer."""
    monkeypatch.setitem(METHODS, "slow", Entry("slow_method:Slow"))
    clock = Clock().put(monkeypatch, endpoint)
    monkeypatch.setattr(Slow, "sleep", staticmethod(clock.sleep))

    def made(period=1e-3, load=0.1, fixed=0.0, sub_step=STEP):
        # the passive ports step sub-step by sub-step, so that what is fixed is that of a sub-step
        monkeypatch.setattr(Slow, "each", load * sub_step * 1e-9)
        monkeypatch.setattr(Slow, "fixed", fixed)
        return System(clock, period, sub_step)

    return made


RATES = [100.0, 500.0, 2000.0]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("load", [0.1, 0.89, 1.79])
def test_no_answer_takes_longer_than_a_period_and_each_is_there_within_two(system, rate, load):
    answers = system(1.0 / rate, load).run(300)[30:]
    fits = max(1.0, load * STEP * 1e-9 * rate)  # one sub-step is made in any case
    assert max(took for _, took, _ in answers) <= fits / rate + 1e-9
    assert max(age for _, _, age in answers) <= 2.0 * fits / rate


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("load", "left_out"), [(0.85, False), (1.1, True)])
def test_a_world_leaves_time_out_only_if_it_is_too_dear_and_sums_say_so(system, rate, load, left_out):
    dear = system(1.0 / rate, load, sub_step=100_000)
    dear.run(300)
    counters, passed = dear.end.simulation.counters, round((dear.sent - 1) * dear.period * 1e9)
    assert 0 <= passed - counters.sub_steps * 100_000 - counters.waited_ns < 100_000
    assert (counters.waited_ns > 0) == dear.end.pace.dear == left_out
    if left_out:  # what it does make up is what it has time for, but for a sub-step a period
        assert counters.sub_steps * 1e-4 >= (SHARE / load - 1e-4 * rate) * 1e-9 * passed


@pytest.mark.parametrize("load", [0.1, 0.5])
def test_after_a_gap_it_makes_up_what_fits_into_one_answer_and_leaves_the_rest_out(system, load):
    late = system(1e-3, load)
    late.run(30)
    late.clock.sleep(7.5e-3)  # the host stood still
    waited, sent = late.end.simulation.counters.waited_ns, late.sent
    made, took, _ = late.run(1)[0]
    passed = 4 * (late.sent - sent)
    assert took <= SHARE * 1e-3 and passed >= 7 * 4 and made == min(passed, int(SHARE * 4 / load))
    assert late.end.simulation.counters.waited_ns - waited == (passed - made) * STEP
    assert [one[0] for one in late.run(5)] == [4] * 5  # and nothing of it is left for later ones


def test_a_world_that_becomes_dear_is_known_to_be_so_after_the_third_answer(system, monkeypatch):
    becomes = system(1e-3, 0.1)
    becomes.run(30)
    monkeypatch.setattr(Slow, "each", 1.5 * STEP * 1e-9)
    assert max(took for _, took, _ in becomes.run(40)[MEDIAN // 2 + 1 :]) <= 1e-3


def test_an_answer_that_was_interrupted_loses_no_time_of_a_cheap_world(system, monkeypatch):
    cheap = system(1e-3, 0.05)
    cheap.run(30)
    monkeypatch.setattr(Slow, "fixed", 1e-3)
    cheap.run(1)
    monkeypatch.setattr(Slow, "fixed", 0.0)
    cheap.run(20)
    assert cheap.end.simulation.counters.waited_ns == 0


@pytest.mark.parametrize("load", [0.1, 1.5])
def test_a_sub_step_longer_than_the_period_is_made_in_turns_and_never_starves(system, load):
    long = system(0.5e-3, load, sub_step=2 * MS)
    made = [made for made, _, _ in long.run(100)]
    assert set(made) == {0, 1}
    if load < SHARE:
        assert sum(made) == (100 - 1) // 4 and long.end.simulation.counters.waited_ns == 0


def test_a_pause_a_reset_and_another_world_leave_nothing_out_and_the_other_world_is_learned_anew(system):
    changes = system(1e-3, 0.5)
    changes.run(30)
    changes.end.pause(True, changes.clock.perf_counter_ns())
    changes.run(10)
    changes.end.pause(False, changes.clock.perf_counter_ns())
    changes.run(SILENCE_NS // MS + 10)
    changes.end.reset(changes.clock.perf_counter_ns())
    changes.run(SILENCE_NS // MS + 10)
    assert changes.end.simulation.counters.waited_ns == 0 and changes.end.pace.load == pytest.approx(0.5, rel=1e-3)
    changes.end.load(changes.world(), changes.clock.perf_counter_ns())
    assert math.isnan(changes.end.pace.load)
    answers = changes.run(SILENCE_NS // MS + 10)
    assert [made for made, _, _ in answers[-5:]] == [4] * 5 and changes.end.simulation.counters.waited_ns == 0


@pytest.mark.parametrize(
    "heard",
    [
        [(1.0, MS), (2.0, 2 * MS), (5.0, 5 * MS), (9.0, 9 * MS)],  # lost samples
        [(1.0, 0), (2.0, MS), (3.0, MS), (4.0, -(10**18)), (5.0, -(10**18) + MS)],  # stamps that go back or stand still
    ],
)
def test_lost_samples_and_wild_stamps_make_no_longer_period(heard):
    pace = Pace(STEP)
    for sequence, time_ns in heard:
        pace.heard(sequence, time_ns, False)
        assert sequence == 1.0 or pace.period_ns == MS
    assert pace.most() == 4


def test_of_a_dear_world_and_of_a_late_host_it_is_said_what_was_left_out_and_what_to_do():
    for taken, start, end in (
        (SHARE + 1e-9, "the world is too dear", left_out_time.CHEAPER),
        (SHARE, "handle samples came late to the world", left_out_time.QUIETER),
    ):
        said = left_out_sentence(0.34, 1.0, taken, 1e-3)
        assert said.startswith(f"{start}: it left out 340 ms of the last 1000 ms") and said.endswith(end)
    assert left_out_sentence(NOTICED, 1.0, 1.5, 1e-3) == "" != left_out_sentence(NOTICED + 1e-9, 1.0, 1.5, 1e-3)
