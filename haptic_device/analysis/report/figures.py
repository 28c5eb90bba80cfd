# SPDX-License-Identifier: Apache-2.0
"""The figures of a report: what each shows, and how it is drawn of one run, or of several over each other.

Of one run a figure has one panel with all its curves; of several a panel for each curve, in which each run has a
colour and dashes of its own and all panels of a row have one scale.
"""

import contextlib
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Shown

from haptic_device.analysis.palette import DOTTED, RUNS, SOLID, Dashes, Look
from haptic_device.analysis.report import curves, panel
from haptic_device.analysis.report.curves import Curve
from haptic_device.analysis.report.panel import GRID
from haptic_device.analysis.report.run import Run
from haptic_device.os_errors import naming

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (the backend is chosen first)

DPI = 130
WIDTH = 9.0  # [inch]
_ERRORS = (ValueError, IndexError, FloatingPointError)
Lines = Callable[[Run], list[tuple[float, str]]]
"""Vertical lines of one run: where, and what they say."""


class Figure(NamedTuple):
    """name: of its file; curves of a run, labels of x and y, log scales, vertical lines; height of a row [inch].

    across: panels in a row where several runs are shown; over_time: with markers and contacts.
    """

    name: str
    title: str
    caption: str
    curves: Callable[[Run], list[Curve]]
    vertical: str
    horizontal: str = ""
    logs: str = ""
    lines: Lines | None = None
    height: float = 2.2
    across: int = 1

    @property
    def over_time(self) -> bool:
        """Whether x is the time of the run."""
        return not self.horizontal

    def check(self, run: Run) -> None:
        """Raises ValueError where the run does not tell it."""
        self.curves(run)

    def draw(self, runs: Sequence[Run], looks: Sequence[Look]) -> Shown:
        """The picture of these runs, open; looks: of each where there are several."""
        return _draw_one(self, runs[0]) if len(runs) == 1 else _draw_over(self, runs, looks)


class Special(NamedTuple):
    """A figure that draws its own panels; panels: 0 for one of each run, else how many."""

    name: str
    title: str
    caption: str
    check: Callable[[Run], None]
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
        shown, grid = pyplot.subplots(
            1, count, figsize=(width, self.height), layout="constrained", squeeze=False, sharey="row"
        )
        self.paint(list(grid[0]), runs, looks)
        return shown


FIGURES: tuple[Figure | Special, ...] = (
    Figure(
        "positions", "Position", "Where handle and tool went.", curves.positions, "position [mm]", height=2.6, across=2
    ),
    Figure("distances", "Stretch", "How far the tool was from the handle.", curves.distances, "handle to tool [mm]"),
    Figure(
        "forces",
        "Force",
        "Force on the handle, and the coupling's part of it.",
        curves.forces,
        "force [N]",
        height=2.7,
        across=2,
    ),
    Figure("angles", "Angle", "Angle of handle and tool, counter-clockwise.", curves.angles, "angle [°]", across=2),
    Special(
        "path", "Path", "The way in the plane, to scale.", panel.check_path, panel.path, 3.6, shape=panel.path_shape
    ),
    Special(
        "contacts",
        "Contacts",
        "From when to when something was touched, and the strongest force on the hand meanwhile.",
        panel.check_contacts,
        panel.contacts,
        2.2,
    ),
    Figure(
        "energies",
        "Energy",
        "Energy through each port since the first tick; what operator or tool is given is positive.",
        curves.energies,
        "energy [mJ]",
        height=2.7,
        across=3,
    ),
    Figure(
        "margin",
        "Passivity margin",
        "How much of the device's damping b the gains leave over; below zero the display is not passive.",
        curves.margins,
        "left over [% of b]",
        across=3,
    ),
    Figure(
        "lateness",
        "Servo timing",
        "How late the servo woke, and how long it worked.",
        curves.lateness,
        "ticks",
        "time [µs]",
        "xy",
        curves.one_period,
        across=2,
    ),
    Figure(
        "age",
        "Sample age",
        "Age of the tool sample in use.",
        curves.ages,
        "ticks",
        "age [ms]",
        "y",
        curves.median_age,
    ),
    Figure(
        "spectrum",
        "Spectrum",
        "Spectrum of the force on the handle; an oscillation is named.",
        curves.spectrum,
        "force on handle [N²/Hz]",
        "frequency [Hz]",
        "xy",
        curves.oscillation,
        height=2.7,
    ),
    Special(
        "impedance",
        "Impedance",
        "Stiffness and damping that the display added, 95 % sure; dotted: as set.",
        panel.check_impedance,
        panel.impedance,
        2.4,
        panels=2,
    ),
)
TELLING = ("positions", "distances", "angles", "forces", "energies", "lateness")  # of the single picture


