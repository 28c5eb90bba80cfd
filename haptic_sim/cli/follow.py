# SPDX-License-Identifier: Apache-2.0
"""Follows a run to its end, and shows how it goes on standard error."""

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator

from haptic_device.control.faults import NAMES
from haptic_device.status import number
from haptic_sim.cli.keys import ESTOP, keys
from haptic_sim.cli.live import Live

START_LIMIT = 180.0  # s until the first motor command, on a machine that does much else
MOTION_LIMIT = 120.0  # s for a scripted motion to end
AFTER_MOTION = 0.6  # s: the nodes' diagnostics come twice a second, the last one shall be of the end
LOOK_PERIOD = 0.05  # s


def follow(seconds: float | None, domain: int, check: Callable[[], None]) -> bool:
    """Returns when `seconds` have passed since the first motor command or, if None, when the motion has ended.

    True if that came within its limits. `check` is called at each look and may raise.
    """
    with contextlib.closing(Live(domain)) as live, keys() as pressed, _display() as show:
        check = _stopping(live, pressed, check)
        if _wait(lambda: live.motor_commanded or _faulty(live), START_LIMIT, live, check, show) is None:
            raise ValueError(f"no motor command came within {START_LIMIT:.0f} s; {_reason(live)}")
        if not live.motor_commanded:
            raise ValueError(f"no motor command came; {_reason(live)}")
        if seconds is not None:
            _wait(lambda: False, seconds, live, check, show)
            return True
        ended = _wait(lambda: live.motion_done, MOTION_LIMIT, live, check, show)
        _wait(lambda: False, AFTER_MOTION, live, check, show)
        return ended is not None


def _stopping(live: Live, pressed: Callable[[], str], check: Callable[[], None]) -> Callable[[], None]:
    """The check of each look, which now hears the space key too: it is the e-stop."""

    def look_at_keys() -> None:
        check()
        if pressed() == ESTOP:
            print(f"e-stop: {live.commands.call('estop')[1]}", file=sys.stderr, flush=True)

    return look_at_keys


def _wait(condition: Callable[[], bool], limit: float, live: Live, check, show) -> float | None:
    """Time on CLOCK_MONOTONIC [s] when the condition came true; None if it did not within `limit` seconds."""
    end = time.monotonic() + limit
    while (now := time.monotonic()) < end:
        live.look()
        check()
        if condition():
            return now
        show(_line(live))
        time.sleep(LOOK_PERIOD)
    return None


def _line(live: Live) -> str:
    insertion = number(live.said("haptic_simulation", "result.insertion_fraction"))
    parts = [f"motor {live.motor_force:6.2f} N"]
    if math.isfinite(insertion):
        parts.append(f"insertion {100 * insertion:5.1f} %")
    for label, name in (("missed ticks", "missed"), ("age [ms]", "age_ms_p50")):
        if said := live.said("haptic_driver", name):
            parts.append(f"{label} {said}")
    return "   ".join(parts)


def _faulty(live: Live) -> bool:
    """Whether the driver waits for a person: after a fault it enables no more by itself."""
    return live.said("haptic_driver", "fault") in NAMES


def _reason(live: Live) -> str:
    silent = [name for name in ("haptic_driver", "haptic_simulation", "haptic_loopback") if name not in live.statuses]
    if silent:
        return f"nothing was heard of {', '.join(silent)}"
    return f"haptic_driver says: {live.statuses['haptic_driver'].message}"


@contextlib.contextmanager
def _display() -> Iterator[Callable[[str], None]]:
    """On a terminal one line that is kept up to date; elsewhere a line a second."""
    from rich.console import Console
    from rich.live import Live as Display
    from rich.text import Text

    began, last = time.monotonic(), -math.inf
    console = Console(stderr=True)

    def print_each_second(line: str) -> None:
        nonlocal last
        if time.monotonic() - last >= 1.0:
            last = time.monotonic()
            print(stamped(line), file=sys.stderr, flush=True)

    def stamped(line: str) -> str:
        return f"{time.monotonic() - began:6.1f} s   {line}"

    if not console.is_terminal:
        yield print_each_second
        return
    with Display(console=console, auto_refresh=False) as display:
        yield lambda line: display.update(Text(stamped(line)), refresh=True)
