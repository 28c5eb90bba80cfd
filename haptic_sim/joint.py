# SPDX-License-Identifier: Apache-2.0
"""Words of the scene language for what holds bodies together: pins, sliders, welds, springs. Immutable, SI.

A joint's coordinate is 0 at the start. Of a pin it is the angle by which body b has turned against body a, counter-
clockwise; of a slider the way of body b along `axis` (given in the plane at the start, fixed in body a).
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from haptic_sim.geometry import turned
from haptic_sim.shape import Number, Part, Point, above_zero
from haptic_sim.solid import Solid

WORLD = "world"
"""Name of what does not move, for joints; its frame is the plane's."""
TOGETHER = 1e-6  # m; anchors nearer than this count as met: a scene file rounds its poses

Torque = Annotated[Number, above_zero("N m")]
Force = Annotated[Number, above_zero("N")]
Positive = Annotated[Number, Field(ge=0.0)]
_OWN = {
    "pin": ("limits", "friction_torque", "motor", "stiffness", "damping", "rest"),
    "slider": ("axis", "limits", "friction_force", "motor", "stiffness", "damping", "rest"),
    "weld": (),
    "spring": ("stiffness", "damping", "rest"),
}
_STRENGTH = {"pin": "max_torque", "slider": "max_force"}
_GENERAL = ("type", "name", "bodies", "at", "anchors", "collide")


class Motor(Part):
    """Moves body b against body a at `speed` along the joint's coordinate.

    Of a pin in rad/s with at most `max_torque` [N m], of a slider in m/s with at most `max_force` [N].
    """

    speed: Number
    max_torque: Torque | None = None
    max_force: Force | None = None


class Joint(Part):
    """Holds two bodies together at a point of the plane, `at`, or at a point of each body's own frame, `anchors`.

    `stiffness` and `damping` act on the joint's coordinate towards `rest` (pin: N m/rad; slider and spring: N/m), where
    a spring's rest is its distance at the start unless given. Joined bodies do not touch each other unless `collide`.
    """

    type: Literal["pin", "slider", "weld", "spring"]
    name: str = ""
    bodies: tuple[str, str]
    at: Point | None = None
    anchors: tuple[Point, Point] | None = None
    axis: Point | None = None
    limits: tuple[Number, Number] | None = None
    friction_torque: Positive = 0.0
    friction_force: Positive = 0.0
    motor: Motor | None = None
    stiffness: Positive = 0.0
    damping: Positive = 0.0
    rest: Number | None = None
    collide: bool = False

    @model_validator(mode="after")
    def _says_what_its_type_needs(self):
        for key in sorted(self.model_fields_set):
            if key not in _GENERAL + _OWN[self.type]:
                kinds = " and ".join(kind for kind, own in _OWN.items() if key in own)
                raise ValueError(f"a {self.type} has no {key}; that belongs to a {kinds}")
        if (self.at is None) == (self.anchors is None):
            raise ValueError("needs exactly one of at (a point of the plane) and anchors (a point of each body)")
        if self.bodies[0] == self.bodies[1]:
            raise ValueError(f"joins {self.bodies[0]!r} to itself; name two bodies")
        given = {key for key in _STRENGTH.values() if getattr(self.motor, key, None) is not None}
        if self.motor and given != {_STRENGTH[self.type]}:
            raise ValueError(
                f"the motor of a {self.type} is given by speed and {_STRENGTH[self.type]}, not by "
                f"{' and '.join(sorted(given)) or 'speed alone'}"
            )
        return self

    @model_validator(mode="after")
    def _can_move_and_hold(self):
        if self.type == "slider" and self.axis in (None, (0.0, 0.0)):
            raise ValueError("a slider needs an axis of some length")
        if self.limits and not self.limits[0] <= 0.0 <= self.limits[1]:
            raise ValueError(f"limits are {list(self.limits)}; they must enclose 0, which is where the joint starts")
        if self.type == "spring" and self.stiffness == self.damping == 0.0:
            raise ValueError("a spring needs a stiffness in N/m or a damping in N s/m")
        if self.type == "spring" and self.rest is not None and self.rest < 0.0:
            raise ValueError(f"rest is {self.rest}; the length of a spring must be at least 0 m")
        return self

    def places(self, a: Solid | None, b: Solid | None) -> tuple[Point, Point]:
        """Points of the plane [m] where the joint holds on to its bodies at the start; None is the world."""
        if self.at is not None:
            return self.at, self.at
        return tuple(
            turned(anchor, solid.pose) if solid else anchor for anchor, solid in zip(self.anchors, (a, b), strict=True)
        )

    @property
    def drive(self) -> tuple[float, float]:
        """Speed of the motor [rad/s | m/s] and its largest torque or force [N m | N]; without a motor 0, 0."""
        return (self.motor.speed, self.motor.max_torque or self.motor.max_force) if self.motor else (0.0, 0.0)

    @property
    def friction(self) -> float:
        """Coulomb friction against the joint's coordinate [N m | N]."""
        return self.friction_torque + self.friction_force
