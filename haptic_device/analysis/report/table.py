# SPDX-License-Identifier: Apache-2.0
"""The table of a report: what ran and what came of it, name by name, as text; what cannot be had says why."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from haptic_device import digits
from haptic_device.analysis.impedance import Estimate
from haptic_device.analysis.report import summary
from haptic_device.analysis.report.run import Run
from haptic_device.control.faults import name_of
from haptic_device.control.withheld import TABLE
from haptic_device.sequence_gaps import UNKNOWN
from haptic_device.withheld_time import LASTS, SHORT

Entries = Iterator[tuple[str, str]]
"""(name, text) of a section's lines."""
MISSING = digits.UNKNOWN
VERSIONS = ("haptic_display", "numba", "numpy", "ros-rclpy")  # of what was attached, those that a reader looks for
READ = (
    "± is 95 % of this law's own fit, by the recording alone. In contact K and B are the coupling's or the wall's as "
    "the hand meets them: delay takes about K times the tool's age from B. In free space they are what is left, zero "
    "at best. Mass is the least certain: the display's own noise, where it shakes the handle, makes it too small."
)


def sections(run: Run) -> dict[str, dict[str, str]]:
    """{section: {name: text}} of one run."""
    parts = {
        "What ran": [_what_ran],
        "Servo": [_servo],
        "Exchange": [_exchange],
        "Force withheld": [_withheld],
        "Energy": [_energy, _truth],
        "Contact": [_contact, _strongest],
        "Impedance added by the display": [_impedance],
        "Oscillation of the force": [_oscillation],
        "Said last on /diagnostics, counted since each node's start": [_said],
        "Recording": [_recording],
        "Trial and markers": [_trial],
    }
    return {title: {name: text for part in those for name, text in _tried(part, run)} for title, those in parts.items()}


def _tried(part: Callable[[Run], Entries], run: Run) -> Entries:
    """The part's entries, as far as they go before something is missing."""
    try:
        yield from part(run)
    except (ValueError, IndexError, KeyError) as error:
        yield "not shown", str(error)


def _what_ran(run: Run) -> Entries:
    yield "recording", run.name
    yield "begun", f"{run.begun:%-d %B %Y, %H:%M:%S %Z}" if run.begun else "in lock-step, without a date"
    yield "length", f"{run.length:.3f} s, " + (f"{len(run.rows)} ticks" if run.traced else "no trace")
    yield from run.conditions.items()
    for kind in ("scene", "device"):
        attached = [name.removeprefix(f"{kind}/") for name in run.recording.attachments if name.startswith(f"{kind}/")]
        yield kind, ", ".join(attached) or MISSING
    made = run.attached("made.yaml")
    yield "git revision", str(made.get("program", {}).get("git_revision") or MISSING)
    packages, machine = made.get("packages", {}), made.get("machine", {})
    yield "versions", ", ".join(f"{name} {packages[name]}" for name in VERSIONS if packages.get(name)) or MISSING
    said = [("{}", "processor"), ("{} cores", "cores"), ("{}", "system")]
    yield "machine", ", ".join(form.format(machine[name]) for form, name in said if machine.get(name)) or MISSING
    yield "real time", run.recording.last_values("haptic_driver").get("realtime", MISSING)
    yield "faults", _faults(run) if run.traced else MISSING


def _faults(run: Run) -> str:
    before = name_of(int(np.nan_to_num(run.recording.trace["fault"][0])))
    found = [
        f"{name} (since before this recording)" if name == before else name for name in summary.faults(run.recording)
    ]
    return ", ".join(found) or "none"


def _servo(run: Run) -> Entries:
    found = summary.servo_figures(run.rows)
    yield "rate", f"{found['rate_hz']:.0f} Hz"
    if np.any(run.rows["stamp_error"] > 0.0):
        yield "times of samples known to", f"± {digits.amount(float(np.nanmax(run.rows['stamp_error'])) * 1e-9, 's')}"
    yield "missed ticks", MISSING if found["missed"] is None else str(found["missed"])
    for name, label in (("lateness_us", "lateness"), ("compute_us", "compute")):
        measured = run.rows[label].any()  # in lock-step nothing is late, exactly
        yield f"{label} p50, p99, max", _three(found[name], "µs") if measured else "not measured"


