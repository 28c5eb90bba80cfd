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
    """Gains of the virtual coupling.

    Attributes:
        stiffness: K in x and y [N/m].
        damping: B in x and y [N s/m].
        rotational_stiffness: K about theta [N m/rad].
        rotational_damping: B about theta [N m s/rad].

    Examples:
        >>> from haptic_sim.protocol import Coupling
        >>> Coupling(-1.0).checked()
        Traceback (most recent call last):
            ...
        ValueError: coupling stiffness is -1.0; it must be finite and at least 0
    """

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
    """One pair of shapes that pressed on each other in the last sub-step.

    Attributes:
        body_a: the tool, or the body that comes first in the scene.
        body_b: the other one.
        point: midway between the touching points [m, m].
        normal: unit vector from body a to body b.
        force_on_a: mean force on body a over the sub-step [N, N]; body b gets the opposite.
        depth: deepest overlap at the start of the sub-step [m].

    Examples:
        >>> from haptic_sim.method_registry import make
        >>> from haptic_sim.protocol import Coupling, held
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> world = make("closed_form", reduce_scene(load("wall")), 0.001)
        >>> world.couple(Coupling(1000.0, 1.0, 1.0, 0.001))
        >>> _ = world.step(held((0.005, 0.0, 0.0)), 3000)
        >>> [(one.body_a, one.body_b, round(one.force_on_a[0], 6)) for one in world.contacts()]
        [('tool', 'wall', 5.0)]
    """

    body_a: str
    body_b: str
    point: tuple[float, float]
    normal: tuple[float, float]
    force_on_a: tuple[float, float]
    depth: float


class StepResult(NamedTuple):
    """Sums and largest values over several sub-steps.

    Attributes:
        supplied: energy that the coupling supplied to the tool [J].
        touched: whether a contact pushed the tool.
        force: largest mean force of one pair of shapes over a sub-step [N].
        depth: deepest overlap [m].
        left_out: contacts that were too many for the method.
        contacts: energy that impacts, friction and stops have taken, less what motors and belts gave [J].
        correction: energy that the correction of constraints has added [J]. This and `contacts` are 0 if a method does
            not know them.
        numerical: energy lost by the damping of the sub-steps [J], if contacts cannot be separated from the rest; else
            None.

    Examples:
        >>> from haptic_sim.protocol import StepResult
        >>> StepResult(supplied=0.1, force=2.0).then(StepResult(supplied=0.2, force=1.0)).force
        2.0
    """

    supplied: float = 0.0
    touched: bool = False
    force: float = 0.0
    depth: float = 0.0
    left_out: int = 0
    contacts: float = 0.0
    correction: float = 0.0
    numerical: float | None = None

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
    """Protocol of a simulation method: it advances a scene with a tool, together with the coupling, by sub-steps.

    A method is a class with these members. Its arguments are a ReducedScene and a sub-step [s]. Only one thread may use
    it.

    Attributes:
        scene: the scene.
        sub_step: [s].
        passive: whether it is discrete-time passive at the tool's port. Then Σ force_on_tool · Δx is never less than
            the energy that the world has gained, for any motion of the handle. The only exceptions are the work of
            motors and belts, and a small error: contact force times 1e-12 m, the overlap that counts as touching.
        inner: number of equal steps within a sub-step.
        position: of the tool's grip at the end of the sub-step [m, m, rad].
        velocity: of the tool [m/s, m/s, rad/s].
        force_on_tool: mean force of the coupling on the tool over the sub-step [N, N, N m].
        touching: whether a contact pushed the tool during the sub-step.

    Examples:
        >>> from haptic_sim.method_registry import make
        >>> from haptic_sim.protocol import Coupling, held
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> world = make("closed_form", reduce_scene(load("wall")), 0.001)  # a wall at x = 0, a tool of radius 10 mm
        >>> world.couple(Coupling(1000.0, 1.0, 1.0, 0.001))
        >>> _ = world.step(held((0.005, 0.0, 0.0)), 3000)
        >>> print(f"{world.position[0]:.6f} m, {world.force_on_tool[0]:.6f} N")  # K (x_handle - x_tool)
        0.010000 m, -5.000000 N
    """

    scene: Scene
    sub_step: float
    passive: bool
    inner: int
    position: Planar
    velocity: Planar
    force_on_tool: Planar
    touching: bool

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""

    def couple(self, coupling: Coupling) -> None:
        """Takes these gains from the next sub-step on. Raises ValueError if one is negative or not finite."""

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """Advance `n` sub-steps from each row of the handle's way to the next.

        target: (m, 6), position [m, m, rad] and velocity; between two rows the handle moves on a straight line at
            constant speed.
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
    """Target of a handle with these positions and velocities one after the other: an array (rows, 6).

    Args:
        rows: a position [m, m, rad] and a velocity [m/s, m/s, rad/s] each.

    Examples:
        >>> from haptic_sim.protocol import STILL, along
        >>> along(((0.0, 0.0, 0.0), STILL), ((0.001, 0.0, 0.0), STILL)).shape
        (2, 6)
    """
    return np.array([(*position, *velocity) for position, velocity in rows], float)


def held(position: Planar, velocity: Planar = STILL) -> np.ndarray:
    """Target of a handle with a constant position [m, m, rad] and velocity: an array (2, 6).

    Args:
        position: of the handle [m, m, rad].
        velocity: of the handle [m/s, m/s, rad/s].

    Examples:
        >>> from haptic_sim.protocol import held
        >>> print(held((0.01, 0.0, 0.0))[:, 0])
        [0.01 0.01]
    """
    return along((position, velocity), (position, velocity))
