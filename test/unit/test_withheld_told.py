# SPDX-License-Identifier: Apache-2.0
"""What the driver says on /diagnostics of force that it withholds, and of a margin that is not positive."""

import io
from types import SimpleNamespace

import numpy as np
from lockstep_systems import device, values
from rich.console import Console

from haptic_device.control import controller_config, enable_state, gain_check, records, withheld
from haptic_device.control.withheld import LASTS
from haptic_device.nodes.driver_diagnostics import DriverDiagnostics
from haptic_device.nodes.telemetry import Telemetry
from haptic_device.realtime.session_clock import SessionClock
from haptic_device.recording.status import LEVELS
from haptic_display.cli.status import table

PERIOD = 0.001  # [s]


class Node:
    """A driver whose servo's rows are the test's; `said` is the last status: level, message, values."""

    def __init__(self, lateness=0.0, refused=None, **given):
        self.values = values("haptic_driver", **given)
        self.device, self.clock, self.survived = device(damping=3.0), SessionClock(), 0
        self._settings = controller_config.settings_from(self.device, self.values)
        self.judged, self.lateness = gain_check.judge(self._settings[0], lateness), lambda: 0.0
        ring = SimpleNamespace(dropped=0)
        link = SimpleNamespace(watchdog=float)
        self.servo = SimpleNamespace(running=True, realtime="no", ring=ring, control=np.zeros(64), link=link)
        self.exchange = SimpleNamespace(sent=1, answered=1, contact_sets=0, refusals=lambda: refused or {})
        self.exchange.refused_contacts, self.exchange.round_trips = dict, lambda: np.zeros(2)
        self.telemetry = Telemetry(self, self.servo, self.device, self.values, self.clock.stamp)
        self.report, self.ticks, self.said = DriverDiagnostics(self), 0, None

    def get_namespace(self):
        return "/haptic"

    def create_publisher(self, kind, topic, qos):
        return SimpleNamespace(publish=lambda message: None)

    def settings(self):
        return self._settings

    def say_status(self, level, message, values, watched, name):
        self.said = level, message, values

    def run(self, seconds, **row):
        """Telemetry takes rows like this one over the time; the driver says its status."""
        rows = np.zeros(round(seconds / PERIOD) + 1, records.TRACE_ROW)
        rows["tick"] = np.arange(len(rows)) + self.ticks
        rows["deadline"], rows["state"] = 1e12 + rows["tick"] * PERIOD * 1e9, enable_state.ENGAGED
        for name, value in ({"exchange_fade": 1.0, "engage": 1.0, "tool_age": 0.001} | row).items():
            rows[name] = value
        self.ticks += len(rows)
        for at in range(0, len(rows), 10):
            self.telemetry._remember(rows[at : at + 10])
        self.report.say(rows.view(np.recarray)[-1])
        return self.said


def test_a_cause_is_told_once_it_has_lasted_with_its_word_and_cure_and_no_longer_after_it():
    for cause in withheld.TABLE:
        node = Node()
        assert node.run(LASTS - 0.01, withheld=cause.bit)[:2] == ("ok", "engaged")
        level, message, told = node.run(0.02, withheld=cause.bit)
        assert level == "warn"
        assert message.startswith(f"engaged; force withheld for 0.2 s ({cause.name}): {cause.cause}; ")
        assert message.endswith(cause.cure) and (told["withheld"], told["withheld_s"]) == (cause.name, "0.2")
        level, message, told = node.run(0.05)
        assert (level, message, told["withheld"], told["withheld_s"]) == ("ok", "engaged", "", "0.0")


def test_the_reason_of_each_cause_is_told_in_its_numbers_and_shown_by_haptic_status():
    place = {"tool_age": 0.002, "exchange_fade": 0.0, "tool_position": (0.003, 0.004, 0.0)}
    _, message, _ = Node().run(0.3, withheld=withheld.FAR_TOOL, **place)
    assert "it is 5 mm from the handle; lead the handle to the tool, or call ~/disable and ~/enable" in message
    assert "old" not in message
    _, message, _ = Node().run(0.3, withheld=withheld.TANK, exchange_tank=2e-5, tool_position=(0.07, 0.0, 0.2))
    assert "0.02 mJ are in it, the tool is 70 mm and 11.5° from the handle" in message
    level, message, told = Node().run(0.3, withheld=withheld.OLD_TOOL, tool_age=0.15, exchange_fade=0.36)
    console = Console(width=400, record=True, file=io.StringIO())
    entry = {"level": LEVELS.index(level.upper()), "message": message, "values": told}
    console.print(table({"haptic_driver": entry}, 7))
    [shown] = [line for line in console.export_text().splitlines() if "haptic_driver" in line]
    assert "WARN" in shown and "the newest is 150 ms old, 36 % of the coupling is there" in shown


def test_a_servo_without_a_device_withholds_nothing():
    node = Node()
    assert node.run(0.3, withheld=withheld.TANK)[2]["withheld"] == "tank"
    node.servo.running = False
    node.report.say(np.zeros(1, records.TRACE_ROW).view(np.recarray)[0])
    assert node.said[1].startswith("no device") and node.said[2]["withheld"] == ""


def test_a_margin_that_is_not_positive_is_said_behind_the_state_and_what_it_withholds():
    stiff = {"coupling__stiffness": 2000.0, "coupling__damping": 1.0, "coupling__rotational_stiffness": 0.0}
    level, message, _ = Node(lateness=5e-3, **stiff).run(0.3, withheld=withheld.TANK)
    assert level == "warn" and message.startswith("engaged; force withheld for 0.3 s (tank): ")
    assert "; the passivity margin is not positive: forces act 5 ms late (99 % of the writes within 5 ms" in message
    stiff["coupling__stiffness"] = 60000.0
    _, message, _ = Node(lateness=1e-4, **stiff).run(0.3)
    assert message.startswith("engaged; the passivity margin is not positive: coupling.stiffness 60000 N/m with")
