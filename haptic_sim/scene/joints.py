# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for what holds bodies together: pins, sliders, welds, springs. Immutable, SI.

A joint's coordinate is 0 at the start. Of a pin it is the angle by which body b has turned against body a, counter-
clockwise; of a slider the way of body b along `axis` (given in the plane at the start, fixed in body a).
"""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from haptic_device.config.refusal import Part, Unit
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.shapes import Direction, NotNegative, Number, Point, Positive, Solid

WORLD = "world"
"""Name of what does not move, for joints; its frame is the plane's."""
FREE = -math.inf, math.inf
"""Limits of a joint that has none."""


def _about_zero(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise ValueError("the smaller limit stands first")
    if not limits[0] <= 0.0 <= limits[1]:
        raise ValueError("must enclose 0, which is where the joint starts")
    return limits


Limits = Annotated[tuple[Number, Number], AfterValidator(_about_zero)]


class Joint(Part):
    """Connects two bodies. Joined bodies do not touch each other unless `collide` is true.

    Attributes:
        name: name of the joint, or "".
        bodies: names of the two; `world` is the plane.
        at: point of the plane where they are joined [m, m]. Give this or `anchors`.
        anchors: a point of each body's frame [m, m].
        collide: whether the bodies touch each other.

    Examples:
        >>> from haptic_sim.scene.language import load
        >>> [(joint.type, joint.bodies) for joint in load("pendulum").joints]
        [('pin', ('world', 'rod'))]
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
        """Points of the plane [m] where the joint is fixed to its bodies at the start; None is the world."""
        if self.anchors is None:
            assert self.at is not None
            return self.at, self.at
        on_a, on_b = self.anchors
        return turned(on_a, a.pose) if a else on_a, turned(on_b, b.pose) if b else on_b

    def forbidden(self, vector: Point) -> Point:
        """Component of the vector from anchor to anchor, or of its rate, at the start, that the joint keeps zero."""
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
    """Joins two bodies rigidly.

    Attributes:
        bodies: names of the two; `world` is the plane.
        at: point of the plane where they are joined [m, m]. Give this or `anchors`.
        anchors: a point of each body's frame [m, m].

    Examples:
        >>> from haptic_sim.scene.joints import Weld
        >>> Weld(type="weld", bodies=("tool", "block"), at=(0.0, 0.0)).locks
        True
    """

    type: Literal["weld"]

    @property
    def locks(self) -> bool:
        """Whether it leaves no coordinate: makes one of two bodies."""
        return True


class Spring(Joint):
    """Pulls or pushes two points towards a given distance.

    Attributes:
        bodies: names of the two; `world` is the plane.
        anchors: a point of each body's frame [m, m].
        stiffness (float): [N/m].
        damping (float): along the line between the points [N s/m].
        rest (float | None): distance without force [m]; by default the distance at the start.

    Examples:
        >>> from haptic_sim.scene.joints import Spring
        >>> pull = Spring(type="spring", bodies=("tool", "world"), anchors=((0.0, 0.0), (0.0, 0.1)), stiffness=50.0)
        >>> pull.spring(0.1)  # stiffness, damping, rest
        (50.0, 0.0, 0.1)
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
    """The motor of a pin.

    Attributes:
        speed (float): of body b against body a, counter-clockwise [rad/s].
        max_torque (float): largest torque [N m].

    Examples:
        >>> from haptic_sim.scene.joints import RotaryMotor
        >>> RotaryMotor(speed=1.0, max_torque=0.1)
        RotaryMotor(speed=1.0, max_torque=0.1)
    """

    max_torque: Annotated[Positive, Unit("N m")]


class LinearMotor(Motor):
    """The motor of a slider.

    Attributes:
        speed (float): of body b against body a, along the axis [m/s].
        max_force (float): largest force [N].

    Examples:
        >>> from haptic_sim.scene.joints import LinearMotor
        >>> LinearMotor(speed=0.1, max_force=2.0)
        LinearMotor(speed=0.1, max_force=2.0)
    """

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
    """A hinge: body b turns about a point of body a. The coordinate is the angle, 0 at the start, counter-clockwise.

    Attributes:
        bodies: names of a and b; `world` is the plane.
        at: point of the plane [m, m]. Give this or `anchors`.
        anchors: a point of each body's frame [m, m].
        limits: least and largest angle [rad], which enclose 0; or None.
        stiffness (float): of a spring on the angle [N m/rad].
        damping (float): of a damper on the angle [N m s/rad].
        rest (float): angle to which the spring pulls [rad].
        friction_torque (float): Coulomb friction [N m].
        motor: a RotaryMotor, or None.

    Examples:
        >>> from haptic_sim.scene.joints import Pin
        >>> hinge = Pin(type="pin", bodies=("world", "door"), at=(0.0, 0.0), limits=(0.0, 1.5), stiffness=0.1)
        >>> hinge.range, hinge.moves
        ((0.0, 1.5), True)
    """

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
    """Body b moves along an axis of body a and does not turn. The coordinate is the distance moved, 0 at the start.

    Attributes:
        bodies: names of a and b; `world` is the plane.
        at: point of the plane [m, m]. Give this or `anchors`.
        anchors: a point of each body's frame [m, m].
        axis (Point): direction in the plane at the start, of any length; it is fixed in body a.
        limits: least and largest coordinate [m], which enclose 0; or None.
        stiffness (float): of a spring on the coordinate [N/m].
        damping (float): of a damper on the coordinate [N s/m].
        rest (float): coordinate to which the spring pulls [m].
        friction_force (float): Coulomb friction [N].
        motor: a LinearMotor, or None.

    Examples:
        >>> from haptic_sim.scene.joints import Slider
        >>> rail = Slider(type="slider", bodies=("world", "cart"), at=(0.0, 0.0), axis=(3.0, 4.0))
        >>> rail.unit_axis
        (0.6, 0.8)
    """

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
        """The part of a vector from anchor to anchor, or of its rate, at the start, perpendicular to the axis."""
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
        """Coulomb friction against the motion [N]."""
        return self.friction_force


AnyJoint = Annotated[Pin | Slider | Weld | Spring, Field(discriminator="type")]
JOINTS = {"pin": Pin, "slider": Slider, "weld": Weld, "spring": Spring}
