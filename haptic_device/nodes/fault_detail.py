# SPDX-License-Identifier: Apache-2.0
"""The number of a latched fault, from the tick that latched it: the sentence `number` of the table of faults."""

import math

import numpy as np

from haptic_device.control import faults
from haptic_device.control.records import TRACE_ROW
from haptic_device.digits import apart, plain
from haptic_device.message_fields import AXES

KEPT = 64  # ticks before the one that latched a fault
DIGITS = 6  # at most, of a value that is beyond its limit
UNITS, FORCES = ("m", "m", "rad"), ("N", "N", "N m")
FINITE = {
    "position": "position",
    "velocity": "velocity",
    "force_walls": "force of the walls",
    "force_coupling": "force of the coupling",
    "force_cancellation": "force of the damping compensation",
    "force_passivity": "force of the passivity controller",
}
SUM = "force_walls", "force_coupling", "force_cancellation", "force_passivity"


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
    code = int(rows["fault"][-1])
    fields = _FIELDS[code](rows, settings) if code in _FIELDS else None
    if code == faults.DEVICE_WATCHDOG:
        place, fields = _unheard(rows, settings, place, watchdog)
    [fault] = [fault for fault in faults.TABLE if fault.code == code]
    sentence, first = faults.AT.get((code, place), (fault.number, fault.first))
    return sentence.format_map(_texts(fields)) if fields else "", first


def _texts(fields):
    """Numbers as texts; what is beyond its limit with enough digits to see that it is, or in words."""
    said = {name: plain(value) if isinstance(value, float | np.floating) else value for name, value in fields.items()}
    beyond = "value" if "value" in fields else "time"
    if beyond in fields and "limit" in fields:
        said[beyond], said["limit"] = apart(fields[beyond], fields["limit"], DIGITS)
        if said[beyond] == said["limit"] and fields[beyond] != fields["limit"]:
            said[beyond] = f"just beyond {said['limit']}"
    return said


def _along(i, **fields):
    return {"axis": AXES[i], "unit": UNITS[i], "force": FORCES[i], **fields}


def _axes(settings):
    return range(int(settings["axes"]))


def _places(row, settings):
    """Of each axis at the device [m, m, rad]."""
    device = settings["hardware"]
    return [row["counts"][i] * device["position_per_count"][i] - device["zero"][i] for i in _axes(settings)]


def _silent(rows, settings):
    waited, limit = (rows["deadline"][-1] - rows["latched"][-1]) * 1e-9, float(settings["fault"]["silence"])
    return {"time": max(waited, limit), "limit": limit}  # counted in ticks where the device's clock is ahead


def _not_finite(rows, settings):
    for name, what in FINITE.items():
        for i in _axes(settings):
            if not math.isfinite(value := float(rows[name][-1][i])):
                return _along(i, what=what, value="not a number" if math.isnan(value) else "infinite")
    return None


def _jump(rows, settings):
    if len(rows) < 2:
        return None
    elapsed = (rows["latched"][-1] - rows["latched"][-2] + rows["stamp_error"][-2:].sum()) * 1e-9  # as sensing has it
    before, after = (_places(row, settings) for row in rows[-2:])
    ways = [
        _along(i, value=abs(after[i] - before[i]), limit=2.0 * settings["hardware"]["velocity_limit"][i] * elapsed)
        for i in _axes(settings)
    ]
    return _first_beyond(ways, time=elapsed * 1e3)


def _outside(rows, settings):
    device, places = settings["hardware"], _places(rows[-1], settings)
    for i, place in enumerate(places):
        low, high = float(device["position_low"][i]), float(device["position_high"][i])
        if not low <= place <= high:
            return _along(i, value=place, limit=low if place < low else high)
    return None


def _fast(rows, settings):
    device = settings["hardware"]
    speeds = [
        _along(i, value=abs(rows["velocity"][-1][i]) / device["scale"][i], limit=device["velocity_limit"][i])
        for i in _axes(settings)
    ]
    return _first_beyond(speeds)


def _saturated(rows, settings):
    """Of the tick before, for in this one nothing is wanted any more."""
    if len(rows) < 2:
        return None
    row, device, wanted = rows[-2], settings["hardware"], []
    for i in _axes(settings):
        limit = settings["force"]["limit"][i]
        total = min(limit, max(-limit, sum(row[name][i] for name in SUM))) * row["engage"]
        force = device["scale"][i] * total + row["force_gravity"][i] * row["engage"]
        wanted.append(_along(i, value=abs(force), limit=device["motor_limit"][i]))
    return _first_beyond(wanted, time=float(settings["fault"]["saturation"]))


def _unheard(rows, settings, place, watchdog):
    """Where commands were held up, and for how long: at the servo itself if it missed what tells half of the time."""
    longest = float(np.diff(rows["deadline"]).max(initial=0.0)) * 1e-9
    if longest > max(1.5 * settings["period"], 0.5 * watchdog):
        return faults.SERVO, {"time": longest}
    return place, {"time": watchdog} if watchdog else None


def _warm(rows, settings):
    limit = float(settings["fault"]["duty"])
    loads = [_along(i, value=math.sqrt(max(0.0, rows["thermal_load"][-1][i])), limit=limit) for i in _axes(settings)]
    return max(loads, key=lambda load: load["value"])


def _unattended(rows, settings):
    return {"limit": float(settings["fault"]["unattended"])}


def _on_switch(rows, settings):
    told = zip(AXES, _places(rows[-1], settings), UNITS, strict=False)
    return {"place": ", ".join(f"{axis} = {plain(place, unit)}" for axis, place, unit in told)}


def _first_beyond(found, **more):
    """Fields of the first axis whose value is beyond its limit; None where none is."""
    return next((each | more for each in found if each["value"] > each["limit"]), None)


_FIELDS = {
    faults.DEVICE_SILENT: _silent,
    faults.NOT_A_NUMBER: _not_finite,
    faults.ENCODER_JUMP: _jump,
    faults.POSITION: _outside,
    faults.VELOCITY: _fast,
    faults.SATURATION: _saturated,
    faults.DUTY: _warm,
    faults.UNATTENDED: _unattended,
    faults.DEVICE_LIMIT: _on_switch,
}
