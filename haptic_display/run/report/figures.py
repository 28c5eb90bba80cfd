# SPDX-License-Identifier: Apache-2.0
"""The figures of a report: what each shows, and how it is drawn of one run, or of several over each other.

Of one run a figure has one panel with all its curves; of several a panel for each curve, in which each run has a
colour and dashes of its own and all panels of a row have one scale.
"""

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Shown
from matplotlib.patheffects import withStroke

from haptic_device.os_errors import naming
from haptic_device.theory.palette import DOTTED, RUNS, SOLID, Dashes, Look
from haptic_display.run.report import curves, panel
from haptic_display.run.report.curves import Curve
from haptic_display.run.report.panel import GRID
from haptic_display.run.report.run import Run

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (the backend is chosen first)

DPI = 130
WIDTH = 9.0  # [inch]
_LIGHT = withStroke(linewidth=2.5, foreground="white")
_TEXT: dict[str, Any] = {"textcoords": "offset points", "va": "top", "fontsize": 9, "path_effects": [_LIGHT]}
ERRORS = (ValueError, IndexError, FloatingPointError)
Lines = Callable[[Run], list[tuple[float, str]]]  # vertical, of one run: where, and what they say


class Figure(NamedTuple):
    """name: of its file; curves of a run, labels of y and x (without one it is the run's time), log scales, vertical
    lines; height of a row [inch]; across: panels in a row where several runs are shown."""

    name: str
    title: str
    curves: Callable[[Run], list[Curve]]
    vertical: str
    horizontal: str = ""
    logs: str = ""
    lines: Lines | None = None
    height: float = 2.2
    across: int = 1

    def check(self, run: Run) -> None:
        """Raises ValueError where the run does not tell it."""
        self.curves(run)

    def draw(self, runs: Sequence[Run], looks: Sequence[Look]) -> Shown:
        """The picture of these runs, open; looks: of each where there are several."""
        if len(runs) > 1:
            return _draw_over(self, runs, looks)
        shown, axes = pyplot.subplots(figsize=(WIDTH, self.height + 0.5), layout="constrained")
        fill(axes, self, runs[0])
        return shown


class Special(NamedTuple):
    """A figure that draws its own panels; check: raises ValueError where the run does not tell it; panels: 0 for one of
    each run, else how many."""

    name: str
    title: str
    check: Callable[[Run], Any]
    paint: Callable[[Sequence[Axes], Sequence[Run], Sequence[Look]], None]
    height: float
    panels: int = 0
    shape: Callable[[Sequence[Run]], float] | None = None

    def draw(self, runs: Sequence[Run], looks: Sequence[Look]) -> Shown:
        """The picture of these runs, open; looks: of each."""
        count = self.panels or len(runs)
        width = WIDTH
        if self.shape:
            width = min(max(count * self.shape(runs) * (self.height - 1.0) + 0.9, 2.4), 1.5 * WIDTH)
        size: dict[str, Any] = {"figsize": (width, self.height), "layout": "constrained"}
        shown, grid = pyplot.subplots(1, count, squeeze=False, sharey="row", **size)
        self.paint(list(grid[0]), runs, looks)
        return shown


FIGURES: tuple[Figure | Special, ...] = (
    Figure("positions", "Position", curves.positions, "position [mm]", height=2.6, across=2),
    Figure("distances", "Stretch", curves.distances, "handle to tool [mm]"),
    Figure("forces", "Force", curves.forces, "force [N]", height=2.7, across=2),
    Figure("angles", "Angle", curves.angles, "angle [°]", across=2),
    Special("path", "Path", lambda run: run.places(0), panel.path, 3.6, shape=panel.path_shape),
    Special("contacts", "Contacts", panel.check_contacts, panel.contacts, 2.2),
    Figure("energies", "Energy", curves.energies, "energy [mJ]", height=2.7, across=3),
    Figure("margin", "Passivity margin", curves.margins, "left over [% of b]", across=3),
    Figure("lateness", "Servo timing", curves.lateness, "ticks", "time [µs]", "xy", curves.one_period, across=2),
    Figure("age", "Sample age", curves.ages, "ticks", "age [ms]", "y", curves.median_age),
    Figure("spectrum", "Spectrum", curves.spectrum, "force [N²/Hz]", "frequency [Hz]", "xy", curves.oscillation, 2.7),
    Special("impedance", "Impedance", panel.fitted, panel.impedance, 2.4, panels=2),
)


def draw_figure(figure: Figure | Special, runs: Sequence[Run], picture: Path) -> list[str]:
    """Writes the picture (PNG) of the runs that tell it, if there are any; a sentence about each that does not."""
    telling, looks, reasons = [], [], {}
    for run, look in zip(runs, RUNS, strict=False):
        try:
            figure.check(run)
            telling.append(run)
            looks.append(look)
        except ERRORS as error:
            reasons[run.name] = f"{error}."
    if not telling and len({*reasons.values()}) == 1:
        return [f"Not shown: {next(iter(reasons.values()))}"]
    said = [f"Not shown of {name}: {reason}" for name, reason in reasons.items()]
    if telling:
        try:
            _save(figure.draw(telling, looks), picture, DPI)
        except ERRORS as error:
            said.append(f"Not shown: {error}.")
    return said


