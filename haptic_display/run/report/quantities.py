# SPDX-License-Identifier: Apache-2.0
"""The one list of what is told of a run: `--json`, the tables of commands and of the report are loops over it."""

from collections.abc import Callable
from operator import attrgetter
from typing import Any, NamedTuple

from haptic_device.digits import UNKNOWN, amount, plain
from haptic_display.run.report import lines
from haptic_display.run.report import summary as of
from haptic_display.run.report.oscillation import too_short
from haptic_display.run.report.run import Run

Needs = Callable[[Run], str]
"""Why a run does not have it, in words; "" where it has."""


_trace, _truth = attrgetter("no_trace"), attrgetter("no_truth")


def _nothing(run: Run) -> str:
    return ""


def _contacts(run: Run) -> str:
    there = run.traced or "tool" in run.recording.joints
    return "" if run.traced else run.recording.lacks("tool", "contact") if there else "no topic tool was recorded"


def _tool(run: Run) -> str:
    return run.no_trace or ("" if (run.rows["tool_age"] >= 0).any() else "no tool sample was ever used")


def _causes(run: Run) -> str:
    said = "the trace does not say it: it is of an older version"
    return run.no_trace or (said if of.withheld(run) is None else "")


def _spectrum(run: Run) -> str:
    return run.no_trace or too_short(len(run.rows), of.servo_rate(run))


def _fits(run: Run) -> str:
    return run.no_trace or ("" if run.fits else "the handle did not move enough, engaged and with the tool held still")


class Quantity(NamedTuple):
    """One thing that is told of a run. To add one of your own, add a line to QUANTITIES.

    Attributes:
        key: in `--json`, `name` or `group name`; "" where it is not there.
        words: in the table of `haptic demo`; "" where each of the values has words of its own.
        of: its value: a number, a text, None where the run does not tell it, or {name: value}.
        unit: of the value.
        section: of the report's table; "" where it is not there.
        label: its words there, where they are others; without any the value is lines, (words, text) each.
        shown: its text there, None for value and unit.
        needs: why a run does not have it.
        first: its place among the few that `haptic demo` shows first; 0 where it is none of them.
        column: its heading in the table of `haptic compare`.

    Examples:
        >>> from haptic_display.run.report.quantities import Quantity
        >>> from haptic_display.run.report.reading import read_run
        >>> ticks = Quantity("servo rows", "rows of the trace", lambda run: len(run.rows), section="Servo")
        >>> ticks.text(read_run("run/bag"))
        '7999'
    """

    key: str
    words: str
    of: Callable[[Run], Any]
    unit: str = ""
    section: str = ""
    label: str = ""
    shown: Callable[[Run], str | None] | None = None
    needs: Needs = _trace
    first: int = 0
    column: str = ""

    def value(self, run: Run) -> Any:
        """Of this run; None where the run does not have it."""
        return None if self.needs(run) else self.of(run)

    def text(self, run: Run) -> str:
        """Of this run, as the report and `haptic compare` have it."""
        said = self.shown(run) if self.shown and not self.needs(run) else None
        return _told(self.value(run), self.unit) if said is None else said


def _told(value: Any, unit: str) -> str:
    if isinstance(value, dict):
        values = [value[name] for name in ("p50", "p99", "max")]
        return UNKNOWN if None in values else ", ".join(map(plain, values)) + f" {unit}"
    if isinstance(value, int | float):
        return amount(value, unit)
    return UNKNOWN if value is None else str(value)


def figures(run: Run) -> dict[str, Any]:
    """Everything with a key, by group and name; None is what the run does not tell.

    Args:
        run: from `read_run`.

    Examples:
        >>> from haptic_display.run.report.quantities import figures
        >>> from haptic_display.run.report.reading import read_run
        >>> found = figures(read_run("run/bag"))
        >>> found["servo"]["missed"], found["exchange"]["answered"], found["withheld_s"]
        (0, 1999, {})
        >>> found["energy_j"]["given_to_operator_end"] < 0.0  # the hand has put energy in
        True
        >>> print(f"{found['contact']['max_on_hand_n']:.2f} N")
        1.68 N
    """
    found: dict[str, Any] = {}
    for one in (one for one in QUANTITIES if one.key):
        *group, name = one.key.split()
        place = found.setdefault(group[0], {}) if group else found
        place[name] = one.value(run)
    return found


RAN, SERVO, EXCHANGE, WITHHELD, ENERGY = "What ran", "Servo", "Exchange", "Force withheld", "Energy"
CONTACT, IMPEDANCE, OSCILLATION = "Contact", "Impedance added by the display", "Oscillation of the force"
SAID = "Said last on /diagnostics, counted since each node's start"
RECORDING, TRIAL = "Recording", "Trial and markers"
SECTIONS = (RAN, SERVO, EXCHANGE, WITHHELD, ENERGY, CONTACT, IMPEDANCE, OSCILLATION, SAID, RECORDING, TRIAL)

