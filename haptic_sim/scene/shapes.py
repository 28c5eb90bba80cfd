# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for numbers and what is solid: shapes, materials, bodies, the tool. Immutable, SI."""

import abc
import math
from typing import Annotated, Any, ClassVar, NamedTuple, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from haptic_device.config.refusal import Part, Unit
from haptic_sim.scene.geometry import Outline, combined, convex, half_plane, rectangle

TOOL = "tool"


def _number(value: Any) -> Any:
    if isinstance(value, bool | str):
        raise ValueError("must be a number")
    return value


def _somewhere(direction: tuple[float, float]) -> tuple[float, float]:
    if direction == (0.0, 0.0):
        raise ValueError("must have some length")
    return direction


Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Length = Annotated[Positive, Unit("m")]
Mass = Annotated[Positive, Unit("kg")]
Inertia = Annotated[Positive, Unit("kg m²")]
Point = tuple[Number, Number]
Pose = tuple[Number, Number, Number]
Direction = Annotated[Point, AfterValidator(_somewhere)]


class Shape(Part, abc.ABC):
    """What all shapes share: the key that tells them, and whether they end somewhere, as those of what moves must."""

    key: ClassVar[str]
    bounded: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def outline(self) -> Outline:
        """The shape in its body's frame."""


class Polygon(Shape):
    """A convex polygon; `{vertices: […]}` in YAML.

    Attributes:
        vertices (tuple[Point, ...]): corners in the body's frame [m, m], in clockwise or counter-clockwise order; they
            are stored counter-clockwise.

    Examples:
        >>> from haptic_sim.scene.shapes import Polygon
        >>> Polygon(vertices=[(0.0, 0.0), (0.0, 0.01), (0.01, 0.0)]).vertices
        ((0.01, 0.0), (0.0, 0.01), (0.0, 0.0))
    """

    key = "vertices"
    vertices: Annotated[tuple[Point, ...], AfterValidator(convex)]

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        return Outline(self.vertices)


