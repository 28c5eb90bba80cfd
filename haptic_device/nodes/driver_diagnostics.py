# SPDX-License-Identifier: Apache-2.0
"""What haptic_driver says of itself in its diagnostics: its status, the figures that are watched, and all others."""

import math

from haptic_device.config.parameters import DRIVER_FIGURES
from haptic_device.control import enable_state, faults, gain_check, withheld
from haptic_device.nodes import diagnostics
from haptic_device.nodes.refusals import Refusals
from haptic_device.realtime import servo_loop

PERCENTILES = ("p50", "p99", "p999", "max")


class DriverDiagnostics:
    """Of one activation of a DriverNode, whose servo, exchange, telemetry, judgement and stall it reads."""

    def __init__(self, node):
        self._node, self._refused, self._rates = node, Refusals("tool"), diagnostics.Rates()

    def say(self, row, watched=()):
        """Publishes the status at this servo row, with the statuses of watched figures."""
        node = self._node
        refused = node.exchange.refusals()
        refused |= {f"contacts: {reason}": count for reason, count in node.exchange.refused_contacts().items()}
        values = {**self._values(row), **{f"refused.{reason}": count for reason, count in refused.items()}}
        node.say_status(*self._status(row), values, watched, node.device.name)

    def watched(self, row):
        """Statuses of the figures that have limits; what has grown is counted since the last look."""
        node, exchange = self._node, self._node.exchange
        lateness, compute, age, _ = node.telemetry.percentiles()[:, 1]
        rates = self._rates.of(missed=row.missed, sent=exchange.sent, answered=exchange.answered)
        lost = max(0.0, 1.0 - rates["answered"] / rates["sent"]) if rates["sent"] > 0.0 <= row.tool_age else math.nan
        figures = {"margin": node.judged.plane, "lateness": lateness, "compute": compute, "missed": rates["missed"]}
        figures |= {"age": age, "loss": lost, "energy": float(sum(row.energy_given))}
        figures |= {"thermal_load": float(max(row.thermal_load)), "stall": node.stall}
        if math.isfinite(node.judged.theta):
            figures["margin_theta"] = node.judged.theta
        node.stall = 0.0
        return diagnostics.statuses("haptic_driver", DRIVER_FIGURES, figures, node.values)

    def fault_detail(self, row):
        """The number of the fault at this servo row, in words; "" while it is not known, and where there is none."""
        return self._node.telemetry.latched.sentence(int(row.fault))

    def _status(self, row):
        """(level, message): the fault, or the state, and behind it what a person should know."""
        node = self._node
        if row.fault:
            return "error", f"fault {faults.name_of(row.fault)}"
        if not node.servo.running:
            return "warn", "no device: waiting for its page"
        warnings = list(self._warnings(row))
        return "warn" if warnings else "ok", "; ".join([enable_state.STATES[int(row.state)], *warnings])

    def _warnings(self, row):
        """Sentences, what the hand feels first."""
        node = self._node
        short = withheld.sentence(self._withheld(row), row)
        if refused := self._refused.sentence(node.exchange.refusals()):
            yield refused
        if short:
            yield short
        elif row.tool_age < 0.0 and not refused:
            yield "no simulation: the handle is in free space"
        elif row.tool_age > node.values["exchange.hold"]:
            yield f"the tool sample is {row.tool_age * 1e3:.0f} ms old: the coupling fades out"
        lack = node.values["passivity.policy"] != "off" and gain_check.shortfall(node.settings()[0], node.judged)
        if lack:
            yield f"the passivity margin is not positive: {lack}"

    def _withheld(self, row):
        """{cause: time [s]} of force that is withheld now; a servo that does not run, or is let go, withholds none."""
        released = row.withheld == 0 and int(row.state) in (enable_state.IDLE, enable_state.FAULT)
        return self._node.telemetry.withheld.standing() if self._node.servo.running and not released else {}

    def _values(self, row):
        node, exchange = self._node, self._node.exchange
        lateness, compute, age, write_delay = node.telemetry.percentiles() * 1e6
        trips, standing = exchange.round_trips() * 1e-3, self._withheld(row)
        return {
            "state": enable_state.STATES[int(row.state)],
            "fault": faults.name_of(row.fault),
            "fault_detail": self.fault_detail(row),
            "fault_first": self._node.telemetry.latched.first(int(row.fault)),
            "withheld": ", ".join(standing),
            "withheld_s": f"{max(standing.values(), default=0.0):.1f}",
            "realtime": node.servo.realtime,
            "clock_offset_ns": node.clock.offset,
            "rate_hz": node.values["servo.rate"],
            "ticks": int(row.tick),
            "missed": int(row.missed),
            "late_device": int(node.servo.control[servo_loop.LATE_DEVICE]),
            "torn_records": int(node.servo.control[servo_loop.TORN]),
            "trace_dropped": node.servo.ring.dropped,
            "telemetry_skipped": node.telemetry.skipped,
            "telemetry_cpu_s": f"{node.telemetry.cpu:.3f}",
            "window_s": f"{node.telemetry.window():.1f}",
            **{f"lateness_us_{name}": f"{v:.1f}" for name, v in zip(PERCENTILES, lateness, strict=True)},
            **{f"compute_us_{name}": f"{v:.2f}" for name, v in zip(PERCENTILES, compute, strict=True)},
            **{f"write_delay_us_{name}": f"{v:.1f}" for name, v in zip(PERCENTILES, write_delay, strict=True)},
            **{f"age_ms_{name}": f"{v / 1e3:.3f}" for name, v in zip(PERCENTILES, age, strict=True)},
            **{f"round_trip_us_{name}": f"{v:.1f}" for name, v in zip(("p50", "p99"), trips, strict=True)},
            "exchange_sent": exchange.sent,
            "exchange_answered": exchange.answered,
            "exchange_method": node.values["exchange.method"],
            "exchange_tank": f"{row.exchange_tank:.6f}",
            "exchange_shortened": int(row.exchange_shortened),
            "exchange_released": int(row.exchange_released),
            **(self._local_values(row) if node.values["exchange.method"] == "local" else {}),
            "physical_damping": ", ".join(f"{axis.damping:g}" for axis in node.device.axes),
            "passivity_margin": f"{node.judged.plane:.4f}",
            **self._margin_here(row),
            "friction_margin": f"{min(node.judged.friction[: min(2, len(node.device.axes))]):.4f}",
            "friction_margin_theta": f"{node.judged.friction[2]:.6f}",
            "passivity_margin_theta": f"{node.judged.theta:.6f}",
            "lateness_counted_us": f"{node.lateness() * 1e6:.1f}",
            "survived": node.survived,
            "stored": f"{row.stored:.6f}",
            "promised": f"{row.promised:.6f}",
            "energy_given": f"{sum(row.energy_given):.6f}",
        }

    def _margin_here(self, row):
        """Of a linkage: what is left at the present pose, where `passivity_margin` is of the worst."""
        count = len(self._node.device.joints)
        return {"passivity_margin_here": f"{min(row.margin[:count]):.4f}"} if count else {}

    def _local_values(self, row):
        return {
            "local": "acts" if row.local else "pspm takes its place",
            "local_sets": self._node.exchange.contact_sets,
            "local_fallbacks": int(row.local_fallbacks),
            "local_stays": int(row.local_stays),
            "tools_apart_mm": f"{row.tools_apart * 1e3:.4f}",
        }
