# SPDX-License-Identifier: Apache-2.0
"""Figure of a map of the K–B plane: cells by what they did, and the lines of theory over them."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from haptic_device.os_errors import naming
from haptic_device.theory.palette import BLACK, CELLS, DASHED, DOTTED, HATCHED, HATCHES, PASS, SOLID
from haptic_device.theory.passivity_figure import dress
from haptic_device.theory.zwidth import NAMES, theory
from haptic_device.theory.zwidth_map import Plane, Request

LINES = {
    "passive": (PASS, SOLID, "passive with any operator, up to here"),
    "stable": (BLACK, DASHED, "stable without operator, up to here"),
    "late writes": (PASS, DOTTED, "passive if writes are late, up to here"),
}


def save_map(request: Request, plane: Plane, lateness: float, path: Path) -> None:
    """Writes the figure as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(7.5, 6.0), layout="constrained")
    axes = figure.subplots()
    draw_cells(axes, request, plane, lateness)
    axes.set_title(f"Which walls shake; operator: {request.operator}")
    dress(figure, caption(request, lateness))
    with naming(path):
        figure.savefig(path, dpi=120, format="png")


def draw_cells(axes: Axes, request: Request, plane: Plane, lateness: float = 0.0) -> None:
    """Cells and lines of one map; what no cell did has no place in the legend."""
    stiffness, found = request.stiffness / 1e3, plane.outcome.assessment.T
    mesh: dict[str, Any] = {
        "cmap": ListedColormap(CELLS),
        "vmin": 0,
        "vmax": 2,
        "shading": "nearest",
        "rasterized": True,
    }
    axes.pcolormesh(request.damping, stiffness, found, **mesh)
    for which in np.unique(found):
        if HATCHES[which]:
            here = axes.contourf(request.damping, stiffness, found == which, [0.5, 1.5], hatches=[HATCHES[which]])
            here.set(facecolor="none", edgecolor=HATCHED, linewidth=0.0)
        axes.fill([], [], facecolor=CELLS[which], hatch=HATCHES[which], edgecolor=HATCHED, label=NAMES[which])
    damping = np.linspace(request.damping[0], request.damping[-1], 121)
    for name, line in theory(request.setup, damping, lateness).items():
        colour, dashes, label = LINES[name]
        axes.plot(damping, line / 1e3, linestyle=dashes, color=colour, linewidth=2.0, label=label)
    axes.set(xlabel="virtual damping B [N s/m]", ylabel="stiffness K [kN/m]", ylim=(stiffness[0], stiffness[-1]))


def caption(request: Request, lateness: float = 0.0) -> str:
    """The operating point in words."""
    s = request.setup
    late = f", writes late by up to {lateness / s.period:g} T" if lateness else ""
    return (
        f"m = {s.mass:g} kg, b = {s.physical_damping:g} N s/m, T = {s.period * 1e3:g} ms, "
        f"delay {s.delay_samples:g} T{late}\nvelocity lag {s.velocity_lag * 1e3:g} ms, "
        f"encoder step {s.resolution * 1e6:g} µm, friction {s.coulomb:g} N, {s.seconds:g} s a cell"
    )
