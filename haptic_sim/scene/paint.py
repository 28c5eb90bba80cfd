# SPDX-License-Identifier: Apache-2.0
"""Draws the shapes of a scene with matplotlib: for its picture, and for each picture of its film."""

import math
from typing import Any

import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke

from haptic_device.theory import palette
from haptic_device.theory.palette import BLACK
from haptic_sim.scene.drawing import Shape
from haptic_sim.scene.geometry import Point, thickness, turned

SPRUNG = palette.COUPLING
ROLES = ("wall", "fixed", "moving", "tool", "coupling", "contact", "force", "handle")  # what is over what
COLOURS = {role: getattr(palette, role.upper()) for role in ROLES} | {"spring": SPRUNG, "joint": BLACK}
PER_NEWTON, LONGEST = 4.3, 100.0  # points of an arrow
MARKS = {"pin": "o", "slider": "s", "weld": "X", "spring": "."}
THIN, SPECK = 0.012, 0.05  # of the picture's width: drawn thicker, drawn with a ring
TEETH = np.array([[0.0, 0.0], *([k / 12.0, 0.5 * (-1) ** k] for k in range(2, 11)), [1.0, 0.0]])
"""A zigzag from 0 to 1 along x, its width 1."""


def paint(axes: Axes, shape: Shape, alpha: float = 0.75) -> None:
    """Draws a shape into axes of matplotlib, in mm, whose limits are set; alpha: of solids."""
    place, color = 1e3 * np.array(shape.pose[:2]), COLOURS[shape.role]
    if shape.kind == "solid":
        _paint_solid(axes, shape, alpha)
    elif shape.points:
        _paint_line(axes, shape)
    elif shape.kind in MARKS:
        axes.plot(*place, MARKS[shape.kind], color=color, markersize=5, markerfacecolor="white", zorder=7)
    else:
        look: dict[str, Any] = {
            "markersize": 5.0 if shape.kind == "arrow" else 8.5,
            "markeredgecolor": BLACK,
            "markeredgewidth": 0.7,
        }
        axes.add_artist(Line2D(*place[:, None], marker="o", color=color, zorder=9, **look))
        _paint_force(axes, place, shape.force, color)


def _paint_solid(axes: Axes, solid: Shape, alpha: float) -> None:
    color, width, ends = COLOURS[solid.role], float(np.ptp(axes.get_xlim())), []
    for outline in solid.outlines:
        places = 1e3 * np.array([turned(vertex, solid.pose) for vertex in outline.vertices])
        shape = patches.Circle(places[0], 1e3 * outline.radius) if outline.radius else patches.Polygon(places)
        shape.set(facecolor=color, edgecolor=BLACK, linewidth=0.6, alpha=alpha, zorder=ROLES.index(solid.role) / 4)
        if 1e3 * thickness(outline) < THIN * width:
            around = [Stroke(linewidth=4.0, foreground=BLACK), Normal()]
            shape.set(edgecolor=color, linewidth=2.8, alpha=1.0, path_effects=around)
        axes.add_artist(shape)  # add_patch takes as long as all else: it asks for limits, which are set
        ends += [places.min(axis=0) - 1e3 * outline.radius, places.max(axis=0) + 1e3 * outline.radius]
    if solid.role == "tool":
        first = np.mean(solid.outlines[0].vertices, axis=0).tolist()
        grip = 1e3 * np.array([solid.pose[:2], turned(first, solid.pose)])
        axes.plot(*grip.T, "-", color=BLACK, linewidth=1.5, zorder=0.7)
        if np.ptp(ends, axis=0).max() < SPECK * width:
            axes.plot(*grip[0], "o", color=color, markersize=24, markeredgewidth=2.0, fillstyle="none", zorder=7)


def _paint_line(axes: Axes, shape: Shape) -> None:
    """A zigzag for a spring, else dashes."""
    start, end = 1e3 * np.array(shape.points)
    along, sprung = end - start, shape.kind == "spring"
    teeth = TEETH * (1.0, 0.08) if sprung else np.array([[0.0, 0.0], [1.0, 0.0]])
    line = start + teeth @ np.array([along, [-along[1], along[0]]])
    width = 1.2 if shape.role == "spring" else 2.5
    axes.plot(*line.T, "-" if sprung else "--", color=COLOURS[shape.role], linewidth=width, zorder=6)
    axes.plot(*line[[0, -1]].T, MARKS["spring"], color=BLACK, markersize=5, markerfacecolor="white", zorder=7)


def _paint_force(axes: Axes, place: np.ndarray, force: Point, color: str) -> None:
    """An arrow as long as the force [N]; none for one too small to see, or that is no number."""
    size = PER_NEWTON * math.hypot(*force)
    if size > 1.0:
        longer = PER_NEWTON * min(1.0, LONGEST / size)
        (x, y), tip = place.tolist(), (longer * force[0], longer * force[1])
        arrow = {"arrowstyle": "<|-", "shrinkA": 0.0, "shrinkB": 0.0, "color": color, "linewidth": 2.0}
        axes.annotate("", (x, y), xytext=tip, textcoords="offset points", arrowprops=arrow, zorder=8)
