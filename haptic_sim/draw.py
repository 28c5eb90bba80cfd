# SPDX-License-Identifier: Apache-2.0
"""Picture of a scene at its start: bodies, joints, the tool and the way that is suggested for the handle."""

import math

import numpy as np
from matplotlib import patches
from matplotlib.figure import Figure

from haptic_device.device import operator_hand
from haptic_device.parameters import OPERATOR
from haptic_sim.geometry import turned
from haptic_sim.joint import WORLD, Slider
from haptic_sim.scene import Scene
from haptic_sim.solid import TOOL

FIXED, MOVING, HELD = "0.72", "tab:blue", "tab:orange"
MARKS = {"pin": "o", "slider": "s", "weld": "X", "spring": "."}
POINTS = 200


def save(scene: Scene, path) -> None:
    """Write the picture as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(5.0, 4.6), layout="constrained")
    draw(scene, figure.subplots())
    figure.savefig(path, dpi=110, format="png")


def draw(scene: Scene, axes) -> None:
    """The scene in an axes object, in mm."""
    way = handle_way(scene)
    for body in (*scene.bodies, scene.tool):
        _draw_solid(axes, body)
    _draw_joints(axes, scene)
    axes.plot(*(1e3 * way[:, :2].T), ":", color=HELD, linewidth=1.2, zorder=5)
    axes.plot(*(1e3 * np.array(scene.tool.pose[:2])), "+", color="black", markersize=9, zorder=6)
    _frame(axes, scene, way)


def handle_way(scene: Scene) -> np.ndarray:
    """Places (x, y, theta) of the suggested motion's hand, evenly in time."""
    values = {parameter.name: parameter.default for parameter in OPERATOR}
    values |= {"motion.start": scene.tool.pose, "motion.target": scene.tool.pose}
    motion = operator_hand.script(values | {f"motion.{key}": value for key, value in scene.motion.items()})
    way = np.empty((POINTS, 3))
    for place, time in zip(way, np.linspace(0.0, float(motion["duration"][0]), POINTS), strict=True):
        operator_hand.target_at(motion[0], time, place)
    return way


def _draw_solid(axes, solid):
    color = HELD if solid.name == TOOL else FIXED if solid.fixed else MOVING
    for outline in solid.outlines:
        corners = 1e3 * np.array([turned(vertex, solid.pose) for vertex in outline.vertices])
        shape = patches.Circle(corners[0], 1e3 * outline.radius) if outline.radius else patches.Polygon(corners)
        shape.set(facecolor=color, edgecolor="black", linewidth=0.6, alpha=0.75)
        axes.add_patch(shape)
    if any(map(abs, solid.velocity[:2])):
        speed = math.hypot(*solid.velocity[:2])
        axes.annotate(
            f"{speed:g} m/s",
            xy=1e3 * np.array(solid.pose[:2]),
            textcoords="offset points",
            xytext=[36.0 * v / speed for v in solid.velocity[:2]],
            fontsize=8,
            ha="center",
            va="center",
            arrowprops={"arrowstyle": "<-", "color": "tab:red"},
        )


def _draw_joints(axes, scene):
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool, WORLD: None}
    for joint in scene.joints:
        ends = 1e3 * np.array(joint.places(*(solids[name] for name in joint.bodies)))
        axes.plot(
            *ends.T,
            linestyle="-" if joint.type == "spring" else "",
            color="black",
            marker=MARKS[joint.type],
            markersize=5,
            markerfacecolor="white",
            zorder=7,
        )
        if isinstance(joint, Slider) and joint.limits:
            way = np.outer(joint.limits, joint.unit_axis)
            axes.plot(*(ends[0] + 1e3 * way).T, "|-", color="black", linewidth=0.8, zorder=6)


def _frame(axes, scene, way):
    """Shows everything that ends somewhere, with a margin, one scale."""
    corners = [
        turned(vertex, solid.pose)
        for solid in (*scene.bodies, scene.tool)
        for shape, outline in zip(solid.shapes, solid.outlines, strict=True)
        if shape.bounded
        for vertex in _around(outline)
    ]
    seen = 1e3 * np.array([*corners, *_feet(scene), *way[:, :2]])
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


def _feet(scene):
    """Points of half-planes nearest to the tool."""
    for body in scene.bodies:
        for plane in (shape for shape in body.shapes if not shape.bounded):
            nx, ny = turned(plane.normal, (0.0, 0.0, body.pose[2]))
            (px, py), (x, y, _) = turned(plane.point, body.pose), scene.tool.pose
            away = ((x - px) * nx + (y - py) * ny) / (nx * nx + ny * ny)
            yield x - away * nx, y - away * ny


def _around(outline):
    r = outline.radius
    return [(x + dx * r, y + dy * r) for x, y in outline.vertices for dx, dy in ((1, 1), (-1, -1))]
