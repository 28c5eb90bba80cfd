# SPDX-License-Identifier: Apache-2.0
"""Figure: how stiff a linkage of two joints may be over its workspace, in the worst direction at each place."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from haptic_device.config.description import Device, beyond, felt
from haptic_device.config.kinematics import CLEAR
from haptic_device.os_errors import naming
from haptic_device.theory.assessment import Display
from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.felt import Felt
from haptic_device.theory.palette import BLACK, DASHED, FAIL, FAIL_MARK, GREY, HANDLE, INK, SOLID
from haptic_device.theory.passivity_figure import dress

POINTS = 201  # of the picture along each axis
CURVE = 40  # dampings at which the limit is found
MARGIN = 0.15  # of the workspace, around it and the motors


def save_workspace(device: Device, pose: Felt, worst: Felt, display: Display, path: Path) -> None:
    """Writes the map as PNG, the linkage drawn at `pose`, the worst pose marked; OSError if it cannot be written.

    display: has B, T, delay and lag.
    """
    figure = Figure(figsize=(7.5, 6.8), layout="constrained")
    axes = figure.subplots()
    shown = draw_workspace(axes, device, pose, worst, display)
    figure.colorbar(shown, ax=axes, label="largest passive stiffness K [N/m]", shrink=0.8)
    figure.suptitle(f"How stiff {device.name} can be, in the worst direction at each place")
    given = f"damping of joints {', '.join(f'{joint.damping:g}' for joint in device.joints)} N m s/rad"
    loop = f"B = {display.damping:g} N s/m, T = {display.period * 1e3:g} ms, delay {display.delay_samples:g} T"
    dress(figure, f"{given}, {loop}\nwhite: out of reach, beyond the joints' limits, or too near to a singular pose")
    with naming(path):
        figure.savefig(path, dpi=120, format="png")


def draw_workspace(axes: Axes, device: Device, pose: Felt, worst: Felt, display: Display) -> Any:
    """Map, contours, the workspace that is used, singular curves and the linkage; the mesh, for a colour bar."""
    kinematics, origin = device.kinematics, np.array(device.kinematics.origin)
    low, high = np.array(device.used).T + origin[:, None].T
    arms = [[*arm, pose.position] for arm in kinematics.arms(*pose.joints)]
    corners = np.concatenate([[low, high], *arms])
    margin = MARGIN * (high - low).max()
    first, last = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    x, y = np.linspace(first[0], last[0], POINTS), np.linspace(first[1], last[1], POINTS)
    found = [[kinematics.angles(a, b) for a in x] for b in y]
    singular = np.array([[c for _, c in row] for row in found])
    there = [[c >= CLEAR and not beyond(device.joints, angles) for angles, c in row] for row in found]
    jacobians = np.array([[kinematics.jacobian(*angles) for angles, _ in row] for row in found])
    b = np.full(singular.shape, math.nan)
    b[there] = felt(jacobians[there], device.joints, device.handle)["damping"]
    loop = display.damping, display.period, display.velocity_lag, display.delay_samples
    known = np.linspace(np.nanmin(b), np.nanmax(b), CURVE)
    stiffness = np.interp(b, known, [largest_passive_stiffness(float(each), *loop) for each in known])
    inside = stiffness[np.ix_((y >= low[1]) & (y <= high[1]), (x >= low[0]) & (x <= high[0]))]
    levels = MaxNLocator(9).tick_values(np.nanmin(inside), np.nanmax(inside))
    mesh = axes.contourf(1e3 * x, 1e3 * y, stiffness, levels, cmap="cividis", extend="both")
    lines = axes.contour(1e3 * x, 1e3 * y, stiffness, levels, colors="white", linewidths=0.8)
    for text in axes.clabel(lines, fontsize=8, fmt="%g", colors=INK):
        text.set_bbox({"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5})
    near = axes.contour(1e3 * x, 1e3 * y, singular, [CLEAR], colors=[FAIL], linestyles=[DASHED])
    ends = axes.contour(1e3 * x, 1e3 * y, singular > 0.0, [0.5], colors=[FAIL], linestyles=[SOLID])
    names = f"c = {CLEAR:g}: forces fade beyond", "c = 0: singular, or out of reach"
    for curve, dashes, name in zip((near, ends), (DASHED, SOLID), names, strict=True):
        if len(curve.get_paths()[0]):
            axes.plot([], [], color=FAIL, linestyle=dashes, label=name)
    box = 1e3 * np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])
    axes.plot(*box.T, color=BLACK, linewidth=1.5, label="workspace that is used")
    for arm in arms:
        axes.plot(*(1e3 * np.array(arm)).T, "o-", color=INK, linewidth=2.5, markersize=5, markerfacecolor=GREY)
    marks = [("worst pose", worst, FAIL_MARK, FAIL), ("this pose", pose, "o", HANDLE)][: 1 if pose is worst else 2]
    for name, at, mark, colour in marks:
        look: dict[str, Any] = {"color": colour, "markeredgecolor": BLACK, "markersize": 10, "zorder": 4}
        label = f"{name}: K < {largest_passive_stiffness(at.damping, *loop):.3g} N/m"
        axes.plot(*(1e3 * np.array(at.position)), mark, label=label, **look)
    axes.set(xlabel="x from the first motor [mm]", ylabel="y [mm]", aspect="equal")
    return mesh
