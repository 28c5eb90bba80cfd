# SPDX-License-Identifier: Apache-2.0
"""The figures of docs/model.md and docs/cli.md.

Writes docs/figures/model.png, and with the folder of a run (`haptic demo --out RUN_FOLDER`) docs/figures/demo.png.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from haptic_device.analysis.report.page import draw_picture
from haptic_device.analysis.report.run import Run
from haptic_device.recording import load

FOLDER = Path(__file__).parents[2] / "docs" / "figures"
REAL, VIRTUAL, FORCE, GROUND = "#0072B2", "#D55E00", "#009E73", "0.35"


def main(run: Annotated[Path | None, typer.Argument(help="Folder of a run of the demo.")] = None) -> None:
    """The figures of docs/model.md, and of docs/cli.md from a run."""
    figure = Figure(figsize=(11.0, 8.6), layout="constrained")
    panels = figure.subplot_mosaic([["chain", "chain"], ["plane", "time"]], height_ratios=(1.0, 1.05))
    for name, panel in panels.items():
        globals()[name](panel)
        panel.set_axis_off()
    figure.savefig(FOLDER / "model.png", dpi=110)
    if run is not None:
        draw_picture(Run(load(run / "bag"), "peg_in_hole"), FOLDER / "demo.png")


def chain(axes):
    """Operator, device, coupling, tool and environment along one axis."""
    axes.set(xlim=(0.0, 22.0), ylim=(-1.2, 6.3), aspect="equal", title="One axis: who pushes whom")
    for left, right, colour, text in (
        (0.1, 5.2, REAL, "operator\n(hand model in haptic_loopback)"),
        (5.4, 10.4, REAL, "device (plant in haptic_loopback,\nservo in haptic_driver)"),
        (10.6, 14.2, VIRTUAL, "coupling\n(both sides)"),
        (14.4, 21.9, VIRTUAL, "tool and environment\n(haptic_simulation)"),
    ):
        axes.add_patch(Rectangle((left, -0.2), right - left, 5.6, facecolor=colour, alpha=0.06))
        axes.text((left + right) / 2, -0.4, text, ha="center", va="top", fontsize=9, color=colour)
    box(axes, 0.5, 2.2, 0.9, 1.2, "s(t)", GROUND)
    spring(axes, 1.4, 4.2, 3.2, "$k_h$")
    damper(axes, 1.4, 4.2, 2.3, "$b_h$")
    box(axes, 4.2, 2.0, 0.8, 1.6, "$m_h$", REAL)
    axes.plot([5.0, 6.2], [2.8, 2.8], color=REAL, linewidth=3)
    box(axes, 6.2, 1.0, 2.2, 2.9, "handle\n$m$", REAL)
    damper(axes, 8.4, 9.8, 1.5, "$b, f_c$")
    ground(axes, 9.8, 1.0, 2.0)
    spring(axes, 8.4, 15.0, 3.4, "$K$", VIRTUAL, shown=(11.0, 14.0))
    damper(axes, 8.4, 15.0, 2.6, "$B$", VIRTUAL, shown=(11.0, 14.0))
    box(axes, 15.0, 1.9, 2.0, 1.8, "tool\n$m_t$", VIRTUAL)
    box(axes, 18.4, 0.9, 2.6, 3.4, "environment", VIRTUAL)
    for x, y, length, text in (
        (6.0, 4.2, 1.3, "operator_force"),
        (8.4, 4.2, 1.6, "force_on_handle"),
        (15.0, 4.3, -1.6, "force_on_tool"),
        (18.3, 2.8, -1.2, "contact"),
    ):
        arrow(axes, x, y, length, FORCE)
        axes.text(x + length / 2, y + 0.2, text, ha="center", va="bottom", fontsize=8, color=FORCE)
    arrow(axes, 0.5, 5.75, 2.0, "black")
    axes.text(
        2.7,
        5.75,
        "positive: positions, velocities and forces on the body that the name says. "
        "Arrow of force_on_tool: the tool is ahead of the handle.",
        va="center",
        fontsize=8.5,
    )


def plane(axes):
    """The plane: frame, poses of handle and tool, a wall."""
    axes.set(xlim=(-1.2, 8.2), ylim=(-1.2, 6.4), aspect="equal", title="The plane: x right, y up, θ counter-clockwise")
    for dx, dy, text in ((1.4, 0.0, "x"), (0.0, 1.4, "y")):
        axes.annotate("", (dx - 0.6, dy + 0.3), (-0.6, 0.3), arrowprops={"arrowstyle": "->"})
        axes.text(dx - 0.55 + 0.1 * (dx > 0), dy + 0.4, text)
    axes.text(-0.9, -0.15, "haptic_base", fontsize=8)
    peg(axes, 3.0, 4.6, -0.2, REAL, "handle\n(x, y, θ)", -1.1)
    peg(axes, 4.6, 4.1, 0.15, VIRTUAL, "tool\n(x, y, θ)", 1.0)
    spring(axes, 3.0, 4.6, 0.0, "", "black", ends=((3.0, 4.6), (4.6, 4.1)))
    axes.text(3.8, 4.75, "stretch = tool − handle", fontsize=8, ha="left", va="bottom")
    axes.add_patch(Rectangle((1.0, -1.0), 7.0, 1.1, facecolor=GROUND, alpha=0.25))
    axes.plot([1.0, 8.0], [0.1, 0.1], color=GROUND)
    axes.annotate("", (7.0, 1.3), (7.0, 0.1), arrowprops={"arrowstyle": "->", "color": FORCE})
    axes.text(7.1, 0.9, "normal n", fontsize=8, color=FORCE)
    axes.text(
        4.5,
        -0.5,
        "wall: free where n·p > offset\nforce_on_handle = n · max(0, K depth + B rate)",
        ha="center",
        va="center",
        fontsize=8,
    )


def time(axes):
    """One servo period on the device page."""
    axes.set(xlim=(-0.35, 2.6), ylim=(-0.75, 3.35), title="The device page: when things happen")
    for k in range(3):
        axes.plot([k, k], [-0.1, 2.9], color="0.6", linewidth=0.8, linestyle=":")
        axes.text(k, 2.95, f"deadline $t_{{k{'+' + str(k) if k else ''}}}$", ha="center", fontsize=8.5)
    axes.text(-0.33, 2.45, "servo", fontsize=8.5)
    axes.text(-0.33, 1.45, "motor", fontsize=8.5)
    axes.text(-0.33, 0.45, "plant", fontsize=8.5)
    for k, write in ((0, 0.16), (1, 1.24), (2, 2.13)):
        axes.add_patch(Rectangle((k + 0.04, 2.35), write - k - 0.04, 0.3, facecolor=REAL, alpha=0.5))
        down = (write, 1.2 + 0.35 * (k != 1))
        axes.annotate("", down, (write, 2.35), arrowprops={"arrowstyle": "->", "color": FORCE})
    axes.text(0.2, 2.5, "read $t_k$, tick, write", fontsize=8, va="center")
    axes.step([0.0, 0.16, 1.24, 2.13, 2.5], [1.2, 1.55, 1.2, 1.55, 1.55], where="post", color=FORCE)
    axes.text(0.7, 1.62, "held from its write to the next", ha="center", va="bottom", fontsize=8, color=FORCE)
    t = np.linspace(0.0, 2.3, 200)
    axes.plot(t, 0.35 + 0.22 * np.sin(2.2 * t), color=VIRTUAL)
    axes.plot([0, 1, 2], 0.35 + 0.22 * np.sin([0.0, 2.2, 4.4]), "o", color=VIRTUAL)
    axes.text(1.05, 0.62, "encoder latched at $t_{k+1}$", fontsize=8, color=VIRTUAL)
    axes.text(
        1.15,
        -0.35,
        "The write names $t_{k+1}$: the plant integrates up to it at once,\n"
        "so the sample is there before the servo wakes. Late writes act late.",
        ha="center",
        va="center",
        fontsize=8,
    )


def box(axes, x, y, width, height, text, colour):
    axes.add_patch(Rectangle((x, y), width, height, facecolor="white", edgecolor=colour, linewidth=1.6, zorder=3))
    axes.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=9, zorder=4)


def spring(axes, start, end, y, text, colour=REAL, shown=None, ends=None):
    """Zigzag from start to end at height y, or between two points; `shown` is where its coils lie."""
    one, two = ends or ((start, y), (end, y))
    length = np.hypot(two[0] - one[0], two[1] - one[1])
    low, high = ((shown[0] - start) / length, (shown[1] - start) / length) if shown else (0.15, 0.85)
    share = np.concatenate([[0.0], np.linspace(low, high, 13), [1.0]])
    aside = np.concatenate([[0.0, 0.0], 0.2 * (-1.0) ** np.arange(11), [0.0, 0.0]])
    across = np.array([one[1] - two[1], two[0] - one[0]]) / length
    points = np.outer(1.0 - share, one) + np.outer(share, two) + np.outer(aside, across)
    axes.plot(*points.T, color=colour, linewidth=1.3, zorder=2)
    axes.text((low + high) / 2 * (end - start) + start, y + 0.25, text, ha="center", va="bottom", fontsize=9)


def damper(axes, start, end, y, text, colour=REAL, shown=None):
    """Piston in a cylinder."""
    middle = sum(shown or (start, end)) / 2
    axes.plot([start, middle], [y, y], color=colour, linewidth=1.3)
    axes.plot([middle, middle], [y - 0.15, y + 0.15], color=colour, linewidth=1.3)
    cylinder = [middle - 0.3, middle + 0.3, middle + 0.3, middle - 0.3]
    axes.plot(cylinder, [y + 0.22, y + 0.22, y - 0.22, y - 0.22], color=colour, linewidth=1.3)
    axes.plot([middle + 0.3, end], [y, y], color=colour, linewidth=1.3)
    axes.text(middle, y - 0.3, text, ha="center", va="top", fontsize=9)


def ground(axes, x, low, high):
    axes.plot([x, x], [low, high], color=GROUND, linewidth=2)
    for y in np.linspace(low + 0.2, high, 4):
        axes.plot([x, x + 0.25], [y, y - 0.25], color=GROUND, linewidth=0.9)


def arrow(axes, x, y, length, colour):
    axes.annotate("", (x + length, y), (x, y), arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6})


def peg(axes, x, y, angle, colour, text, aside):
    """A tool outline hanging from its grip."""
    corners = np.array([(-0.35, 0.3), (0.35, 0.3), (0.35, -2.6), (-0.35, -2.6)])
    c, s = np.cos(angle), np.sin(angle)
    turned = corners @ np.array([[c, s], [-s, c]]) + (x, y)
    axes.add_patch(Polygon(turned, facecolor=colour, alpha=0.25, edgecolor=colour))
    axes.add_patch(Circle((x, y), 0.1, color=colour, zorder=4))
    axes.text(x + aside, y - 0.9, text, ha="center", va="center", fontsize=8, color=colour)
