# SPDX-License-Identifier: Apache-2.0
"""Picture of a scene at its start: bodies, joints, the tool and the way that is suggested for the handle.

Zigzags and spirals are springs, arrows with a speed are motors, belts and what moves at the start.
"""

import math
import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from haptic_device.device import operator_hand
from haptic_device.os_errors import naming
from haptic_device.parameter_types import defaults
from haptic_device.parameters import OPERATOR
from haptic_sim.scene.drawing import Drawing, Solid, corners, drawing_of
from haptic_sim.scene.geometry import Point, turned
from haptic_sim.scene.joints import AnyJoint, Slider
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL, Body, HalfPlane, Tool

FIXED, MOVING, HELD = "0.72", "tab:blue", "tab:orange"
DRIVEN, SPRUNG = "tab:red", "tab:green"
MARKS = {"pin": "o", "slider": "s", "weld": "X", "spring": "."}
POINTS = 200
TEETH = np.array([[0.0, 0.0], *([k / 12.0, 0.5 * (-1) ** k] for k in range(2, 11)), [1.0, 0.0]])
"""A zigzag from 0 to 1 along x, its width 1."""
ZIGZAG = Path(TEETH * (2.0, 0.6) - (1.0, 0.6))
_TURN = np.linspace(0.0, 1.0, 60)[:, None] * (1.0, 5.0 * math.pi)
SPIRAL = Path(_TURN[:, :1] * np.column_stack([np.cos(_TURN[:, 1]), np.sin(_TURN[:, 1])]))
_ARC = np.linspace(-0.5 * math.pi, math.pi, 30)
ROUND = Path([*np.column_stack([np.cos(_ARC), np.sin(_ARC)]), (-1.35, 0.35), (-1.0, 0.0), (-0.65, 0.35)])
"""An arrow that turns counter-clockwise."""
STRAIGHT = Path([(-1.0, 0.0), (1.0, 0.0), (0.6, 0.3), (1.0, 0.0), (0.6, -0.3)])
"""An arrow along x."""


def save(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the picture as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(5.0, 4.6), layout="constrained")
    draw(scene, figure.subplots())
    with naming(path):
        figure.savefig(path, dpi=110, format="png")


def draw(scene: Scene, axes: Axes) -> None:
    """The scene in an axes object, in mm."""
    way, drawn = handle_way(scene), drawing_of(scene)
    for solid in (*drawn.solids[1:], drawn.solids[0]):
        _draw_solid(axes, solid)
    _draw_velocities(axes, scene)
    _draw_joints(axes, scene.joints, drawn)
    _draw_belts(axes, scene)
    axes.plot(*(1e3 * way[:, :2].T), ":", color=HELD, linewidth=1.2, zorder=5)
    axes.plot(*(1e3 * np.array(scene.tool.pose[:2])), "+", color="black", markersize=9, zorder=6)
    _frame(axes, scene, way)


def handle_way(scene: Scene) -> np.ndarray:
    """Places (x, y, theta) of the suggested motion's hand, evenly in time."""
    values = defaults(OPERATOR)
    values |= {"motion.start": scene.tool.pose, "motion.target": scene.tool.pose}
    motion = operator_hand.script(values | {f"motion.{key}": value for key, value in scene.motion.items()})
    way = np.empty((POINTS, 3))
    for place, time in zip(way, np.linspace(0.0, float(motion["duration"][0]), POINTS), strict=True):
        operator_hand.target_at(motion[0], time, place)
    return way


def _draw_solid(axes: Axes, solid: Solid) -> None:
    color = HELD if solid.name == TOOL else FIXED if solid.fixed else MOVING
    for outline in solid.outlines:
        places = 1e3 * np.array([turned(vertex, solid.pose) for vertex in outline.vertices])
        shape = patches.Circle(places[0], 1e3 * outline.radius) if outline.radius else patches.Polygon(places)
        shape.set(facecolor=color, edgecolor="black", linewidth=0.6, alpha=0.75)
        axes.add_patch(shape)


def _draw_velocities(axes: Axes, scene: Scene) -> None:
    for solid in (*scene.bodies, scene.tool):
        if speed := math.hypot(*solid.velocity[:2]):
            axes.annotate(
                f"{speed:g} m/s",
                xy=(1e3 * solid.pose[0], 1e3 * solid.pose[1]),
                textcoords="offset points",
                xytext=(36.0 * solid.velocity[0] / speed, 36.0 * solid.velocity[1] / speed),
                fontsize=8,
                ha="center",
                va="center",
                arrowprops={"arrowstyle": "<-", "color": DRIVEN},
            )


