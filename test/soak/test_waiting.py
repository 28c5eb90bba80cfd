# SPDX-License-Identifier: Apache-2.0
"""What a long wait of a test says on the terminal, and when."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import waiting
from made_up_clock import Clock

SHARED = Path(waiting.__file__).parent
SLOW = """
import sys, threading, time
import pytest, waiting
waiting.SAY_AFTER, waiting.LOOK = 0.2, 0.05

def test_polled():
    began = time.monotonic()
    waiting.until(lambda: time.monotonic() > began + 3, "the second that comes next", said=lambda: "not yet")

def test_blocked():
    assert threading.Event().wait(3.0) is False

def test_looking():
    seen = []
    waiting.until(lambda: seen, "what its look brings", look=lambda: seen.append(time.sleep(3.0)))

@pytest.fixture
def slow():
    yield
    time.sleep(3.0)

def test_ending(slow):
    pass

def test_process():
    words = [sys.executable, "-c", "import time; print('so far', flush=True); time.sleep(3)"]
    assert waiting.run(words).stdout == "so far\\n"
"""


@pytest.fixture
def told(monkeypatch, tmp_path):
    """The lines that were told on the terminal so far."""
    with open(tmp_path / "terminal", "w+b") as terminal:
        monkeypatch.setattr(waiting, "terminal", terminal.fileno())
        yield lambda: (tmp_path / "terminal").read_text().split("\n")[1::2]


def test_a_wait_says_after_20_s_and_again_after_as_many_what_it_waits_for_and_what_was_said(monkeypatch, told):
    clock = Clock().put(monkeypatch, waiting)
    said = iter(["nothing", "a word"])
    began = clock.now

    def wait(seconds):
        end = clock.now + seconds
        waiting.until(lambda: clock.now >= end, "the end", look=lambda: clock.sleep(0.25), said=lambda: next(said))

    wait(19.75)
    assert told() == []
    wait(59.75)
    assert clock.now == began + 79.5
    first, second = told()
    assert first.endswith(": waits for the end since 20 s; said: nothing")
    assert second.endswith(": waits for the end since 40 s; said: a word")


def test_a_wait_in_vain_ends_at_its_limit_with_what_was_waited_for_and_said(monkeypatch, told):
    clock = Clock().put(monkeypatch, waiting)
    for limit, wanted in ((None, waiting.LIMIT), (30.0, 30.0)):
        began = clock.now
        with pytest.raises(AssertionError, match=f"^not within {wanted:g} s: the end; nothing$"):
            waiting.until(lambda: False, "the end", lambda: clock.sleep(1.0), lambda: "nothing", limit)
        assert clock.now == began + wanted


def test_every_long_wait_of_a_captured_test_is_told_on_the_terminal_by_itself_or_by_where_it_stands(tmp_path):
    (tmp_path / "test_slow.py").write_text(SLOW)
    (tmp_path / "conftest.py").symlink_to(SHARED / "conftest.py")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    environment |= {"PYTHONPATH": f"{SHARED}:{SHARED.parent}"}
    words = [sys.executable, "-m", "pytest", "-q", "-c", os.devnull, "--rootdir", tmp_path, "-n", "1", tmp_path]
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    for wanted in (
        "test_polled: waits for the second that comes next since N s; said: not yet",
        "test_blocked: stands at test_slow.py:11, 'assert threading.Event().wait(3.0) is False', since N s",
        "test_looking: stands at test_slow.py:15",
        "test_ending: stands at test_slow.py:20, 'time.sleep(3.0)', since N s",
        "; said: so far",
    ):
        assert wanted in re.sub(r"since \d+ s", "since N s", done.stderr), done.stderr
