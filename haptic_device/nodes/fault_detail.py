# SPDX-License-Identifier: Apache-2.0
"""Number and first step of a latched fault, from the tick that latched it, as its row of the table says them."""

import numpy as np

from haptic_device.control import faults
from haptic_device.control.records import TRACE_ROW
from haptic_device.digits import apart, plain

KEPT = 64  # ticks before the one that latched a fault
DIGITS = 6  # at most, of a value that is beyond its limit


class LatchedFault:
    """The number of the last fault that the rows of a servo show."""

    def __init__(self, link="", watchdog=float):
        """link: the type of the device's; watchdog: returns the device's [s], 0: not known."""
        self._rows, self._found, self._cuts = np.zeros(0, TRACE_ROW), (faults.NONE, "", ""), watchdog
        self._place = link and (faults.SIMULATED if link == "loopback" else faults.LINE)

    def add(self, rows: np.ndarray, settings: np.void) -> None:
        """The next rows of the trace, with the SETTINGS record that they were made by."""
        known = np.concatenate([self._rows, rows])
        code = known["fault"]
        new = np.flatnonzero((code != faults.NONE) & (np.concatenate([[faults.NONE], code[:-1]]) != code))
        if len(new) and new[-1] >= len(self._rows):
            first, end = max(0, new[-1] - KEPT), new[-1] + 1  # the first of all may have no row before it
            self._found = int(code[new[-1]]), *told(known[first:end], settings, self._place, self._cuts())
        self._rows = known[-KEPT:].copy()

    def sentence(self, code: int) -> str:
        """The number of the fault with this code, in words; "" where there is none, or it is not known."""
        return self._found[1] if self._found[0] == code else ""

    def first(self, code: int) -> str:
        """What a person does first about the fault with this code; "" where there is nothing, or it is not known."""
        return self._found[2] if self._found[0] == code else ""


def told(rows: np.ndarray, settings: np.void, place: str = "", watchdog: float = 0.0) -> tuple[str, str]:
    """Number and first step of the fault of the last of these rows, as the table says them where its cause was; the
    number "" where it is not known. place: of the device; watchdog: of the device [s], 0: not known."""
    fault = faults.FAULTS.get(faults.name_of(rows["fault"][-1]))
    if fault is None:  # of a newer driver
        return "", ""
    fields = fault.measure(faults.Ticks(rows, settings, watchdog)) or {}
    number, first = fault.at.get(fields.pop("at", place), (fault.number, fault.first))
    return number.format_map(_texts(fields)) if fields else "", first


def _texts(fields):
    """Numbers as texts; what is beyond its limit with enough digits to see that it is, or in words."""
    said = {name: plain(value) if isinstance(value, float | np.floating) else value for name, value in fields.items()}
    beyond = "value" if "value" in fields else "time"
    if beyond in fields and "limit" in fields:
        said[beyond], said["limit"] = apart(fields[beyond], fields["limit"], DIGITS)
        if said[beyond] == said["limit"] and fields[beyond] != fields["limit"]:
            said[beyond] = f"just beyond {said['limit']}"
    return said
