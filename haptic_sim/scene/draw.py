# SPDX-License-Identifier: Apache-2.0
"""Picture of a scene at its start: bodies, joints, the tool, what is measured and the way suggested for the handle.

Zigzags and spirals are springs, arrows with a speed are motors, belts and what moves at the start.
"""

import math
import os
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D

from haptic_device.os_errors import naming
from haptic_device.theory.palette import BLACK, FORCE, HANDLE, TARGET
from haptic_sim.scene.drawing import Drawing, corners, drawing_of, standing
from haptic_sim.scene.geometry import Point, turned
from haptic_sim.scene.joints import AnyJoint, Slider
from haptic_sim.scene.language import Measure, Scene
from haptic_sim.scene.paint import COLOURS, SPRUNG, TEETH, paint
from haptic_sim.scene.shapes import Body, HalfPlane, Tool

DRIVEN = FORCE
LINE = 50  # letters of the title in a line
TILTED = 1.0  # degrees
UNLIKE = 100.0  # masses of two bodies that differ as much are told
ZIGZAG = Path(TEETH * (2.0, 0.6) - (1.0, 0.6))
_TURN = np.linspace(0.0, 1.0, 60)[:, None] * (1.0, 5.0 * math.pi)
SPIRAL = Path(_TURN[:, :1] * np.column_stack([np.cos(_TURN[:, 1]), np.sin(_TURN[:, 1])]))
_ARC = np.linspace(-0.5 * math.pi, math.pi, 30)
ROUND = Path([*np.column_stack([np.cos(_ARC), np.sin(_ARC)]), (-1.35, 0.35), (-1.0, 0.0), (-0.65, 0.35)])
"""An arrow that turns counter-clockwise."""
STRAIGHT = Path([(-1.0, 0.0), (1.0, 0.0), (0.6, 0.3), (1.0, 0.0), (0.6, -0.3)])
"""An arrow along x."""
GOAL = Path([(-1.0, 0.6), (0.0, 0.0), (-1.0, -0.6), (0.0, 0.0), (0.0, 1.0), (0.0, -1.0)], [1, 2, 2, 1, 2, 2])
ARC = 25  # points of an arc that shows an angle
"""The end of an arrow along x, at a bar."""
FLIGHT = Path([(0.0, 0.5), (2.0, 0.5), (1.6, 0.7), (2.0, 0.5), (1.6, 0.3)])
"""An arrow along x, beside its beginning."""
_LIGHT: dict[str, Any] = {"fontsize": 9, "path_effects": [withStroke(linewidth=2.5, foreground="white")], "zorder": 9}
"""Of text over the scene."""


