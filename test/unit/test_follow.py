# SPDX-License-Identifier: Apache-2.0
"""How `haptic demo` follows a run, on statuses and a motor that the test makes up."""

import re

from examples import few
from hypothesis import given
from hypothesis import strategies as st
from made_up_clock import Clock

from haptic_device.control.enable_state import STATES
from haptic_device.control.enable_state import WAITING as WAITING_STATE
from haptic_device.control.faults import TABLE
from haptic_device.recording.status import Status
from haptic_display.fault_sentence import called, what_to_do
from haptic_display.run import follow, news


class Run:
    """A run by the clock: events are (time [s] from its start, what then happens to the client)."""

    def __init__(self, clock, *events):
        self._clock, self._began, self._events = clock, clock.now, sorted(events, key=lambda event: event[0])
        self.statuses, self.truth, self.motor_force, self.printed = {}, {}, 0.0, {}
        self.motor_commanded = self.motion_done = False

    def look(self):
        while self._events and self._clock.now - self._began >= self._events[0][0]:
            self._events.pop(0)[1](self)

    def said(self, node, entry):
        return self.statuses[node].values.get(entry, "") if node in self.statuses else ""


def says(name, message, level=0, **values):
    return lambda run: run.statuses.update({name: Status(0, level, message, values)})


def prints(name, line):
    return lambda run: run.printed.update({name: line})


def device(seconds):
    return lambda run: run.truth.update(time=(seconds, 0.0, 0.0))


def has(**attributes):
    return lambda run: vars(run).update(attributes)


def run(monkeypatch, *events, seconds=1.0, show=lambda line: None, tell=lambda line: None):
    """How the run ended, and how long it took [s]."""
    clock = Clock().put(monkeypatch, follow, news)
    client, began = Run(clock, *events), clock.now
    return follow.follow(seconds, client, lambda: client.printed, show, tell), clock.now - began


COMMANDED = has(motor_commanded=True)


def falls(name):
    return says("haptic_driver", f"fault {name}", 2, fault=name, state="fault")


def going_on(seconds):
    """A device whose own clock goes on for so long."""
    return [(float(t), device(float(t))) for t in range(int(seconds))]


ENGAGED = says("haptic_driver", "engaged", state="engaged")
LACKS = {
    "before the first command": "no motor command was seen",
    "while it engages": "the motion did not begin",
    "in the motion": "the motion did not end",
}


def test_a_latched_fault_ends_a_run_soon_but_not_at_once_in_a_sentence_with_its_cause_and_what_clears_it(monkeypatch):
    kinds = [(entry, "in the motion", None) for entry in TABLE]
    kinds += [(TABLE[0], moment, seconds) for moment in LACKS for seconds in (None, 3600.0)]
    for entry, moment, seconds in kinds:
        before = moment == "before the first command"
        events = [] if before else [(1.0, COMMANDED)]
        events += [(2.0, ENGAGED)] if moment == "in the motion" else []
        ending, took = run(monkeypatch, *events, (5.0, falls(entry.name)), *going_on(1000.0), seconds=seconds)
        assert 5.0 + (not before) * follow.AFTERWARDS <= took < 5.0 + 2.0 * follow.AFTERWARDS, (
            "the recording has what came then"
        )
        lack = "the run did not last 3600 s" if seconds and not before else LACKS[moment]
        assert ending.why == f"{lack}: {what_to_do(entry.name)}"
        assert (ending.fault, ending.commanded, ending.begun) == (entry.name, not before, moment == "in the motion")


def test_a_fault_is_told_when_it_latches_and_with_its_cause_and_number_at_the_end(monkeypatch):
    told = []
    latches = says("haptic_driver", "", 2, fault="velocity", fault_detail="")
    number = says("haptic_driver", "", 2, fault="velocity", fault_detail="0.83 m/s; the limit is 0.6 m/s")
    ending, _ = run(monkeypatch, (0.0, COMMANDED), (5.0, latches), (5.1, number), seconds=3600.0, tell=told.append)
    assert told == [called("velocity")]
    assert what_to_do("velocity", "0.83 m/s; the limit is 0.6 m/s") in ending.why
    told.clear()
    assert not run(monkeypatch, (0.0, COMMANDED), seconds=1.0, tell=told.append)[0].why and told == []


NEWS = {
    "another node is heard of": says("haptic_simulation", "answering"),
    "a node says something else": says("haptic_driver", "no simulation"),
    "a node's state is another": says("haptic_driver", "waiting", state="engaged"),
    "a node's level is another": says("haptic_driver", "waiting", 1),
    "a node has printed a line": prints("haptic_loopback", "compiling 2/3"),
    "the device is heard for the first time": device(1.0),
}
WAITING = (0.0, says("haptic_driver", "waiting"))


