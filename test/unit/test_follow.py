# SPDX-License-Identifier: Apache-2.0
"""How `haptic demo` follows a run, on statuses and a motor that the test makes up."""

import pytest

from haptic_device.status import Status
from haptic_sim import outcome
from haptic_sim.cli.progress import status_line
from haptic_sim.cli.tables import print_outcome
from haptic_sim.live import follow


class Said:
    """What is heard: in each look the next fault, and the force [N] of the motor."""

    def __init__(self, *looks):
        self.looks, self.statuses, self.motor_force = list(looks), {}, 0.0

    def look(self):
        fault, self.motor_force = self.looks.pop(0) if len(self.looks) > 1 else self.looks[0]
        message = f"fault {fault}" if fault else "waiting"
        said = {"fault": fault, "missed": "[/x]", "age_ms_p50": ""}
        driver, other = Status(0, 2 if fault else 0, message, said), Status(0, 0, "serving", {})
        simulation = Status(0, 0, "serving", {"result.insertion_fraction": "all of it"})
        self.statuses = {"haptic_driver": driver, "haptic_loopback": other, "haptic_simulation": simulation}

    @property
    def motor_commanded(self):
        return self.motor_force != 0.0

    def said(self, node, entry):
        return self.statuses.get(node, Status(0, 0, "", {})).values.get(entry, "")


def followed(monkeypatch, *looks, limit=60.0):
    monkeypatch.setattr(follow, "START_LIMIT", limit)
    with status_line() as show:
        return follow.follow(0.1, Said(*looks), lambda: None, show)


def test_a_driver_in_fault_before_its_first_command_ends_the_run_in_a_sentence_and_is_not_waited_for(monkeypatch):
    with pytest.raises(ValueError, match="^no motor command came; haptic_driver says: fault device_silent$"):
        followed(monkeypatch, ("", 0.0), ("device_silent", 0.0))


def test_a_fault_after_the_first_command_does_not_end_the_run_early(monkeypatch):
    assert followed(monkeypatch, ("", 0.0), ("", 1.0), ("estop", 0.0))


def test_without_command_or_fault_the_limit_ends_the_run_in_a_sentence(monkeypatch):
    with pytest.raises(ValueError, match="^no motor command came within 0 s; haptic_driver says: waiting$"):
        followed(monkeypatch, ("", 0.0), limit=0.2)


def test_a_word_that_is_no_fault_of_ours_ends_no_run(monkeypatch):
    assert followed(monkeypatch, ("overheated", 0.0), ("overheated", 1.0))


def test_words_of_others_are_shown_as_they_are_on_a_terminal_and_in_the_table(monkeypatch, capsys):
    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    assert followed(monkeypatch, ("", 1.0))
    found = outcome.nothing() | {"scene": "[/x]", "done": False, "bag": None, "faults": ["[/x] says [bold"]}
    print_outcome(found)
    said = capsys.readouterr()
    assert "missed ticks [/x]" in said.err and "[/x] says [bold" in said.out
