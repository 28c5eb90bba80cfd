# SPDX-License-Identifier: Apache-2.0
"""The scene language: bodies, materials, the tool and its grip, what to measure; immutable, SI, read from YAML.

The plane is x right, y up, theta counter-clockwise. A shape is given in its body's frame. Two materials in contact act
by the geometric mean of their friction and of their restitution, so that like on like gives the number written down.
"""

import math
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import BaseModel, Field, ValidationError, model_validator

from haptic_device.share import find
from haptic_sim.clearance import body_distance
from haptic_sim.outline import finest_feature
from haptic_sim.solid import TOOL, Body, Material, Number, Part, Point, Solid, Tool

TOUCHING = 1e-9  # overlap [m] up to which two bodies count as touching: rounding of poses, far below any feature


class SceneError(ValueError):
    """A scene that cannot be used: one sentence with file, path in the file, value and what to do."""


class Measure(Part):
    """How far `point` of `body` has come along `axis`: 0 where its projection is `from`, 1 where it is `to` [m]."""

    body: str = TOOL
    point: Point
    axis: Point
    start: Annotated[Number, Field(alias="from")]
    end: Annotated[Number, Field(alias="to")]

    @model_validator(mode="after")
    def _some_way_to_go(self):
        if self.start == self.end or self.axis == (0.0, 0.0):
            raise ValueError("needs an axis of some length, and from and to that differ")
        return self

    def fraction(self, pose) -> float:
        """Fraction of the way with the body at `pose` (x, y, theta)."""
        (x, y), (ax, ay), (px, py, theta) = self.point, self.axis, pose
        c, s = math.cos(theta), math.sin(theta)
        along = ((px + c * x - s * y) * ax + (py + s * x + c * y) * ay) / math.hypot(ax, ay)
        return (along - self.start) / (self.end - self.start)


class Scene(Part):
    """A named environment with a tool in it. `motion` is handed to the operator's model as it stands."""

    name: str
    description: str = ""
    gravity: Point = (0.0, 0.0)
    materials: dict[str, Material] = {}
    bodies: tuple[Body, ...] = ()
    tool: Tool
    measure: dict[str, Measure] = {}
    motion: dict[str, Any] = {}

    @model_validator(mode="after")
    def _holds_together(self):
        _check_names(self)
        _check_overlaps(self)
        return self

    def material(self, solid: Solid) -> Material:
        """Material of a body or of the tool; without one, neither friction nor restitution."""
        return self.materials[solid.material] if solid.material else Material()

    @property
    def feature(self) -> float:
        """Finest feature of all shapes [m]: shortest edge or radius."""
        return min(finest_feature(outline) for solid in (self.tool, *self.bodies) for outline in solid.outlines)


def load(name: str | Path) -> Scene:
    """The scene called `name`, or in the YAML file at that path; SceneError says in one sentence what is wrong."""
    try:
        path = find("scenes", str(name))
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError as missing:
        raise SceneError(str(missing)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{name} cannot be read: {error}") from None
    except yaml.YAMLError as error:
        raise SceneError(f'{path} is not YAML: {" ".join(str(error).split())}') from None
    return parse(content, str(path))


def parse(content, source: str) -> Scene:
    """A scene from a mapping; `source` names it in the sentence of a SceneError."""
    try:
        return Scene.model_validate(content)
    except ValidationError as error:
        raise SceneError(f"{source}: {_sentence(error.errors()[0])}") from None


def _check_names(scene):
    names = [body.name for body in scene.bodies]
    for i, name in enumerate(names):
        if name == TOOL or name in names[:i]:
            raise ValueError(f"bodies[{i}].name is {name!r}, which is taken; give each body its own")
    for path, solid in _solids(scene):
        if solid.material is not None and solid.material not in scene.materials:
            raise ValueError(f"{path}.material is {solid.material!r}; materials has {_listed(scene.materials)}")
    for key, measure in scene.measure.items():
        if measure.body not in (TOOL, *names):
            raise ValueError(f"measure.{key}.body is {measure.body!r}; it must be one of {_listed((TOOL, *names))}")


def _check_overlaps(scene):
    solids = _solids(scene)
    for i, (path, a) in enumerate(solids):
        for other, b in solids[i + 1:]:
            if getattr(a, "fixed", False) and b.fixed:
                continue
            gap = body_distance(a.outlines, a.pose, b.outlines, b.pose)
            if gap < -TOUCHING:
                raise ValueError(
                    f"{other} ({b.name!r}) overlaps {path} ({a.name!r}) by {-gap * 1e3:.4g} mm at the start; "
                    "move one of them away by at least that"
                )


def _listed(names):
    return ", ".join(names) or "none"


def _solids(scene):
    return [("tool", scene.tool), *((f"bodies[{i}]", body) for i, body in enumerate(scene.bodies))]


def _sentence(error):
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in error["loc"]).lstrip(".")
    if error["type"] == "missing":
        return f"{path} is missing; add it"
    problem = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    if isinstance(error["input"], dict | list | BaseModel):
        return f"{path}: {problem}" if path else problem
    return f'{path} is {error["input"]!r}: {problem}'
