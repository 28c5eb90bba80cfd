# SPDX-License-Identifier: Apache-2.0
"""Time for kernels; the only file whose kernels ask what time it is."""

import numpy as np
from numba import types

from haptic_device.jit import kernel

MONOTONIC = 1
TIMER_ABSTIME = 1
EINTR = 4  # of errno: a signal ended the wait

_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.CPointer(types.int64)))
_nanosleep = types.ExternalFunction(
    "clock_nanosleep", types.int32(types.int32, types.int32, types.CPointer(types.int64), types.CPointer(types.int64))
)


@kernel
def now_ns(scratch):
    """Nanoseconds of CLOCK_MONOTONIC, the same for all processes of this host; scratch: int64 array (2)."""
    _gettime(MONOTONIC, scratch.ctypes)
    return scratch[0] * 1_000_000_000 + scratch[1]


@kernel
def sleep_until(deadline, scratch):
    """Sleeps to an absolute CLOCK_MONOTONIC time [ns], whatever signals come; returns at once if it has passed."""
    scratch[0], scratch[1] = deadline // 1_000_000_000, deadline % 1_000_000_000
    while _nanosleep(MONOTONIC, TIMER_ABSTIME, scratch.ctypes, scratch.ctypes) == EINTR:
        pass


def scratch():
    """Room that the kernels of this file write a time into."""
    return np.zeros(2, np.int64)
