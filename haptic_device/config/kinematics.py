# SPDX-License-Identifier: Apache-2.0
"""Linkages in closed form: joints to handle and back. `haptic_device/control/linkage` compiles the same functions.

Angles [rad] are counter-clockwise from x, places [m] in the linkage's own frame, whose 0 is the first motor. A pose is
(x, y, ∂x/∂a, ∂x/∂b, ∂y/∂a, ∂y/∂b, c): c is how far from singular it is, the least sine of the angles that must not
close, 1 at best. c ≤ 0: the linkage cannot be there, or is assembled another way. Campion, Wang & Hayward 2005 have the
five bars; signs are of our own derivation, which tests hold against finite differences.
"""

import math
from itertools import product
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from haptic_device.config.refusal import Part, Unit

Length = Annotated[float, Field(gt=0.0, le=10.0, allow_inf_nan=False, strict=True), Unit("m")]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
KINDS = "cartesian", "sector_pulley", "five_bar", "serial_2r"
CARTESIAN, SECTOR_PULLEY, FIVE_BAR, SERIAL_2R = range(4)
JOINTS = 0, 1, 2, 2  # of each kind
SINGULAR, CLEAR = 0.05, 0.15  # c up to which no force is made, and from which all of it
GRID = 21  # places of a workspace that are looked at, along each axis


def pose(link: Any, a: float, b: float) -> Any:
    """Pose of a linkage, a Kinematics or a LINKAGE record, at its joint angles.

    Of two links in a row b is the second's angle from the first, and assembly the sign of b. The arms of five bars have
    their motors at (0, 0) and (base, 0), and their distal links meet at the handle: for assembly 1 to the left of the
    line from the first elbow to the second, for −1 to the right. The elbows point outwards.
    """
    if link.kind == SECTOR_PULLEY:
        return link.travel * a, 0.0, link.travel, 0.0, 0.0, 0.0, 1.0
    proximal, distal, assembly = link.proximal, link.distal, link.assembly
    ax, ay = proximal * math.cos(a), proximal * math.sin(a)
    if link.kind == SERIAL_2R:
        u, v = distal * math.cos(a + b), distal * math.sin(a + b)
        return ax + u, ay + v, -ay - v, -v, ax + u, u, assembly * math.sin(b)
    bx, by = link.base + proximal * math.cos(b), proximal * math.sin(b)
    dx, dy = bx - ax, by - ay
    h = math.sqrt(dx * dx + dy * dy)
    square = distal * distal - 0.25 * h * h
    if h <= 0.0 or square <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    along = assembly * math.sqrt(square) / h
    x, y = ax + 0.5 * dx - along * dy, ay + 0.5 * dy + along * dx
    # unit vectors along the distal links, and what of each proximal link's motion is along it
    ex, ey, fx, fy = (x - ax) / distal, (y - ay) / distal, (x - bx) / distal, (y - by) / distal
    at, bt = ey * math.cos(a) - ex * math.sin(a), fy * math.cos(b) - fx * math.sin(b)
    cross = ex * fy - ey * fx
    p, q = proximal * at / cross, proximal * bt / cross
    c = min(assembly * cross, min(-assembly * at, assembly * bt))
    return x, y, p * fy, -q * ey, -p * fx, q * ex, c


def angles(link: Any, x: float, y: float) -> Any:
    """Joint angles (a, b) at a place, and c as of the pose: at most 0 where there are none."""
    if link.kind == SECTOR_PULLEY:
        return x / link.travel, 0.0, 1.0
    base, proximal, distal, assembly = link.base, link.proximal, link.distal, link.assembly
    if link.kind == SERIAL_2R:
        cosine = (x * x + y * y - proximal * proximal - distal * distal) / (2.0 * proximal * distal)
        if abs(cosine) >= 1.0:
            return 0.0, 0.0, 0.0
        b = assembly * math.acos(cosine)
        sine = math.sin(b)
        return math.atan2(y, x) - math.atan2(distal * sine, proximal + distal * cosine), b, assembly * sine
    r, s = math.sqrt(x * x + y * y), math.sqrt((x - base) * (x - base) + y * y)
    if min(r, s) <= 0.0:
        return 0.0, 0.0, 0.0
    first = (proximal * proximal + r * r - distal * distal) / (2.0 * proximal * r)
    second = (proximal * proximal + s * s - distal * distal) / (2.0 * proximal * s)
    if max(abs(first), abs(second)) >= 1.0:
        return 0.0, 0.0, 0.0
    a = math.atan2(y, x) + assembly * math.acos(first)
    b = math.atan2(y, x - base) - assembly * math.acos(second)
    # the elbows, and on which side of them this place is
    ax, ay = proximal * math.cos(a), proximal * math.sin(a)
    bx, by = base + proximal * math.cos(b), proximal * math.sin(b)
    ex, ey, fx, fy = (x - ax) / distal, (y - ay) / distal, (x - bx) / distal, (y - by) / distal
    at, bt = ey * math.cos(a) - ex * math.sin(a), fy * math.cos(b) - fx * math.sin(b)
    return a, b, min(assembly * (ex * fy - ey * fx), min(-assembly * at, assembly * bt))


