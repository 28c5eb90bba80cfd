# SPDX-License-Identifier: Apache-2.0
"""What a device believes of the servo's writes in its page."""

import math

import numpy as np

from haptic_device.jit import njit

NEAR = 1_000_000_000  # [ns] from now within which the times of a write make sense
PERIODS = 10_000, 10_000_000  # [ns] that a servo may have


@njit
def sensible(inbox, now, watchdog):
    """Whether a write is of the last second, its deadline near now, its period a servo's, and its motor values numbers.

    The next write may be announced for two periods ahead, and no further than the watchdog waits: up to then the plant
    goes on with this motor value.
    """
    near = 0 <= now - inbox[1] < NEAR and -NEAR < inbox[2] - now <= max(2 * inbox[3], watchdog)
    motor = inbox.view(np.float64)[5:]
    finite = abs(motor[0]) < math.inf and abs(motor[1]) < math.inf and abs(motor[2]) < math.inf
    return near and PERIODS[0] <= inbox[3] <= PERIODS[1] and finite


@njit
def holds(inbox):
    """Whether a write engages the display or drives the motor; the last one of a servo that ends does neither."""
    motor = inbox.view(np.float64)[5:]
    return inbox[4] != 0 or motor[0] != 0.0 or motor[1] != 0.0 or motor[2] != 0.0
