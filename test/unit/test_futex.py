# SPDX-License-Identifier: Apache-2.0
"""A wait for a word ends when the word has changed and its writer wakes, at once where it has already, or by time."""

import threading
import time

import numpy as np

from haptic_device.realtime import clock, futex

MS, HOUR = 1_000_000, 3600 * 1_000_000_000


def test_whoever_waits_is_woken_by_the_writer():
    words, scratch = np.zeros(4, np.int64), clock.scratch()
    words[2] = 6
    until = clock.now_ns(scratch) + HOUR
    thread = threading.Thread(target=futex.wait, args=(words, 2, 6, until, clock.scratch()), daemon=True)
    thread.start()
    woken = 0
    while woken == 0 and thread.is_alive():
        woken = futex.wake(words, 2)
        time.sleep(0.001)
    thread.join(60.0)
    assert not thread.is_alive()
    assert woken == 1


def test_a_word_that_has_changed_is_not_waited_for():
    words, scratch = np.zeros(4, np.int64), clock.scratch()
    words[1] = 8
    until = clock.now_ns(scratch) + HOUR
    futex.wait(words, 1, 6, until, scratch)
    assert clock.now_ns(scratch) < until


def test_a_word_that_nobody_changes_is_waited_for_until_the_time():
    words, scratch = np.zeros(4, np.int64), clock.scratch()
    words[0] = (1 << 32) + 6  # the upper half does not count
    until = clock.now_ns(scratch) + 5 * MS
    futex.wait(words, 0, int(words[0]), until, scratch)
    assert clock.now_ns(scratch) >= until


def test_nobody_waits_and_nobody_is_woken():
    assert futex.wake(np.zeros(1, np.int64), 0) == 0