def _exchange(run: Run) -> Entries:
    found = summary.exchange_figures(run.recording, run.rows)
    yield "handle samples", f"{found['sent']} at {found['rate_hz']:.0f} Hz"
    yield "answered", f"{found['answered']} ({100 * found['answered'] / max(1, found['sent']):.2f} %)"
    yield "age p50, p99, max", _three(found["age_ms"], "ms")
    waited = summary.waited_time(run.recording)
    yield "time that the world left out", MISSING if waited is None else digits.amount(waited, "s")
    yield "handle to tool, RMS, largest", ", ".join(digits.amount(distance, "m") for distance in _apart(run))


def _apart(run: Run) -> tuple[float, float]:
    """RMS and largest distance from handle to tool [m]."""
    distance = run.distance[np.isfinite(run.distance)]
    if not len(distance):
        return np.nan, np.nan
    return float(np.sqrt(np.mean(distance**2, dtype=float))), float(np.max(distance))


def _withheld(run: Run) -> Entries:
    found = summary.withheld_figures(run.recording)
    if found is None:
        raise ValueError("the trace does not say it: it is of an older version")
    short = summary.short_time(run.recording)
    if short:
        yield "tool_port", f"{short:.2f} s in all: {SHORT}"
    if not found and not short:
        yield "found", f"none for more than {LASTS:g} s"
    causes = {each.name: each.cause for each in TABLE}
    for name, (total, longest) in found.items():
        yield name, f"{total:.2f} s in all, {longest:.2f} s at most: {causes[name]}"


def _energy(run: Run) -> Entries:
    yield "given to the operator, servo's account, end", digits.amount(float(run.booked[-1]), "J")
    by_simulation = summary.energy_given_to_tool(run.recording)
    yield "given to the tool, at the end", MISSING if by_simulation is None else digits.amount(by_simulation, "J")
    yield "given to the tool, by the samples at the servo, end", digits.amount(float(run.tool_energy[-1]), "J")
    margin = np.fmin.reduce(run.rows["margin"], axis=0)
    units = ("N s/m", "N s/m", "N m s/rad")
    yield "least margin x, y, θ", ", ".join(digits.plain(float(m), unit) for m, unit in zip(margin, units, strict=True))
    yield "ticks in which the controller acted", _told("{:.0f}", run.rows["injections"][-1] - run.rows["injections"][0])


def _truth(run: Run) -> Entries:
    given = run.given
    yield "given to the operator, truth, largest", digits.amount(float(np.fmax.reduce(given)), "J")
    yield "given to the operator, truth, end", digits.amount(float(given[-1]), "J")


def _contact(run: Run) -> Entries:
    yield "contacts", str(len(run.contacts))
    yield "time in contact", f"{100 * run.touch.mean():.1f} %"
    if run.contacts:
        yield "first", f"at {run.contacts[0].begin:.3f} s"


def _strongest(run: Run) -> Entries:
    on_hand = summary.contact_figures(run.recording, run.rows if run.traced else None)["max_on_hand_n"]
    yield "strongest contact", _greatest(run, "max_contact_force", "N")
    yield "strongest on the hand", MISSING if on_hand is None else digits.amount(on_hand, "N")
    yield "deepest overlap", _greatest(run, "max_penetration", "m")


def _greatest(run: Run, name: str, unit: str) -> str:
    value, bound = summary.greatest(run.recording, name)
    if value is not None:
        return digits.amount(value, unit)
    return MISSING if bound is None else f"at most {digits.amount(bound, unit)}, which was before this recording"


