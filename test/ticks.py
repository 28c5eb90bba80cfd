# SPDX-License-Identifier: Apache-2.0
"""A tick of the servo for tests, by a kernel that is there since set-up: `servo.tick` itself is part of others only."""

from haptic_device.runtime import recompute


def tick(settings, memory, row):
    """One tick, in place; SETTINGS, MEMORY and TICK arrays of one."""
    row["margin"], row["surplus"] = settings["margin"], settings["surplus"]
    recompute.recompute(settings, memory, row, recompute.NO_SETS)
