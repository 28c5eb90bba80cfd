# SPDX-License-Identifier: Apache-2.0
"""How `haptic demo` follows a run, on statuses and a motor that the test makes up."""

import pytest
from made_up_clock import Clock

from haptic_device.status import Status
from haptic_sim import outcome
from haptic_sim.cli.progress import status_line
from haptic_sim.cli.tables import print_outcome
from haptic_sim.live import follow, news


class Said:
    """What is heard: in each look the next fault, and the force [N] of the motor."""

    def __init__(self, *looks):
        self.looks, self.statuses, self.motor_force = list(looks), {}, 0.0
        self.truth, self.motion_done, self.withheld = {}, False, {}

    def look(self):
        fault, self.motor_force = self.looks.pop(0) if len(self.looks) > 1 else self.looks[0]
        message = f"fault {fault}" if fault else "waiting"
        said = {"fault": fault, "missed": "[/x]", "age_ms_p50": "", **self.withheld}
        driver, other = Status(0, 2 if fault else 0, message, said), Status(0, 0, "serving", {})
        simulation = Status(0, 0, "serving", {"result.insertion_fraction": "all of it"})
        self.statuses = {"haptic_driver": driver, "haptic_loopback": other, "haptic_simulation": simulation}

    @property
    def motor_commanded(self):
        return self.motor_force != 0.0

    def said(self, node, entry):
        return self.statuses.get(node, Status(0, 0, "", {})).values.get(entry, "")


def followed(monkeypatch, *looks):
    Clock().put(monkeypatch, follow, news)
    with status_line() as show:
        return follow.follow(0.1, Said(*looks), dict, show)


def test_a_driver_in_fault_before_its_first_command_ends_the_run_in_a_sentence_and_is_not_waited_for(monkeypatch):
    said = "haptic_driver says: fault device_silent; haptic_simulation says: serving; haptic_loopback says: serving"
    with pytest.raises(ValueError, match=f"^no motor command came: {said}$"):
        followed(monkeypatch, ("", 0.0), ("device_silent", 0.0))


def test_a_fault_after_the_first_command_does_not_end_the_run_early(monkeypatch):
    assert followed(monkeypatch, ("", 0.0), ("", 1.0), ("estop", 0.0))


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


def run(monkeypatch, *events, seconds=1.0):
    """Whether the run ended well, and how long it took [s]."""
    clock = Clock().put(monkeypatch, follow, news)
    client, began = Run(clock, *events), clock.now
    return follow.follow(seconds, client, lambda: client.printed, lambda line: None), clock.now - began


COMMANDED = has(motor_commanded=True)
NEWS = {
    "another node is heard of": says("haptic_simulation", "answering"),
    "a node says something else": says("haptic_driver", "no simulation"),
    "a node's state is another": says("haptic_driver", "waiting", state="engaged"),
    "a node's level is another": says("haptic_driver", "waiting", 1),
    "a node has printed a line": prints("haptic_loopback", "compiling 2/3"),
    "the device is heard for the first time": device(1.0),
}
WAITING = (0.0, says("haptic_driver", "waiting"))


@pytest.mark.parametrize("what", NEWS)
def test_a_start_is_waited_for_as_long_as_there_is_news_and_no_longer(monkeypatch, what):
    late, later = news.LIMIT - 1.0, 2.0 * news.LIMIT - 2.0
    assert run(monkeypatch, WAITING, (late, NEWS[what]), (later, COMMANDED))[0]
    with pytest.raises(ValueError, match=f"^no motor command came, and no news for {news.LIMIT:.0f} s: "):
        run(monkeypatch, WAITING, (later, COMMANDED))


def test_what_changes_for_ever_is_no_news(monkeypatch):
    counts = [(float(t), says("haptic_driver", f"{t} samples refused", 1)) for t in range(300)]
    clocks = [(float(t), device(float(t))) for t in range(300)]
    turns = [(float(t), says("haptic_simulation", ("answering", "waiting")[t % 2])) for t in range(300)]
    with pytest.raises(ValueError, match="no motor command came"):
        run(monkeypatch, *counts, *clocks, *turns, (1.5 * news.LIMIT, COMMANDED))


def test_the_sentence_that_ends_a_start_has_the_last_words_of_every_node(monkeypatch):
    told = "haptic_driver says: no simulation; nothing was heard of haptic_simulation, which printed last: compiling; "
    told += "nothing was heard of haptic_loopback"
    with pytest.raises(ValueError, match=f"no news for {news.LIMIT:.0f} s: {told}$"):
        run(monkeypatch, (0.0, says("haptic_driver", "no simulation")), (0.0, prints("haptic_simulation", "compiling")))


def test_a_motion_is_followed_to_its_end_while_the_device_goes_on_and_given_up_where_it_stands(monkeypatch, capsys):
    long = [(float(t), device(float(t))) for t in range(int(4 * news.LIMIT))]
    ended, took = run(monkeypatch, (0.0, COMMANDED), *long, (4 * news.LIMIT, has(motion_done=True)), seconds=None)
    assert ended and took >= 4 * news.LIMIT and not capsys.readouterr().err
    ended, took = run(monkeypatch, (0.0, COMMANDED), *long[:50], seconds=None)
    assert not ended and took < 50 + 1.1 * news.LIMIT
    assert "the motion did not end, and no news" in capsys.readouterr().err


def test_force_that_is_withheld_stands_in_the_line_and_its_cause_in_the_table_of_the_end(monkeypatch, capsys):
    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    Clock().put(monkeypatch, follow, news)
    client = Said(("", 1.0))
    client.withheld = {"withheld": "tank, limit", "withheld_s": "3.2"}
    with status_line() as show:
        follow.follow(0.1, client, dict, show)
    found = outcome.nothing() | {"scene": "wall", "done": False, "bag": None, "withheld_s": {"tank": 3.2}}
    print_outcome(found)
    said = capsys.readouterr()
    assert "force withheld for 3.2 s: tank, limit" in said.err
    assert "force withheld [s]: the energy tank cannot pay" in " ".join(said.out.split()) and "3.2" in said.out


def test_a_word_that_is_no_fault_of_ours_ends_no_run(monkeypatch):
    assert followed(monkeypatch, ("overheated", 0.0), ("overheated", 1.0))


def test_words_of_others_are_shown_as_they_are_on_a_terminal_and_in_the_table(monkeypatch, capsys):
    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    assert followed(monkeypatch, ("", 1.0))
    found = outcome.nothing() | {"scene": "[/x]", "done": False, "bag": None, "faults": ["[/x] says [bold"]}
    print_outcome(found)
    said = capsys.readouterr()
    assert "missed ticks [/x]" in said.err and "[/x] says [bold" in said.out
