# SPDX-License-Identifier: Apache-2.0
"""Figure: the K–B plane of a display, how stiff it is passive and how stiff it is stable, and where it stands."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from haptic_device.analysis.assessment import Assessment, Display
from haptic_device.analysis.delay import largest_passive_stiffness
from haptic_device.analysis.stability import largest_stable_stiffness
from haptic_device.os_errors import naming

POINTS = 61


def save_map(display: Display, assessment: Assessment, path: Path) -> None:
    """Write the figure of an assessed display as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    axes = figure.subplots()
    draw_map(axes, display)
    colour = "tab:green" if assessment.passive else "tab:red"
    axes.plot(display.damping, display.stiffness / 1e3, "o", color=colour, label="this display", zorder=3)
    axes.set_ylim(0.0, 1.15 * max(axes.get_ylim()[1], display.stiffness / 1e3))
    axes.legend()
    with naming(path):
        figure.savefig(path, dpi=120, format="png")


def draw_map(axes: Axes, display: Display) -> None:
    """Both boundaries over the virtual damping, labelled with everything that they depend on."""
    reach = 1.3 * max(display.physical_damping, abs(display.damping))
    corners = display.physical_damping * np.array([-1.0, 0.0, 1.0])
    damping = np.union1d(np.linspace(-reach, reach, POINTS), corners)
    passive, stable = np.array([_boundaries(display, value) for value in damping]).T / 1e3
    axes.fill_between(damping, passive, color="tab:green", alpha=0.2, label="passive with any operator")
    axes.plot(damping, passive, color="tab:green")
    axes.plot(damping, stable, color="tab:blue", linestyle="--", label="stable without operator, up to here")
    axes.set(xlabel="virtual damping B [N s/m]", ylabel="stiffness K [kN/m]")
    axes.set_title(caption(display), fontsize=10)
    axes.set_xlim(-reach, reach)


def caption(display: Display) -> str:
    """The operating point in words for a title."""
    device = f"m = {display.mass:g} kg, b = {display.physical_damping:g} N s/m, T = {display.period * 1e3:g} ms"
    loop = f"delay {display.delay_samples:g} T, velocity lag {display.velocity_lag * 1e3:g} ms"
    return f"{device}, {loop}\nno encoder step, no friction, contact kept"


def _boundaries(display: Display, damping: float) -> tuple[float, float]:
    mass, physical_damping, period = display.mass, display.physical_damping, display.period
    return (
        largest_passive_stiffness(physical_damping, damping, period, display.velocity_lag, display.delay_samples),
        largest_stable_stiffness(mass, physical_damping, damping, period, display.delay_samples, display.velocity_lag),
    )