def _impedance(run: Run) -> Entries:
    if not run.fits:
        raise ValueError("the handle did not move enough, engaged and with the tool held still")
    for (kind, axis), found in run.fits.items():
        if (kind, axis) not in run.impedances:
            yield f"{kind}, {axis}", f"not told: mass, damper and spring explain only {100 * found.explained:.0f} %"
            continue
        torque = axis == "theta"
        yield f"{kind}, {axis}: K", _plus(found.stiffness, "N m/rad" if torque else "N/m")
        yield f"{kind}, {axis}: B", _plus(found.damping, "N m s/rad" if torque else "N s/m")
        yield f"{kind}, {axis}: apparent damping b + B", _apparent(run, axis, found.damping)
        mass = _plus(found.mass, "kg m²" if torque else "kg")
        yield f"{kind}, {axis}: mass, r²", f"{mass}, r² = {found.explained:.4f}"
    yield "how to read it", READ


def _apparent(run: Run, axis: str, damping: Estimate) -> str:
    physical = run.physical_damping[("x", "y", "theta").index(axis)]
    if not np.isfinite(physical):
        return MISSING
    unit = "N m s/rad" if axis == "theta" else "N s/m"
    return _plus(Estimate(physical + damping.value, damping.error), unit)


def _oscillation(run: Run) -> Entries:
    found = run.spectrum.oscillation
    if found is None:
        yield "found", "none"
        return
    yield "frequency", f"{found.frequency:.1f} Hz"
    yield "force", f"{digits.amount(found.force, 'N')} RMS"
    yield "when", f"from {found.begin:.2f} s, {found.seconds:.2f} s in all"


def _said(run: Run) -> Entries:
    """Each node's last status, which without a trace is all that is known of the servo."""
    for name in run.recording.diagnostics:
        if not run.traced and ":" not in name:
            last = run.recording.statuses(name)[-1]
            yield name, "; ".join([last.message, *(f"{key} {value}" for key, value in last.values.items() if value)])


def _recording(run: Run) -> Entries:
    yield "rows missing from the trace", str(run.recording.trace_rows_missing) if run.traced else MISSING
    left_out = run.recording.left_out
    yield "rows that the servo had to drop", str(left_out.get("trace rows", MISSING))
    yield "samples that the driver had to skip", str(left_out.get("samples", MISSING))
    begin = f"{run.recording.namespace}/"
    lost = {
        name.removeprefix(begin): UNKNOWN if count is None else count
        for name, count in run.recording.lost.items()
        if name.startswith(begin) and count != 0
    }
    yield "messages", str(sum(run.recording.counts.values()))
    topics = (f"{name.removeprefix(begin)} {count}" for name, count in run.recording.counts.items())
    yield "messages of each topic", ", ".join(topics)
    yield "messages lost", ", ".join(f"{name} {count}" for name, count in lost.items()) or "none"
    yield "stamps that go back, or stand still", _unordered(run)


def _unordered(run: Run) -> str:
    orders, begin = run.recording.orders, f"{run.recording.namespace}/"
    wrong = [
        f"{name.removeprefix(begin)} {found.back} back, {found.same} still"
        for name, found in orders.items()
        if found.back or found.same
    ]
    return ", ".join(wrong) or f"none, in {len(orders)} topics"


def _trial(run: Run) -> Entries:
    yield from ((str(name), str(value)) for name, value in run.attached("trial.yaml").items())
    for time, text in run.marks:
        yield f"mark at {time:.3f} s", text


def _three(found: dict[str, Any], unit: str) -> str:
    values = [found[name] for name in ("p50", "p99", "max")]
    return MISSING if None in values else ", ".join(map(digits.plain, values)) + f" {unit}"


def _told(text: str, *values: float) -> str:
    """The text with its values, where every one is a number."""
    return text.format(*values) if np.isfinite(values).all() else MISSING


def _plus(estimate: Estimate, unit: str) -> str:
    return digits.with_error(estimate.value, estimate.error, unit)
