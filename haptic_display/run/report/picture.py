# SPDX-License-Identifier: Apache-2.0
"""The picture of a run, for one screen: what came of it, where it was, and all that has a time over one axis."""

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Shown
from matplotlib.figure import SubFigure

from haptic_device.os_errors import naming
from haptic_display.run.report import curves, panel
from haptic_display.run.report.curves import Curve
from haptic_display.run.report.figures import ERRORS, FIGURES, Figure, fill, key, over_time, plot_own, since
from haptic_display.run.report.run import Run
from haptic_display.run.report.style import LEVELS
from haptic_display.run.report.verdict import verdict

SIZE, DPI = (14.0, 7.9), 110  # [inch]
LETTERS, LINE = 56, 0.17  # of the words: in a line, and its height [inch]
PANELS: dict[str, tuple[Callable[[Run], list[Curve]], float]] = {  # and the least range of its axis
    "x [mm]": (partial(curves.positions, axes=(0,)), 1.0),
    "y [mm]": (partial(curves.positions, axes=(1,)), 1.0),
    "θ [°]": (curves.angles, 0.5),
    "handle to\ntool [mm]": (curves.distances, 0.05),
    "force [N]": (curves.forces, 0.1),
    "energy [mJ]": (curves.energies, 0.01),
}
[TIMING] = [figure for figure in FIGURES if isinstance(figure, Figure) and figure.name == "lateness"]
Lines = Sequence[tuple[float, str]]  # vertical: times [s], and what they say


def draw_picture(run: Run, picture: Path, draw_scene: Callable[[Axes], None] | None = None, done: Lines = ()) -> Shown:
    """Writes the picture (PNG) and returns it. Raises OSError if it cannot be written.

    draw_scene: draws the scene into axes in mm; without it the path is alone. done: lines through all curves, as those
    of markers.
    """
    shown, missing = Shown(SIZE, DPI, layout="constrained"), list[str]()
    left, right = shown.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.9))[0]
    told = {label: found for label, (tell, _) in PANELS.items() if (found := _told(label, tell, run, missing))}
    _draw_curves(right, run, told, [*run.marks, *done])
    timed = bool(_told(TIMING.title, TIMING.curves, run, missing))
    words = _words(run, missing)
    top, place, *timing = left.subplots(2 + timed, 1, height_ratios=[LINE * len(words), 4.6, 1.4][: 2 + timed])
    _write(top, words, LEVELS[verdict(run).level][1])
    _draw_place(place, run, draw_scene)
    for axes in timing:
        fill(axes, TIMING, run, columns=2)
    with naming(picture):
        shown.savefig(picture)
    return shown


def _draw_curves(place: SubFigure, run: Run, told: dict[str, list[Curve]], lines: Lines) -> None:
    """A panel each, one below the other, over one axis of time."""
    grid = place.subplots(len(told), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, found) in zip(grid, told.items(), strict=True):
        low, high = curves.range_of(found, PANELS[label][1])
        plot_own(axes, curves.once(found, high - low))
        over_time(axes, run, lines, "in contact" if axes is grid[0] else "")
        key(axes, 4)
        names = 0.2 * (high - low) if lines else 0.0
        axes.set(ylabel=label, ylim=(low, high + names), axisbelow=True)
        axes.grid(color=panel.GRID)
    grid[-1].set_xlabel(since(run))
    place.align_ylabels()


def _told(what: str, tell: Callable[[Run], list[Curve]], run: Run, missing: list[str]) -> list[Curve]:
    """The curves, or none; why is then among what is missing."""
    try:
        return tell(run)
    except ERRORS as error:
        missing.append(f"{what} is not shown: {error}.".replace("\n", " "))
        return []


def _words(run: Run, missing: list[str]) -> list[str]:
    """Lines: the heading, what came of the run, its conditions, and why something is not shown."""
    found, name = verdict(run), (run.scene or run.name).replace("_", " ")
    conditions = (f"{what} {value}".replace(" ", "\u00a0") for what, value in run.conditions.items())
    said = [f"{found.ending} {found.rest}", ", ".join(conditions), *missing]
    heading = f"{name[:1].upper()}{name[1:]}: {LEVELS[found.level][0]}"
    return [heading, *(line for sentence in said for line in textwrap.wrap(sentence, LETTERS))]


def _write(axes: Axes, words: list[str], colour: str) -> None:
    axes.set_axis_off()
    axes.text(0, 1, words[0], va="bottom", fontsize=14, weight="bold", color=colour)
    axes.text(0, 1, "\n".join(words[1:]), va="top", fontsize=9.5)


def _draw_place(axes: Axes, run: Run, draw_scene: Callable[[Axes], None] | None) -> None:
    """The scene at its start, and the way of handle and tool."""
    left, right, bottom, top = panel.box([run])
    if draw_scene:
        draw_scene(axes)
        (x, across), (y, up) = axes.get_xlim(), axes.get_ylim()
        left, right, bottom, top = min(left, x), max(right, across), min(bottom, y), max(top, up)
    panel.plane(axes, run, (left, right, bottom, top), ", as recorded")
    axes.set(ylabel="y [mm]", anchor="N")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=9, frameon=False)