def save(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Writes a picture of the scene as PNG: bodies, joints, measures, the path of the suggested motion, in mm.

    Raises OSError if it cannot be written.

    Args:
        scene: the scene.
        path: of the file.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_sim.scene.draw import save
        >>> from haptic_sim.scene.language import load
        >>> save(load("wall"), "wall.png")
        >>> Path("wall.png").stat().st_size > 0
        True
    """
    figure = Figure(figsize=(5.0, 5.2), layout="constrained")
    axes = figure.subplots()
    draw(scene, axes)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    with naming(path):
        figure.savefig(path, dpi=110, format="png")


def draw(scene: Scene, axes: Axes) -> None:
    """Draws the scene into axes of matplotlib, in mm.

    Args:
        scene: the scene.
        axes: of matplotlib.

    Examples:
        >>> from matplotlib.figure import Figure
        >>> from haptic_sim.scene.draw import draw
        >>> from haptic_sim.scene.language import load
        >>> axes = Figure().subplots()
        >>> draw(load("wall"), axes)
        >>> axes.get_xlabel()
        'x [mm]'
    """
    drawn = drawing_of(scene)
    way = 1e3 * np.array(drawn.way)[:, :2]
    seen = _frame(axes, scene, way, drawn)
    _draw_kinds(axes, drawn)
    for shape in standing(drawn, (solid.pose for solid in drawn.solids)):
        paint(axes, shape)
    _draw_velocities(axes, scene)
    _draw_joints(axes, scene.joints, drawn)
    _draw_belts(axes, scene)
    _draw_masses(axes, scene)
    if np.ptp(way, axis=0).any():
        axes.plot(*way.T, ":", color=HANDLE, linewidth=1.8, zorder=5, label="way of the handle")
    axes.plot(*(1e3 * np.array(scene.tool.pose[:2])), "+", color=BLACK, markersize=9, zorder=6)
    _draw_goals(axes, scene)
    _draw_gravity(axes, scene, seen)


def _draw_kinds(axes: Axes, drawn: Drawing) -> None:
    """What the colours of the solids say, for the legend."""
    kinds = {
        "tool": (COLOURS["tool"], True),
        "can move": (COLOURS["moving"], any(not solid.fixed for solid in drawn.solids[1:])),
        "fixed": (COLOURS["fixed"], any(solid.fixed for solid in drawn.solids)),
    }
    for kind, (color, there) in kinds.items():
        if there:
            axes.fill([], [], facecolor=color, edgecolor=BLACK, linewidth=0.6, alpha=0.75, label=kind)


def _draw_velocities(axes: Axes, scene: Scene) -> None:
    """What moves at the start: an arrow that begins beside the middle of the body."""
    for solid in (*scene.bodies, scene.tool):
        if speed := math.hypot(*solid.velocity[:2]):
            vx, vy = (value / speed for value in solid.velocity[:2])
            side = -1.0 if vx < 0.0 else 1.0
            beside = FLIGHT.transformed(Affine2D().scale(1.0, side))
            at = 1e3 * np.array(solid.pose[:2])
            _mark(axes, at, _rotated(beside, math.atan2(vy, vx)), DRIVEN, 64.0)
            across = 16.0 * side if abs(vx) > abs(vy) else 26.0 * side
            _say(axes, f"{speed:g} m/s", at, (16.0 * vx - across * vy, 16.0 * vy + across * vx))


def _say(axes: Axes, text: str, at: np.ndarray, offset: tuple[float, float]) -> None:
    """A text about a place [mm, mm], as many points away."""
    middle: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center"}
    axes.annotate(text, (float(at[0]), float(at[1])), xytext=offset, **middle, **_LIGHT)


def _draw_masses(axes: Axes, scene: Scene) -> None:
    """The mass of the heaviest and of the lightest body, where they are very unlike."""
    masses = {body.name: body.mass for body in scene.bodies if body.mass and not body.fixed}
    if not masses or max(masses.values()) < UNLIKE * min(masses.values()):
        return
    for name in (min(masses, key=masses.__getitem__), max(masses, key=masses.__getitem__)):
        body = scene.solids[name]
        at = 1e3 * np.array(turned(body.mass_properties.center, body.pose))
        _say(axes, _mass(masses[name]), at, (-30.0, 0.0))


def _mass(value: float) -> str:
    """A mass [kg] in the unit that fits."""
    unit, factor = next((one for one in (("kg", 1.0), ("g", 1e3)) if value * one[1] >= 1.0), ("mg", 1e6))
    return f"{value * factor:g} {unit}"


def _draw_goals(axes: Axes, scene: Scene) -> None:
    """What is measured: the way of its point from 0 to 1, as it is at the start."""
    for measure in scene.measure.values():
        ends = 1e3 * _goal(scene, measure)
        angle = math.atan2(*reversed((ends[-1] - ends[-2]).tolist()))
        axes.plot(*ends.T, "-", color=TARGET, linewidth=1.4, zorder=8)
        axes.plot(*ends[0], ".", color=TARGET, markersize=5, zorder=8)
        at_end: dict[str, Any] = {"marker": _rotated(GOAL, angle), "markersize": 12, "linestyle": ""}
        axes.plot(*ends[-1], color=TARGET, markerfacecolor="none", markeredgewidth=1.6, zorder=8, **at_end)
    if scene.measure:
        names = ", ".join(name.replace("_", " ") for name in scene.measure)
        mark: dict[str, Any] = {"marker": GOAL, "markersize": 9, "markerfacecolor": "none", "markeredgewidth": 1.6}
        axes.plot([], [], "-", color=TARGET, label=f"measured: {names}", **mark)


def _goal(scene: Scene, measure: Measure) -> np.ndarray:
    """The measured point from 0 to 1 if it goes along the axis alone [m]; of an angle an arc round the body."""
    solid = scene.solids[measure.body]
    if measure.axis is None:
        radius = 1.1 * max(math.hypot(*place) + line.radius for line in solid.outlines for place in line.vertices)
        turn = np.linspace(measure.start, measure.end, ARC)
        return np.array(solid.pose[:2]) + radius * np.array([np.cos(turn), np.sin(turn)]).T
    at, axis = np.array(turned(measure.point, solid.pose)), np.array(measure.axis)
    axis /= np.linalg.norm(axis)
    return np.array([at + (end - at @ axis) * axis for end in (measure.start, measure.end)])


def _draw_gravity(axes: Axes, scene: Scene, seen: np.ndarray) -> None:
    """An arrow with g in the corner that is farthest from all that is seen."""
    if scene.gravity == (0.0, 0.0):
        return
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    places = [np.array(place) for place in ((0.93, 0.88), (0.07, 0.88), (0.93, 0.14), (0.07, 0.14))]
    x, y = max(places, key=lambda place: np.linalg.norm(seen - (low + place * (high - low)), axis=1).min())
    gx, gy = (0.07 * value / math.hypot(*scene.gravity) for value in scene.gravity)
    tilt = abs(math.degrees(math.atan2(scene.gravity[0], -scene.gravity[1])))
    arrow = {"arrowstyle": "-|>", "linewidth": 2.0, "color": BLACK}
    ends: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "axes fraction"}
    axes.annotate("", (x + gx, y + gy), xytext=(x - gx, y - gy), arrowprops=arrow, zorder=9, **ends)
    label, inward = f"gravity, tilted {tilt:.0f}°" if tilt > TILTED else "gravity", 1.0 if x < 0.5 else -1.0
    beside: dict[str, Any] = {"ha": "left" if x < 0.5 else "right", "va": "center"}
    axes.annotate(label, (x, y), xytext=(x + 0.05 * inward, y), **ends, **beside, **_LIGHT)


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
    _say(axes, label, place, (0.0, -21.0))


def _mark(axes: Axes, place: np.ndarray, shape: Path, color: str, size: float) -> None:
    axes.plot(*place, marker=shape, markersize=size, color=color, markerfacecolor="none", markeredgewidth=1.5, zorder=8)


def _draw_joints(axes: Axes, joints: Sequence[AnyJoint], drawn: Drawing) -> None:
    """What drives the joints, and how far sliders go."""
    poses = {solid.name: solid.pose for solid in drawn.solids}
    for joint, marks in zip(joints, drawn.joints, strict=True):
        place = 1e3 * np.array(marks[0].place(poses))
        _draw_drives(axes, joint, place)
        if isinstance(joint, Slider) and joint.limits:
            way = np.outer(joint.limits, joint.unit_axis)
            axes.plot(*(place + 1e3 * way).T, "|-", color="black", linewidth=0.8, zorder=6)


def _frame(axes: Axes, scene: Scene, way: np.ndarray, drawn: Drawing) -> np.ndarray:
    """Shows everything that ends somewhere, with a margin, one scale; places (x, y) of it [mm]."""
    feet = [foot for body in scene.bodies for foot in _feet(body, scene.tool)]
    goals = [end for measure in scene.measure.values() for end in _goal(scene, measure)]
    poses = {solid.name: solid.pose for solid in drawn.solids}
    ends = [mark.place(poses) for marks in drawn.joints for mark in marks]
    seen = np.array([*(1e3 * np.array([*corners(scene), *feet, *goals, *ends])), *way])
    low, high = seen.min(axis=0), seen.max(axis=0)
    center, half = (low + high) / 2.0, 0.56 * max(*(high - low), 1.0)
    (left, bottom), (right, top) = center - half, center + half
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.locator_params(nbins=6)
    title = scene.description or scene.name
    even = LINE if len(title) <= LINE else math.ceil(len(title) / math.ceil(len(title) / LINE)) + 4
    axes.set_title(textwrap.fill(title, even), fontsize=11)
    return seen


def _feet(body: Body, tool: Tool) -> Iterator[Point]:
    """Points of a body's half-planes nearest to the tool."""
    for plane in (shape for shape in body.shapes if isinstance(shape, HalfPlane)):
        nx, ny = turned(plane.normal, (0.0, 0.0, body.pose[2]))
        (px, py), (x, y, _) = turned(plane.point, body.pose), tool.pose
        away = ((x - px) * nx + (y - py) * ny) / (nx * nx + ny * ny)
        yield x - away * nx, y - away * ny