QUANTITIES = (  # in the order of `--json`, and of each section
    Quantity("", "", lines.what_ran, section=RAN, needs=_nothing),
    Quantity("seconds", "length of the run", lambda run: run.length, "s"),
    Quantity("servo rate_hz", "servo rate", of.servo_rate, "Hz", SERVO, "rate", first=4),
    Quantity("servo ticks", "servo ticks", of.ticks),
    Quantity("", "", lines.stamp_error, section=SERVO),
    Quantity("servo missed", "servo ticks missed", of.missed, "", SERVO, "missed ticks", first=5),
    Quantity(
        "servo lateness_us",
        "servo lateness",
        of.lateness,
        "µs",
        SERVO,
        "lateness p50, p99, max",
        lines.lateness,
        first=6,
    ),
    Quantity(
        "servo compute_us", "time to compute a tick", of.compute, "µs", SERVO, "compute p50, p99, max", lines.compute
    ),
    Quantity("servo late_device", "servo ticks without a new device sample", of.late_samples),
    Quantity("servo realtime", "scheduling of the servo", of.realtime, "", RAN, "real time", needs=_nothing),
    Quantity("exchange rate_hz", "exchange rate", of.exchange_rate, "Hz"),
    Quantity("exchange sent", "handle samples sent", of.sent, first=7),
    Quantity("", "handle samples", lines.sent, section=EXCHANGE),
    Quantity("exchange answered", "handle samples answered", of.answered, first=8),
    Quantity("", "answered", lines.answered, section=EXCHANGE),
    Quantity("exchange age_ms", "age of the tool sample", of.age, "ms", EXCHANGE, "age p50, p99, max"),
    Quantity("simulation method", "simulation method", of.said_by_simulation("method")),
    Quantity("simulation why", "why this method", of.said_by_simulation("why")),
    Quantity(
        "simulation waited_s",
        "time left out by the simulation",
        of.waited,
        "s",
        EXCHANGE,
        "time that the world left out",
    ),
    Quantity("", "handle to tool, RMS, largest", lines.apart, section=EXCHANGE, needs=_tool),
    Quantity("withheld_s", "force withheld", of.withheld_seconds, "s"),
    Quantity("", "", lines.withheld, section=WITHHELD, needs=_causes),
    Quantity("energy_j given_to_operator_max", "energy given to the hand, largest", of.most_given, "J", first=3),
    Quantity("energy_j given_to_operator_end", "energy given to the hand, at the end", of.given_at_end, "J"),
    Quantity("", "given to the operator, servo's account, end", lambda run: float(run.booked[-1]), "J", ENERGY),
    Quantity(
        "energy_j tool_port_end",
        "energy given to the tool, at the end",
        of.given_to_tool,
        "J",
        ENERGY,
        "given to the tool, at the end",
    ),
    Quantity("", "", lines.energies, section=ENERGY),
    Quantity("", "", lines.truth, section=ENERGY, needs=_truth),
    Quantity("", "", lines.contacts, section=CONTACT, needs=_contacts),
    Quantity(
        "contact max_force_n", "strongest contact", of.strongest, "N", CONTACT, "", lines.stronger, _nothing, first=2
    ),
    Quantity("contact max_on_hand_n", "strongest on the hand", of.on_hand, "N", CONTACT, needs=_nothing, first=1),
    Quantity("contact max_penetration_m", "deepest overlap", of.deepest, "m", CONTACT, "", lines.deeper, _nothing),
    Quantity("startup_s", "start-up", of.startup, "s", first=10),
    Quantity("residual", "", of.residual, "N", needs=of.no_residual),
    Quantity("", "", lines.impedance, section=IMPEDANCE, needs=_fits),
    Quantity("", "", lines.oscillation, section=OSCILLATION, needs=_spectrum),
    Quantity("", "", lines.said, section=SAID, needs=_nothing),
    Quantity("", "", lines.recording, section=RECORDING, needs=_nothing),
    Quantity("", "", lines.trial, section=TRIAL, needs=_nothing),
    Quantity("result", "", of.last_results),
    Quantity("result_greatest", "", of.greatest_results),
    Quantity("faults", "", of.faults, "", RAN, "faults", lines.faults, _nothing),
    Quantity("", "", lines.stiffness, column="stiffness [N/m]"),
    Quantity("", "", lines.error, column="error [mm]", needs=_tool),
    Quantity("", "", lines.most_energy, column="energy given [mJ]", needs=_nothing),
    Quantity("", "", lines.wave, column="oscillation", needs=_spectrum),
    Quantity("", "", lines.least_margin, column="least margin [N s/m]"),
    Quantity("", "", lines.cpu, column="CPU [%]", needs=_nothing),
)


def sections(run: Run) -> dict[str, dict[str, str]]:
    """The table of a report, {section: {words: text}}; what cannot be had says why."""
    found: dict[str, dict[str, str]] = {title: {} for title in SECTIONS}
    for one in (one for one in QUANTITIES if one.section):
        words = one.label or one.words
        if reason := one.needs(run):
            found[one.section].setdefault("not shown", reason)
        else:
            found[one.section] |= {words: one.text(run)} if words else dict(one.of(run))
    return found
