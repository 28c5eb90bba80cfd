# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for what is solid: materials, bodies, the tool. Immutable, SI."""

import math
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from haptic_sim.geometry import Outline, combined
from haptic_sim.shape import Number, Part, Point, Pose, Shape, above_zero

TOOL = "tool"

Mass = Annotated[Number, above_zero("kg")]
Inertia = Annotated[Number, above_zero("kg m²")]


class Material(Part):
    """Surface of a body: Coulomb friction coefficient and coefficient of restitution."""

    friction: Annotated[Number, Field(ge=0.0)] = 0.0
    restitution: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.0


class MassProperties(NamedTuple):
    """Mass [kg], inertia about the mass centre [kg m²], mass centre in the body's frame [m]."""

    mass: float
    inertia: float
    center: tuple[float, float]


class Solid(Part):
    """What tool and bodies share: pose [m, m, rad] and its rate at the start, a material, one or more shapes.

    Bodies touch if they have a layer in common; one without any layer touches nothing.
    """

    pose: Pose = (0.0, 0.0, 0.0)
    velocity: Pose = (0.0, 0.0, 0.0)
    layers: frozenset[int] = frozenset({0})
    material: str | None = None
    shapes: Annotated[tuple[Shape, ...], Field(min_length=1)]

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """All shapes in the body's frame."""
        return tuple(shape.outline for shape in self.shapes)


class Body(Solid):
    """A body: fixed, or dynamic with a mass.

    The mass is spread evenly over the shapes unless `inertia`, about the mass centre, is given. `surface_velocity`
    [m/s, m/s], in the body's frame, makes a belt of a fixed body: its surface runs at that while the body stands still,
    and friction drags what touches it that way. Only the part along the surface counts.
    """

    name: str
    fixed: bool = False
    mass: Mass | None = None
    inertia: Inertia | None = None
    surface_velocity: Point = (0.0, 0.0)

    @model_validator(mode="after")
    def _mass_if_dynamic(self):
        if not self.fixed and self.mass is None:
            raise ValueError("needs a mass in kg, or fixed: true")
        if self.fixed and self.velocity != (0.0, 0.0, 0.0):
            raise ValueError(f"is fixed, so its velocity cannot be {list(self.velocity)}; leave one of the two out")
        if not self.fixed and self.surface_velocity != (0.0, 0.0):
            raise ValueError(
                f"has the surface_velocity {list(self.surface_velocity)} m/s, which only a fixed body can "
                "have; write fixed: true or leave it out"
            )
        if not self.fixed and any(shape.half_plane for shape in self.shapes):
            raise ValueError("has a half_plane, which only a fixed body can have; write fixed: true or take a box")
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

    @model_validator(mode="after")
    def _ends_somewhere(self):
        if any(shape.half_plane for shape in self.shapes):
            raise ValueError("has a half_plane, which only a fixed body can have; take a box")
        return self

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
