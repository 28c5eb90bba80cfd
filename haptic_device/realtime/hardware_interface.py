# SPDX-License-Identifier: Apache-2.0
"""How the servo reaches a device: the hardware interface, and the one to a device in shared memory.

A hardware interface has `memory` (int64 array, its own), `read` and `write` (compiled with the signatures below),
`present()`, whether the device answers, `delay()`, how late the motor acts after a write as the link measures it, from
the earliest that the counts may be of [s], `watchdog()`, the time without a command after which the device cuts its
motor [s] (0: not known, either), and `close()`. Another device is one more file with such a class;
haptic_display/device_tools/conformance.py checks any against this text.

* read(memory, deadline, give_up, sample) → 1 if the sample is of this deadline, 0 if it is older. It may wait for
  the device until give_up [ns of CLOCK_MONOTONIC], never longer. sample (9): time of sampling [ns], status, counts of
  x, y, theta, measured damper force of x, y, theta [N | N m], half-width of what is not known of the time [ns]. Counts
  change with the time only.
* status: sum of 2, the watchdog has cut the motor; 4, the e-stop button is pressed; 8, too hot, the motor is cut; 16,
  an end switch is reached; 32, an encoder is broken by the device's own check, the motor is cut; 64, the device's clock
  cannot be followed; 128, the last motor value was clamped. Other bits count for nothing; 1 is the servo's own
  (control/faults: FRESH).
* write(memory, written, next_deadline, period, engaged, motor) → 0. motor (3) in motor units, held until the next
  write; the device zeroes it by itself when writes stop.
"""

import functools

import numpy as np
from numba import types

from haptic_device.control import faults
from haptic_device.jit import kernel
from haptic_device.realtime import clock, shared_memory

WORDS, REALS, WORD = types.int64[::1], types.float64[::1], types.int64
READ = WORD(WORDS, WORD, WORD, REALS)
WRITE = WORD(WORDS, WORD, WORD, WORD, WORD, REALS)
LATCHED, STATUS, COUNTS, DRAG, STAMP_ERROR, SAMPLE = 0, 1, 2, 5, 8, 9

SESSION = shared_memory.WORDS - 1  # word in which the servo keeps the number of its own run, for its writes
LIVELY = 100_000_000  # [ns] within which a device that is there has written
AHEAD = 20_000_000  # [ns] beyond which a sample from the future is nonsense: it would hide a silent device so long


class SharedMemoryInterface:
    """The device in the shared memory of this name, as haptic_loopback serves it; session: of this servo's run."""

    def __init__(self, name, session):
        self._shared = shared_memory.SharedMemory(name, shared_memory.SERVO)
        self.stale = self._shared.stale
        self.memory = self._shared.words
        self.memory[SESSION] = session
        self.read, self.write = compiled()
        self._scratch = clock.scratch()

    def present(self):
        age = clock.now_ns(self._scratch) - self.memory[shared_memory.DEVICE_FIRST + 3]
        return self._shared.peer_present() and abs(age) < LIVELY

    def delay(self):
        return max(0, *map(int, self.memory[shared_memory.DEVICE_FIRST + 10 :][:2])) * 1e-9

    def watchdog(self):
        return int(self.memory[shared_memory.DEVICE_WATCHDOG]) * 1e-9

    def close(self):
        self.memory = None  # a view that is left would keep the mapping
        self._shared.close()


def _read(memory, deadline, give_up, sample):
    block, scratch = np.empty(shared_memory.DEVICE_WORDS, np.int64), np.empty(2, np.int64)
    fresh = shared_memory.read_device(memory, block, deadline, give_up, scratch)
    if fresh < 0 or block[1] > clock.now_ns(scratch) + AHEAD:  # it died while it wrote, or wrote nonsense
        return 0
    # a float64 would round a long word, and its low bits away
    sample[LATCHED], sample[STATUS] = block[1], block[2] & faults.DEVICE_BITS
    sample[STAMP_ERROR] = max(0, block[11])
    reals = block.view(np.float64)
    for i in range(3):
        sample[COUNTS + i], sample[DRAG + i] = block[4 + i], reals[7 + i]
    return fresh


def _write(memory, written, next_deadline, period, engaged, motor):
    block = np.empty(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.write_servo(memory, block, memory[SESSION], written, next_deadline, period, engaged, motor)
    return 0


@functools.cache
def compiled():
    """Both as function pointers; compiled where there is such an interface, not in each process that imports this."""
    return kernel(READ)(_read), kernel(WRITE)(_write)