class KeyedShape(Shape):
    """A shape that is written as a mapping under its key."""

    under_key = True

    @model_validator(mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        return value.get(cls.key, value) if isinstance(value, dict) else value

    @model_serializer(mode="wrap")
    def _write(self, fields: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {self.key: fields(self)}


class Circle(KeyedShape):
    """A disc; `{circle: {radius: …}}` in YAML.

    Attributes:
        radius (float): [m].
        center: in the body's frame [m, m].

    Examples:
        >>> from haptic_sim.scene.shapes import Circle
        >>> Circle(radius=0.01).center
        (0.0, 0.0)
    """

    key = "circle"
    radius: Length
    center: Point = (0.0, 0.0)

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        return Outline((self.center,), self.radius)


class Box(KeyedShape):
    """A rectangle; `{box: {size: [w, h]}}` in YAML.

    Attributes:
        size (tuple[float, float]): width and height [m, m].
        center: in the body's frame [m, m].
        angle (float): rotation, counter-clockwise [rad].

    Examples:
        >>> from haptic_sim.scene.shapes import Box
        >>> Box(size=(0.02, 0.01)).outline.vertices[0]  # [m, m]
        (-0.01, -0.005)
    """

    key = "box"
    size: tuple[Length, Length]
    center: Point = (0.0, 0.0)
    angle: Number = 0.0

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        return Outline(rectangle(self.size, self.center, self.angle))


class HalfPlane(KeyedShape):
    """Everything behind a line; only a fixed body may have one. `{half_plane: {normal: [x, y]}}` in YAML.

    Attributes:
        point: a point of the line, in the body's frame [m, m].
        normal (Point): direction out of the body, of any length.

    Examples:
        >>> from haptic_sim.scene.shapes import HalfPlane
        >>> HalfPlane(normal=(0.0, 1.0)).bounded
        False
    """

    key = "half_plane"
    bounded = False
    point: Point = (0.0, 0.0)
    normal: Direction

    @property
    def outline(self) -> Outline:
        """The shape in its body's frame."""
        return half_plane(self.point, self.normal)


SHAPES = {kind.key: kind for kind in (Polygon, Circle, Box, HalfPlane)}
_LISTED = ", ".join(SHAPES)


def _key(value: Any) -> Any:
    if isinstance(value, dict):
        return next(iter(value)) if len(value) == 1 else None
    return getattr(value, "key", None)


AnyShape = Annotated[
    Annotated[Polygon, Tag(Polygon.key)]
    | Annotated[Circle, Tag(Circle.key)]
    | Annotated[Box, Tag(Box.key)]
    | Annotated[HalfPlane, Tag(HalfPlane.key)],
    Discriminator(_key, custom_error_type="shape", custom_error_message=f"must have exactly one of {_LISTED}"),
]


class Material(Part):
    """Surface of a body.

    Attributes:
        friction (float): coefficient of Coulomb friction.
        restitution (float): coefficient of restitution, 0…1.

    Examples:
        >>> from haptic_sim.scene.shapes import Material
        >>> Material(friction=0.3)
        Material(friction=0.3, restitution=0.0)
    """

    friction: NotNegative = 0.0
    restitution: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.0


class MassProperties(NamedTuple):
    """Mass and inertia of a body.

    Attributes:
        mass: [kg].
        inertia: about the mass centre [kg m²].
        center: mass centre in the body's frame [m, m].

    Examples:
        >>> from haptic_sim.scene.shapes import Body, Box
        >>> properties = Body(name="block", mass=0.12, shapes=[Box(size=(0.03, 0.04))]).mass_properties
        >>> round(properties.inertia, 9)  # m (w² + h²)/12
        2.5e-05
    """

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
    shapes: Annotated[tuple[AnyShape, ...], Field(min_length=1)]

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """All shapes in the body's frame."""
        return tuple(shape.outline for shape in self.shapes)

    @property
    def bounded(self) -> bool:
        """Whether all shapes end somewhere."""
        return all(shape.bounded for shape in self.shapes)


class Body(Solid):
    """A body: fixed, or movable with a mass. Bodies touch if they have a layer in common.

    Attributes:
        name: name of the body.
        pose: of its frame at the start [m, m, rad].
        velocity: at the start [m/s, m/s, rad/s].
        layers: numbers of its layers; a body without layers touches nothing.
        material: name of its material, or None for neither friction nor restitution.
        shapes (tuple[AnyShape, ...]): one or more shapes.
        fixed: whether it cannot move.
        mass (float | None): [kg], evenly spread over the shapes unless `inertia` is given.
        inertia (float | None): about the mass centre [kg m²].
        surface_velocity: of a belt, a fixed body whose surface runs, in the body's frame [m/s, m/s].

    Examples:
        >>> from haptic_sim.scene.shapes import Body, Circle
        >>> block = Body(name="disc", mass=0.2, shapes=[Circle(radius=0.01)])
        >>> round(block.mass_properties.inertia, 9)  # m r²/2
        1e-05
    """

    name: str
    fixed: bool = False
    mass: Mass | None = None
    inertia: Inertia | None = None
    surface_velocity: Point = (0.0, 0.0)

    @model_validator(mode="after")
    def _fixed_or_dynamic(self) -> Self:
        if self.fixed and self.velocity != (0.0, 0.0, 0.0):
            raise ValueError(f"is fixed, so its velocity cannot be {list(self.velocity)}; leave one of the two out")
        if self.fixed:
            return self
        if self.mass is None:
            raise ValueError("needs a mass in kg, or fixed: true")
        if self.surface_velocity != (0.0, 0.0):
            raise ValueError(
                f"has the surface_velocity {list(self.surface_velocity)} m/s, which only a fixed body can "
                "have; write fixed: true or leave it out"
            )
        if not self.bounded:
            raise ValueError("has a half_plane, which only a fixed body can have; write fixed: true or take a box")
        return self

    @property
    def mass_properties(self) -> MassProperties:
        """Mass, inertia and mass centre; a fixed body without a mass has an infinite one."""
        lamina, mass = combined(self.outlines), math.inf if self.mass is None else self.mass
        return MassProperties(mass, self.inertia or mass * lamina.second_moment / lamina.area, lamina.centroid)


class Tool(Solid):
    """The body that the coupling moves. The origin of its frame is the grip and is used as its mass centre.

    So the force of the coupling acts at the mass centre and causes no torque.

    Attributes:
        pose: of the grip at the start [m, m, rad].
        velocity: at the start [m/s, m/s, rad/s].
        layers: numbers of its layers.
        material: name of its material, or None.
        shapes (tuple[AnyShape, ...]): one or more shapes.
        mass (float): [kg].
        inertia (float | None): about the grip [kg m²], or None for that of the shapes.

    Examples:
        >>> from haptic_sim.scene.shapes import Circle, Tool
        >>> round(Tool(mass=0.1, shapes=[Circle(radius=0.01)]).mass_properties.inertia, 9)  # m r²/2
        5e-06
    """

    name: ClassVar[str] = TOOL
    fixed: ClassVar[bool] = False
    surface_velocity: ClassVar[tuple[float, float]] = (0.0, 0.0)
    mass: Mass
    inertia: Inertia | None = None

    @model_validator(mode="after")
    def _ends_somewhere(self) -> Self:
        if not self.bounded:
            raise ValueError("has a half_plane, which only a fixed body can have; take a box")
        return self

    @property
    def mass_properties(self) -> MassProperties:
        """Mass, inertia about the grip and mass centre (the grip)."""
        lamina = combined(self.outlines)
        about_grip = lamina.second_moment / lamina.area + math.hypot(*lamina.centroid) ** 2
        return MassProperties(self.mass, self.inertia or self.mass * about_grip, (0.0, 0.0))


AnySolid = Tool | Body
