# SPDX-License-Identifier: Apache-2.0
"""The truth of a simulated device as `operator/state`: of haptic_loopback's own plant, or of one behind the bridge."""

import threading

import numpy as np

from haptic_device.device import simulated_device
from haptic_device.message_fields import truth_names
from haptic_device.nodes import messages
from haptic_device.realtime import clock
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.recording.layouts import JointLayout

BATCH = 10_000_000  # [ns] of truths that are published together


class TruthPublisher:
    """`mail`, a sequence lock: where the truth is written; published from start() to stop(), on a thread of its own."""

    def __init__(self, node):
        self._node, self.mail = node, SeqLock(simulated_device.TRUTH)
        self._state = node.create_publisher(messages.JointState, "operator/state", messages.STREAM)
        self._control, self._thread = np.zeros(simulated_device.CONTROLS, np.int64), None

    def start(self, axes, rate):
        """axes: of the device; rate [Hz] of the truths."""
        self._axes, self._layout, self._period = axes, JointLayout(truth_names(axes)), int(1e9 / rate)
        self._control[:] = 0
        self._thread = threading.Thread(target=self._publish, name="telemetry")
        self._thread.start()

    def stop(self):
        """Ends it, if it has begun."""
        self._control[simulated_device.STOP] = 1
        if self._thread is not None:
            self._thread.join()
        self._thread = None

    def _publish(self):
        """Several at a time: to wake Python for each took twice the time."""
        scratch, truths = clock.scratch(), np.zeros(max(1, BATCH // self._period), simulated_device.TRUTH)
        words = truths.view(np.int64).reshape(len(truths), -1)
        deadline, told = clock.now_ns(scratch), 0.0
        while not self._control[simulated_device.STOP]:
            deadline = simulated_device.gather(self.mail.words, self._control, self._period, deadline, words, scratch)
            for truth in truths:
                if truth["time"] > told:
                    told = float(truth["time"])
                    self._state.publish(self._bytes(truth, self._node.clock.stamp(round(told * 1e9))))

    def _bytes(self, truth, stamp):
        extra, none = [float(truth[name]) for name in ("energy_given", "time", "motion_done")], (0.0, 0.0, 0.0)
        return self._layout.pack(
            stamp,
            (*self._of(truth, "position"), *self._of(truth, "target"), *extra),
            (*self._of(truth, "velocity"), *self._of(truth, "target_velocity"), *none),
            (*self._of(truth, "operator_force"), *self._of(truth, "motor_force"), *none),
        )

    def _of(self, truth, name):
        return truth[name][: self._axes].tolist()
