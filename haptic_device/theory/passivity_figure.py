# SPDX-License-Identifier: Apache-2.0
"""Figure: the K–B plane of a display, how stiff it is passive and how stiff it is stable, and where it stands."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from haptic_device.os_errors import naming
from haptic_device.theory.assessment import Assessment, Display
from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.palette import BLACK, DASHED, FAIL, FAIL_MARK, PASS, PASS_MARK
from haptic_device.theory.stability import largest_stable_stiffness

POINTS = 61
TITLE = "How stiff a wall can be: passive, and stable"


def save_map(display: Display, assessment: Assessment, path: Path) -> None:
    """Write the figure of an assessed display as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(7.0, 5.4), layout="constrained")
    axes = figure.subplots()
    draw_map(axes, display)
    mark, colour, verdict = (PASS_MARK, PASS, "passive") if assessment.passive else (FAIL_MARK, FAIL, "not passive")
    look: dict[str, Any] = {"color": colour, "markeredgecolor": BLACK, "markersize": 10, "zorder": 3}
    axes.plot(display.damping, display.stiffness / 1e3, mark, label=f"this display: {verdict}", **look)
    axes.set_ylim(0.0, 1.15 * max(axes.get_ylim()[1], display.stiffness / 1e3))
    axes.set_title(TITLE)
    dress(figure, caption(display))
    with naming(path):
        figure.savefig(path, dpi=120, format="png")


def draw_map(axes: Axes, display: Display) -> None:
    """Both boundaries over the virtual damping."""
    reach = 1.3 * max(display.physical_damping, abs(display.damping))
    corners = display.physical_damping * np.array([-1.0, 0.0, 1.0])
    damping = np.union1d(np.linspace(-reach, reach, POINTS), corners)
    passive, stable = np.array([_boundaries(display, value) for value in damping]).T / 1e3
    axes.fill_between(damping, passive, color=PASS, alpha=0.2, label="passive with any operator")
    axes.plot(damping, passive, color=PASS)
    axes.plot(damping, stable, color=BLACK, linestyle=DASHED, label="stable without operator, up to here")
    axes.set(xlabel="virtual damping B [N s/m]", ylabel="stiffness K [kN/m]", xlim=(-reach, reach))
    axes.grid(alpha=0.3)


def dress(figure: Figure, note: str) -> None:
    """A note below all axes and the legend of the first under it, off the data."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    look = {"fontsize": 9, "title_fontsize": 9, "frameon": False}
    figure.legend(handles, labels, title=note, loc="outside lower center", ncols=3, **look)


def caption(display: Display) -> str:
    """The operating point in words."""
    device = f"m = {display.mass:g} kg, b = {display.physical_damping:g} N s/m, T = {display.period * 1e3:g} ms"
    loop = f"delay {display.delay_samples:g} T, velocity lag {display.velocity_lag * 1e3:g} ms"
    return f"{device}, {loop}\nno encoder step, no friction, contact kept"


def _boundaries(display: Display, damping: float) -> tuple[float, float]:
    mass, physical_damping, period = display.mass, display.physical_damping, display.period
    return (
        largest_passive_stiffness(physical_damping, damping, period, display.velocity_lag, display.delay_samples),
        largest_stable_stiffness(mass, physical_damping, damping, period, display.delay_samples, display.velocity_lag),
    )