def _draw_belts(axes: Axes, scene: Scene) -> None:
    """Where the surface of a fixed body runs, how fast: at its place, of half-planes nearest to the tool."""
    for body in scene.bodies:
        if speed := math.hypot(*body.surface_velocity):
            vx, vy = turned(body.surface_velocity, (0.0, 0.0, body.pose[2]))
            at = next(_feet(body, scene.tool), body.pose[:2])
            _arrow(axes, 1e3 * np.array(at), STRAIGHT, math.atan2(vy, vx), f"{speed:g} m/s")


def _draw_drives(axes: Axes, joint: AnyJoint, place: np.ndarray) -> None:
    """Motor and spring of a pin or a slider, at its place [mm, mm]."""
    axis = math.atan2(*reversed(joint.unit_axis)) if isinstance(joint, Slider) else None
    if joint.type != "spring" and joint.spring(0.0)[0] > 0.0:
        shape = SPIRAL if axis is None else ZIGZAG
        _mark(axes, place, _rotated(shape, axis or 0.0), SPRUNG, 16.0)
    if joint.drive[1] > 0.0:
        speed = joint.drive[0]
        if axis is None:
            turning = ROUND if speed > 0.0 else ROUND.transformed(Affine2D().scale(1.0, -1.0))
            _arrow(axes, place, turning, 0.0, f"{speed:g} rad/s")
        else:
            _arrow(axes, place, STRAIGHT, axis + (0.0 if speed > 0.0 else math.pi), f"{speed:g} m/s")


def _rotated(path: Path, angle: float) -> Path:
    return path.transformed(Affine2D().rotate(angle))


def _arrow(axes: Axes, place: np.ndarray, path: Path, angle: float, label: str) -> None:
    """An arrow with a label; where the label says 0, which has no direction, the label alone."""
    if not label.startswith(("0 ", "-0 ")):
        _mark(axes, place, _rotated(path, angle), DRIVEN, 28.0)
    below: dict[str, Any] = {"xytext": (0.0, -24.0), "textcoords": "offset points", "ha": "center", "fontsize": 8}
    axes.annotate(label, (place[0], place[1]), color=DRIVEN, zorder=8, **below)


def _mark(axes: Axes, place: np.ndarray, shape: Path, color: str, size: float) -> None:
    axes.plot(*place, marker=shape, markersize=size, color=color, markerfacecolor="none", zorder=8)


def _draw_joints(axes: Axes, joints: Sequence[AnyJoint], drawn: Drawing) -> None:
    poses = {solid.name: solid.pose for solid in drawn.solids}
    for joint, marks in zip(joints, drawn.joints, strict=True):
        ends = 1e3 * np.array([mark.place(poses) for mark in marks])
        axes.plot(
            *ends.T,
            linestyle="",
            color="black",
            marker=MARKS[joint.type],
            markersize=5,
            markerfacecolor="white",
            zorder=7,
        )
        if joint.type == "spring":
            along = ends[1] - ends[0]
            teeth = TEETH * (1.0, 0.08) if joint.stiffness else np.array([[0.0, 0.0], [1.0, 0.0]])
            line = ends[0] + teeth @ np.array([along, [-along[1], along[0]]])
            axes.plot(*line.T, "-" if joint.stiffness else "--", color=SPRUNG, linewidth=1.2, zorder=6)
        _draw_drives(axes, joint, ends[0])
        if isinstance(joint, Slider) and joint.limits:
            way = np.outer(joint.limits, joint.unit_axis)
            axes.plot(*(ends[0] + 1e3 * way).T, "|-", color="black", linewidth=0.8, zorder=6)


def _frame(axes: Axes, scene: Scene, way: np.ndarray) -> None:
    """Shows everything that ends somewhere, with a margin, one scale."""
    feet = [foot for body in scene.bodies for foot in _feet(body, scene.tool)]
    seen = 1e3 * np.array([*corners(scene), *feet, *way[:, :2]])
    low, high = seen.min(axis=0), seen.max(axis=0)
    center, half = (low + high) / 2.0, 0.56 * max(*(high - low), 1.0)
    axes.set(
        xlim=(center[0] - half, center[0] + half),
        ylim=(center[1] - half, center[1] + half),
        aspect="equal",
        xlabel="x [mm]",
        ylabel="y [mm]",
    )
    axes.set_title(scene.name, fontsize=10)


def _feet(body: Body, tool: Tool) -> Iterator[Point]:
    """Points of a body's half-planes nearest to the tool."""
    for plane in (shape for shape in body.shapes if isinstance(shape, HalfPlane)):
        nx, ny = turned(plane.normal, (0.0, 0.0, body.pose[2]))
        (px, py), (x, y, _) = turned(plane.point, body.pose), tool.pose
        away = ((x - px) * nx + (y - py) * ny) / (nx * nx + ny * ny)
        yield x - away * nx, y - away * ny
