# SPDX-License-Identifier: Apache-2.0
"""Follows a run to its end, or to the fault that ends it."""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from haptic_device.control.enable_state import STATES, WAITING
from haptic_device.control.faults import FAULTS
from haptic_device.digits import amount
from haptic_device.recording.status import number
from haptic_display.client import Client
from haptic_display.fault_sentence import called, what_to_do
from haptic_display.run.news import News

NODES, LOOPBACK, BRIDGE = ("haptic_driver", "haptic_simulation"), "haptic_loopback", "haptic_bridge"
AFTERWARDS = 0.6  # s: the nodes' diagnostics come twice a second, the last one shall be of the end
NUMBER = 0.2  # s within which the driver tells the number of a fault
LOOK_PERIOD = 0.05  # s
PATIENCE = 30.0  # s that the driver may wait for a small force: a hand that is simulated holds still until then


Check = Callable[[], dict[str, str]]


class Ending(NamedTuple):
    """How a run ended. why: a sentence, "" if it ended as asked; fault: what ended it, by name, or "".

    commanded: whether the motor was seen to be; begun: whether the operator's motion had begun.
    """

    why: str
    fault: str
    commanded: bool
    begun: bool


def follow(
    seconds: float | None, client: Client, check: Check, show: Callable[[str], None], tell: Callable[[str], None]
) -> Ending:
    """Returns when `seconds` have passed since the first motor command or, if None, when the motion has ended.

    A fault that is latched ends the run, for nobody will clear it. So does a driver that waits for a small force for
    PATIENCE, and the end of all news (news.py); the device's clock is news only when the motion has begun, or a display
    that never engages would be waited for without end. At each look `check` is called, which may raise and gives the
    last line that each node printed, and `show` hears how it goes; `tell` hears of a fault as soon as it is latched.
    """
    run, nodes = _Run(client, check, show, tell), (*NODES, BRIDGE if BRIDGE in check() else LOOPBACK)
    if why := run.wait(lambda: run.commanded, News(client, *nodes)):
        came = "was seen" if run.fault else "came"  # one between two looks, the fault after it, is in the bag alone
        return Ending(f"no motor command {came}{why}", run.fault, False, False)
    end = time.monotonic() + (seconds or 0.0)
    if seconds is not None:
        lack, why = f"the run did not last {seconds:g} s", run.wait(lambda: time.monotonic() >= end)
    elif why := run.wait(lambda: run.begun or client.motion_done, News(client, *nodes)):
        lack = "the motion did not begin"
    else:
        lack, why = "the motion did not end", run.wait(lambda: client.motion_done, News(client, *nodes, moving=True))
    if why or seconds is None:
        run.rest(AFTERWARDS)
    return Ending(f"{lack}{why}" if why else "", run.fault, True, run.begun)


class _Run:
    """A run that is looked at. fault: what ended a wait, by name; commanded, begun: whether the motor was seen to have
    been commanded, the motion to have begun."""

    def __init__(self, client: Client, check: Check, show: Callable[[str], None], tell: Callable[[str], None]):
        self.fault, self.commanded, self.begun = "", False, False
        self._client, self._check, self._show, self._tell = client, check, show, tell

    def wait(self, condition: Callable[[], bool], news: News | None = None) -> str:
        """Until the condition is true; what came before that did, a fault or the end of the news, or ""."""
        while True:
            printed = self._look()
            if condition():
                return ""
            if (said := self._client.said("haptic_driver", "fault")) in FAULTS:
                self.fault = said
                self._tell(called(said))
                self.rest(NUMBER)
                number, first = (self._client.said("haptic_driver", f"fault_{entry}") for entry in ("detail", "first"))
                return f": {what_to_do(said, number, first=first)}"
            if news and self._withheld():
                return f": {self._client.statuses['haptic_driver'].message}"
            if news and news.ended(printed):
                return f", and {news.last_words()}"
            self._pause()

    def rest(self, seconds: float) -> None:
        """So long, whatever comes."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._look()
            self._pause()

    def _look(self) -> dict[str, str]:
        self._client.look()
        self.begun |= self._client.said("haptic_driver", "state") == "engaged"
        self.commanded |= self._client.motor_commanded or self.begun  # a fault may end it between two looks
        return self._check()

    def _withheld(self) -> bool:
        state, seconds = (self._client.said("haptic_driver", entry) for entry in ("state", "withheld_s"))
        return state == STATES[WAITING] and number(seconds) >= PATIENCE

    def _pause(self) -> None:
        self._show(_line(self._client))
        time.sleep(LOOK_PERIOD)


def _line(client: Client) -> str:
    insertion = number(client.said("haptic_simulation", "result.insertion_fraction"))
    parts = [f"motor {client.motor_force:.2f} N"] if client.truth else []
    if withheld := client.said("haptic_driver", "withheld"):
        parts.append(f"force withheld for {client.said('haptic_driver', 'withheld_s')} s: {withheld}")
    if math.isfinite(insertion):
        parts.append(f"inserted {100 * min(max(0.0, insertion), 1.0):.0f} %")
    if math.isfinite(age := 1e-3 * number(client.said("haptic_driver", "age_ms_p50"))):
        parts.append(f"tool known {amount(age, 's')} ago")
    if missed := client.said("haptic_driver", "missed"):
        parts.append(f"servo ticks missed: {missed}")
    return ", ".join(parts) or "nothing is heard of the nodes yet"
