# SPDX-License-Identifier: Apache-2.0
"""The servo by the clock, alone against a handle that stands still: how late it wakes."""

import time
from typing import NamedTuple

import numpy as np

from haptic_device import jit
from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import DRIVER
from haptic_device.control import controller_config, enable_state
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.servo_thread import ServoThread

BRIEF = 0.5  # [s]
RATES = (1000, 2000, 4000, 8000, 10000)  # [Hz]
COMMON = {  # 3 axes, 4 walls, coupling, cancellation, observer and controller, faults, trace: all that a tick can do
    "wall.normals": (1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0),
    "wall.offsets": (-0.06, -0.06, 0.07, -0.15),
    "wall.stiffness": (500.0,) * 4,
    "wall.damping": (0.1,) * 4,
    "cancellation.ratio": 0.5,
}


class Lateness(NamedTuple):
    """Wake-ups after their deadlines [us], sorted, and how many deadlines passed meanwhile without a tick."""

    sorted_us: np.ndarray
    missed: int
    scheduling: str

    def at(self, percent: float) -> float:
        """Percentile [us]."""
        return float(np.percentile(self.sorted_us, percent))

    def figures(self) -> dict:
        """Ticks, missed ones, and percentiles [us]."""
        quantiles = {"p50": 50, "p99": 99, "p999": 99.9, "max": 100}
        known = {name: self.at(percent) if len(self.sorted_us) else None for name, percent in quantiles.items()}
        return {"ticks": len(self.sorted_us), "missed": self.missed, **known, "scheduling": self.scheduling}


def values(**given) -> dict:
    """All parameters of the driver, with these instead of the defaults."""
    return defaults(DRIVER) | given


def alone(rate: float, seconds: float, realtime: str = "prefer") -> tuple[Lateness, np.ndarray]:
    """Runs the servo for so long against a handle that stands still: lateness, and the rows of all ticks."""
    settings = controller_config.settings_from(load_device("desktop"), values(**COMMON, **{"servo.rate": float(rate)}))
    thread, kept = ServoThread(NullDevice(), settings, None, realtime), []
    thread.order(set_flags=enable_state.ENABLE)
    thread.start()
    try:
        while not thread.running:
            time.sleep(0.01)
        thread.ring.take(thread.ring.size)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(min(0.1, seconds))
            kept.append(thread.ring.take(thread.ring.size))
    finally:
        thread.stop()
    rows = np.concatenate(kept)
    missed = int(rows["missed"][-1] - rows["missed"][0]) if len(rows) else 0
    return Lateness(np.sort(rows["lateness"]) * 1e6, missed, thread.realtime), rows


def write_delay(rate: float, realtime: str) -> float | None:
    """Within how long after their deadlines 99 % of the writes come on this machine now [s], by a trial of BRIEF.

    None where it cannot be measured: the servo is not compiled yet, or has not the scheduling that it requires.
    """
    if jit.missing(("servo",)):
        return None
    try:
        rows = alone(rate, BRIEF, realtime)[1]
    except (ValueError, OSError):
        return None
    return float(np.percentile(rows["lateness"] + rows["compute"], 99)) if len(rows) else None
