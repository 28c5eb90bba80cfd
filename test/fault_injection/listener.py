# SPDX-License-Identifier: Apache-2.0
"""What happens to the handle, heard by a thread that misses nothing: the loopback's truth, the servo's ticks, and what
the nodes say of themselves."""

import contextlib
import threading
import time
from typing import NamedTuple

import numpy as np

from haptic_device.control.records import TRACE_ROW
from haptic_device.nodes.messages import TRACE
from haptic_device.recording.layouts import CLOUD
from haptic_display.client import Client
from haptic_display.run.processes import NAMESPACE
from haptic_display.service_requests import trigger

LOOK_PERIOD = 0.004  # s
HAND_SPEED = 0.1  # [m/s] with which the hand's target moves; a slow hand brings the exchange little energy
COLUMNS = (
    "tick",
    "deadline",
    "latched",
    "missed",
    "command",
    "tool_age",
    "exchange_fade",
    "engage",
    "state",
    "fault",
    "force_on_handle",
    "motor",
    "margin",
    "lateness",
)
ROW = np.dtype([(name, *TRACE_ROW.fields[name][:1]) for name in COLUMNS])
TRUTH = np.dtype([("time", "f8"), ("x", "f8"), ("y", "f8"), ("energy", "f8"), ("motor", "f8", (3,))])
SERVICES = ("estop", "reset", "enable")
PATIENCE = 3.0  # [s] for a service of the driver


class Heard(NamedTuple):
    """Records of TRUTH and of ROW, oldest first, and the times [s] at which a driver or a device began anew."""

    truths: np.ndarray
    rows: np.ndarray
    sessions: tuple[float, ...]


class Listener:
    """Listens until close(); `begin` forgets, `heard` tells what came since. Of a device with three axes."""

    def __init__(self, domain: int):
        self._client = Client.join("haptic_listener", domain, NAMESPACE, every_truth=True)
        self._client.prepare(*(f"haptic_driver/{name}" for name in SERVICES))
        self._trace = self._client.subscribe("trace", CLOUD, TRACE)
        self._truths, self._rows, self._sessions = [], [], []
        self._goal = self._hand = None
        self.said, self.statuses = self._client.said, self._client.statuses
        self.levels, self._lock = {}, threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="listener")
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and leaves the network."""
        self._stop.set()
        self._thread.join()
        self._client.close()

    def call(self, service: str, patience: float = PATIENCE) -> None:
        """Calls the driver's ~/estop, ~/reset or ~/enable, whether it refuses, or does not answer in time [s]."""
        with contextlib.suppress(ValueError):
            self._client.call(trigger(f"haptic_driver/{service}"), patience=patience)

    def begin(self) -> None:
        """Forgets what was heard, but for the newest truth and tick."""
        with self._lock:
            self._truths, self._rows, self._sessions = self._truths[-1:], self._rows[-1:], []
            self.levels = {}

    def mark_session(self) -> None:
        """From here on the energy given counts from zero: a driver or a device is new."""
        self._sessions.append(time.monotonic())

    def heard(self) -> Heard:
        """What came since begin()."""
        with self._lock:
            rows = np.concatenate(self._rows) if self._rows else np.zeros(0, ROW)
            return Heard(np.array(self._truths, TRUTH), rows, tuple(self._sessions))

    def aim(self, x: float) -> None:
        """Where the loopback's hand shall go from now on, along x at HAND_SPEED."""
        self._goal = x

    @property
    def truth(self):
        """The newest truth, or None."""
        return self._truths[-1] if self._truths else None

    @property
    def row(self):
        """The newest tick that was heard of, or None."""
        return self._rows[-1][-1] if self._rows else None

    def _listen(self):
        looked = time.monotonic()
        while not self._stop.wait(LOOK_PERIOD):
            began = time.monotonic()
            with self._lock:
                self._client.look()
                self._truths += [_truth(each) for each in self._client.truths]
                self._client.truths.clear()
                self._rows += [_rows(each.message) for each in self._trace.take()]
                new = [name for name, at in self._client.heard.items() if at >= began]
                for name, said in [(name, self.statuses.get(name)) for name in new]:
                    if said is not None:
                        self.levels[name] = max(said.level, self.levels.get(name, 0))
            elapsed, looked = time.monotonic() - looked, time.monotonic()
            if self._goal is not None:
                self._move_hand(min(elapsed, 5 * LOOK_PERIOD) * HAND_SPEED)

    def _move_hand(self, way):
        self._hand = self._goal if self._hand is None else self._hand
        self._hand += max(-way, min(way, self._goal - self._hand))
        self._client.aim((self._hand, 0.0, 0.0))


def _truth(one):
    motor = tuple(one[f"motor_{axis}"][2] for axis in ("x", "y", "theta"))
    return one["time"][0], one["x"][0], one["y"][0], one["energy_given"][0], motor


def _rows(cloud):
    found = np.zeros(cloud.width, ROW)
    if cloud.point_step == TRACE_ROW.itemsize:
        ticks = np.frombuffer(cloud.data, TRACE_ROW)
        for name in COLUMNS:
            found[name] = ticks[name]
    return found