NEEDS = {
    "cartesian": (),
    "sector_pulley": ("handle_radius", "sector_radius", "pulley_radius"),
    "five_bar": ("base", "proximal", "distal"),
    "serial_2r": ("proximal", "distal"),
}
LENGTHS = tuple(dict.fromkeys(name for names in NEEDS.values() for name in names))


class Kinematics(Part):
    """How joints move the handle.

    Attributes:
        type: cartesian (each motor moves an axis), sector_pulley, five_bar or serial_2r.
        base (float): five_bar: x of the second motor [m].
        proximal, distal (float): lengths of the links at the motors, and of those at the handle [m].
        handle_radius, sector_radius, pulley_radius (float): sector_pulley; the joint is the motor's pulley [m].
        assembly: 1 or −1: which of both ways it is put together (five_bar, serial_2r).
        origin (tuple[float, float]): place in the linkage's frame that is x = y = 0 of the handle [m].

    Examples:
        >>> from haptic_device.config.kinematics import Kinematics
        >>> arms = Kinematics(type="five_bar", base=0.038, proximal=0.07, distal=0.09)
        >>> [round(1e3 * value, 6) for value in arms.pose(math.radians(168.0), math.radians(12.0))[:2]]  # [mm]
        [19.0, 35.742046]
    """

    type: Literal["cartesian", "sector_pulley", "five_bar", "serial_2r"] = "cartesian"
    base: Annotated[float, Field(ge=0.0, le=10.0, allow_inf_nan=False, strict=True), Unit("m")] | None = None
    proximal: Length | None = None
    distal: Length | None = None
    handle_radius: Length | None = None
    sector_radius: Length | None = None
    pulley_radius: Length | None = None
    assembly: Literal[1, -1] = 1
    origin: Annotated[tuple[Number, Number], Unit("m")] = (0.0, 0.0)

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        given, needed = [name for name in LENGTHS if getattr(self, name) is not None], NEEDS[self.type]
        if missing := [name for name in needed if name not in given]:
            raise ValueError(f"{missing[0]} is missing; a {self.type} needs {', '.join(needed)}")
        if unknown := [name for name in given if name not in needed]:
            raise ValueError(f"a {self.type} has no {unknown[0]}")
        base, *arm = (getattr(self, name) for name in NEEDS["five_bar"])
        if self.type == "five_bar" and base >= 2.0 * sum(arm):
            raise ValueError(
                f"base is {base:g} m; arms of {sum(arm):g} m never meet: the limit is {2.0 * sum(arm):g} m"
            )
        return self

    @property
    def kind(self) -> int:
        """Place of its type in KINDS."""
        return KINDS.index(self.type)

    @property
    def joints(self) -> int:
        """How many joints there are; 0 where each motor moves an axis."""
        return JOINTS[self.kind]

    @property
    def motors(self) -> tuple[float, ...]:
        """x of the motors that bear an arm [m]; of two links in a row, of the first."""
        return () if self.proximal is None else (0.0,) if self.base is None else (0.0, self.base)

    @property
    def travel(self) -> float:
        """Way of the handle per turn of a sector pulley's motor [m/rad]."""
        handle, sector, pulley = (getattr(self, name) for name in NEEDS["sector_pulley"])
        return float(handle * pulley / sector) if self.type == "sector_pulley" else 0.0

    def pose(self, *joints: float) -> tuple[float, ...]:
        """(x, y, ∂x/∂a, ∂x/∂b, ∂y/∂a, ∂y/∂b, c) at these joint angles [rad]; c ≤ 0: it cannot be there."""
        return pose(self, joints[0], joints[-1])

    def angles(self, x: float, y: float = 0.0) -> tuple[tuple[float, ...], float]:
        """Joint angles [rad] at a place of the linkage's frame, and c of its pose: ≤ 0: it cannot be there."""
        *found, c = angles(self, x, y)
        return tuple(found[: self.joints]), c

    def jacobian(self, *joints: float) -> list[list[float]]:
        """∂place/∂joints by rows x[, y] at these joint angles [m/rad], as many of both as there are joints."""
        count, (_, _, xa, xb, ya, yb, _) = self.joints, self.pose(*joints)
        return [[xa, xb][:count], [ya, yb][:count]][:count]

    def arms(self, *joints: float) -> list[list[tuple[float, float]]]:
        """Motor and elbow of each arm at these joint angles [m]."""
        length, each = self.proximal or 0.0, zip(self.motors, joints, strict=False)
        return [[(x, 0.0), (x + length * math.cos(angle), length * math.sin(angle))] for x, angle in each]

    def grid(self, workspace: tuple[tuple[float, float], ...]) -> list[tuple[float, ...]]:
        """Places (x[, y]) of a workspace of the handle that are looked at, its corners among them."""
        steps = [[low + (high - low) * i / (GRID - 1) for i in range(GRID)] for low, high in workspace]
        return list(product(*steps))
