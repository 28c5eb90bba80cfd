# SPDX-License-Identifier: Apache-2.0
"""Follows a run to its end."""

import math
import time
from collections.abc import Callable

from haptic_device.control.faults import NAMES
from haptic_device.status import number
from haptic_sim.client import Client

START_LIMIT = 180.0  # s until the first motor command, on a machine that does much else
MOTION_LIMIT = 120.0  # s for a scripted motion to end
AFTER_MOTION = 0.6  # s: the nodes' diagnostics come twice a second, the last one shall be of the end
LOOK_PERIOD = 0.05  # s


def follow(seconds: float | None, client: Client, check: Callable[[], None], show: Callable[[str], None]) -> bool:
    """Returns when `seconds` have passed since the first motor command or, if None, when the motion has ended.

    True if that came within its limits. At each look `check` is called, which may raise, and `show` hears how it goes.
    """
    if _wait(lambda: client.motor_commanded or _faulty(client), START_LIMIT, client, check, show) is None:
        raise ValueError(f"no motor command came within {START_LIMIT:.0f} s; {_reason(client)}")
    if not client.motor_commanded:
        raise ValueError(f"no motor command came; {_reason(client)}")
    if seconds is not None:
        _wait(lambda: False, seconds, client, check, show)
        return True
    ended = _wait(lambda: client.motion_done, MOTION_LIMIT, client, check, show)
    _wait(lambda: False, AFTER_MOTION, client, check, show)
    return ended is not None


def _wait(condition: Callable[[], bool], limit: float, client: Client, check, show) -> float | None:
    """Time on CLOCK_MONOTONIC [s] when the condition came true; None if it did not within `limit` seconds."""
    end = time.monotonic() + limit
    while (now := time.monotonic()) < end:
        client.look()
        check()
        if condition():
            return now
        show(_line(client))
        time.sleep(LOOK_PERIOD)
    return None


def _line(client: Client) -> str:
    insertion = number(client.said("haptic_simulation", "result.insertion_fraction"))
    parts = [f"motor {client.motor_force:6.2f} N"]
    if math.isfinite(insertion):
        parts.append(f"insertion {100 * insertion:5.1f} %")
    for label, name in (("missed ticks", "missed"), ("age [ms]", "age_ms_p50")):
        if said := client.said("haptic_driver", name):
            parts.append(f"{label} {said}")
    return "   ".join(parts)


def _faulty(client: Client) -> bool:
    """Whether the driver waits for a person: after a fault it enables no more by itself."""
    return client.said("haptic_driver", "fault") in NAMES


def _reason(client: Client) -> str:
    silent = [name for name in ("haptic_driver", "haptic_simulation", "haptic_loopback") if name not in client.statuses]
    if silent:
        return f"nothing was heard of {', '.join(silent)}"
    return f"haptic_driver says: {client.statuses['haptic_driver'].message}"
