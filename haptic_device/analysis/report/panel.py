# SPDX-License-Identifier: Apache-2.0
"""Panels of a report: each draws one thing of a run into axes, or says in them why it cannot.

Colours are Okabe and Ito's, and every pair of lines differs by its dashes too, so that it can be read in grey. A long
line is drawn as the envelope of its ticks: no peak is lost.
"""

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from haptic_device.analysis.quantity import Array
from haptic_device.analysis.report.run import Run
from haptic_device.analysis.report.summary import gains, period

BLUE, ORANGE, GREEN, VERMILION, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7"
COLOURS, NAMES = (BLUE, VERMILION, GREEN), ("x", "y", "θ")
POINTS = 2000  # of one line; more than a page resolves
_BACK = (4, 2)  # dashes
_DASHES: dict[str, dict[str, Any]] = {
    "handle": {},
    "tool": {"dashes": _BACK},
    "on handle": {},
    "of the coupling": {"dashes": _BACK},
}


def positions(axes: Axes, run: Run) -> None:
    """Handle and tool, x and y over time."""
    for i in range(2):
        for what, (time, place) in run.places(i).items():
            _line(axes, time, place * 1e3, COLOURS[i], f"{what} {NAMES[i]}", **_DASHES[what])
    _mark(axes, run)
    _finish(axes, _time(run), "position [mm]")


def distances(axes: Axes, run: Run) -> None:
    """Handle to tool in the plane, over time."""
    _line(axes, run.seconds[run.rows["tool_age"] >= 0], run.distance * 1e3, BLUE, "handle to tool")
    _finish(axes, _time(run), "distance [mm]")


def angles(axes: Axes, run: Run) -> None:
    """Handle and tool, angle over time."""
    for what, (time, angle) in run.places(2).items():
        colour = GREEN if what == "handle" else PURPLE
        _line(axes, time, np.degrees(angle), colour, f"{what} θ", **_DASHES[what])
    _finish(axes, _time(run), "angle [°],\ncounter-clockwise")


def path(axes: Axes, run: Run) -> None:
    """Handle and tool in the plane, to scale."""
    across, up = run.places(0), run.places(1)
    for what, (time, x) in across.items():
        some = _stride(len(time))
        colour = BLUE if what == "handle" else VERMILION
        axes.plot(x[some] * 1e3, up[what][1][some] * 1e3, color=colour, linewidth=1, label=what, **_DASHES[what])
    axes.set_aspect("equal", adjustable="datalim")
    _finish(axes, "x [mm]", "y [mm]")


def forces(axes: Axes, run: Run) -> None:
    """Force on the handle, and the coupling's part of it, with the contacts shaded."""
    with contextlib.suppress(ValueError):  # nothing told of contacts
        for contact in run.contacts[:200]:
            axes.axvspan(contact.begin, contact.end, color="0.9", linewidth=0)
    for what, colours in (("on handle", COLOURS), ("of the coupling", (ORANGE, PURPLE))):
        for i in range(2):
            if what in (there := run.forces(i)):
                _line(axes, *there[what], colours[i], f"{what}, {NAMES[i]}", **_DASHES[what])
    _mark(axes, run)
    _finish(axes, f"{_time(run)}; grey: contact", "force [N]")


def contact_events(axes: Axes, run: Run) -> None:
    """Each contact as a bar from beginning to end, as high as the strongest force on the hand meanwhile."""
    if not run.contacts:
        raise ValueError("nothing was touched")
    begins, ends, sizes = (np.array(column) for column in zip(*run.contacts, strict=True))
    axes.bar(begins, sizes, np.maximum(ends - begins, run.length / 500), align="edge", color=BLUE, alpha=0.7)
    axes.set_xlim(0, run.length)
    axes.set(xlabel=_time(run), ylabel="strongest on\nthe hand [N]")
    axes.grid(color="0.9")


def energies(axes: Axes, run: Run) -> None:
    """Energy given to the operator by the ground truth and by the servo's account, and through the other ports."""
    if run.traced:
        booked = run.booked * 1e3
        _line(axes, run.seconds, booked, ORANGE, "to the operator, servo's books", dashes=_BACK)
    try:
        _line(axes, run.ground_truth_seconds, run.given * 1e3, BLUE, "to the operator, truth")
    except ValueError:
        if not run.traced:
            raise
        axes.plot([], [], color="none", label="operator/state was not recorded: no truth")
    if run.traced:
        _line(axes, run.seconds, run.tool_energy * 1e3, GREEN, "to the tool at its port", dashes=(1, 1))
    axes.axhline(0, color="0.6", linewidth=0.8)
    _finish(axes, _time(run), "energy [mJ]")


def margins(axes: Axes, run: Run) -> None:
    """Passivity margin: physical damping left over by the gains in force, as a share of b."""
    damping = run.physical_damping
    if not np.isfinite(damping).any():
        raise ValueError("the driver did not say its physical damping")
    for i in range(3):
        if np.isfinite(damping[i]):
            share = run.rows["margin"][:, i] / damping[i] * 100
            _line(axes, run.seconds, share, COLOURS[i], NAMES[i], dashes=(4, i + 0.01))
    axes.axhline(0, color="black", linewidth=0.8)
    _finish(axes, _time(run), "passivity margin\n[% of b left over]")


