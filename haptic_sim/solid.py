# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for what is solid: materials, shapes, bodies, the tool. Immutable, SI."""

import difflib
import math
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from haptic_sim.outline import Outline, combined, convex, rectangle

TOOL = "tool"


def _number(value):
    if isinstance(value, bool):
        raise ValueError("must be a number")
    return value


def _above_zero(unit):
    def check(value):
        if value <= 0.0:
            raise ValueError(f"must be greater than 0 {unit}")
        return value

    return AfterValidator(check)


Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
Mass = Annotated[Number, _above_zero("kg")]
Inertia = Annotated[Number, _above_zero("kg m²")]
Length = Annotated[Number, _above_zero("m")]
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
                advice = f"did you mean {near[0]!r}?" if near else f'known here are {", ".join(known)}'
                raise ValueError(f"has no key {key!r}; {advice}")
        return value


class Material(Part):
    """Surface of a body: Coulomb friction coefficient and coefficient of restitution."""

    friction: Annotated[Number, Field(ge=0.0)] = 0.0
    restitution: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.0


class Circle(Part):
    """A disc of `radius` [m] about `center` [m]."""

    radius: Length
    center: Point = (0.0, 0.0)


class Box(Part):
    """A rectangle of `size` width, height [m] about `center` [m], turned by `angle` [rad]."""

    size: tuple[Length, Length]
    center: Point = (0.0, 0.0)
    angle: Number = 0.0


class Shape(Part):
    """One of: `vertices` of a convex polygon [m] (either sense), `circle`, `box`."""

    vertices: tuple[Point, ...] | None = None
    circle: Circle | None = None
    box: Box | None = None

    @field_validator("vertices")
    @classmethod
    def _convex(cls, value):
        return None if value is None else convex(value)

    @model_validator(mode="after")
    def _one_kind(self):
        if sum(kind is not None for kind in (self.vertices, self.circle, self.box)) != 1:
            raise ValueError("must have exactly one of vertices, circle, box")
        return self

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        if self.circle:
            return Outline((self.circle.center,), self.circle.radius)
        return Outline(self.vertices or rectangle(self.box.size, self.box.center, self.box.angle))


class MassProperties(NamedTuple):
    """Mass [kg], inertia about the mass centre [kg m²], mass centre in the body's frame [m]."""

    mass: float
    inertia: float
    center: tuple[float, float]


class Solid(Part):
    """What tool and bodies share: a pose at the start [m, m, rad], a material, one or more shapes."""

    pose: Pose = (0.0, 0.0, 0.0)
    material: str | None = None
    shapes: Annotated[tuple[Shape, ...], Field(min_length=1)]

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """All shapes in the body's frame."""
        return tuple(shape.outline for shape in self.shapes)


class Body(Solid):
    """A body: fixed, or dynamic with a mass.

    The mass is spread evenly over the shapes unless `inertia`, about the mass centre, is given.
    """

    name: str
    fixed: bool = False
    mass: Mass | None = None
    inertia: Inertia | None = None

    @model_validator(mode="after")
    def _mass_if_dynamic(self):
        if not self.fixed and self.mass is None:
            raise ValueError("needs a mass in kg, or fixed: true")
        return self

    @property
    def mass_properties(self) -> MassProperties:
        """Mass, inertia and mass centre of a dynamic body."""
        lamina = combined(self.outlines)
        inertia = self.inertia or self.mass * lamina.second_moment / lamina.area
        return MassProperties(self.mass, inertia, lamina.centroid)


class Tool(Solid):
    """The body that the coupling moves. Its frame's origin is the grip, and its mass centre is taken to be there.

    So the coupling's force and torque act at the mass centre and do not mix; the inertia is about the grip.
    """

    mass: Mass
    inertia: Inertia | None = None

    @property
    def name(self) -> str:
        """Name of the tool among the bodies."""
        return TOOL

    @property
    def mass_properties(self) -> MassProperties:
        """Mass, inertia about the grip and mass centre (the grip)."""
        lamina = combined(self.outlines)
        about_grip = lamina.second_moment / lamina.area + math.hypot(*lamina.centroid) ** 2
        return MassProperties(self.mass, self.inertia or self.mass * about_grip, (0.0, 0.0))
