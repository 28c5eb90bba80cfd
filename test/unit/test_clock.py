# SPDX-License-Identifier: Apache-2.0
"""Waits of kernels: until a deadline and no shorter, or until a word has changed and its writer wakes."""

import signal
import threading
import time

import numpy as np
import pytest

from haptic_device.realtime import clock, futex

MS, HOUR = 1_000_000, 3600 * 1_000_000_000
SLEEP = 2 * MS


@pytest.fixture
def disturb():
    """disturb(thread) sends a signal to a thread; what it does is to end the system call that the thread waits in."""
    before = signal.signal(signal.SIGUSR1, lambda number, frame: None)
    yield lambda thread: signal.pthread_kill(thread.ident, signal.SIGUSR1)
    signal.signal(signal.SIGUSR1, before)


def test_signals_wake_nobody_before_his_deadline(disturb):
    late, done, end = [], threading.Event(), threading.Event()

    def sleep():
        scratch = clock.scratch()
        for _ in range(50):
            deadline = int(clock.now_ns(scratch)) + SLEEP
            clock.sleep_until(deadline, scratch)
            late.append(int(clock.now_ns(scratch)) - deadline)
        done.set()
        end.wait()  # a thread that has ended takes no signal

    sleeper = threading.Thread(target=sleep)
    sleeper.start()
    while not done.wait(0.0002):
        disturb(sleeper)
    end.set()
    sleeper.join()
    assert len(late) == 50 and min(late) >= 0


def test_whoever_waits_for_a_word_is_woken_by_its_writer():
    words = np.array([0, 0, 6, 0])
    until = clock.now_ns(clock.scratch()) + HOUR
    thread = threading.Thread(target=futex.wait, args=(words, 2, 6, until, clock.scratch()), daemon=True)
    thread.start()
    woken = 0
    while woken == 0 and thread.is_alive():
        woken = futex.wake(words, 2)
        time.sleep(0.001)
    thread.join(60.0)
    assert not thread.is_alive() and woken == 1
    assert futex.wake(words, 2) == 0  # nobody waits any more