def draw_figure(figure: Figure | Special, runs: Sequence[Run], picture: Path) -> list[str]:
    """Writes the picture (PNG) of the runs that tell it, if there are any; a sentence about each that does not."""
    telling, looks, reasons = [], [], {}
    for run, look in zip(runs, RUNS, strict=False):
        try:
            figure.check(run)
            telling.append(run)
            looks.append(look)
        except _ERRORS as error:
            reasons[run.name] = f"{error}."
    if not telling and len({*reasons.values()}) == 1:
        return [f"Not shown: {next(iter(reasons.values()))}"]
    said = [f"Not shown of {name}: {reason}" for name, reason in reasons.items()]
    if telling:
        try:
            _save(figure.draw(telling, looks), picture, DPI)
        except _ERRORS as error:
            said.append(f"Not shown: {error}.")
    return said


def draw_picture(run: Run, picture: Path) -> None:
    """Writes the picture (PNG) of the figures that tell most, headed by the run's name and its conditions."""
    figures = [figure for figure in FIGURES if figure.name in TELLING and isinstance(figure, Figure)]
    heights = [figure.height for figure in figures]
    shown, grid = pyplot.subplots(
        len(figures), 1, figsize=(WIDTH, sum(heights) + 1.0), layout="constrained", height_ratios=heights
    )
    title = run.name.replace("_", " ")
    shown.suptitle(f"{title[:1].upper()}{title[1:]}: what hand and tool did. {_GREY}\n{_wrapped(run)}", fontsize=10)
    for figure, axes in zip(figures, grid, strict=True):
        try:
            _fill(axes, figure, run)
        except _ERRORS as error:
            axes.text(0.5, 0.5, f"not shown: {error}", ha="center", va="center", wrap=True, transform=axes.transAxes)
            axes.set_axis_off()
    _save(shown, picture, 110)


_GREY = "Grey: in contact."


def _wrapped(run: Run) -> str:
    """The conditions in lines that fit the picture."""
    said = ", ".join(f"{name} {value}".replace(" ", "\u00a0") for name, value in run.conditions.items())
    return "\n".join(textwrap.wrap(said, 95))


def _save(shown: Shown, picture: Path, dpi: int) -> None:
    try:
        with naming(picture):
            shown.savefig(picture, dpi=dpi)
    finally:
        pyplot.close(shown)


def _draw_one(figure: Figure, run: Run) -> Shown:
    shown, axes = pyplot.subplots(figsize=(WIDTH, figure.height + 0.5), layout="constrained")
    _fill(axes, figure, run)
    return shown


def _fill(axes: Axes, figure: Figure, run: Run) -> None:
    """All curves of one run, with its contacts and markers."""
    for curve in figure.curves(run):
        _plot(axes, curve, curve.colour, curve.dashes, curve.name)
    if figure.over_time:
        _shade(axes, run)
        _mark(axes, run)
        axes.set_xlim(0.0, run.length or None)
    for place, name in figure.lines(run) if figure.lines else ():
        axes.axvline(place, color="black", linestyle=DOTTED, label=name)
    _finish(axes, figure)
    axes.set(xlabel=_horizontal(figure, run), ylabel=figure.vertical)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8, frameon=False, borderaxespad=0.1)


def _draw_over(figure: Figure, runs: Sequence[Run], looks: Sequence[Look]) -> Shown:
    told = [{curve.name: curve for curve in figure.curves(run)} for run in runs]
    names = list(dict.fromkeys(name for one in told for name in one))
    across = min(figure.across, len(names))
    down = -(-len(names) // across)
    size = (WIDTH * 1.2, down * figure.height + 0.7)
    shown, grid = pyplot.subplots(
        down, across, figsize=size, layout="constrained", squeeze=False, sharex="all", sharey="row"
    )
    for run, one, look in zip(runs, told, looks, strict=True):
        for name, axes in zip(names, grid.flat, strict=False):
            if name in one:
                _plot(axes, one[name], look.colour, look.dashes, run.name)
    for name, axes in zip(names, grid.flat, strict=False):
        axes.set_title(name, fontsize=9, loc="left")
        _finish(axes, figure)
    if figure.over_time:
        grid[0, 0].set_xlim(0.0, max(run.length for run in runs) or None)
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel(figure.vertical)
    for axes in grid[-1]:
        axes.set_xlabel(_horizontal(figure, runs[0]))
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


def _horizontal(figure: Figure, run: Run) -> str:
    since = "motor command" if run.traced else "message"
    return figure.horizontal or f"time since first {since} [s]"


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


def _shade(axes: Axes, run: Run) -> None:
    with contextlib.suppress(*_ERRORS):  # nothing told of contacts
        for contact in run.contacts[:200]:
            axes.axvspan(contact.begin, contact.end, color="0.9", linewidth=0, zorder=0)


def _mark(axes: Axes, run: Run) -> None:
    """Markers as vertical lines with their text."""
    for time, text in run.marks[:40]:
        axes.axvline(time, color="black", linewidth=0.8, dashes=(2, 2))
        axes.annotate(text[:30], (time, 1), xycoords=("data", "axes fraction"), rotation=90, va="top", fontsize=7)