def lateness(axes: Axes, run: Run) -> None:
    """Histogram of wake-up after the deadline and of the tick's own work."""
    late, compute = (np.maximum(_finite(run.rows[name]) * 1e6, 0.1) for name in ("lateness", "compute"))
    if not len(late) or not len(compute):
        raise ValueError("lateness and compute are no numbers")
    if not run.rows["lateness"].any():
        raise ValueError("it was not measured: lateness is 0 in every tick")
    bins = np.geomspace(0.1, max(late.max(), compute.max()) * 1.01, 80).tolist()
    axes.hist(late, bins, color=BLUE, alpha=0.8, label="wake-up after the deadline")
    axes.hist(compute, bins, color=ORANGE, histtype="step", linewidth=1.5, label="time of the tick's own work")
    axes.axvline(period(run.rows) * 1e6, color="black", linestyle=":", label="one period T")
    axes.set(xscale="log", yscale="log")
    _finish(axes, "lateness and compute time [µs]", "ticks")


def ages(axes: Axes, run: Run) -> None:
    """Histogram of the age of the tool sample in use."""
    age = run.rows["tool_age"][run.rows["tool_age"] >= 0] * 1e3
    if not len(age):
        raise ValueError("no tool sample was ever used")
    axes.hist(
        age, np.linspace(0, np.percentile(age, 99.9) * 1.2 + 0.1, 80).tolist(), color=GREEN, alpha=0.8, label="age"
    )
    axes.axvline(np.median(age), color="black", linestyle=":", label=f"median {np.median(age):.2f} ms")
    axes.set(yscale="log")
    _finish(axes, "age of the tool sample in use [ms]", "ticks")


def spectrum(axes: Axes, run: Run) -> None:
    """Power density of the force on the handle; an oscillation is named with its frequency."""
    found = run.spectrum
    axes.loglog(found.frequency[1:], np.maximum(found.density[1:], 1e-18), color=BLUE, label="x and y together")
    if found.oscillation:
        line = found.oscillation
        name = f"{line.frequency:.1f} Hz, {line.force:.3g} N RMS"
        axes.axvline(line.frequency, color=VERMILION, dashes=_BACK, label=name)
    _finish(axes, "frequency [Hz]", "force on handle [N²/Hz]")


def impedance(axes: Sequence[Axes], run: Run) -> None:
    """Fitted stiffness and damping of each axis, with confidence."""
    rows = [(kind, axis, fitted) for (kind, axis), fitted in run.impedances.items() if axis != "theta"]
    if not rows:
        raise ValueError("no motion of the handle that told an impedance")
    for place, (kind, _, fitted) in enumerate(rows):
        look: dict[str, Any] = {"color": VERMILION, "fmt": "o"} if kind == "contact" else {"color": BLUE, "fmt": "s"}
        for column, estimate in enumerate((fitted.stiffness, fitted.damping)):
            axes[column].errorbar(estimate.value, place, xerr=estimate.error, capsize=4, **look)
    for column, value in enumerate(_set_gains(run)):
        axes[column].axvline(value, color="black", linestyle=":", linewidth=1.2)
    for column, label in enumerate(("stiffness [N/m]", "damping added [N s/m]")):
        axes[column].set(xlabel=label, yticks=range(len(rows)), ylim=(-0.6, len(rows) - 0.4))
        axes[column].set_yticklabels([f"{kind}, {axis}" for kind, axis, _ in rows] if column == 0 else [])
        axes[column].axvline(0, color="0.6", linewidth=0.8)
        axes[column].grid(color="0.9")


def _set_gains(run: Run) -> list[float]:
    """Stiffness and damping of the coupling, if the bag has them."""
    try:
        return list(gains(run.recording).values())[:2]
    except (ValueError, IndexError):
        return []


def _time(run: Run) -> str:
    return f"time since first {'motor command' if run.traced else 'message'} [s]"


def _line(axes: Axes, time: Array, values: npt.NDArray[np.floating], colour: str, label: str, **style: Any) -> None:
    if len(time) == 0:
        return
    axes.plot(*thin(time, values), color=colour, linewidth=1.2, label=label, **style)


def thin(time: Array, values: npt.NDArray[np.floating]) -> tuple[Array, npt.NDArray[np.floating]]:
    """At most 2 POINTS of a line: the least and the largest value of each stretch."""
    if len(values) <= 2 * POINTS:
        return time, values
    begins = np.linspace(0, len(values), POINTS, endpoint=False).astype(int)
    thin = np.stack([np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)], axis=1).ravel()
    return np.repeat(time[begins], 2), thin


def _stride(count: int) -> slice:
    return slice(None, None, max(1, count // (10 * POINTS)))


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


def _mark(axes: Axes, run: Run) -> None:
    """Markers as vertical lines with their text."""
    for time, text in run.marks[:40]:
        axes.axvline(time, color="black", linewidth=0.8, dashes=(2, 2))
        axes.annotate(text[:30], (time, 1), xycoords=("data", "axes fraction"), rotation=90, va="top", fontsize=7)


def _finish(axes: Axes, horizontal: str, vertical: str) -> None:
    axes.set(xlabel=horizontal, ylabel=vertical)
    axes.set_axisbelow(True)
    axes.grid(color="0.9")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", fontsize=7, ncols=2)
