# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for what holds bodies together: pins, sliders, welds, springs. Immutable, SI.

A joint's coordinate is 0 at the start. Of a pin it is the angle by which body b has turned against body a, counter-
clockwise; of a slider the way of body b along `axis` (given in the plane at the start, fixed in body a).
"""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from haptic_device.refusal import Part, Unit
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.shapes import Direction, NotNegative, Number, Point, Positive, Solid

WORLD = "world"
"""Name of what does not move, for joints; its frame is the plane's."""
FREE = -math.inf, math.inf
"""Limits of a joint that has none."""


def _about_zero(limits: tuple[float, float]) -> tuple[float, float]:
    if not limits[0] <= 0.0 <= limits[1]:
        raise ValueError("must enclose 0, which is where the joint starts")
    return limits


Limits = Annotated[tuple[Number, Number], AfterValidator(_about_zero)]


class Joint(Part):
    """Holds two bodies together at a point of the plane, `at`, or at a point of each body's own frame, `anchors`.

    Joined bodies do not touch each other unless `collide`.
    """

    name: str = ""
    bodies: tuple[str, str]
    at: Point | None = None
    anchors: tuple[Point, Point] | None = None
    collide: bool = False

    holds: ClassVar[bool] = True
    """Whether it binds its bodies' motion; else it only pulls."""

    @model_validator(mode="after")
    def _between_two_bodies_at_one_place(self) -> Self:
        if (self.at is None) == (self.anchors is None):
            raise ValueError("needs exactly one of at (a point of the plane) and anchors (a point of each body)")
        if self.bodies[0] == self.bodies[1]:
            raise ValueError(f"joins {self.bodies[0]!r} to itself; name two bodies")
        return self

    def places(self, a: Solid | None, b: Solid | None) -> tuple[Point, Point]:
        """Points of the plane [m] where the joint holds on to its bodies at the start; None is the world."""
        if self.anchors is None:
            assert self.at is not None
            return self.at, self.at
        on_a, on_b = self.anchors
        return turned(on_a, a.pose) if a else on_a, turned(on_b, b.pose) if b else on_b

    def forbidden(self, vector: Point) -> Point:
        """The part of a vector from anchor to anchor, or of its rate, at the start, that the joint does not let be."""
        return vector

    @property
    def locks(self) -> bool:
        """Whether it leaves no coordinate: makes one of two bodies."""
        return self.range == (0.0, 0.0)

    @property
    def keeps_angle(self) -> bool:
        """Whether its bodies cannot turn against each other."""
        return self.locks

    @property
    def reach(self) -> float:
        """Farthest that the anchors can ever be apart [m]."""
        return 0.0

    @property
    def drive(self) -> tuple[float, float]:
        """Speed of the motor [rad/s | m/s] and its largest torque or force [N m | N]; without a motor 0, 0."""
        return 0.0, 0.0

    @property
    def friction(self) -> float:
        """Coulomb friction against the joint's coordinate [N m | N]."""
        return 0.0

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest coordinate [rad | m]."""
        return FREE

    def spring(self, length: float) -> tuple[float, float, float]:
        """Stiffness, damping and rest of its own spring, whose anchors are `length` [m] apart at the start."""
        return 0.0, 0.0, 0.0

    @property
    def moves(self) -> bool:
        """Whether a motor or spring of its own moves the bodies."""
        return self.drive[1] > 0.0 or self.spring(0.0)[0] > 0.0


class Weld(Joint):
    """Makes one of two bodies, as limits of a pin or a slider do that are both 0."""

    type: Literal["weld"]

    @property
    def locks(self) -> bool:
        """Whether it leaves no coordinate: makes one of two bodies."""
        return True


class Spring(Joint):
    """Pulls its anchors with `stiffness` [N/m] and `damping` [N s/m] towards the distance `rest` [m].

    The rest is the distance at the start unless given.
    """

    type: Literal["spring"]
    stiffness: Annotated[NotNegative, Unit("N/m")] = 0.0
    damping: Annotated[NotNegative, Unit("N s/m")] = 0.0
    rest: Annotated[NotNegative, Unit("m")] | None = None
    holds = False

    @model_validator(mode="after")
    def _pulls(self) -> Self:
        if self.stiffness == self.damping == 0.0:
            raise ValueError("a spring needs a stiffness in N/m or a damping in N s/m")
        return self

    @property
    def reach(self) -> float:
        """Farthest that the anchors can ever be apart [m]."""
        return math.inf

    def spring(self, length: float) -> tuple[float, float, float]:
        """Stiffness [N/m], damping [N s/m] and rest [m]: `length`, that at the start, unless given."""
        return self.stiffness, self.damping, length if self.rest is None else self.rest


class Motor(Part):
    """Moves body b against body a at `speed` [rad/s | m/s] along the joint's coordinate, as hard as it can."""

    speed: Annotated[Number, Unit("m/s | rad/s")]


