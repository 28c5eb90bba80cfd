# SPDX-License-Identifier: Apache-2.0
"""What haptic_loopback and haptic_bridge have in common: device page, the loop that serves it, truth and targets."""

import threading

import numpy as np

from haptic_device.message_fields import AXES
from haptic_device.nodes import diagnostics, messages
from haptic_device.nodes.lifecycle import ManagedNode
from haptic_device.nodes.truth_publisher import TruthPublisher
from haptic_device.realtime import scheduling
from haptic_device.realtime.shared_memory import DEVICE, SharedMemory, file_name

PRIORITY = 85  # above the servo, which waits for what the loop writes


class PageServer(ManagedNode):
    """Configured it holds the page, active a thread serves the servo there. A subclass sets `device` first, and has
    loop() → (function, its arguments), called in that thread, and lead(places) → whether a hand follows them."""

    def __init__(self, name, parameters, controls):
        """controls: how many words of control its loop has."""
        super().__init__(name, parameters)
        self.shared = self._thread = None
        self._control, self._truth = np.zeros(controls, np.int64), TruthPublisher(self)
        self.create_subscription(messages.JointState, "operator/target", self._on_target, messages.LATEST)
        self.refused_targets, self.realtime = 0, ""
        self._rates = diagnostics.Rates()

    def take_page(self):
        """Takes the shared memory."""
        self.shared = SharedMemory(file_name(self.context.get_domain_id(), self.get_namespace()), DEVICE)
        if self.shared.stale:
            self.get_logger().warning(f"took over the stale page {self.shared.path} of a process that had died")

    def start_loop(self, name):
        """Starts the loop in a thread of this name, and the truth; raises what keeps the loop from it."""
        self._refused, ready = None, threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(ready,), name=name)
        self._thread.start()
        ready.wait()
        if self._refused is not None:
            raise self._refused
        self._truth.start(len(self.device.axes), self.values["publish.rate"])

    def stop_loop(self):
        """Ends truth and loop, which has been told to stop."""
        if self._thread is not None:
            self._thread.join()
        self._truth.stop()
        self._thread = None

    def cleanup(self):
        """Lets the shared memory go."""
        if self.shared is not None:
            self.shared.close()
        self.shared = None

    def _serve(self, ready):
        try:
            loop, arguments = self.loop()
            self.realtime = scheduling.go_realtime(self.values["realtime"], PRIORITY)
        except Exception as error:
            self._refused = error
            return
        finally:
            ready.set()
        loop(*arguments)

    def _on_target(self, message):
        """Leads the hand to a target in the world; with wrong names or numbers, or led nowhere, it is counted."""
        names = AXES[: len(self.device.axes)] if self.shared else ()
        target = messages.planar_target(message, names)
        if target is None or not self.lead([self._within(i, place) for i, place in enumerate(target)]):
            self.refused_targets += 1

    def _within(self, axis, place):
        """The place [m | rad] in the device's own units, in the workspace."""
        low, high = self.device.axes[axis].workspace
        return min(high, max(low, place / self.device.scale[axis // 2]))
