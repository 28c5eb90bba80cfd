# SPDX-License-Identifier: Apache-2.0
"""Records that cross between threads: never torn, the latest counts, nobody waits. test_shared_memory.py: processes."""

import threading
import time

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from haptic_device.jit import kernel
from haptic_device.realtime import atomic, seqlock

PAIR = np.dtype([("a", "f8"), ("b", "f8", (5,))])
LONG = 40  # words: a copy takes long enough to be met half way


@kernel
def write_until(words, first, values, stop):
    """Writes records whose words are all the same number, the next each time, until stop[0]; returns how many."""
    count = 0
    while atomic.load(stop, 0) == 0:
        count += 1
        values[:] = count
        atomic.publish(words, 0, first, values)
        for _ in range(37 * count % 20_000):  # pauses of every length: a slow reader succeeds too
            atomic.load(stop, 0)
    return count


@kernel
def read_many(words, first, values, wanted, attempts=1_000_000):
    """(records read, torn ones, steps back in time), at most as many records as wanted."""
    known, got, torn, back = 0, 0, 0, 0
    for _ in range(attempts):
        if got == wanted:
            break
        if atomic.collect(words, 0, first, values) < 0:
            continue
        got += 1
        torn += values.min() != values.max()
        back += values[0] < known
        known = values[0]
    return got, torn, back


def test_no_record_is_torn_between_two_threads():
    words, values, stop = np.zeros(64, np.int64), np.zeros(LONG, np.int64), np.zeros(1, np.int64)
    write_until(words, 8, values.copy(), np.ones(1, np.int64))  # compiles it
    writer = threading.Thread(target=write_until, args=(words, 8, values.copy(), stop))
    writer.start()
    end, wanted = time.monotonic() + 60.0, 500
    try:
        while wanted > 0:
            assert time.monotonic() < end, f"{wanted} records are missing"
            got, torn, back = read_many(words, 8, values, wanted) if words[8] else (0, 0, 0)
            assert torn == 0 and back == 0
            wanted -= got
    finally:
        stop[0] = 1
        writer.join(60.0)


def test_a_seqlock_gives_the_latest_record_again_and_again_and_the_one_before_when_its_writer_died_half_way():
    box, record = seqlock.SeqLock(PAIR), np.zeros(1, PAIR)
    assert box.get()[0].a == 0.0
    for value in (1.0, 2.0):
        record["a"], record["b"] = value, np.arange(5) * value
        box.put(record)
    assert box.get()[0].b.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]
    box.words[0] |= 1
    box.words[8:] = 77
    assert (box.get() == record).all()


def push(ring, value):
    """Writes one row as the servo does; whether it found a place."""
    slot = seqlock.ring_slot(ring.words, ring.size)
    if slot >= 0:
        ring.rows["a"][slot] = value
        seqlock.ring_push(ring.words)
    return slot >= 0


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 7), st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=20))
def test_a_ring_hands_over_every_row_once_and_in_order_and_drops_and_counts_the_new_ones_when_it_is_full(size, turns):
    ring, waiting, number, dropped = seqlock.Ring(PAIR, size), [], 0, 0
    for pushes, most in [*turns, (0, 100)]:
        for _ in range(pushes):
            number += 1
            assert push(ring, number) == (len(waiting) < size)
            waiting, dropped = ([*waiting, number], dropped) if len(waiting) < size else (waiting, dropped + 1)
        assert ring.take(most)["a"].tolist() == waiting[:most]
        waiting = waiting[most:]
    assert ring.dropped == dropped
