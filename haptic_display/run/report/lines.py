# SPDX-License-Identifier: Apache-2.0
"""Lines of a report's table that are no single value, (words, text) each, and texts of more than value and unit."""

from collections.abc import Callable, Iterator

import numpy as np

from haptic_device.control.faults import name_of
from haptic_device.control.withheld import LASTS, SHORT, TABLE
from haptic_device.digits import UNKNOWN, amount, plain, with_error
from haptic_device.recording.sequence_gaps import UNKNOWN as NOT_COUNTED
from haptic_device.recording.status import number
from haptic_display.run.report import summary
from haptic_display.run.report.impedance import Estimate
from haptic_display.run.report.run import AXES, Run

Entries = Iterator[tuple[str, str]]
VERSIONS = ("haptic_display", "numba", "numpy", "ros-rclpy")  # of what was attached, those that a reader looks for
READ = (
    "± is 95 % of this law's own fit, by the recording alone. In contact K and B are the coupling's or the wall's as "
    "the hand meets them: delay takes about K times the tool's age from B. In free space they are what is left, zero "
    "at best. Mass is the least certain: the display's own noise, where it shakes the handle, makes it too small."
)


def what_ran(run: Run) -> Entries:
    """What was recorded, when, with what and on what."""
    yield "recording", run.name
    yield "begun", f"{run.begun:%-d %B %Y, %H:%M:%S %Z}" if run.begun else "in lock-step, without a date"
    yield "length", f"{run.length:.3f} s, " + (f"{len(run.rows)} ticks" if run.traced else "no trace")
    yield from run.conditions.items()
    for kind in ("scene", "device"):
        attached = [name.removeprefix(f"{kind}/") for name in run.recording.attachments if name.startswith(f"{kind}/")]
        yield kind, ", ".join(attached) or UNKNOWN
    made = run.attached("made.yaml")
    yield "git revision", str(made.get("program", {}).get("git_revision") or UNKNOWN)
    packages, machine = made.get("packages", {}), made.get("machine", {})
    yield "versions", ", ".join(f"{name} {packages[name]}" for name in VERSIONS if packages.get(name)) or UNKNOWN
    said = [("{}", "processor"), ("{} cores", "cores"), ("{}", "system")]
    yield "machine", ", ".join(form.format(machine[name]) for form, name in said if machine.get(name)) or UNKNOWN


def faults(run: Run) -> str:
    """Names of the faults, and which of them latched before."""
    if not run.traced:
        return UNKNOWN
    before = name_of(int(np.nan_to_num(run.recording.trace["fault"][0])))
    found = [f"{name} (since before this recording)" if name == before else name for name in summary.faults(run)]
    return ", ".join(found) or "none"


def stamp_error(run: Run) -> Entries:
    """How exact the times of the device's samples are, where it says so."""
    if np.any(run.rows["stamp_error"] > 0.0):
        yield "times of samples known to", f"± {amount(float(np.nanmax(run.rows['stamp_error'])) * 1e-9, 's')}"


def _measured(column: str) -> Callable[[Run], str | None]:
    """That the column was not: it is zero in every tick, as in lock-step."""
    return lambda run: None if run.rows[column].any() else "not measured"


lateness, compute = _measured("lateness"), _measured("compute")


def sent(run: Run) -> str:
    """Handle samples, and their rate."""
    return f"{summary.sent(run)} at {summary.exchange_rate(run):.0f} Hz"


def answered(run: Run) -> str:
    """Handle samples that were answered, and their share."""
    count = summary.answered(run)
    return f"{count} ({100 * count / max(1, summary.sent(run)):.2f} %)"


def apart(run: Run) -> str:
    """From handle to tool."""
    return ", ".join(amount(distance, "m") for distance in summary.apart(run))


def withheld(run: Run) -> Entries:
    """Each cause by which force was withheld, for how long."""
    found, short = summary.withheld(run) or {}, summary.withheld_by_port(run)
    if short:
        yield summary.PORT, f"{short:.2f} s in all: {SHORT}"
    if not found and not short:
        yield "found", f"none for more than {LASTS:g} s"
    causes = {each.name: each.cause for each in TABLE}
    for name, (total, longest) in found.items():
        yield name, f"{total:.2f} s in all, {longest:.2f} s at most: {causes[name]}"


def energies(run: Run) -> Entries:
    """What the servo knows of energy, beside its account."""
    yield "given to the tool, by the samples at the servo, end", amount(float(run.tool_energy[-1]), "J")
    margin = np.fmin.reduce(run.rows["margin"], axis=0)
    units = ("N s/m", "N s/m", "N m s/rad")
    yield "least margin x, y, θ", ", ".join(plain(float(m), unit) for m, unit in zip(margin, units, strict=True))
    short = run.rows["exchange_shortened"][-1] - run.rows["exchange_shortened"][0]
    yield "ticks in which the coupling was kept short", f"{short:.0f}" if np.isfinite(short) else UNKNOWN


def truth(run: Run) -> Entries:
    """Energy given to the operator while the ticks ran."""
    given = run.given if len(run.given) else np.array([np.nan])
    yield "given to the operator, truth, largest", amount(float(np.fmax.reduce(given)), "J")
    yield "given to the operator, truth, end", amount(float(given[-1]), "J")


