# SPDX-License-Identifier: Apache-2.0
"""What came of a run, in two sentences: how it ended, and what was wrong meanwhile."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from haptic_device.control.faults import FAULTS, name_of
from haptic_device.digits import amount, plain
from haptic_display.run.report import summary
from haptic_display.run.report.run import Run

LATE = 0.01  # share of ticks missed, or of samples late or unanswered, that is worth a warning
NOTHING = 1e-6  # [J] of energy that nobody feels
MISMATCH = 0.1  # [N] between the forces on handle and tool, beyond what the age of samples explains
GOOD, WARN, BAD = "good", "warn", "bad"
Findings = Iterator[tuple[str, str]]
"""(level, sentence) each."""


class Verdict(NamedTuple):
    """The verdict on a run.

    Attributes:
        level: the worst that was found: good, warn or bad.
        ending: how the run ended.
        rest: other findings, in one line.

    Examples:
        >>> from haptic_display.run.report.reading import read_run
        >>> from haptic_display.run.report.verdict import verdict
        >>> print(verdict(read_run("run/bag")).ending)
        No fault. Reached 100 % at the end.
    """

    level: str
    ending: str
    rest: str


def verdict(run: Run) -> Verdict:
    """The verdict on a run: faults, whether the job was done, energy given, force withheld, ticks and samples late.

    It is good only where the whole run was read: where something is noted, lost or not judged it says so.

    Args:
        run: from `read_run`.

    Examples:
        >>> from haptic_display.run.report.reading import read_run
        >>> from haptic_display.run.report.verdict import verdict
        >>> verdict(read_run("run/bag")).level
        'good'
    """
    parts = _ENDING, _REST + (_OF_TICKS if run.traced else ())
    ending, rest = ([found for part in some for found in part(run)] for some in parts)
    levels = {level for level, _ in ending + rest}
    worst = next((level for level in (BAD, WARN) if level in levels), GOOD)
    return Verdict(worst, *(" ".join(f"{sentence}." for _, sentence in part) for part in (ending, rest)))


def _whole(run: Run) -> Findings:
    """Notes, and what is missing: of the trace anything, of other messages more than a share."""
    yield from ((WARN, note.removesuffix(".")) for note in run.notes)
    recording, begin = run.recording, f"{run.recording.namespace}/"
    there = {name.removeprefix(begin): count for name, count in recording.counts.items() if name.startswith(begin)}
    lost = [(f"messages of {name}", recording.lost[begin + name] or 0, count) for name, count in there.items()]
    lost += [(what, count, there.get("encoder", 0)) for what, count in recording.left_out.items() if what == "samples"]
    lost += [(what, count, 0) for what, count in recording.left_out.items() if what != "samples"]
    if said := [f"{count} {what}" for what, count, among in lost if count > LATE * among]:
        yield WARN, f"Not the whole run was recorded: {', '.join(said)} are missing"


def _faults(run: Run) -> Findings:
    if not run.traced:
        said = [status.values.get("fault", "") for status in run.recording.statuses("haptic_driver")]
        found, last, known = sorted({*said} - {""}), said[-1] if said else "", bool(said)
    else:
        codes = run.recording.trace["fault"]
        found, last = summary.faults(run), name_of(int(np.nan_to_num(codes[-1])))
        known = bool(np.isfinite(codes).any())
    if last in FAULTS:
        yield BAD, f"Ended by a fault: {_title(last)} ({FAULTS[last].cause})"
    elif found:
        yield WARN, f"A fault came and was cleared: {', '.join(map(_title, found))}"
    elif known:
        yield GOOD, "No fault"
    else:
        yield WARN, "Not known whether there was a fault"


def _title(name: str) -> str:
    """Of a fault, for people; its name where it is of a newer driver."""
    return FAULTS[name].title if name in FAULTS else name


def _job(run: Run) -> Findings:
    greatest = summary.greatest_results(run)
    for name, value in summary.last_results(run).items():
        last, most = (plain(round(100 * one)) for one in (value, greatest.get(name, value)))
        told = f"{name.replace('_', ' ')} {last} %"
        if name not in summary.GOALS:
            yield GOOD, f"{told.capitalize()} at the end" + (f", {most} % at most" if most != last else "")
        elif value >= summary.REACHED:
            yield GOOD, f"Job done: {told}"
        else:
            yield BAD, f"Job not done: {told} of the {100 * summary.REACHED:.0f} % needed"


def _energy(run: Run) -> Findings:
    known = not run.no_truth and len(run.given)
    if not known and not run.traced:
        return
    given = np.fmax.reduce(run.given if known else run.booked)
    if given > NOTHING:
        yield WARN, f"The operator got up to {amount(float(given), 'J')} more than was put in"
    elif np.isfinite(given):
        yield GOOD, "The operator never got more energy than was put in"
    if run.traced and (least := np.fmin.reduce(run.rows["margin"][:, :2], axis=None)) < 0.0:
        yield WARN, f"The passivity margin fell to {plain(float(least), 'N s/m')}"


def _withheld(run: Run) -> Findings:
    causes = summary.withheld_seconds(run)
    if causes:
        yield WARN, "Force was withheld: " + ", ".join(f"{name} {total:.2f} s" for name, total in causes.items())
    elif run.traced and summary.withheld(run) is not None:
        yield GOOD, "No force was withheld"


def _timing(run: Run) -> Findings:
    if not run.rows["lateness"].any():  # in lock-step nothing can be late
        return
    missed, late, ticks = summary.missed(run), summary.late_samples(run), len(run.rows)
    said = [] if missed is None else [f"{missed} of {ticks} ticks missed"]
    said += [] if late is None else [f"{late} of the device's samples late"]
    if said:
        yield WARN if max(missed or 0, late or 0) > LATE * ticks else GOOD, ", ".join(said)


def _answers(run: Run) -> Findings:
    sent, answered = summary.sent(run), summary.answered(run)
    if sent and answered < (1.0 - LATE) * sent:
        yield WARN, f"Only {answered} of {sent} handle samples were answered"


def _forces(run: Run) -> Findings:
    if reason := summary.no_residual(run):
        yield WARN, f"Not judged: forces ({reason})"
        return
    found = summary.residual(run)["unexplained_n"]
    if found is not None and found > MISMATCH:
        yield WARN, f"Forces on handle and tool differ by {amount(found, 'N')} (RMS), which no age of samples explains"


_ENDING = (_faults, _job)
_REST = (_whole, _energy, _withheld)
_OF_TICKS = (_forces, _timing, _answers)
