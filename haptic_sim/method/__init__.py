# SPDX-License-Identifier: Apache-2.0
"""Simulation methods: one file each, all behind the protocol below. Vectors are planar, (x, y, theta)."""

from typing import NamedTuple, Protocol

Planar = tuple[float, float, float]


class Coupling(NamedTuple):
    """Gains of the virtual coupling: N/m, N s/m, N m/rad, N m s/rad."""

    stiffness: float = 0.0
    damping: float = 0.0
    rotational_stiffness: float = 0.0
    rotational_damping: float = 0.0


class Contact(NamedTuple):
    """One pair of shapes that pressed on each other in the last sub-step; body a is the tool, or earlier in the scene.

    `point` [m] lies midway between the touching points, `normal` points from body a to body b, `force_on_a` [N] is the
    mean over the sub-step, `depth` [m] the deepest overlap at its start.
    """

    body_a: str
    body_b: str
    point: tuple[float, float]
    normal: tuple[float, float]
    force_on_a: tuple[float, float]
    depth: float


class StepResult(NamedTuple):
    """What happened over several sub-steps.

    Energy supplied to the tool by the coupling [J], whether a contact pushed the tool, the largest mean force of one
    pair of shapes over a sub-step [N], the deepest overlap [m], how many contacts were too many to be solved for;
    energy that impacts, friction, stops (and motors and belts, which give it) have taken, and that putting constraints
    right has put in [J], both 0 where a method cannot tell them from the rest.
    """

    supplied: float
    touched: bool
    force: float
    depth: float
    left_out: int = 0
    contacts: float = 0.0
    correction: float = 0.0
    numerical: float | None = None
    """Where contacts cannot be told from the rest: what the sub-steps' own damping has lost [J]; the rest is theirs."""


class Method(Protocol):
    """A world with a tool in it that is advanced sub-step by sub-step, the coupling solved within.

    One compiled as a whole also offers `follow(path, count) -> StepResult`: `travel` from each row of a path (n, 6:
    position, velocity) to the next.
    """

    passive: bool
    """Whether it is discrete-time passive at the tool's port: Σ force_on_tool · Δx is never less than the world has
    gained, whatever the handle does, beyond what its motors and belts work and rounding: contact force times the
    1e-12 m that count as touching."""
    inner: int
    """Equal steps that it takes within a sub-step."""
    position: Planar
    """Tool's grip at the end of the sub-step [m, m, rad]."""
    velocity: Planar
    """Tool's velocity at the end of the sub-step [m/s, m/s, rad/s]."""
    force_on_tool: Planar
    """What the coupling applied to the tool over the sub-step, its mean [N, N, N m]."""
    touching: bool
    """Whether a contact pushed the tool during the sub-step."""

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""

    def couple(self, coupling: Coupling) -> None:
        """Take these gains from the next sub-step on."""

    def step(self, handle_position: Planar, handle_velocity: Planar) -> None:
        """Advance one sub-step; the arguments are the handle's at its end."""

    def travel(
        self, start: Planar, start_velocity: Planar, end: Planar, end_velocity: Planar, count: int
    ) -> StepResult:
        """Advance `count` sub-steps, the handle going on a straight line from start (exclusive) to end."""

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, in an order that depends on the motion alone."""

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of every moving body's mass centre at the end of the sub-step, as in the compiled model."""

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of all bodies [J], with the tool's true mass."""
