# SPDX-License-Identifier: Apache-2.0
"""From where to where each gain may go while all others stay as they are, by the driver's own check of gains."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from haptic_device.config.description import Device
from haptic_device.config.parameter_types import Parameter
from haptic_device.control import controller_config, gain_check
from haptic_display.page.settings import DRIVER, LIVE
from haptic_display.page.state import State

Left = Callable[[float], float]
"""Damping that is left over at a value of a gain."""
GAINS = {
    "coupling.stiffness": ("coupling", "stiffness", slice(0, 2)),
    "coupling.damping": ("coupling", "damping", slice(0, 2)),
    "coupling.rotational_stiffness": ("coupling", "stiffness", 2),
    "coupling.rotational_damping": ("coupling", "damping", 2),
    "cancellation.ratio": ("cancellation", "ratio", None),
}
"""Where in the record of settings a gain stands: group, name and axes."""
WALL_GAINS = ("stiffness", "damping")
NEW_WALL = "new_wall"
MOST_WALLS = 16  # that ranges are found for: with 64 it would take seconds
PRECISE = 1e-5  # of the least and the most, relative
SEARCHED = 60  # steps of a search for a value that is passive, each two thirds of the one before
NORMALS = tuple((math.cos(angle), math.sin(angle)) for angle in np.radians((0.0, 90.0, 22.5, 67.5)))
"""Of a wall that is added: across an axis it needs least of the damping, between them most."""
CHANGED = 0.02  # of the lateness, beyond which the ranges are found anew


class PassiveRanges:
    """`found` is what passive_ranges gave last; lateness as the driver's diagnostics say it."""

    def __init__(self, state: State):
        self._state, self._late, self.found = state, 0.0, dict[str, Any]()
        self._known: tuple[Device, dict[str, Any]] | None = None

    async def follow(self, device: Device | None, values: dict[str, Any]) -> None:
        """Finds the ranges anew, in a thread, if the device, the driver's values or its lateness have changed."""
        late = self._state.said(DRIVER, "lateness_counted_us")
        if not isinstance(device, Device) or not values or not late:
            self.found, self._known = {}, None
            return
        known, lateness = (device, dict(values)), float(late) * 1e-6
        if known == self._known and abs(lateness - self._late) <= CHANGED * self._late:
            return
        self.found = await asyncio.to_thread(passive_ranges, device, values, lateness)
        self._known, self._late = known, lateness


def passive_ranges(device: Device, values: dict[str, Any], lateness: float) -> dict[str, Any]:
    """{name: [least, most]} of each gain, None where no value is passive; of walls {name: [[least, most], ...]}, of the
    first MOST_WALLS.

    new_wall: the most stiffness of one wall more, without damping, across the worst direction. lateness: how late
    forces act, delays of the device included [s]. Where walls do not fit together there are none.
    """
    try:
        settings = controller_config.settings_unjudged(device, values)
    except (ValueError, KeyError):  # KeyError: a driver that does not have all of this version's parameters
        return {}
    found: dict[str, Any] = {}
    for name, (group, field, axes) in GAINS.items():
        if axes != 2 or int(settings["axes"][0]) > 2:
            place = (0,) if axes is None else (0, axes)
            found[name] = _range(settings, lateness, (settings[group][field], place), LIVE[name])
    for field in WALL_GAINS:
        array, count = settings["wall"][field], int(settings["wall"]["count"][0])
        declared = LIVE[f"wall.{field}"]
        places = [(array, (0, i)) for i in range(min(count, MOST_WALLS))]
        found[declared.name] = [_range(settings, lateness, place, declared) for place in places]
    found[NEW_WALL] = _one_more(settings, lateness)
    return found


def _one_more(settings: np.ndarray, lateness: float) -> list[float] | None:
    """[0, most stiffness [N/m]] of a wall that is added, or None if there is no passive one, or no room for one."""
    walls, new = settings["wall"], int(settings["wall"]["count"][0])
    if new >= controller_config.MOST_WALLS:
        return None
    walls["count"] = new + 1
    ranges = []
    for normal in NORMALS if int(settings["axes"][0]) > 1 else NORMALS[:1]:
        walls["x"][0, new], walls["y"][0, new] = normal
        ranges.append(_range(settings, lateness, (walls["stiffness"], (0, new)), LIVE["wall.stiffness"]))
    return None if None in ranges else min(filter(None, ranges))


def _range(
    settings: np.ndarray, lateness: float, where: tuple[np.ndarray, Any], declared: Parameter
) -> list[float] | None:
    """[least, most] within the legal values; where: an array and the place in it that holds the gain."""
    array, place = where
    kept = array[place].copy()

    def left(value: float) -> float:
        """Damping that is left over; it has no more than one rise and fall over the values of one gain."""
        array[place] = value
        return min(gain_check.margins(settings[0], lateness)[1:])

    try:
        passive = kept if kept.ndim == 0 else kept[0]
        if left(passive) <= 0.0:
            passive = _best(left, declared.low, declared.high)
        if left(passive) <= 0.0:
            return None
        return [_end(left, passive, end) for end in (declared.low, declared.high)]
    finally:
        array[place] = kept


def _best(left: Left, low: float, high: float) -> float:
    """The value that leaves most damping over."""
    for _ in range(SEARCHED):
        third = (high - low) / 3.0
        low, high = (low + third, high) if left(low + third) < left(high - third) else (low, high - third)
    return min(low, high, key=lambda value: (-left(value), value))


def _end(left: Left, passive: float, end: float) -> float:
    """The last passive value on the way from a passive one to an end."""
    if left(end) > 0.0:
        return float(end)
    while not math.isclose(passive, end, rel_tol=PRECISE, abs_tol=1e-9):
        middle = 0.5 * (passive + end)
        passive, end = (middle, end) if left(middle) > 0.0 else (passive, middle)
    return float(passive)
