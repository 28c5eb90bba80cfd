# SPDX-License-Identifier: Apache-2.0
"""One picture of a run: where handle and tool went, the forces, the energy given to the operator, the lateness.

Colours are Okabe and Ito's, and every pair of lines differs by its dashes too, so that it can be read in grey.
"""

from pathlib import Path

import matplotlib
import numpy as np

from haptic_device.analysis.recording import Recording
from haptic_device.analysis.summary import conditions, engaged_rows, period

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (the backend is chosen first)

BLUE, ORANGE, GREEN, VERMILION, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7"
_AXES = ("x", "y", "θ")
_POINTS = 3000  # more than a page resolves


def draw(recording: Recording, picture: Path, title: str) -> None:
    """Writes the picture (PNG), headed by the title and by gains, period, damping and exchange method.

    Raises ValueError if the bag has no trace, no engaged tick or no handle.
    """
    rows = engaged_rows(recording.trace)
    seconds = (rows["deadline"] - rows["deadline"][0]) * 1e-9
    labels = ", ".join(f"{name} = {value}" for name, value in conditions(recording).items())
    figure, axes = pyplot.subplots(5, 1, figsize=(9, 14), layout="constrained", height_ratios=(3, 2, 3, 2, 2))
    try:
        figure.suptitle(f"{title}\n{labels}", fontsize=10)
        _positions(axes[0], seconds, rows)
        _angles(axes[1], seconds, rows)
        _forces(axes[2], seconds, rows)
        _energy(axes[3], seconds, rows, recording)
        _lateness(axes[4], rows)
        figure.savefig(picture, dpi=110)
    finally:
        pyplot.close(figure)


def _positions(axes, seconds: np.ndarray, rows: np.ndarray) -> None:
    some = _some(rows)
    for index, colour in enumerate((BLUE, VERMILION)):
        axes.plot(seconds[some], rows["position"][some, index] * 1e3, color=colour, label=f"handle {_AXES[index]}")
        tool = _tool(seconds, rows, index, 1e3)
        axes.plot(*tool, color=colour, dashes=(4, 2), alpha=0.7, label=f"tool {_AXES[index]}")
    _finish(axes, "time since first motor command [s]", "position [mm]")


def _angles(axes, seconds: np.ndarray, rows: np.ndarray) -> None:
    some = _some(rows)
    axes.plot(seconds[some], np.degrees(rows["position"][some, 2]), color=GREEN, label="handle θ")
    axes.plot(*_tool(seconds, rows, 2, 180 / np.pi), color=GREEN, dashes=(4, 2), alpha=0.7, label="tool θ")
    _finish(axes, "time since first motor command [s]", "angle [°], counter-clockwise")


def _forces(axes, seconds: np.ndarray, rows: np.ndarray) -> None:
    some = _some(rows)
    for index, colour in enumerate((BLUE, VERMILION)):
        axes.plot(seconds[some], rows["force_on_handle"][some, index], color=colour, label=f"on handle, {_AXES[index]}")
    for index, colour in enumerate((ORANGE, PURPLE)):
        opposite = -rows["tool_effort"][some, index]
        axes.plot(seconds[some], opposite, color=colour, dashes=(4, 2), label=f"−(coupling on tool), {_AXES[index]}")
    _finish(axes, "time since first motor command [s]", "force [N]")


def _energy(axes, seconds: np.ndarray, rows: np.ndarray, recording: Recording) -> None:
    some = _some(rows)
    booked = rows["energy_given"][some].sum(axis=1)
    axes.plot(seconds[some], booked * 1e3, color=ORANGE, dashes=(4, 2), label="as the servo books it")
    state = recording.joints.get("operator/state")
    if state is not None:
        since = state.entry("time") - rows["deadline"][0] * 1e-9
        given = state.entry("energy_given") * 1e3
        during = (since >= 0) & (since <= seconds[-1])
        axes.plot(since[during], given[during], color=BLUE, label="truth at the handle")
    axes.axhline(0, color="0.6", linewidth=0.8)
    _finish(axes, "time since first motor command [s]", "energy given to\nthe operator [mJ]")


def _lateness(axes, rows: np.ndarray) -> None:
    lateness = np.maximum(rows["lateness"] * 1e6, 0.1)
    compute = np.maximum(rows["compute"] * 1e6, 0.1)
    bins = np.geomspace(0.1, max(lateness.max(), compute.max()) * 1.01, 80)
    axes.hist(lateness, bins, color=BLUE, alpha=0.8, label="wake-up after the deadline")
    axes.hist(compute, bins, color=ORANGE, histtype="step", linewidth=1.5, label="time of the tick's own work")
    axes.axvline(period(rows) * 1e6, color="black", linestyle=":", label="one period T")
    axes.set(xscale="log", yscale="log")
    _finish(axes, "lateness and compute time [µs]", "ticks")


def _tool(seconds: np.ndarray, rows: np.ndarray, axis: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    there = np.flatnonzero(rows["tool_age"] >= 0)
    there = there[:: max(1, len(there) // _POINTS)]
    return seconds[there], rows["tool_position"][there, axis] * scale


def _some(rows: np.ndarray) -> slice:
    return slice(None, None, max(1, len(rows) // _POINTS))


def _finish(axes, horizontal: str, vertical: str) -> None:
    axes.set(xlabel=horizontal, ylabel=vertical)
    axes.set_axisbelow(True)
    axes.grid(color="0.9")
    axes.legend(loc="best", fontsize=8, ncols=2)
