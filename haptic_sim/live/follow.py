# SPDX-License-Identifier: Apache-2.0
"""Follows a run to its end."""

import math
import sys
import time
from collections.abc import Callable

from haptic_device.control.faults import NAMES
from haptic_device.status import number
from haptic_sim.client import Client
from haptic_sim.live.news import LIMIT, News

NODES = ("haptic_driver", "haptic_simulation", "haptic_loopback")
AFTER_MOTION = 0.6  # s: the nodes' diagnostics come twice a second, the last one shall be of the end
LOOK_PERIOD = 0.05  # s


Check = Callable[[], dict[str, str]]


def follow(seconds: float | None, client: Client, check: Check, show: Callable[[str], None]) -> bool:
    """Returns when `seconds` have passed since the first motor command or, if None, when the motion has ended.

    False if the motion did not end, which is said. At each look `check` is called, which may raise and gives the last
    line that each node printed, and `show` hears how it goes. ValueError if no motor command comes.
    """
    news = News(client, *NODES)
    if not _wait(lambda: client.motor_commanded or _faulty(client), news.ended, client, check, show):
        raise ValueError(f"no motor command came, and no news for {LIMIT:.0f} s: {news.last_words()}")
    if not client.motor_commanded:
        raise ValueError(f"no motor command came: {news.last_words()}")
    if seconds is not None:
        _pass(seconds, client, check, show)
        return True
    news = News(client, *NODES, moving=True)
    ended = _wait(lambda: client.motion_done, news.ended, client, check, show)
    if not ended:
        print(
            f"haptic demo: the motion did not end, and no news for {LIMIT:.0f} s: {news.last_words()}", file=sys.stderr
        )
    _pass(AFTER_MOTION, client, check, show)
    return ended


def _pass(seconds: float, client: Client, check: Check, show) -> None:
    end = time.monotonic() + seconds
    _wait(lambda: False, lambda printed: time.monotonic() >= end, client, check, show)


def _wait(condition: Callable[[], bool], over: Callable[[dict[str, str]], bool], client, check: Check, show) -> bool:
    """Whether the condition came true before over(what the nodes printed) did."""
    while True:
        client.look()
        printed = check()
        if condition():
            return True
        if over(printed):
            return False
        show(_line(client))
        time.sleep(LOOK_PERIOD)


def _line(client: Client) -> str:
    insertion = number(client.said("haptic_simulation", "result.insertion_fraction"))
    parts = [f"motor {client.motor_force:6.2f} N"]
    if withheld := client.said("haptic_driver", "withheld"):
        parts.append(f"force withheld for {client.said('haptic_driver', 'withheld_s')} s: {withheld}")
    if math.isfinite(insertion):
        parts.append(f"insertion {100 * insertion:5.1f} %")
    for label, name in (("missed ticks", "missed"), ("age [ms]", "age_ms_p50")):
        if said := client.said("haptic_driver", name):
            parts.append(f"{label} {said}")
    return "   ".join(parts)


def _faulty(client: Client) -> bool:
    """Whether the driver waits for a person: after a fault it enables no more by itself."""
    return client.said("haptic_driver", "fault") in NAMES
