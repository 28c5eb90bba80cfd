# SPDX-License-Identifier: Apache-2.0
"""To wait until a word of shared memory changes, in the kernel and not by looking (man futex)."""

import platform

from numba import types

from haptic_device.jit import kernel

NUMBER = 202 if platform.machine() == "x86_64" else 98  # of the system call; 98 on all later architectures
WAKE, WAIT_BITSET = 1, 9  # the latter takes an absolute time
ANY = 0xFFFFFFFF
ALL = 0x7FFFFFFF

_pointer = types.CPointer(types.int64)
_syscall = types.ExternalFunction(
    "syscall", types.intp(types.intp, _pointer, types.intp, types.intp, _pointer, types.intp, types.intp)
)


@kernel
def wait(words, index, seen, until, scratch):
    """Returns when words[index] is no longer `seen`, at `until` [ns of CLOCK_MONOTONIC], or without a reason.

    Only its lower 32 bits are looked at, and whoever changes it has to wake. words: int64 array in memory that others
    may share; scratch: int64 array (2).
    """
    scratch[0], scratch[1] = until // 1_000_000_000, until % 1_000_000_000
    _syscall(NUMBER, words[index:].ctypes, WAIT_BITSET, seen & 0xFFFFFFFF, scratch.ctypes, 0, ANY)


@kernel
def wake(words, index):
    """Wakes all who wait for words[index]; returns how many they were."""
    return _syscall(NUMBER, words[index:].ctypes, WAKE, ALL, words[:1].ctypes, 0, 0)