def contacts(run: Run) -> Entries:
    """How many, how long, and when the first began."""
    yield "contacts", str(len(run.contacts))
    yield "time in contact", f"{100 * run.touch.mean():.1f} %"
    if run.contacts:
        yield "first", f"at {run.contacts[0].begin:.3f} s"


def _before(name: str, unit: str) -> Callable[[Run], str | None]:
    """The bound of what the simulation keeps the greatest of, where an earlier and greater one hides it."""

    def text(run: Run) -> str | None:
        value, bound = summary.greatest(run.recording, name)
        if value is not None or bound is None:
            return None
        return f"at most {amount(bound, unit)}, which was before this recording"

    return text


stronger, deeper = _before("max_contact_force", "N"), _before("max_penetration", "m")


def impedance(run: Run) -> Entries:
    """Stiffness, damping and mass of each fit, or how little it explains."""
    for (kind, axis), found in run.fits.items():
        if (kind, axis) not in run.impedances:
            yield f"{kind}, {axis}", f"not told: mass, damper and spring explain only {100 * found.explained:.0f} %"
            continue
        torque = axis == "theta"
        yield f"{kind}, {axis}: K", with_error(*found.stiffness, "N m/rad" if torque else "N/m")
        yield f"{kind}, {axis}: B", with_error(*found.damping, "N m s/rad" if torque else "N s/m")
        yield f"{kind}, {axis}: apparent damping b + B", _apparent(run, axis, found.damping)
        mass = with_error(*found.mass, "kg m²" if torque else "kg")
        yield f"{kind}, {axis}: mass, r²", f"{mass}, r² = {found.explained:.4f}"
    yield "how to read it", READ


def _apparent(run: Run, axis: str, damping: Estimate) -> str:
    physical = run.physical_damping[AXES.index(axis)]
    if not np.isfinite(physical):
        return UNKNOWN
    unit = "N m s/rad" if axis == "theta" else "N s/m"
    return with_error(physical + damping.value, damping.error, unit)


def oscillation(run: Run) -> Entries:
    """Frequency, force and time, or that there was none."""
    found = run.spectrum.oscillation
    if found is None:
        yield "found", "none"
        return
    yield "frequency", f"{found.frequency:.1f} Hz"
    yield "force", f"{amount(found.force, 'N')} RMS"
    yield "when", f"from {found.begin:.2f} s, {found.seconds:.2f} s in all"


def said(run: Run) -> Entries:
    """Each node's last status, which without a trace is all that is known of the servo."""
    for name in run.recording.diagnostics:
        if not run.traced and ":" not in name:
            last = run.recording.statuses(name)[-1]
            yield name, "; ".join([last.message, *(f"{key} {value}" for key, value in last.values.items() if value)])


def recording(run: Run) -> Entries:
    """What was recorded, and what of it is missing."""
    yield "rows missing from the trace", str(run.recording.trace_rows_missing) if run.traced else UNKNOWN
    left_out = run.recording.left_out
    yield "rows that the servo had to drop", str(left_out.get("trace rows", UNKNOWN))
    yield "samples that the driver had to skip", str(left_out.get("samples", UNKNOWN))
    begin = f"{run.recording.namespace}/"
    lost = {
        name.removeprefix(begin): NOT_COUNTED if count is None else count
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


def trial(run: Run) -> Entries:
    """What was noted of the trial, and the markers."""
    yield from ((str(name), str(value)) for name, value in run.attached("trial.yaml").items())
    for time, text in run.marks:
        yield f"mark at {time:.3f} s", text


def stiffness(run: Run) -> str | None:
    """Fitted in contact, in the axis that tells most."""
    found = [fitted for (kind, axis), fitted in run.impedances.items() if kind == "contact" and axis != "theta"]
    if not found:
        return None
    best = min(found, key=lambda fitted: fitted.stiffness.error / abs(fitted.stiffness.value))
    return with_error(*best.stiffness)


def error(run: Run) -> str:
    """RMS of the distance from handle to tool."""
    return plain(summary.apart(run)[0] * 1e3)


def most_energy(run: Run) -> str | None:
    """Largest energy given to the operator: by the truth, or else as the servo counts it."""
    if not run.no_truth and np.isfinite(run.given).any():
        return plain(float(np.fmax.reduce(run.given)) * 1e3)
    if not run.traced or not np.isfinite(run.booked).any():
        return None
    return f"{plain(float(np.fmax.reduce(run.booked)) * 1e3)} by the servo"


def wave(run: Run) -> str:
    """Frequency and force of an oscillation."""
    found = run.spectrum.oscillation
    return "none" if found is None else f"{plain(found.frequency, 'Hz')}, {amount(found.force, 'N')}"


def least_margin(run: Run) -> str:
    """The least passivity margin in x and y."""
    return plain(float(np.fmin.reduce(run.rows["margin"][:, :2], axis=None)))


def cpu(run: Run) -> str | None:
    """In lock-step the share of a core that plant, servo and simulation would need in real time."""
    share = number(run.recording.last_values("haptic_replay").get("cpu_share", ""))
    return None if np.isnan(share) else f"{100 * share:.1f}"
