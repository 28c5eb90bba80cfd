# SPDX-License-Identifier: Apache-2.0
"""haptic_loopback: a device model in shared memory, with an operator's hand on it; publishes the truth."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import secrets

import numba
import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.parameters import LOOPBACK, LOOPBACK_FIGURES
from haptic_device.device import loopback_config, operator_hand, simulated_device
from haptic_device.jit import ensure_compiled
from haptic_device.nodes import diagnostics
from haptic_device.nodes.lifecycle import run
from haptic_device.nodes.page_server import PageServer
from haptic_device.nodes.ros_parameters import on_change


class LoopbackNode(PageServer):
    """Configured it holds the shared memory, active it serves the servo there."""

    def __init__(self):
        super().__init__("haptic_loopback", LOOPBACK, simulated_device.CONTROLS)
        on_change(self, LOOPBACK, lambda values: None, self.take_values)

    def configure(self):
        """Reads device and script, which may be refused, and takes the shared memory."""
        ensure_compiled("loopback", told=self.told)
        self.device = load_device(self.values["device"])
        self.plant, self.memory, self.motion = loopback_config.hand_from(self.device, self.values)
        self.take_page()

    def activate(self):
        """Starts plant and telemetry, the handle and its script at their beginning: nothing went on without them."""
        self.plant, self.memory, self.motion = loopback_config.hand_from(self.device, self.values)
        self._control[:] = 0
        self._control[simulated_device.WATCHDOG] = round(1e9 * self.values["motor_watchdog"])
        self.start_loop("plant")
        self.get_logger().info(f"serving {self.device.name} in {self.where}; {self.realtime}")

    def deactivate(self):
        """Stops them."""
        self._control[simulated_device.STOP] = 1  # first: whatever else fails, the plant ends
        if self.failure:
            self.diagnose()
        self.stop_loop()

    def loop(self):
        """The plant with its hand."""
        session, truth = secrets.randbits(48) | 1, np.zeros(1, simulated_device.TRUTH)
        page, hand = (self.shared.words, self._control, self._truth.mail.words), (self.plant, self.memory, self.motion)
        serving = (*page, session, *hand, truth)
        simulated_device.serve.compile(tuple(map(numba.typeof, serving)))
        return simulated_device.serve, serving

    def lead(self, places):
        """A hand that has a script does not follow."""
        if following := self.motion["kind"][0] == operator_hand.FOLLOW:
            self.motion["points"][0, 0, : len(places)] = places
        return following

    def diagnose(self):
        """Says how the plant is, while the node is active."""
        if self._thread is None:
            return
        level, message = ("ok", "serving") if self._thread.is_alive() else ("error", "the plant is not running")
        values = {
            "device": self.device.name,
            "realtime": self.realtime,
            "driven": bool(self._truth.mail.get()[0].driven),
            "late_writes": int(self._control[simulated_device.LATE_WRITES]),
            "run_on": int(self._control[simulated_device.RUN_ON]),
            "watchdog_trips": int(self._control[simulated_device.TRIPS]),
            "refused_writes": int(self._control[simulated_device.REFUSED]),
            "refused_targets": self.refused_targets,
            "survived": self.survived,
            "energy_given": float(self._truth.mail.get()[0].energy_given),
        }
        self.say_status(level, message, values, self._watched(values), self.device.name)

    def _watched(self, values):
        """Statuses of the figures that have limits."""
        figures = {"energy": values["energy_given"]}
        figures |= self._rates.of(run_on=values["run_on"], late_writes=values["late_writes"])
        return diagnostics.statuses("haptic_loopback", LOOPBACK_FIGURES, figures, self.values)


def main(args=None):
    """Runs haptic_loopback until SIGINT, SIGTERM or SIGHUP."""
    return run(LoopbackNode, "haptic_loopback", args)
