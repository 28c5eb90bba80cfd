# SPDX-License-Identifier: Apache-2.0
"""Time for kernels: who sleeps until a deadline wakes no sooner."""

import signal
import threading

import pytest

from haptic_device.realtime import clock

SLEEP = 2_000_000  # [ns]


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


def test_a_deadline_that_has_passed_is_not_waited_for():
    scratch = clock.scratch()
    for deadline in (0, int(clock.now_ns(scratch)) - 1):
        clock.sleep_until(deadline, scratch)
