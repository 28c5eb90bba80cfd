# SPDX-License-Identifier: Apache-2.0
"""What `haptic compile` says while kernels are made up and nothing is compiled, and how seldom."""

import os
import re
import subprocess
import time
from concurrent.futures import Future
from pathlib import Path

import pytest
from in_process import haptic
from made_up_clock import Clock

from haptic_device import jit
from haptic_display.cli import compile as command
from haptic_display.cli import progress

GROUPS = ["servo", "methods", "bridge"]
LINE = re.compile(r" *([\d.]+) s   compiling, once for this machine: (\d+) kernels, (\d+) of 3 groups")


class Pool:
    """In place of processes that compile: what is submitted is done when the test says."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        pass

    def submit(self, *_):
        return Future()


@pytest.fixture
def told(monkeypatch, tmp_path, capsys):
    """Lines of a compiler that keeps a kernel every 3 s and completes a group every 40 s, where no terminal is."""
    clock, began, made, recorded = Clock(), time.time(), [], []
    (tmp_path / "there_before.1.nbc").touch()
    os.utime(tmp_path / "there_before.1.nbc", (1.0, 1.0))

    def wait(left, seconds, until):
        clock.sleep(seconds)
        if clock.now % 3.0 < seconds:
            made.append(tmp_path / f"law_{len(made)}.1.nbc")
            made[-1].touch()
            os.utime(made[-1], (began + clock.now,) * 2)  # a file's own time may be 4 ms behind
            (tmp_path / f"law_{len(made)}.nbi").touch()
        if clock.now % 40.0 < seconds:
            next(iter(left)).set_result(None)
        return {one for one in left if one.done()}, {one for one in left if not one.done()}

    monkeypatch.setattr(command, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(command, "wait", wait)
    monkeypatch.setattr(command.jit, "folder", lambda: tmp_path)
    monkeypatch.setattr(command.jit, "record", recorded.extend)
    clock.put(monkeypatch, progress)
    assert command._compile(GROUPS) == [] and sorted(recorded) == sorted(GROUPS)
    return [LINE.fullmatch(line) for line in capsys.readouterr().err.splitlines()]


def test_in_a_file_a_line_comes_every_ten_seconds_and_each_counts_kernels_that_are_kept_since_the_first(told):
    assert len(told) >= 10 and all(told)
    seconds, kernels, groups = ([float(line[k]) for line in told] for k in (1, 2, 3))
    assert {round(b - a) for a, b in zip(seconds, seconds[1:], strict=False)} == {10}
    assert all(a < b for a, b in zip(kernels, kernels[1:], strict=False)), "more at each line"
    assert all(abs(count - second / 3.0) <= 1.0 for second, count in zip(seconds, kernels, strict=True))
    assert groups == sorted(groups) and {*groups} >= {0, 1, 2}


@pytest.mark.parametrize("seldom", [1.0, 10.0])
def test_a_line_is_written_just_after_its_time_and_not_just_before(monkeypatch, capsys, seldom):
    clock = Clock().put(monkeypatch, progress)
    with progress.status_line(seldom) as show:
        for after in (0.0, seldom - 0.01, 0.02, seldom - 0.01, 0.02):
            clock.sleep(after)
            show("at work")
    seconds = [line.split()[0] for line in capsys.readouterr().err.splitlines()]
    assert seconds == [f"{count * (seldom + 0.01):.1f}" for count in (0, 1, 2)]


@pytest.mark.parametrize(
    ("entries", "level", "hint"), [((), None, "next: haptic demo --view\n"), ((), "1", ""), (("servo",), None, "")]
)
def test_a_person_is_told_what_is_next_and_make_and_whoever_needs_some_kernels_are_not(
    monkeypatch, tmp_path, entries, level, hint
):
    monkeypatch.delenv("MAKELEVEL", raising=False)
    if level:
        monkeypatch.setenv("MAKELEVEL", level)
    monkeypatch.setattr(jit, "folder", lambda: tmp_path)
    monkeypatch.setattr(command, "_compile", lambda names: [])
    done = haptic("compile", *entries)
    assert done.returncode == 0 and done.stdout.endswith(f"kernels are compiled; they are kept in {tmp_path}\n")
    assert done.stderr == hint


def test_kernels_that_cannot_be_read_are_all_taken_away_with_a_sentence_and_made_anew_once(monkeypatch, tmp_path):
    (tmp_path / "law.nbi").touch()
    (tmp_path / f"servo{jit.DONE}").touch()
    monkeypatch.setattr(jit, "folder", lambda: tmp_path)
    wrong = ["servo (EOFError: cut)"]
    monkeypatch.setattr(command, "_compile", lambda names: wrong if [*tmp_path.glob("*.nbi")] else [])
    done = haptic("compile")
    sentence = f"compiled kernels in {tmp_path} cannot be read (servo (EOFError: cut)); all are compiled anew\n"
    assert done.returncode == 0 and done.stderr.startswith(sentence) and not [*tmp_path.glob(f"*{jit.DONE}")]
    monkeypatch.setattr(command, "_compile", lambda names: ["servo (TypeError: no law)"])
    done = haptic("compile", "servo")
    assert (done.returncode, done.stderr) == (1, "haptic: not compiled: servo (TypeError: no law)\n")


@pytest.mark.parametrize(("goal", "hints"), [("setup", 1), ("demo", 0), ("check", 0)])
def test_make_setup_alone_says_what_is_next(goal, hints):
    command = ["make", "--dry-run", "--old-file", ".venv/.ready", goal]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True)
    assert done.stdout.count("next: ") == hints