def _save(shown: Shown, picture: Path, dpi: int) -> None:
    try:
        with naming(picture):
            shown.savefig(picture, dpi=dpi)
    finally:
        pyplot.close(shown)


def fill(axes: Axes, figure: Figure, run: Run, columns: int = 4) -> None:
    """All curves of one run, with its contacts and markers; columns: of the key."""
    plot_own(axes, figure.curves(run))
    if not figure.horizontal:
        over_time(axes, run, run.marks)
    for place, name in figure.lines(run) if figure.lines else ():
        axes.axvline(place, color="black", linestyle=DOTTED, label=name)
    _finish(axes, figure)
    axes.set(xlabel=figure.horizontal or since(run), ylabel=figure.vertical)
    key(axes, columns)


def key(axes: Axes, columns: int) -> None:
    """The key, above the axes."""
    above = (0.0, 1.0)
    axes.legend(ncols=columns, fontsize=9, frameon=False, loc="lower left", bbox_to_anchor=above, borderaxespad=0.1)


def plot_own(axes: Axes, found: Sequence[Curve]) -> None:
    """Curves, as each looks."""
    for curve in found:
        _plot(axes, curve, curve.colour, curve.dashes, curve.name)


def over_time(axes: Axes, run: Run, lines: Sequence[tuple[float, str]], grey: str = "in contact") -> None:
    """The run's time as the axis, its contacts in grey, as the key says, and vertical lines [s] with their names."""
    _shade(axes, run, grey)
    for number, (time, text) in enumerate(lines[:40]):
        side, way = ("left", 3) if time < 0.7 * run.length else ("right", -3)
        axes.axvline(time, color="black", linewidth=0.8, dashes=(2, 2))
        place = way, -2 - 12 * (number % 3)
        axes.annotate(text[:60], (time, 1), xycoords=("data", "axes fraction"), xytext=place, ha=side, **_TEXT)
    axes.set_xlim(0.0, run.length or None)


def _draw_over(figure: Figure, runs: Sequence[Run], looks: Sequence[Look]) -> Shown:
    told = [{curve.name: curve for curve in figure.curves(run)} for run in runs]
    names = list(dict.fromkeys(name for one in told for name in one))
    across = min(figure.across, len(names))
    down = -(-len(names) // across)
    size: dict[str, Any] = {"figsize": (WIDTH * 1.2, down * figure.height + 0.7), "layout": "constrained"}
    shown, grid = pyplot.subplots(down, across, squeeze=False, sharex="all", sharey="row", **size)
    for run, one, look in zip(runs, told, looks, strict=True):
        for name, axes in zip(names, grid.flat, strict=False):
            if name in one:
                _plot(axes, one[name], look.colour, look.dashes, run.name)
    for name, axes in zip(names, grid.flat, strict=False):
        axes.set_title(name, fontsize=9, loc="left")
        _finish(axes, figure)
    if not figure.horizontal:
        grid[0, 0].set_xlim(0.0, max(run.length for run in runs) or None)
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel(figure.vertical)
    for axes in grid[-1]:
        axes.set_xlabel(figure.horizontal or since(runs[0]))
    handles = {label: line for axes in grid.flat for line, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    shown.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=3, fontsize=8, frameon=False)
    return shown


def _plot(axes: Axes, curve: Curve, colour: str, dashes: Dashes, label: str) -> None:
    width = 1.8 if dashes == SOLID else 1.2
    look: dict[str, Any] = {"color": colour, "dashes": dashes[1], "label": label, "linewidth": width}
    if curve.steps:
        axes.plot(curve.x, curve.y, drawstyle="steps-post", **look)
    elif len(curve.x):
        axes.plot(*curves.thin(curve.x, curve.y), **look)


def since(run: Run) -> str:
    """Label of the axis of time."""
    return f"time since first {'motor command' if run.traced else 'message'} [s]"


def _finish(axes: Axes, figure: Figure) -> None:
    if "x" in figure.logs:
        axes.set_xscale("log")
    if "y" in figure.logs:
        axes.set_yscale("log")
        if figure.vertical == "ticks":
            axes.set_ylim(bottom=0.8)
        _widen(axes)
    axes.set_axisbelow(True)
    axes.grid(color=GRID)
    if figure.name in ("energies", "margin"):
        axes.axhline(0, color="0.5", linewidth=0.8)


def _widen(axes: Axes) -> None:
    """A log axis has a decade at least: what lies close together looks so."""
    low, high = axes.get_ylim()
    if high < 10.0 * low:
        middle = np.sqrt(low * high)
        axes.set_ylim(middle / np.sqrt(10.0), middle * np.sqrt(10.0))


def _shade(axes: Axes, run: Run, grey: str) -> None:
    with contextlib.suppress(*ERRORS):  # nothing told of contacts
        for number, contact in enumerate(run.contacts[:200]):
            label = "" if number else grey
            axes.axvspan(contact.begin, contact.end, color="0.9", linewidth=0, zorder=0, label=label)
