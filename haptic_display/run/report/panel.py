# SPDX-License-Identifier: Apache-2.0
"""Panels that are no curves over one scale: the path in the plane, the contacts, the fitted impedance.

Each draws runs, which have a look each, into the axes that its figure makes for it.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from haptic_device.theory.palette import BLACK, DASHED, DOTTED, HANDLE, SOLID, TOOL, Look
from haptic_display.run.report.conditions import gains
from haptic_display.run.report.curves import POINTS, Values
from haptic_display.run.report.impedance import Impedance
from haptic_display.run.report.run import Run

GRID = "0.9"
Limits = tuple[float, float, float, float]  # left, right, bottom, top [mm]
_NARROW = 0.35  # least width of a path's box by its height, and height by its width


def path(grid: Sequence[Axes], runs: Sequence[Run], looks: Sequence[Look]) -> None:
    """Handle and tool in the plane, to scale; one panel for each run, all with the same limits."""
    for axes, run in zip(grid, runs, strict=True):
        plane(axes, run, box(runs))
        if len(runs) > 1:
            axes.set_title(run.name, fontsize=9)
    grid[0].set_ylabel("y [mm]")
    lines = grid[0].get_legend_handles_labels()
    grid[0].figure.legend(*lines, loc="outside upper left", ncols=2, fontsize=9, frameon=False)


def plane(axes: Axes, run: Run, limits: Limits, recorded: str = "") -> None:
    """Where handle and tool went, to scale; recorded: what the key says beside their names."""
    across, up = run.places(0), run.places(1)
    for what, (time, x) in across.items():
        some = slice(None, None, max(1, len(time) // (10 * POINTS)))
        look = (HANDLE, SOLID) if what == "handle" else (TOOL, DASHED)
        x, y = x[some] * 1e3, up[what][1][some] * 1e3
        axes.plot(x, y, color=look[0], linestyle=look[1], linewidth=1.5, label=what + recorded)
    axes.set(xlim=limits[:2], ylim=limits[2:], aspect="equal", xlabel="x [mm]", axisbelow=True)
    axes.grid(color=GRID)


def path_shape(runs: Sequence[Run]) -> float:
    """Width by height of the box of all paths."""
    left, right, bottom, top = box(runs)
    return (right - left) / (top - bottom)


def box(runs: Sequence[Run]) -> Limits:
    """Limits [mm] of all paths, with a border, and no side much shorter than the other."""
    ends = [_ends([place for run in runs for _, place in run.places(i).values()]) for i in (0, 1)]
    width, height = (high - low for low, high in ends)
    least = max(_NARROW * max(width, height), 0.2)
    (x, y), (half_x, half_y) = [(low + high) / 2 for low, high in ends], (0.54 * max(s, least) for s in (width, height))
    return x - half_x, x + half_x, y - half_y, y + half_y


def _ends(places: Sequence[Values]) -> tuple[float, float]:
    """The least and the largest [mm]. Raises ValueError if none is a number."""
    found = np.concatenate(places)
    found = found[np.isfinite(found)]
    if not len(found):
        raise ValueError("no place of it is a number")
    return float(found.min()) * 1e3, float(found.max()) * 1e3


def check_contacts(run: Run) -> None:
    """Raises ValueError where nothing was touched."""
    if not run.contacts:
        raise ValueError("nothing was touched")


def contacts(grid: Sequence[Axes], runs: Sequence[Run], looks: Sequence[Look]) -> None:
    """Each contact as a bar from beginning to end, as high as the strongest force on the hand meanwhile."""
    for axes, run, look in zip(grid, runs, looks, strict=True):
        begins, ends, sizes = (np.array(column) for column in zip(*run.contacts, strict=True))
        lengths = np.maximum(ends - begins, run.length / 500)
        axes.bar(begins, sizes, lengths, align="edge", color=look.colour, alpha=0.7)
        axes.set(xlim=(0, max(run.length for run in runs)), xlabel="time [s]", axisbelow=True)
        axes.grid(color=GRID)
        if len(runs) > 1:
            axes.set_title(run.name, fontsize=9)
    grid[0].set_ylabel("strongest on\nthe hand [N]")


def impedance(grid: Sequence[Axes], runs: Sequence[Run], looks: Sequence[Look]) -> None:
    """Fitted stiffness and damping of each axis, with confidence; of several runs in their colours."""
    told = list(dict.fromkeys(row for run in runs for row in fitted(run)))
    for number, run in enumerate(runs):
        rows = fitted(run)
        for (kind, axis), one in rows.items():
            place = told.index((kind, axis)) + 0.6 * ((number + 0.5) / len(runs) - 0.5)
            label = run.name if (kind, axis) == next(iter(rows)) else None
            dot, colour = "o" if kind == "contact" else "s", looks[number].colour
            for axes, estimate in zip(grid, (one.stiffness, one.damping), strict=True):
                axes.errorbar(estimate.value, place, xerr=estimate.error, fmt=dot, color=colour, label=label, capsize=4)
        for axes, value in zip(grid, gains(run.recording).values(), strict=False):
            look = looks[number] if len(runs) > 1 else Look(BLACK, "", DOTTED)
            axes.axvline(value, color=look.colour, linestyle=DOTTED, linewidth=1.2)
    for axes, label in zip(grid, ("stiffness [N/m]", "damping added [N s/m]"), strict=True):
        axes.set(xlabel=label, yticks=range(len(told)), ylim=(len(told) - 0.4, -0.6), axisbelow=True)
        axes.set_yticklabels([f"{kind}, {axis}" for kind, axis in told])
        axes.axvline(0, color="0.6", linewidth=0.8)
        axes.grid(color=GRID)
    if len(runs) > 1:
        grid[0].figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper left", ncols=3, fontsize=8)


def fitted(run: Run) -> dict[tuple[str, str], Impedance]:
    """Fits in the plane. Raises ValueError where no motion told an impedance."""
    if found := {(kind, axis): one for (kind, axis), one in run.impedances.items() if axis != "theta"}:
        return found
    raise ValueError("no motion of the handle that told an impedance")