def test_a_start_is_waited_for_as_long_as_there_is_news_and_no_longer(monkeypatch):
    late, later = news.LIMIT - 1.0, 2.0 * news.LIMIT - 2.0
    for what, event in NEWS.items():
        assert not run(monkeypatch, WAITING, (late, event), (later, COMMANDED))[0].why, what
    ending, _ = run(monkeypatch, WAITING, (later, COMMANDED))
    assert ending.why.startswith(f"no motor command came, and no news for {news.LIMIT:.0f} s: ")
    assert not ending.commanded


def holds_back(seconds, state=STATES[WAITING_STATE], cause="waiting"):
    """A driver that has withheld force for so long, each second in other words."""
    words = f"{state}; force withheld for {seconds:.1f} s ({cause}): {'x' * int(seconds)}"
    return says("haptic_driver", words, 1, state=state, withheld=cause, withheld_s=f"{seconds:.1f}")


def test_a_driver_that_waits_for_a_small_force_is_waited_for_so_long_and_its_own_words_are_the_cause(monkeypatch):
    limit, waits = follow.PATIENCE, [(float(t), holds_back(float(t))) for t in range(600)]
    for begin, seconds, lack in (
        ([], 2.0, "no motor command came"),
        ([], None, "no motor command came"),
        ([(0.0, COMMANDED)], None, "the motion did not begin"),
    ):
        ending, took = run(monkeypatch, *begin, *waits, seconds=seconds)
        words = f"waiting for a small force; force withheld for {limit:.1f} s (waiting): {'x' * int(limit)}"
        assert ending.why == f"{lack}: {words}" and limit <= took < limit + 1.0
        assert (ending.fault, ending.commanded, ending.begun) == ("", bool(begin), False)


def test_a_driver_that_engages_just_before_that_or_withholds_a_force_that_has_begun_goes_on(monkeypatch):
    waits = [(float(t), holds_back(float(t))) for t in range(int(follow.PATIENCE))]
    assert not run(monkeypatch, *waits, (follow.PATIENCE - 0.1, COMMANDED), seconds=2.0)[0].why
    short = [(float(t), holds_back(float(t), "engaged", "tank")) for t in range(100)]
    done = (99.0, has(motion_done=True))
    assert not run(monkeypatch, *short, *going_on(100.0), done, seconds=None)[0].why


def test_what_changes_for_ever_is_no_news(monkeypatch):
    counts = [(float(t), says("haptic_driver", f"{t} samples refused", 1)) for t in range(300)]
    clocks = [(float(t), device(float(t))) for t in range(300)]
    turns = [(float(t), says("haptic_simulation", ("answering", "waiting")[t % 2])) for t in range(300)]
    ending, _ = run(monkeypatch, *counts, *clocks, *turns, (1.5 * news.LIMIT, COMMANDED))
    assert ending.why.startswith("no motor command came")


def test_a_motion_is_followed_to_its_end_while_the_device_goes_on_and_given_up_where_it_stands(monkeypatch):
    long, begun = going_on(4 * news.LIMIT), [(0.0, COMMANDED), (0.0, ENGAGED)]
    end = [(4 * news.LIMIT, has(motion_done=True)), (4 * news.LIMIT + 0.01, falls("estop"))]
    ending, took = run(monkeypatch, *begun, *long, *end, seconds=None)
    assert not ending.why and took >= 4 * news.LIMIT, "a fault after it is none of the motion's"
    ending, took = run(monkeypatch, *begun, *long[:50], seconds=None)
    assert ending.why.startswith(f"the motion did not end, and no news for {news.LIMIT:.0f} s: ")
    assert took < 50 + 1.1 * news.LIMIT
    ending, took = run(monkeypatch, begun[0], *long, seconds=None)
    assert ending.why.startswith(f"the motion did not begin, and no news for {news.LIMIT:.0f} s: ")
    assert not ending.begun and took < 1.1 * news.LIMIT


def test_a_line_says_something_from_the_first_look_on(monkeypatch):
    lines = []
    run(monkeypatch, (1.0, has(truth={"time": (0.0, 0.0, 0.0)})), (2.0, COMMANDED), show=lines.append)
    assert lines[0] == "nothing is heard of the nodes yet" and lines[-1] == "motor 0.00 N" and all(lines)


@given(st.floats(-1e6, 1e6) | st.floats(-1e-3, 1e-3))
@few(100)
def test_a_share_that_is_inserted_is_told_from_nothing_to_the_whole(share):
    """The peg is above its hole where its measure is below nothing, and rounding leaves -1e-17 of it."""
    client = Run(Clock())
    says("haptic_simulation", "", **{"result.insertion_fraction": str(share)})(client)
    percent = int(re.fullmatch(r"inserted (\d+) %", follow._line(client))[1])
    assert abs(percent - 100.0 * min(max(share, 0.0), 1.0)) <= 0.5
