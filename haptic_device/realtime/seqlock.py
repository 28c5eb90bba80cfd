# SPDX-License-Identifier: Apache-2.0
"""Memory between threads of one process: the latest record under a sequence lock, and a ring that never blocks.

Neither side ever waits for the other, so that an ordinary thread cannot hold up a real-time one. Each has one writer.
"""

import numpy as np

from haptic_device.jit import kernel
from haptic_device.realtime import atomic

HEAD, TAIL, DROPPED = 0, 1, 2  # words of a ring
FIRST = 8  # word at which the record begins, a cache line behind its lock


class SeqLock:
    """The latest record of one writer; the record's type is a structured one of 8-byte fields."""

    def __init__(self, dtype):
        self.dtype = dtype
        self.words = np.zeros(FIRST + dtype.itemsize // 8, np.int64)
        self._whole = np.zeros(dtype.itemsize // 8, np.int64)  # as words: a record is copied field by field

    def put(self, record):
        """Writes a record: array of one of dtype."""
        atomic.publish(self.words, 0, FIRST, record.view(np.int64).reshape(-1))

    def get(self):
        """The latest record as an array of one, a copy; zeros before the first.

        While its writer does not leave it alone, the one of the last call.
        """
        record = np.zeros(1, self.dtype)
        self.read(record)
        return record.view(np.recarray)

    def read(self, record):
        """As get, into an array of one; for who reads a thousand times a second."""
        words = record.view(np.int64)
        if atomic.collect(self.words, 0, FIRST, words) >= 0:
            self._whole[:] = words
        else:
            words[:] = self._whole


class Ring:
    """Rows from one writer to one reader; when full, new rows are dropped and counted."""

    def __init__(self, dtype, size):
        self.size, self.rows = size, np.zeros(size, dtype)
        self.rows.view(np.uint8).fill(0)  # touched now, so that the writer meets no page fault
        self.words = np.zeros(8, np.int64)

    def take(self, most):
        """Up to `most` of the oldest rows, copied."""
        tail = int(self.words[TAIL])  # the reader's own; the head is the writer's, read with acquire ordering
        count = min(int(atomic_head(self.words)) - tail, most)
        begin = tail % self.size
        to_end = min(count, self.size - begin)
        rows = np.concatenate([self.rows[begin : begin + to_end], self.rows[: count - to_end]])
        release_tail(self.words, tail + count)
        return rows

    @property
    def dropped(self):
        """Rows that found the ring full."""
        return int(self.words[DROPPED])


@kernel
def atomic_head(words):
    """Rows written so far, with what stands in them."""
    return atomic.load(words, HEAD)


@kernel
def release_tail(words, value):
    """Gives the rows before this one back to the writer."""
    atomic.store(words, TAIL, value)


@kernel
def ring_slot(words, size):
    """Index of the row to write next, or −1 if the ring is full (counted)."""
    head = words[HEAD]
    if head - atomic.load(words, TAIL) >= size:
        words[DROPPED] += 1
        return -1
    return head % size


@kernel
def ring_push(words):
    """Hands the row written last to the reader."""
    atomic.store(words, HEAD, words[HEAD] + 1)  # release: the row is whole before the reader may see it
