# SPDX-License-Identifier: Apache-2.0
"""The scene language: bodies, materials, the tool and its grip, what to measure; immutable, SI, read from YAML.

The plane is x right, y up, theta counter-clockwise. A shape is given in its body's frame. Two materials in contact act
by the geometric mean of their friction and of their restitution, so that like on like gives the number written down.
"""

import math
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from haptic_device import yaml_reader
from haptic_device.config_files import ConfigError, find
from haptic_device.refusal import Part, Unit
from haptic_sim.method_registry import offered
from haptic_sim.scene import checks
from haptic_sim.scene.geometry import finest_feature
from haptic_sim.scene.joints import AnyJoint
from haptic_sim.scene.motion import flat_motion
from haptic_sim.scene.refusal import Unfit, found_wrong, is_unfit, with_stand_ins
from haptic_sim.scene.shapes import TOOL, AnySolid, Body, Direction, Material, Number, Point, Positive, Tool


class SceneError(ConfigError):
    """A scene that cannot be used: one sentence with file, path in the file, value and what to do."""


class Measure(Part):
    """How far `point` of `body` has come along `axis`: 0 where its projection is `from`, 1 where it is `to` [m]."""

    body: str = TOOL
    point: Point
    axis: Direction
    start: Annotated[Number, Field(alias="from")]
    end: Annotated[Number, Field(alias="to")]

    @model_validator(mode="after")
    def _some_way_to_go(self) -> Self:
        if self.start == self.end:
            raise ValueError("needs from and to that differ")
        return self

    def fraction(self, pose: tuple[float, float, float]) -> float:
        """Fraction of the way with the body at `pose` (x, y, theta)."""
        (x, y), (ax, ay), (px, py, theta) = self.point, self.axis, pose
        c, s = math.cos(theta), math.sin(theta)
        along = ((px + c * x - s * y) * ax + (py + s * x + c * y) * ay) / math.hypot(ax, ay)
        return (along - self.start) / (self.end - self.start)


class Scene(Part):
    """A named environment with a tool in it. `motion` is handed to the operator's model as it stands.

    `method`, `sub_step` [s] and `error` (relative, of the fastest motion) are wishes; what is left out is worked out.
    """

    name: str
    description: str = ""
    gravity: Point = (0.0, 0.0)
    method: str | None = None
    sub_step: Annotated[Positive, Unit("s")] | None = None
    error: Positive = 0.02
    materials: dict[str, Material] = {}
    bodies: tuple[Body, ...] = ()
    joints: tuple[AnyJoint, ...] = ()
    tool: Tool
    measure: dict[str, Measure] = {}
    motion: dict[str, Any] = {}

    @field_validator("method")
    @classmethod
    def _known_method(cls, value: str | None) -> str | None:
        if value not in (None, *offered()):
            raise ValueError(f"there is no such method; take one of {', '.join(offered())}")
        return value

    @field_validator("motion")
    @classmethod
    def _flat_waypoints(cls, value: dict[str, Any]) -> dict[str, Any]:
        return flat_motion(value)

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        solids: tuple[AnySolid, ...] = (self.tool, *self.bodies)
        measured = {key: part.body for key, part in self.measure.items()}
        wrong = [
            *checks.wrong_names(solids, self.materials, measured),
            *checks.wrong_joints(solids, self.joints),
            *checks.overlaps(solids, self.kept_apart),
            *checks.beyond_half_planes(solids),
        ]
        if wrong:
            raise Unfit(wrong)
        return self

    @property
    def solids(self) -> dict[str, AnySolid]:
        """The tool, then the bodies, by name."""
        return {TOOL: self.tool, **{body.name: body for body in self.bodies}}

    @property
    def kept_apart(self) -> set[frozenset[str]]:
        """Pairs of bodies that do not touch since a joint that is not a spring holds them together."""
        return {frozenset(joint.bodies) for joint in self.joints if joint.holds and not joint.collide}

    @property
    def shared_layers(self) -> list[int]:
        """Layers that more than one body is on, in their order."""
        count = Counter(layer for solid in self.solids.values() for layer in solid.layers)
        return sorted(layer for layer, bodies in count.items() if bodies > 1)

    @property
    def driven(self) -> bool:
        """Whether a motor or a belt can do work."""
        belts = any(body.surface_velocity != (0.0, 0.0) for body in self.bodies)
        return belts or any(joint.drive[0] != 0.0 and not joint.locks for joint in self.joints)

    def material(self, solid: AnySolid) -> Material:
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
        content = yaml_reader.load(path)
    except FileNotFoundError as missing:
        raise SceneError(str(missing)) from None
    except ConfigError as error:
        raise SceneError(str(error), error.found) from None
    return parse(content, str(path))


def parse(content: Any, source: str) -> Scene:
    """A scene from a mapping; `source` names it in the sentence of a SceneError."""
    try:
        return Scene.model_validate(content)
    except ValidationError as error:
        found = [*found_wrong(error, Scene), *_unfit_rest(content, error)]
        raise SceneError(f"{source}: {found[0]}", found) from None


def _unfit_rest(content: Any, error: ValidationError) -> list[str]:
    """What does not fit together of what is right each by itself."""
    if not isinstance(content, dict) or is_unfit(error):
        return []
    try:
        Scene.model_validate(with_stand_ins(content, [found["loc"] for found in error.errors()]))
    except ValidationError as rest:
        return found_wrong(rest, Scene) if is_unfit(rest) else []
    return []
