# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for numbers, points and shapes. Immutable, SI."""

import difflib
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from haptic_sim.geometry import Outline, convex, half_plane, rectangle


def _number(value):
    if isinstance(value, bool):
        raise ValueError("must be a number")
    return value


def above_zero(unit):
    """Validator of a number that must be greater than 0 of this unit."""

    def check(value):
        if value <= 0.0:
            raise ValueError(f"must be greater than 0 {unit}")
        return value

    return AfterValidator(check)


Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
Length = Annotated[Number, above_zero("m")]
Point = tuple[Number, Number]
Pose = tuple[Number, Number, Number]


class Part(BaseModel):
    """A mapping of the language: no key but its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _knows_every_key(cls, value):
        known = [field.alias or name for name, field in cls.model_fields.items()]
        for key in value if isinstance(value, dict) else ():
            if key not in known:
                near = difflib.get_close_matches(str(key), known, 1)
                advice = f"did you mean {near[0]!r}?" if near else f"known here are {', '.join(known)}"
                raise ValueError(f"has no key {key!r}; {advice}")
        return value


class Circle(Part):
    """A disc of `radius` [m] about `center` [m]."""

    radius: Length
    center: Point = (0.0, 0.0)


class Box(Part):
    """A rectangle of `size` width, height [m] about `center` [m], turned by `angle` [rad]."""

    size: tuple[Length, Length]
    center: Point = (0.0, 0.0)
    angle: Number = 0.0


class HalfPlane(Part):
    """Everything behind the line through `point` [m]; `normal`, of any length, points out of it. For fixed bodies."""

    point: Point = (0.0, 0.0)
    normal: Point

    @field_validator("normal")
    @classmethod
    def _points_somewhere(cls, value):
        if value == (0.0, 0.0):
            raise ValueError("must have some length")
        return value


class Shape(Part):
    """One of: `vertices` of a convex polygon [m] (either sense), `circle`, `box`, `half_plane`."""

    vertices: tuple[Point, ...] | None = None
    circle: Circle | None = None
    box: Box | None = None
    half_plane: HalfPlane | None = None

    @field_validator("vertices")
    @classmethod
    def _convex(cls, value):
        return None if value is None else convex(value)

    @model_validator(mode="after")
    def _one_kind(self):
        if sum(kind is not None for kind in (self.vertices, self.circle, self.box, self.half_plane)) != 1:
            raise ValueError("must have exactly one of vertices, circle, box, half_plane")
        return self

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        if self.circle:
            return Outline((self.circle.center,), self.circle.radius)
        if self.half_plane:
            return half_plane(self.half_plane.point, self.half_plane.normal)
        return Outline(self.vertices or rectangle(self.box.size, self.box.center, self.box.angle))