class RotaryMotor(Motor):
    """The motor of a pin, with at most `max_torque` [N m]."""

    max_torque: Annotated[Positive, Unit("N m")]


class LinearMotor(Motor):
    """The motor of a slider, with at most `max_force` [N]."""

    max_force: Annotated[Positive, Unit("N")]


class LowerPair(Joint):
    """A pin or a slider: leaves one coordinate, with `limits` [rad | m].

    `stiffness` [N m/rad | N/m] and `damping` [N m s/rad | N s/m] act on the coordinate towards `rest`.
    """

    limits: Limits | None = None
    stiffness: Annotated[NotNegative, Unit("N/m | N m/rad")] = 0.0
    damping: Annotated[NotNegative, Unit("N s/m | N m s/rad")] = 0.0
    rest: Number = 0.0

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest coordinate [rad | m]."""
        return self.limits or FREE

    def spring(self, length: float) -> tuple[float, float, float]:
        """Stiffness [N m/rad | N/m], damping [N m s/rad | N s/m] and rest [rad | m] on the coordinate."""
        return self.stiffness, self.damping, self.rest


class Pin(LowerPair):
    """Lets body b turn about the anchor, against `friction_torque` [N m]."""

    type: Literal["pin"]
    friction_torque: Annotated[NotNegative, Unit("N m")] = 0.0
    motor: RotaryMotor | None = None

    @property
    def drive(self) -> tuple[float, float]:
        """Speed of the motor [rad/s] and its largest torque [N m]; without a motor 0, 0."""
        return (self.motor.speed, self.motor.max_torque) if self.motor else (0.0, 0.0)

    @property
    def friction(self) -> float:
        """Coulomb friction against turning [N m]."""
        return self.friction_torque


class Slider(LowerPair):
    """Lets body b go along `axis`, of any length, without turning, against `friction_force` [N]."""

    type: Literal["slider"]
    axis: Direction
    friction_force: Annotated[NotNegative, Unit("N")] = 0.0
    motor: LinearMotor | None = None

    @property
    def keeps_angle(self) -> bool:
        """Whether its bodies cannot turn against each other."""
        return True

    @property
    def unit_axis(self) -> Point:
        """Axis of length 1."""
        length = math.hypot(*self.axis)
        return self.axis[0] / length, self.axis[1] / length

    def forbidden(self, vector: Point) -> Point:
        """The part of a vector from anchor to anchor, or of its rate, at the start, that lies across the axis."""
        x, y = self.unit_axis
        across = vector[0] * -y + vector[1] * x
        return across * -y, across * x

    @property
    def reach(self) -> float:
        """Farthest that the anchors can ever be apart [m]."""
        return max(map(abs, self.range))

    @property
    def drive(self) -> tuple[float, float]:
        """Speed of the motor [m/s] and its largest force [N]; without a motor 0, 0."""
        return (self.motor.speed, self.motor.max_force) if self.motor else (0.0, 0.0)

    @property
    def friction(self) -> float:
        """Coulomb friction against the way [N]."""
        return self.friction_force


AnyJoint = Annotated[Pin | Slider | Weld | Spring, Field(discriminator="type")]
JOINTS = {"pin": Pin, "slider": Slider, "weld": Weld, "spring": Spring}
