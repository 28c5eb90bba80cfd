# SPDX-License-Identifier: Apache-2.0
"""haptic_driver: runs the servo on a device, exchanges samples with the simulation, and tells what happens."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import math
import secrets
import threading
import time

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.drives import drives_at
from haptic_device.config.parameters import DRIVER, DRIVER_FIGURES
from haptic_device.control import controller_config, enable_state, faults, gain_check, records
from haptic_device.jit import ensure_compiled
from haptic_device.nodes import fault_answers
from haptic_device.nodes.diagnostics import statuses
from haptic_device.nodes.driver_diagnostics import DriverDiagnostics
from haptic_device.nodes.exchange_server import ExchangeServer
from haptic_device.nodes.lifecycle import ManagedNode, run
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.nodes.service_thread import ServiceThread
from haptic_device.nodes.telemetry import Telemetry
from haptic_device.realtime import scheduling
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.servo_thread import ServoThread
from haptic_device.realtime.shared_memory import file_name

MIDDLEWARE_PRIORITY = 65  # below the servo, above the exchange; the thread of the commands has it too
WATCH_PERIOD = controller_config.ATTENDED_EVERY  # a look of the executor at all that may wake it costs a millisecond
PATIENCE = 1.0  # [s] that a service waits for the servo to have taken a command
DELAY_CHANGE, LEAST_CHANGE = 0.25, 20e-6  # of the link's delay that is followed: relative, and [s]
NOT_TAKEN = f"the servo did not take it within {PATIENCE} s"


class DriverNode(ManagedNode):
    """Configured it holds the device, active the servo runs; the motor is zero in every other state."""

    def __init__(self):
        super().__init__("haptic_driver", DRIVER)
        self.hardware = self.servo = self.exchange = self.telemetry = None
        self._kept = {"code": faults.NONE}
        self._version, self._said, self.judged, self._delay = 0, set(), None, 0.0
        self._announced, self._alone_since = False, 0.0
        self._to_enable = self.values["auto_enable"]  # by itself, until a person has said otherwise
        self._watched, self.stall, self._reported = time.monotonic(), 0.0, None
        self._changing = threading.Lock()  # held while the servo comes, goes or is enabled by itself: no e-stop between
        commands = {f"~/{name}": getattr(self, f"_on_{name}") for name in ("estop", "reset", "enable", "disable")}
        self._commands = ServiceThread(self, commands, "an e-stop came first")
        on_change(self, DRIVER, self._check, self._apply)
        self.create_timer(WATCH_PERIOD, self._watch)
        self._commands.start()

    def destroy_node(self):
        """Ends the thread of the commands, then the node."""
        self._commands.stop()
        super().destroy_node()

    def configure(self):
        """Reads the device description and takes the device."""
        ensure_compiled("servo", "exchange", told=self.told)
        scheduling.lift_threads(self.values["realtime"], MIDDLEWARE_PRIORITY)  # that of the commands too
        self.device = load_device(self.values["device"])
        self._delay = self.device.sensing_delay + self.device.actuation_delay
        self._warn(self._settings(self.values)[1])
        name = file_name(self.context.get_domain_id(), self.get_namespace())
        self.hardware = SharedMemoryInterface(name, secrets.randbits(48) | 1)
        if self.hardware.stale:
            self.get_logger().warning("took over a stale page of a process that had died")

    def activate(self):
        """Starts servo, exchange and telemetry; the motor stays at zero until enabled, and a latched fault latched."""
        if not self._commands.running:
            raise ValueError("the services thread has ended: nobody could stop the motor")
        home = drives_at(self.device, self.device.home) if self.device.homing == "at_start" else None
        settings, self.judged = self._settings(self.values)
        settings["version"] = self._version
        self._warn(self.judged)
        self._announced, self._alone_since = False, 0.0
        with self._changing:
            judged, realtime = self.judged.into(settings), self.values["realtime"]
            self.servo = ServoThread(self.hardware, judged, home, realtime, self._kept)
        self.servo.gains.put(controller_config.gains_from(self.values, settings))
        self._set_flag(enable_state.CLUTCH, self.values["clutch.open"])
        self.exchange = ExchangeServer(self, self.servo, len(self.device.axes), self.values, self.clock.offset)
        self.exchange.start()
        self.report = DriverDiagnostics(self)
        scheduling.spare_collections()
        self.servo.start()
        self.telemetry = Telemetry(self, self.servo, self.device, self.values, self.clock.stamp)
        self.telemetry.start()

    def on_deactivate(self, state):
        """Stops; the next activation may enable by itself again, unless a person disables from now on."""
        with self._changing:
            self._to_enable = self.values["auto_enable"]
        return super().on_deactivate(state)

    def deactivate(self):
        """Stops the servo first: the motor is zero when this returns."""
        for part in (self.servo, self.exchange, self.telemetry):
            if part is not None:
                part.stop()
        if self.telemetry is not None:
            self.diagnose()
        with self._changing:
            if self.servo is not None:
                self._kept = self.servo.kept
            self.servo = None
        self.exchange = self.telemetry = None

    def cleanup(self):
        """Lets the device go."""
        if self.hardware is not None:
            self.hardware.close()
        self.hardware = None

    def _check(self, values):
        """Settings and Judgement of values, None without a device. ValueError, one sentence, where they do not fit."""
        return None if self.hardware is None else self._settings(values)

    def _apply(self, values, checked):
        """Takes the values as they were judged, at the next tick boundary."""
        self.values = values
        if checked is None:
            return
        settings, judged = checked
        self._warn(judged)
        if self.servo is not None:
            self._version += 1
            settings["version"] = self._version
            self._set(settings, judged)
            self.servo.gains.put(controller_config.gains_from(values, settings))
            self._set_flag(enable_state.CLUTCH, values["clutch.open"])

    def _settings(self, values):
        """SETTINGS record of these values, with the delay that counts now, and the one Judgement of their gains.

        Raises ValueError for gains beyond the device's damping, if passivity.policy is to enforce it. Gains that need
        no more in any direction than those in force are taken, and said: a servo that runs late must not refuse softer
        ones.
        """
        settings = controller_config.settings_unjudged(self.device, values)
        settings["hardware"]["delay"] = self._delay
        judged = gain_check.judge(settings[0], self.lateness())
        if judged.sentence and values["passivity.policy"] == "enforce":
            known = self.servo.settings.get()[0] if self.servo is not None else None
            if known is None or not gain_check.softer(settings[0], known, judged.lateness):
                raise ValueError(judged.sentence)
        return settings, judged

    def _warn(self, judged):
        """Says gains beyond the device's damping, unless the policy is off."""
        if judged.sentence and self.values["passivity.policy"] != "off":
            self._say("warning", judged.sentence)

    def _set(self, settings, judged):
        """Gives the servo settings with what is left of the damping, and keeps the Judgement for the diagnostics."""
        self.judged = judged
        self.servo.set(judged.into(settings))

    def lateness(self):
        """How late forces act [s]: the delays of device and link, and the p99 of the measured delay of the writes.

        The delays of the description may have been identified with the link in them: the longer of both counts, no sum.
        """
        measured = self.telemetry.percentiles()[3, 1] if self.telemetry is not None else math.nan
        described = self.device.sensing_delay + self.device.actuation_delay
        delays = max(described, self.hardware.delay() if self.hardware is not None else 0.0) + self.device.stamp_error
        return delays + (0.0 if math.isnan(measured) else measured)

    def _follow_margin(self):
        """Judges the gains in force anew, with the lateness as measured now.

        Energy is booked with the link's delay where that is longer than the description says; small changes wait.
        """
        settings, described = self.settings(), self.device.sensing_delay + self.device.actuation_delay
        most = controller_config.MOST_LATE / self.values["servo.rate"]
        delay = max(described, min(self.hardware.delay(), most))
        if abs(delay - self._delay) > DELAY_CHANGE * self._delay + LEAST_CHANGE:
            self._delay, self._version = delay, self._version + 1
            settings["version"], settings["hardware"]["delay"] = self._version, delay
        self._set(settings, gain_check.judge(settings[0], self.lateness()))

    def settings(self):
        """SETTINGS array of one, those wished for now."""
        return self.servo.settings.get().view(np.ndarray).view(records.SETTINGS)

    def _set_flag(self, flag, wanted):
        self.servo.order(**({"set_flags": flag} if wanted else {"clear_flags": flag}))

    def _watch(self):
        """Enables once by itself if asked to, and says what is new."""
        now = time.monotonic()
        self.stall, self._watched = max(self.stall, now - self._watched), now
        if self.servo is None or not self.servo.running:
            return
        if not self._announced:
            self._announced = True
            what = f"servo at {self.values['servo.rate']:g} Hz on {self.device.name}"
            self.get_logger().info(f"{what} in {self.where}; {self.servo.realtime}")
        row = self.servo.row.get()[0]
        if self._reported != (news := (int(row.state), int(row.fault), self.report.fault_detail(row))):
            self._reported = news
            self.report.say(row)  # without figures: a rate needs its half second
        if row.fault:  # its reset takes the wish to be enabled back: here it could already be the next one
            self._say("error", f"fault {faults.name_of(row.fault)}: motor off")
        elif self._to_enable and self._met(now):
            with self._changing:
                if self._to_enable:
                    self.servo.order(set_flags=enable_state.ENABLE)
                self._to_enable = False
        if self._commands.running:  # else nobody could stop it
            self.servo.attend()

    def _met(self, now):
        """Whether a tool has answered, or was waited for long enough."""
        self._alone_since = self._alone_since or now
        return self.exchange.answered > 0 or now - self._alone_since >= self.values["auto_enable_wait"]

    def _say(self, level, sentence):
        """Logs a sentence once; rclpy allows each place in the code one severity only."""
        if sentence in self._said:
            return
        self._said.add(sentence)
        if level == "error":
            self.get_logger().error(sentence)
        else:
            self.get_logger().warning(sentence)

    def _on_enable(self, request, response):
        def refusal(servo):
            row = servo.row.get()[0]
            return fault_answers.latched(faults.name_of(row.fault)) if row.fault else ""

        return self._command(response, lambda servo: servo.order(set_flags=enable_state.ENABLE), "enabled", refusal)

    def _on_disable(self, request, response):
        self._stay_disabled()
        act, idle = lambda servo: servo.order(clear_flags=enable_state.ENABLE), "motor zero: the servo does not run"
        return self._command(response, act, "motor zero", idle=idle)

    def _on_estop(self, request, response):
        with self._changing:
            servo, self._to_enable = self.servo, False
            if servo is None:
                self._kept["code"] = self._kept["code"] or faults.ESTOP
            else:
                servo.order(set_flags=enable_state.ESTOP, clear_flags=enable_state.ENABLE)
        response.success = True
        if servo is None:
            response.message = "e-stop latched for when the node is active again"
        elif not servo.running:
            response.message = "e-stop latched for the device that is not there yet"
        else:
            servo.attend()
            response.success = self._taken(servo)
            response.message = "e-stop latched, motor zero" if response.success else NOT_TAKEN
        return response

    def _on_reset(self, request, response):
        self._said = {sentence for sentence in tuple(self._said) if not sentence.startswith("fault")}

        def act(servo):
            self._stay_disabled()
            servo.reset()

        self._command(response, act, fault_answers.CLEARED)
        servo = self.servo
        if response.success and servo is not None and (code := int(servo.row.get()[0].fault)):
            response.success = False
            response.message = fault_answers.latched_again(faults.name_of(code))
        return response

    def _stay_disabled(self):
        """A person has decided: nothing is enabled by itself, until after a deactivation."""
        with self._changing:
            self._to_enable = False

    def _command(self, response, act, done, refusal=lambda servo: "", idle=""):
        """Gives the servo a command and answers when it has taken it; the node may be deactivated meanwhile.

        idle: what is true, and answered, where the servo does not run; "": the command is refused there.
        """
        with self._changing:
            servo = self.servo
        if servo is None or not servo.running:
            response.success = bool(idle)
            response.message = idle or "the servo does not run: no device, or the node is not active"
        elif sentence := refusal(servo):
            response.message = sentence
        else:
            servo.attend()  # who gives a command is there
            act(servo)
            response.success = self._taken(servo)
            response.message = done if response.success else NOT_TAKEN
        return response

    def _taken(self, servo):
        """Whether it has taken its command in time, or ended, which leaves the motor at zero."""
        until = time.monotonic() + PATIENCE
        while servo.running and int(servo.row.get()[0].command) & ~enable_state.UNATTENDED != servo.command:
            if time.monotonic() > until:
                return False
            time.sleep(0.0002)
        return True

    def diagnose(self):
        """Says how servo and exchange are, while the node is active."""
        if self.telemetry is None:
            return
        self._follow_margin()
        self.exchange.follow(self.clock.offset)
        row = self.servo.row.get()[0]
        left_out = statuses("haptic_driver", DRIVER_FIGURES, self.telemetry.left_out(), self.values)
        self.report.say(row, self.report.watched(row) + left_out)


def main(args=None):
    """Runs haptic_driver until SIGINT, SIGTERM or SIGHUP."""
    return run(DriverNode, "haptic_driver", args)
