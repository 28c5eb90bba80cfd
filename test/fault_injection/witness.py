# SPDX-License-Identifier: Apache-2.0
"""What happens to the handle, heard by a thread that misses nothing: the loopback's truth, the servo's ticks, and what
the nodes say of themselves."""

import threading
import time
from typing import NamedTuple

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from haptic_device.control.records import TRACE_ROW
from haptic_device.message_fields import AXES, truth_names
from haptic_device.nodes.messages import LATEST, STREAM, TRACE, JointState, statuses_of
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, JointLayout
from haptic_sim.cli.commands import Commands
from haptic_sim.cli.processes import NAMESPACE

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
_STATE = JointLayout(truth_names(3))


class Heard(NamedTuple):
    """Records of TRUTH and of ROW, oldest first, and the times [s] at which a driver or a device began anew."""

    truths: np.ndarray
    rows: np.ndarray
    sessions: tuple[float, ...]


class Witness:
    """Listens until close(); `begin` forgets, `heard` tells what came since. Of a device with three axes."""

    def __init__(self, domain: int):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("haptic_witness", namespace=NAMESPACE, context=self._context)
        self.commands = Commands(self._node, self._context)
        self._truth = PolledSubscription(self._node, "operator/state", JOINTS, STREAM, raw=True)
        self._trace = PolledSubscription(self._node, "trace", CLOUD, TRACE)
        self._said = PolledSubscription(self._node, "/diagnostics", DIAGNOSTICS, STREAM, raw=True)
        self._target = self._node.create_publisher(JointState, "operator/target", LATEST)
        self._truths, self._rows, self._sessions = [], [], []
        self._goal = self._hand = None
        self.statuses, self.levels, self._lock = {}, {}, threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="witness")
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and leaves the network."""
        self._stop.set()
        self._thread.join()
        self.commands.close()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

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

    def said(self, node: str, entry: str) -> str:
        """Last value of a node's diagnostic entry, or an empty text."""
        return self.statuses[node].values.get(entry, "") if node in self.statuses else ""

    def _listen(self):
        looked = time.monotonic()
        while not self._stop.wait(LOOK_PERIOD):
            with self._lock:
                self._truths += [_truth(each.message) for each in self._truth.take() if _STATE.matches(each.message)]
                self._rows += [_rows(each.message) for each in self._trace.take()]
            for sample in self._said.take():
                found = statuses_of(sample.message, sample.received)
                self.statuses |= found
                self.levels |= {name: max(said.level, self.levels.get(name, 0)) for name, said in found.items()}
            elapsed, looked = time.monotonic() - looked, time.monotonic()
            if self._goal is not None:
                self._move_hand(min(elapsed, 5 * LOOK_PERIOD) * HAND_SPEED)

    def _move_hand(self, way):
        self._hand = self._goal if self._hand is None else self._hand
        self._hand += max(-way, min(way, self._goal - self._hand))
        self._target.publish(JointState(name=list(AXES), position=[self._hand, 0.0, 0.0]))


def _truth(data):
    sample = _STATE.unpack(data)
    given, now = sample.position[6], sample.position[7]
    return now, sample.position[0], sample.position[1], given, tuple(sample.effort[3:6])


def _rows(cloud):
    found = np.zeros(cloud.width, ROW)
    if cloud.point_step == TRACE_ROW.itemsize:
        ticks = np.frombuffer(cloud.data, TRACE_ROW)
        for name in COLUMNS:
            found[name] = ticks[name]
    return found
