# SPDX-License-Identifier: Apache-2.0
"""Records that cross between threads and processes: never torn, the latest counts, nobody waits."""

import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

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


def read_while_it_writes(words, values, wanted=2_000, limit=60.0):
    """Reads records of a writer that has begun or will; a writer that stands still for a while is waited for."""
    end, got = time.monotonic() + limit, 0
    while got < wanted:
        assert time.monotonic() < end, f"read {got} of {wanted} records"
        if words[8] == 0:
            time.sleep(0.001)
            continue
        more, torn, back = read_many(words, 8, values, wanted - got)
        assert torn == 0 and back == 0
        got += more


def test_no_record_is_torn_between_two_threads():
    words, values = np.zeros(64, np.int64), np.zeros(LONG, np.int64)
    stop = np.zeros(1, np.int64)
    write_until(words, 8, values.copy(), np.ones(1, np.int64))
    writer = threading.Thread(target=write_until, args=(words, 8, values.copy(), stop))
    writer.start()
    try:
        read_while_it_writes(words, values)
    finally:
        stop[0] = 1
        writer.join(60.0)
    assert not writer.is_alive()


WRITER = """
    import mmap, sys
    import numpy as np
    from test_seqlock import LONG, write_until
    with open(sys.argv[1], "r+b") as file:
        words = np.frombuffer(mmap.mmap(file.fileno(), 8 * 64), np.int64)
        write_until(words, 8, np.zeros(LONG, np.int64), words[63:])
"""


def test_no_record_is_torn_between_two_processes(tmp_path, start):
    path, values = tmp_path / "page", np.zeros(LONG, np.int64)
    path.write_bytes(bytes(8 * 64))
    words = np.memmap(path, np.int64)
    process = start(
        [sys.executable, "-c", textwrap.dedent(WRITER), path], stderr=subprocess.PIPE, cwd=Path(__file__).parent
    )
    read_while_it_writes(words, values)
    words[63] = 1
    assert process.wait(60.0) == 0, process.stderr.read()


def test_a_reader_does_not_wait_for_a_writer_that_died_half_way_and_a_new_writer_mends_it():
    words, values = np.zeros(64, np.int64), np.arange(5)
    atomic.publish(words, 0, 8, values)
    words[0] |= 1
    assert atomic.collect(words, 0, 8, values.copy()) == -1
    atomic.publish(words, 0, 8, values + 10)
    found = values.copy()
    assert atomic.collect(words, 0, 8, found) > 0
    assert found.tolist() == [10, 11, 12, 13, 14]


def test_a_seqlock_whose_writer_died_half_way_gives_the_record_before():
    box, record = seqlock.SeqLock(PAIR), np.ones(1, PAIR)
    box.put(record)
    assert box.get()[0].a == 1.0
    box.words[0] |= 1
    box.words[8:] = 77
    assert (box.get() == record).all()


def test_a_seqlock_gives_the_latest_record_again_and_again_and_zeros_before_the_first():
    box, record = seqlock.SeqLock(PAIR), np.zeros(1, PAIR)
    assert box.get()[0].a == 0.0
    for value in (1.0, 2.0):
        record["a"], record["b"] = value, np.arange(5) * value
        box.put(record)
    assert box.get()[0].a == box.get()[0].a == 2.0
    assert box.get()[0].b.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]


def push(ring, value):
    """Writes one row as the servo does; whether it found a place."""
    slot = seqlock.ring_slot(ring.words, ring.size)
    if slot >= 0:
        ring.rows["a"][slot] = value
        seqlock.ring_push(ring.words)
    return slot >= 0


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 7), st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=20))
def test_a_ring_hands_over_every_row_once_and_in_order_and_counts_the_ones_it_had_to_drop(size, turns):
    ring, kept, taken, number = seqlock.Ring(PAIR, size), [], [], 0
    for pushes, most in turns:
        for _ in range(pushes):
            number += 1
            if push(ring, number):
                kept.append(float(number))
        taken += ring.take(most)["a"].tolist()
    taken += ring.take(100)["a"].tolist()
    assert taken == kept
    assert ring.dropped == number - len(kept)


def test_a_full_ring_drops_the_new_row_and_goes_on_when_there_is_room():
    ring = seqlock.Ring(PAIR, 3)
    assert [push(ring, value) for value in (1, 2, 3, 4)] == [True, True, True, False]
    assert ring.take(1)["a"].tolist() == [1.0]
    assert push(ring, 5)
    assert ring.take(9)["a"].tolist() == [2.0, 3.0, 5.0]
    assert ring.dropped == 1
