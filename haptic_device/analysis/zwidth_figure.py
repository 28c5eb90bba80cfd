# SPDX-License-Identifier: Apache-2.0
"""Figure of a map of the K–B plane: cells by what they did, and the lines of theory over them."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from haptic_device.analysis.zwidth import NAMES, theory
from haptic_device.analysis.zwidth_map import Plane, Request
from haptic_device.os_errors import naming

COLOURS = ("#d9ead3", "#f9d9a8", "#e8a7a1")
LINES = {
    "passive": ("tab:green", "-", "passive with any operator"),
    "stable": ("tab:blue", "--", "stable without operator"),
    "late writes": ("tab:green", ":", "passive, writes late"),
}


def save_map(request: Request, plane: Plane, lateness: float, path: Path) -> None:
    """Writes the figure as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(7.5, 5.5), layout="constrained")
    draw_cells(figure.subplots(), request, plane, lateness)
    with naming(path):
        figure.savefig(path, dpi=120, format="png")


def draw_cells(axes: Axes, request: Request, plane: Plane, lateness: float = 0.0) -> None:
    """Cells and lines of one map, labelled with everything that they depend on."""
    stiffness = request.stiffness / 1e3
    axes.pcolormesh(
        request.damping,
        stiffness,
        plane.outcome.assessment.T,
        cmap=ListedColormap(COLOURS),
        vmin=0,
        vmax=2,
        shading="nearest",
        rasterized=True,
    )
    damping = np.linspace(request.damping[0], request.damping[-1], 121)
    for name, line in theory(request.setup, damping, lateness).items():
        colour, style, label = LINES[name]
        axes.plot(damping, line / 1e3, style, color=colour, label=label)
    axes.set(xlabel="virtual damping B [N s/m]", ylabel="stiffness K [kN/m]", ylim=(stiffness[0], stiffness[-1]))
    patches = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, NAMES, strict=True)]
    axes.legend(handles=[*patches, *axes.lines], fontsize=8, loc="upper right")
    axes.set_title(caption(request, lateness), fontsize=9)


def caption(request: Request, lateness: float = 0.0) -> str:
    """The operating point in words."""
    s = request.setup
    late = f", writes late by up to {lateness / s.period:g} T" if lateness else ""
    return (
        f"m = {s.mass:g} kg, b = {s.physical_damping:g} N s/m, T = {s.period * 1e3:g} ms, "
        f"operator: {request.operator}, {s.seconds:g} s a cell\n"
        f"delay {s.delay_samples:g} T{late}, velocity lag {s.velocity_lag * 1e3:g} ms\n"
        f"encoder step {s.resolution * 1e6:g} µm, friction {s.coulomb:g} N"
    )
