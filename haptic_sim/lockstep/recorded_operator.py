# SPDX-License-Identifier: Apache-2.0
"""A recorded hand in lock-step, in place of a script: as the target that the modelled hand follows, or as the device.

As target the hand's own spring and damper are between the recording and the handle, so that the handle gives way as
it did. As device the handle is where it was, whatever the display does: the same motion to the last count.
"""

import numpy as np

from haptic_device.config.drives import drives_at
from haptic_device.device import operator_hand
from haptic_device.realtime import tick_replay
from haptic_sim.lockstep.lockstep import Lockstep


class PlayedTarget:
    """The hand's recorded target over time; times [ns] of lock-step, points (n, 3) in the device's own units."""

    def __init__(self, times: np.ndarray, points: np.ndarray):
        self.times, self.points = times, points

    def begin(self, system: Lockstep) -> None:
        """Puts handle and target where the recording begins."""
        system.motion["kind"], system.motion["started"] = operator_hand.PATH, 1
        system.motion["grip"] = 1.0
        system.plant_memory["position"] = system.plant_memory["target"] = self.points[0]

    def run(self, system: Lockstep, rows: np.ndarray, start: int) -> None:
        """Ticks of the system from this time [ns] on."""
        done = 0
        while done < len(rows):
            now = start + done * system.period
            ticks = max(1, (self._fill(system.motion, now - system.period) - now) // system.period)
            part = rows[done : done + ticks]
            system.script_ticks(part, now)
            part["tick"] += done
            done += len(part)

    def _fill(self, motion: np.ndarray, now: int) -> int:
        """The path from `now` on, as much as fits; returns when it ends."""
        first = max(0, int(np.searchsorted(self.times, now, side="right")) - 1)
        times = self.times[first : first + operator_hand.MOST]
        motion["count"] = len(times)
        motion["times"][0, : len(times)] = (times - 1) * 1e-9
        motion["points"][0, : len(times)] = self.points[first : first + len(times)]
        return int(times[-1]) if first + len(times) < len(self.times) else 1 << 62


class PlayedDevice:
    """The handle's recorded position over time, as counts of the device; times [ns] of lock-step, points in world."""

    def __init__(self, times: np.ndarray, points: np.ndarray):
        self._times, self._points = times, points

    def begin(self, system: Lockstep) -> None:
        """Nothing moves the handle but the recording."""

    def run(self, system: Lockstep, rows: np.ndarray, start: int) -> None:
        """Ticks of the system from this time [ns] on."""
        deadlines = start + np.arange(len(rows)) * system.period
        device = system.settings[0]["hardware"]
        world = np.stack([np.interp(deadlines, self._times, column) for column in self._points.T], axis=1)
        per_count = np.where(device["position_per_count"] != 0.0, device["position_per_count"], 1.0)
        seen = world / device["scale"]
        if system.device.joints:
            seen = np.array([drives_at(system.device, place) for place in seen.tolist()])
        counts = np.round((seen + device["zero"]) / per_count)
        timing = start, system.ticks, system.write_delay
        tick_replay.run_on_counts(system.settings, system.memory, rows, system.tool, counts, *timing, system.command)
