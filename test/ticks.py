# SPDX-License-Identifier: Apache-2.0
"""A tick of the servo for tests, by a kernel that is there since set-up: `servo.tick` itself is part of others only."""

from haptic_device.realtime import tick_replay


def tick(settings, memory, row):
    """One tick, in place; SETTINGS, MEMORY and TICK arrays of one."""
    row["margin"], row["surplus"] = settings["passivity"]["margin"], settings["passivity"]["surplus"]
    row["lateness_least"], row["lateness_counted"] = settings["port"]["least"], settings["port"]["most"]
    row["lateness_ratio"] = settings["port"]["ratio"]
    tick_replay.recompute(settings, memory, row, tick_replay.NO_SETS)
