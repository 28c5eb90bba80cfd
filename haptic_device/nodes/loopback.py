# SPDX-License-Identifier: Apache-2.0
"""haptic_loopback: a device model in shared memory, with an operator's hand on it; publishes the truth."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import secrets
import threading

import numba
import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.parameters import LOOPBACK, LOOPBACK_FIGURES
from haptic_device.device import loopback_config, operator_hand, simulated_device
from haptic_device.jit import ensure_compiled
from haptic_device.message_fields import AXES
from haptic_device.nodes import diagnostics, messages
from haptic_device.nodes.lifecycle import ManagedNode, run
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.nodes.truth_publisher import TruthPublisher
from haptic_device.realtime import scheduling
from haptic_device.realtime.shared_memory import DEVICE, SharedMemory, file_name

PRIORITY = 85  # above the servo: the plant must be there when the servo reads


class LoopbackNode(ManagedNode):
    """Configured it holds the shared memory, active it serves the servo there."""

    def __init__(self):
        super().__init__("haptic_loopback", LOOPBACK)
        self.shared = self._thread = None
        self._control, self._truth = np.zeros(simulated_device.CONTROLS, np.int64), TruthPublisher(self)
        self.create_subscription(messages.JointState, "operator/target", self._on_target, messages.LATEST)
        self.refused_targets, self.realtime = 0, ""
        self._rates = diagnostics.Rates()
        on_change(self, LOOPBACK, lambda values: None, lambda values, _: self._apply(values))

    def configure(self):
        """Reads device and script, which may be refused, and takes the shared memory."""
        ensure_compiled("loopback", told=self.told)
        self.device = load_device(self.values["device"])
        self.plant, self.memory, self.motion = loopback_config.hand_from(self.device, self.values)
        self.shared = SharedMemory(file_name(self.context.get_domain_id(), self.get_namespace()), DEVICE)
        if self.shared.stale:
            self.get_logger().warning(f"took over the stale page {self.shared.path} of a process that had died")

    def activate(self):
        """Starts plant and telemetry, the handle and its script at their beginning: nothing went on without them."""
        self.plant, self.memory, self.motion = loopback_config.hand_from(self.device, self.values)
        self._control[:], self._refused = 0, None
        self._control[simulated_device.WATCHDOG] = round(1e9 * self.values["motor_watchdog"])
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="plant")
        self._thread.start()
        self._ready.wait()
        if self._refused is not None:
            raise self._refused
        self._truth.start(len(self.device.axes), self.values["publish.rate"])
        where = f"{self.get_namespace()}, domain {self.context.get_domain_id()}"
        self.get_logger().info(f"serving {self.device.name} in {where}; {self.realtime}")

    def deactivate(self):
        """Stops them."""
        self._control[simulated_device.STOP] = 1  # first: whatever else fails, the plant ends
        if self.failure:
            self.diagnose()
        if self._thread is not None:
            self._thread.join()
        self._truth.stop()
        self._thread = None

    def cleanup(self):
        """Lets the shared memory go."""
        if self.shared is not None:
            self.shared.close()
        self.shared = None

    def _serve(self):
        session, truth = secrets.randbits(48) | 1, np.zeros(1, simulated_device.TRUTH)
        serving = (
            self.shared.words,
            self._control,
            self._truth.mail.words,
            session,
            self.plant,
            self.memory,
            self.motion,
            truth,
        )
        try:
            simulated_device.serve.compile(tuple(map(numba.typeof, serving)))
            self.realtime = scheduling.go_realtime(self.values["realtime"], PRIORITY)
        except Exception as error:
            self._refused = error
            return
        finally:
            self._ready.set()
        simulated_device.serve(*serving)

    def _on_target(self, message):
        """Takes a target in the world; with wrong names or numbers, or beside a script, it is refused and counted."""
        names = AXES[: len(self.device.axes)] if self.shared else ()
        following = self.shared and self.motion["kind"][0] == operator_hand.FOLLOW
        target = messages.planar_target(message, names)
        if not following or target is None:
            self.refused_targets += 1
            return
        for i, axis in enumerate(self.device.axes):
            low, high = axis.workspace
            self.motion["points"][0, 0, i] = min(high, max(low, target[i] / self.device.scale[i // 2]))

    def _apply(self, values):
        self.values = values

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
