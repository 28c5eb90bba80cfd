# SPDX-License-Identifier: Apache-2.0
"""The device's shared memory ("page" in messages): it behaves like the registers of a hardware-timed DAQ card.

One block of int64 words each way, each under a sequence lock. The device latches encoders at the servo's nominal
deadlines; the servo's write carries its time and the next deadline, up to which the device holds that motor value.
Either side may start, end and return first. Who is there is told by locks on bytes of its file, which the kernel
drops when a process ends, however it ends; the last one out removes the file.
"""

import fcntl
import mmap
import os
import struct
from pathlib import Path

import numpy as np

from haptic_device.control import faults
from haptic_device.jit import kernel
from haptic_device.realtime import atomic, clock, futex

FOLDER = Path("/dev/shm")
_FLOCK = "hhqqi4x"  # struct flock of the kernel
MAGIC, LAYOUT_VERSION, WORDS = 0x6861707469630001, 2, 64
DEVICE, SERVO = "device", "servo"
ROLE_BYTE = {DEVICE: 0, SERVO: 1}
GATE_BYTE = 2  # held by who comes or goes, so that nobody opens a file that another one is about to remove

# words of either block, each with its lock before it and apart from the other: no two writers share a cache line
DEVICE_LOCK, DEVICE_FIRST = 8, 9
DEVICE_WORDS = 12  # session, latched, status, alive, counts 3, drag 3, delay, stamp error: 0 by those who know none
DEVICE_WATCHDOG = 21  # word beside that block: time without a write after which the device cuts [ns], 0: unknown
SERVO_LOCK, SERVO_FIRST, SERVO_WORDS = 32, 33, 8  # session, written, next deadline, period, engaged, motor 3
WATCHDOG, CLOCK = faults.WATCHDOG, faults.CLOCK  # bits of status: the device has cut the motor; its clock is not good
# enough; the others are there too
SPIN, PAUSE = 10_000, 30_000  # [ns] that a sample is looked for without a pause; longest pause after that, else woken
WAKE = 60_000  # [ns] that a sleeper may wake late: the last of a wait is spent awake, so that it ends in time


class SharedMemoryError(OSError):
    """The shared memory cannot be had; one sentence says why."""


def file_name(domain, namespace):
    """Name of the file in FOLDER for this ROS domain and namespace."""
    return f"haptic_display.{domain}.{namespace.strip('/').replace('/', '.') or 'root'}"


class SharedMemory:
    """One side's hold; `words` is the memory (WORDS int64), `stale`: it was left by owners that had died."""

    def __init__(self, name, role):
        self.path, self.role = FOLDER / name, role
        self.peer = SERVO if role == DEVICE else DEVICE
        self.words = self._open()

    def _open(self):
        while True:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            _lock(self._file, GATE_BYTE, wait=True)
            if self._still_there():
                break
            os.close(self._file)  # removed by its last owner between our open and our lock
        try:
            words = self._claim()
        except OSError:
            self._let_go()
            raise
        _unlock(self._file, GATE_BYTE)
        return words

    def _let_go(self):
        """Gives the locks up by name: a mapping that somebody still looks at keeps the file open, and its locks."""
        for byte in (ROLE_BYTE[self.role], GATE_BYTE):
            _unlock(self._file, byte)
        os.close(self._file)

    def _still_there(self):
        try:
            return os.stat(self.path).st_ino == os.fstat(self._file).st_ino
        except FileNotFoundError:
            return False

    def _claim(self):
        if not _lock(self._file, ROLE_BYTE[self.role]):
            raise SharedMemoryError(
                f"page {self.path} is held by another {self.role}; stop it, or use another namespace"
            )
        alone = not self.peer_present()
        self.stale = alone and os.fstat(self._file).st_size > 0
        os.ftruncate(self._file, 8 * WORDS)
        self._reserve()
        self._map = mmap.mmap(self._file, 8 * WORDS)
        words = np.frombuffer(self._map, np.int64)
        if alone:
            words[:] = 0
            words[:2] = MAGIC, LAYOUT_VERSION
        if words[0] != MAGIC or words[1] != LAYOUT_VERSION:
            raise SharedMemoryError(
                f"page {self.path} has layout version {words[1]}, this program speaks {LAYOUT_VERSION}"
            )
        return words

    def _reserve(self):
        """Has the memory set aside now: to write where there is none would end the process (SIGBUS)."""
        try:
            os.posix_fallocate(self._file, 0, 8 * WORDS)
        except OSError as error:
            if not self.peer_present() and self._still_there():
                self.path.unlink()
            needed = f"page {self.path} needs {8 * WORDS} bytes of {FOLDER}"
            raise SharedMemoryError(f"{needed}, which cannot be had: {error.strerror}") from None

    def peer_present(self):
        """Whether a process holds the other role now; asked without taking its lock, which it may be about to take."""
        answer = fcntl.fcntl(self._file, fcntl.F_OFD_GETLK, _request(fcntl.F_WRLCK, ROLE_BYTE[self.peer]))
        return struct.unpack(_FLOCK, answer)[0] != fcntl.F_UNLCK

    def close(self):
        """Lets it go; removes the file if the other side is not there."""
        if self.words is None:
            return
        self.words = None
        _lock(self._file, GATE_BYTE, wait=True)
        if not self.peer_present() and self._still_there():
            self.path.unlink()
        self._let_go()


