# SPDX-License-Identifier: Apache-2.0
"""What every simulation method is to those who use it: a `World` that is stepped along a handle's way.

Vectors are planar, (x, y, theta).
"""

import math
from typing import NamedTuple, Protocol

import numpy as np

from haptic_sim.scene.language import Scene

Planar = tuple[float, float, float]
STILL: Planar = (0.0, 0.0, 0.0)


class Coupling(NamedTuple):
    """Gains of the virtual coupling: N/m, N s/m, N m/rad, N m s/rad."""

    stiffness: float = 0.0
    damping: float = 0.0
    rotational_stiffness: float = 0.0
    rotational_damping: float = 0.0

    def checked(self) -> "Coupling":
        """These gains; ValueError if one is negative or not finite."""
        for name, gain in self._asdict().items():
            if not 0.0 <= gain < math.inf:
                raise ValueError(f"coupling {name} is {gain}; it must be finite and at least 0")
        return self


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
    """What happened over several sub-steps."""

    supplied: float = 0.0
    """Energy that the coupling supplied to the tool [J]."""
    touched: bool = False
    """Whether a contact pushed the tool."""
    force: float = 0.0
    """Largest mean force of one pair of shapes over a sub-step [N]."""
    depth: float = 0.0
    """Deepest overlap [m]."""
    left_out: int = 0
    """Contacts that were too many to be solved for."""
    contacts: float = 0.0
    """Energy that impacts, friction and stops have taken, less what motors and belts gave [J]."""
    correction: float = 0.0
    """Energy that putting constraints right has put in [J]; this and `contacts` are 0 where a method cannot tell."""
    numerical: float | None = None
    """Where contacts cannot be told from the rest: what the sub-steps' own damping has lost [J]; the rest is theirs."""

    def then(self, later: "StepResult") -> "StepResult":
        """This and what happened after it."""
        lost = self.numerical if later.numerical is None else (self.numerical or 0.0) + later.numerical
        return StepResult(
            self.supplied + later.supplied,
            self.touched or later.touched,
            max(self.force, later.force),
            max(self.depth, later.depth),
            self.left_out + later.left_out,
            self.contacts + later.contacts,
            self.correction + later.correction,
            lost,
        )


class World(Protocol):
    """A scene with a tool in it, advanced sub-step by sub-step, the coupling solved within. One thread may use it."""

    scene: Scene
    sub_step: float
    """s"""
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
        """Take these gains from the next sub-step on; ValueError if one is negative or not finite."""

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """Advance `n` sub-steps from each row of the handle's way to the next.

        target: (m, 6), position [m, m, rad] and velocity; in between the handle goes evenly on straight lines.
        """

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, in an order that depends on the motion alone."""

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of every moving body's mass centre at the end of the sub-step, as in the reduced model."""

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of all bodies [J], with the tool's true mass."""


def along(*rows: tuple[Planar, Planar]) -> np.ndarray:
    """Target of a handle that has these positions and velocities in turn."""
    return np.array([(*position, *velocity) for position, velocity in rows], float)


def held(position: Planar, velocity: Planar = STILL) -> np.ndarray:
    """Target of a handle that is kept at a position and velocity."""
    return along((position, velocity), (position, velocity))
