# SPDX-License-Identifier: Apache-2.0
"""One exchange: a handle sample comes in, the world advances by whole sub-steps, a tool sample goes out.

Simulated time follows the handle's stamps: an exchange advances by the difference to the sample before, in whole
sub-steps, and carries the remainder in integer nanoseconds. Within it the handle moves on a straight line that ends at
the newest sample. Of more sub-steps than it may make the rest is left out: the world waits for so long, and says so.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from haptic_sim.exchange import Limits
from haptic_sim.exchange.local_contacts import LocalContacts
from haptic_sim.exchange.port import DirectPort, HandleSample, Port, port_of
from haptic_sim.method_registry import METHODS, make
from haptic_sim.protocol import Coupling, Planar, World, along
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.method_choice import short_step

SECOND = 1_000_000_000
Added = Callable[[Any], object]
"""Puts bodies into the `space` of a `haptic_sim.pymunk_world.world.PymunkWorld`."""


class ToolSample(NamedTuple):
    """The answer to one handle sample.

    Attributes:
        position: of the tool's grip [m, m, rad], as the hand is to feel it: nearer to the handle where limit or energy
            of the port keep the force short.
        velocity: of the tool [m/s, m/s, rad/s].
        force_on_tool: mean force of the coupling on the tool over the last sub-step [N, N, N m].
        contact: whether the tool was in contact during the exchange.
        energy: energy supplied at the tool's port so far [J], or what the exchange method sends.

    Examples:
        >>> from haptic_sim.exchange.simulation import HandleSample, Simulation
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> simulation = Simulation(reduce_scene(load("wall")))
        >>> first = simulation.exchange(HandleSample(0, (0.03, 0.0, 0.0), (0.0, 0.0, 0.0), 1000.0, 1.0, 1.0, 0.001))
        >>> first.position, first.contact
        ((0.03, 0.0, 0.0), False)
    """

    position: Planar
    velocity: Planar
    force_on_tool: Planar
    contact: bool
    energy: float


class Counters(NamedTuple):
    """Counts since the last reset.

    Attributes:
        exchanges: handle samples that were answered.
        sub_steps: sub-steps that the world made.
        rejoined: how often a handle sample started a new time base.
        max_contact_force: largest force of one pair of shapes [N].
        max_penetration: deepest overlap [m].
        left_out: contacts that were too many for the method; above 0 the motion can be wrong.
        waited_ns: time between handle samples that the world did not simulate [ns].
        short_ns: simulated time in which the port kept the force short [ns].

    Examples:
        >>> from haptic_sim.exchange.simulation import Simulation
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> Simulation(reduce_scene(load("wall"))).counters.exchanges
        0
    """

    exchanges: int = 0
    sub_steps: int = 0
    rejoined: int = 0
    max_contact_force: float = 0.0
    max_penetration: float = 0.0
    left_out: int = 0
    waited_ns: int = 0
    short_ns: int = 0


class Energy(NamedTuple):
    """Energy of the simulated world [J]; all but `kinetic` and `potential` since the start.

    supplied = Δkinetic + Δpotential + dissipated, and dissipated = contacts + numerical − correction.

    Attributes:
        kinetic: of all bodies now.
        potential: of gravity and springs now.
        supplied: work of the coupling on the tool.
        contacts: taken by impacts, friction, stops and dry friction of joints, less what motors and belts gave. With
            `impulse` it is all lost energy except `numerical`.
        correction: added by the correction of joints and overlaps; negative if the correction slowed the motion down.
        dissipated: energy supplied or present at the start that is no longer stored.

    Examples:
        >>> from haptic_sim.exchange.simulation import Simulation
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> balance = Simulation(reduce_scene(load("wall"))).ledger.balance
        >>> balance.kinetic, balance.supplied
        (0.0, 0.0)
    """

    kinetic: float
    potential: float
    supplied: float
    contacts: float
    correction: float
    dissipated: float

    @property
    def numerical(self) -> float:
        """Lost by damping of the sub-step and of springs; with `impulse` only by a tool that nothing pushes."""
        return self.dissipated - self.contacts + self.correction


class Ledger:
    """Energy of the simulated world [J], booked exchange by exchange; energy() says what is stored, kinetic, potential.

    Work supplied at the tool port is Σ force_on_tool · Δx, with the force really applied over a sub-step and the
    displacement over that same sub-step; positive goes into the world. What is neither kinetic nor potential has been
    dissipated: by contacts and stops, friction of joints with them, less what motors and belts give; by the sub-step's
    own damping (½ Δvᵀ M Δv by backward difference) and dampers of springs; less what putting constraints right has put
    in. A negative `dissipated` is energy the method has created, or a motor or a belt has given.

        supplied = Δkinetic + Δpotential + dissipated,      dissipated = contacts + numerical − correction
    """

    def __init__(self, energy: Callable[[], tuple[float, float]]):
        self._energy, self._stored_at_start = energy, sum(energy())
        self.supplied = self._contacts = self._correction = 0.0
        self._lost: float | None = None

    def book(self, supplied: float, contacts: float, correction: float, numerical: float | None = None) -> None:
        """What some sub-steps say of themselves [J]; with `numerical` said, contacts have taken what else is gone."""
        self.supplied += supplied
        self._contacts += contacts
        self._correction += correction
        if numerical is not None:
            self._lost = (self._lost or 0.0) + numerical

    @property
    def balance(self) -> Energy:
        """Balance with what is stored now; of the thread that steps the world."""
        kinetic, potential = self._energy()
        dissipated = self.supplied - (kinetic + potential - self._stored_at_start)
        contacts = self._contacts if self._lost is None else dissipated + self._correction - self._lost
        return Energy(kinetic, potential, self.supplied, contacts, self._correction, dissipated)


def kernels_of(reduced: ReducedScene, exchange_method: str) -> tuple[str, ...]:
    """Entries of kernels (haptic_display/run/kernels.py) that a simulation of this scene needs at its port."""
    local = ("local contacts",) if exchange_method == "local" else ()
    return "closed form", *METHODS[reduced.method].kernels, *local  # with the closed form come the ports


class Simulation:
    """A scene behind a tool port, which answers handle samples. Equal samples give identical results.

    Within an exchange the handle moves at constant speed from the last sample to the new one. Raises ValueError for a
    sub-step out of range, and for `added` bodies if the method has no space.

    Args:
        reduced: the scene.
        sub_step: step of the world [s]; by default that of `reduced`.
        max_catch_up: longest time between two handle samples that the world simulates [s]. A later sample, or one with
            an earlier time, starts a new time base.
        port: the exchange method at the tool; by default `direct`.
        added: function that adds your bodies to the `space` of the method `impulse`; it is called with the method at
            the start and after each reset.

    Examples:
        >>> from haptic_sim.exchange.simulation import HandleSample, Simulation
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> simulation = Simulation(reduce_scene(load("wall")))  # a wall at x = 0, a tool of radius 10 mm
        >>> still, gains = (0.0, 0.0, 0.0), (1000.0, 1.0, 1.0, 0.001)
        >>> for millisecond in range(2000):
        ...     x = max(0.005, 0.03 - 1e-4 * millisecond)
        ...     tool = simulation.exchange(HandleSample(1_000_000 * millisecond, (x, 0.0, 0.0), still, *gains))
        >>> print(f"tool at {1e3 * tool.position[0]:.3f} mm, {tool.force_on_tool[0]:.3f} N")  # K (x_handle - x_tool)
        tool at 10.000 mm, -5.000 N
    """

    def __init__(
        self,
        reduced: ReducedScene,
        sub_step: float | None = None,
        max_catch_up: float = 0.02,
        port: Port | None = None,
        added: Added | None = None,
    ):
        sub_step = reduced.sub_step if sub_step is None else sub_step
        self.scene, self.port, self._reduced = reduced.scene, port or DirectPort(), reduced
        self.method_name, self.why = reduced.method, reduced.reasons[0]
        self.sub_step_ns = round(sub_step * SECOND)
        self.max_catch_up_ns = round(max_catch_up * SECOND)
        if not 0 < self.sub_step_ns <= self.max_catch_up_ns:
            raise ValueError(f"sub_step is {sub_step} s; it must be above 0 and at most max_catch_up, {max_catch_up} s")
        if added is not None:  # what is added, nobody knows
            reduced = reduced._replace(inside=short_step(reduced.model))
        self.method: World = make(reduced.method, reduced, self.sub_step_ns / SECOND)
        if added is not None and not hasattr(self.method, "space"):
            raise ValueError(
                f"scene {self.scene.name!r} gets the method {reduced.method}, which takes no bodies of your own: "
                "write method: impulse in the scene, or start the node with method:=impulse"
            )
        self._added = added
        self._coupled: Coupling | None = None
        self.reset()

    @classmethod
    def by_parameters(cls, reduced: ReducedScene, values: dict[str, Any], added: Added | None = None) -> "Simulation":
        """A simulation with these parameters of haptic_simulation and its own port."""
        limits = Limits(*(values[f"port_{name}"] for name in Limits._fields))
        port = port_of(values["exchange.method"], values["port_budget"], limits)
        return cls(reduced, values["sub_step"] or None, values["max_catch_up"], port, added)

    def reset(self) -> None:
        """Resets bodies, energy and counters to the scene's start; the next handle sample starts a new time base."""
        self.method.reset()
        if self._added is not None:
            self._added(self.method)
        self.ledger = Ledger(self.method.energy)
        self.counters = Counters()
        self.rejoin()
        self.port.restart()

    def attach(self, port: Port) -> None:
        """Takes over a port from another world: the sums of the port continue, its energy starts again."""
        self.port, self._coupled = port, None
        port.restart()

    def rejoin(self) -> None:
        """The next handle sample starts a new time base (a new session of the device); the tool stays where it is."""
        self._last: HandleSample | None = None
        self._remainder_ns = 0
        self.port.rejoin()

    def exchange(self, handle: HandleSample, most: int | None = None) -> ToolSample:
        """Advances to the time of the handle sample and answers. Sub-steps beyond `most` are left out.

        Raises ValueError if a gain is negative or not finite.
        """
        gains = self.port.receive(handle, self.sub_step_ns / SECOND, self.method.inner)
        if gains != self._coupled:
            self.method.couple(gains)
            self._coupled = gains
        count = self._sub_steps_until(handle.time_ns, most)
        touched = self._advance(handle, count)
        self._last = handle
        exchanges, sub_steps = self.counters[:2]
        self.counters = Counters(exchanges + 1, sub_steps + count, *self.counters[2:])
        return self._sample(touched, self.port.kept_back(handle), count)

    @cached_property
    def local_contacts(self) -> LocalContacts:
        """What the tool can touch, for the exchange method `local`."""
        return LocalContacts(self._reduced, self.method)

    def measure(self) -> dict[str, float]:
        """What the scene reports: name → fraction."""
        return {name: measure.fraction(self.method.pose(measure.body)) for name, measure in self.scene.measure.items()}

    def _sub_steps_until(self, time_ns: int, most: int | None) -> int:
        if self._last is None:
            return 0
        passed = time_ns - self._last.time_ns
        if not 0 <= passed <= self.max_catch_up_ns:
            self._leave_out(max(0, passed + self._remainder_ns), rejoined=self.counters.rejoined + 1)
            return 0
        count, self._remainder_ns = divmod(passed + self._remainder_ns, self.sub_step_ns)
        if most is None or count <= most:
            return count
        self._leave_out((count - most) * self.sub_step_ns + self._remainder_ns)
        return most

    def _leave_out(self, time_ns: int, **counted: int) -> None:
        self._remainder_ns = 0
        self.counters = self.counters._replace(waited_ns=self.counters.waited_ns + time_ns, **counted)

    def _advance(self, handle: HandleSample, count: int) -> bool:
        if count == 0 or self._last is None:
            return self.method.touching
        target = along((self._last.position, self._last.velocity), (handle.position, handle.velocity))
        travelled = self.port.step(self.method, target, count)
        self.ledger.book(travelled.supplied, travelled.contacts, travelled.correction, travelled.numerical)
        counters = self.counters
        if (
            travelled.force > counters.max_contact_force
            or travelled.depth > counters.max_penetration
            or travelled.left_out
        ):
            self.counters = counters._replace(
                max_contact_force=max(travelled.force, counters.max_contact_force),
                max_penetration=max(travelled.depth, counters.max_penetration),
                left_out=counters.left_out + travelled.left_out,
            )
        return travelled.touched

    def _sample(self, touched: bool, kept_back: np.ndarray | None, count: int) -> ToolSample:
        """The tool as the hand is to feel it: where the pull to it is the one that it got."""
        position, velocity = self.method.position, self.method.velocity
        energy = self.port.send(self.ledger.supplied)
        if kept_back is not None:
            self.counters = self.counters._replace(short_ns=self.counters.short_ns + count * self.sub_step_ns)
            x, y, angle, vx, vy, turn = (np.array((*position, *velocity)) + kept_back).tolist()
            position, velocity = (x, y, angle), (vx, vy, turn)
        return ToolSample(position, velocity, self.method.force_on_tool, touched, energy)