def _lock(file, byte, wait=False):
    """Takes the lock on one byte, of this open file and not of the process; False if another has it."""
    try:
        fcntl.fcntl(file, fcntl.F_OFD_SETLKW if wait else fcntl.F_OFD_SETLK, _request(fcntl.F_WRLCK, byte))
    except (BlockingIOError, PermissionError):
        return False
    return True


def _unlock(file, byte):
    fcntl.fcntl(file, fcntl.F_OFD_SETLK, _request(fcntl.F_UNLCK, byte))


def _request(kind, byte):
    return struct.pack(_FLOCK, kind, os.SEEK_SET, byte, 1, 0)


@kernel
def write_device(words, block, session, latched, status, alive, counts, drag, delay, stamp_error):
    """Device side: encoder counts and damper forces [N | N m], sampled at `latched` [ns].

    block: int64 scratch (DEVICE_WORDS). delay: how late the motor acts after the servo's write, as the link measures
    it, from the earliest that the counts may be of [ns]; 0: not known. stamp_error: half-width of what is not known of
    `latched` [ns].
    """
    block[0], block[1], block[2], block[3] = session, latched, status, alive
    reals = block.view(np.float64)
    for i in range(3):
        block[4 + i] = np.int64(counts[i])
        reals[7 + i] = drag[i]
    block[10], block[11] = delay, stamp_error
    atomic.publish(words, DEVICE_LOCK, DEVICE_FIRST, block)


@kernel
def read_servo(words, block):
    """Device side: the servo's last write into block (SERVO_WORDS), motor as float64 bits; returns its sequence."""
    return atomic.collect(words, SERVO_LOCK, SERVO_FIRST, block)


@kernel
def write_servo(words, block, session, written, next_deadline, period, engaged, motor):
    """Servo side: motor values [motor units] written at this time, held up to the next deadline and beyond."""
    block[0], block[1], block[2], block[3], block[4] = session, written, next_deadline, period, engaged
    reals = block.view(np.float64)
    for i in range(3):
        reals[5 + i] = motor[i]
    atomic.publish(words, SERVO_LOCK, SERVO_FIRST, block)


@kernel
def read_device(words, block, deadline, give_up, scratch):
    """Servo side: the sample latched at this deadline into block, waiting for it no longer than give_up [ns].

    Returns 1 if the sample is of this deadline, 0 if an older one had to do, −1 if the device left none that is whole.
    A device that wakes those who wait at DEVICE_LOCK (futex) is heard at once, another one after a pause.
    """
    began = clock.now_ns(scratch)
    while True:
        seen = atomic.load(words, DEVICE_LOCK)
        turn = atomic.collect(words, DEVICE_LOCK, DEVICE_FIRST, block)
        if turn >= 0 and block[1] >= deadline:
            return 1
        now = clock.now_ns(scratch)
        if now >= give_up:
            return 0 if turn >= 0 else -1
        if (
            now - began > SPIN and give_up - now > WAKE
        ):  # whoever brings the sample may need this core: of a serial line it is a kernel thread
            futex.wait(words, DEVICE_LOCK, seen, min(now + PAUSE, give_up - WAKE), scratch)
