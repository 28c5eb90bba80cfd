# SPDX-License-Identifier: Apache-2.0
"""The tool's end of the exchange methods: which handle the coupling pulls to, and what the port's energy may be.

A port moves the world: it says for each sub-step where the handle is that the coupling pulls to.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_device.config.parameters import EXCHANGE_METHODS, Exchange
from haptic_device.control import tool_side_tank
from haptic_sim.exchange import BUDGET, LIMITS, Limits
from haptic_sim.protocol import STILL, Coupling, Planar, StepResult, World

UNSHIPPED = Exchange.model_fields["tank"].default
"""Energy [J] that a device keeps before it ships any: the tool may have been given that much ahead."""


class HandleSample(NamedTuple):
    """State of the handle and gains, as the driver sends them.

    Attributes:
        time_ns: time of the sample [ns].
        position: of the handle in the world's frame [m, m, rad].
        velocity: of the handle [m/s, m/s, rad/s].
        stiffness: K of the coupling [N/m].
        damping: B of the coupling [N s/m].
        rotational_stiffness: K of the coupling about theta [N m/rad].
        rotational_damping: B of the coupling about theta [N m s/rad].
        energy: energy that the exchange method sends [J].
        limit: largest force of the coupling's spring on the hand [N, N, N m]; 0 where it is not told.

    Examples:
        >>> from haptic_sim.exchange.simulation import HandleSample
        >>> sample = HandleSample(1_000_000, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1000.0, 1.0, 1.0, 0.001)
        >>> sample.gains.stiffness
        1000.0
    """

    time_ns: int
    position: Planar
    velocity: Planar
    stiffness: float
    damping: float
    rotational_stiffness: float
    rotational_damping: float
    energy: float = 0.0
    limit: Planar = STILL

    @property
    def gains(self) -> Coupling:
        """The gains alone."""
        return Coupling(self.stiffness, self.damping, self.rotational_stiffness, self.rotational_damping)


class DirectPort:
    """The handle as it is said to be, whatever that does to the energy; what each call is for, at any port."""

    def rejoin(self) -> None:
        """A new session of the device: the next sample's sums are the new zero."""

    def restart(self) -> None:
        """A world at its start: as `rejoin`, with the energy that a world begins with; the sums sent go on."""

    def receive(self, handle: HandleSample, sub_step: float, inner: int = 1) -> Coupling:
        """Take what a handle sample ships; the gains to couple with over the next sub-steps [s] of `inner` steps."""
        return handle.gains

    def step(self, world: World, target: np.ndarray, n: int) -> StepResult:
        """Advance a world by `n` sub-steps, the handle wished on the way between its two rows."""
        return world.step(target, n)

    def send(self, supplied: float) -> float:
        """Energy that the tool sample tells [J]; supplied: at this port so far [J]."""
        return supplied

    def kept_back(self, handle: HandleSample) -> np.ndarray | None:
        """By how much of the handle's position and velocity (6) limit or energy keep the force short; None if not."""
        return None


class PspmPort:
    """The handle drawn nearer where its pull could supply more energy than the device has shipped.

    What is really supplied is taken from the tank, and what the tool gives back comes into it. The tank begins with
    what the largest pull needs that device and limits hold (control/tool_side_tank), and what the device keeps before
    it ships any; with the budget at most. Where that is short, the hand feels the tool so much nearer.

    limits: force [N], torque [N m] and fastest change of the force [N/s] on the tool by the device's samples.
    """

    def __init__(self, budget: float = BUDGET, limits: Limits = LIMITS):
        self.limits, self.rules, self.memory = limits, np.zeros(tool_side_tank.RULES), np.zeros(tool_side_tank.MEMORY)
        self._held = np.zeros((2, 6))  # target of a sub-step: the handle is kept where the tank lets it be
        self.budget, self.granted, self.returned = budget, 0.0, 0.0
        self._known: float | None = None
        self._told: tuple[Coupling, Planar] | None = None
        self._compile()

    def _compile(self) -> None:
        """Here, not in the first exchange."""
        way = np.zeros((2, 6))
        tool_side_tank.drive(self.rules, self.memory, STILL, STILL, STILL)
        tool_side_tank.worst(0.0, 0.0, 1.0)
        self.memory[:] = 0.0
        tool_side_tank.covers(self.rules, self.memory, way, STILL, 2)
        tool_side_tank.went(self.rules, self.memory, way, STILL)
        tool_side_tank.kept(np.ones(tool_side_tank.RULES), 0, 0.0)
        self.memory[:] = 0.0

    @property
    def tank(self) -> float:
        """Energy that the coupling may still supply [J]."""
        return float(self.memory[tool_side_tank.TANK])

    def rejoin(self) -> None:
        """The next sample's sum of energy is the new zero, and the pull begins at none; the tank keeps what it has."""
        self._known = None
        self.memory[[tool_side_tank.JOINED, tool_side_tank.PULL, tool_side_tank.PULL + 1, tool_side_tank.SHORT]] = 0.0

    def restart(self) -> None:
        """As `rejoin`, with a new reserve: what the world before had left, or had spent, is gone with it."""
        self.rejoin()
        self.memory[tool_side_tank.TANK] = self.granted = 0.0
        self._told = None  # the world may have another sub-step

    def receive(self, handle: HandleSample, sub_step: float, inner: int = 1) -> Coupling:
        """Energy shipped since the last sample goes into the tank."""
        known = handle.energy if self._known is None else self._known
        self.memory[tool_side_tank.TANK] += max(0.0, handle.energy - known)
        self._known = max(known, handle.energy)
        gains = handle.gains
        if (gains, handle.limit) != self._told:
            self._told = gains, handle.limit
            self._rule(gains, sub_step, inner, handle.limit)
            self._grant(*handle.limit)
        return gains

    def _rule(self, gains: Coupling, sub_step: float, inner: int, told: Planar) -> None:
        """Rules for these gains and this sub-step [s]; a torque may change as fast as a force does for its limit.

        Over a sub-step of n steps a spring supplies more than over one: with the stretch as it was at the start in each
        of them, which a world that shortens its moves may come to, as much as one of an n-th of its stiffness. Of
        more than four steps moves that are made before others that are not take more (control/tool_side_tank.py, λ);
        where the damping is too small for a bound there, the first counts.
        """
        stiff, damping, turning, turning_damping = gains
        force, torque, slew = self.limits
        self.rules[:] = (
            *(stiff, stiff, turning, damping, damping, turning_damping),
            _worst(stiff, damping, sub_step, inner),
            _worst(turning, turning_damping, sub_step, inner),
            *(force, torque),
            *(slew * sub_step, slew * sub_step * torque / force),
            *(sub_step / inner, inner),
            *told,
        )

    def _grant(self, x: float, y: float, turn: float) -> None:
        """Changes the reserve to what these limits of the device [N, N, N m] need; what is spent is not taken back."""
        force = min(self.limits.force, math.hypot(x, y)) if x > 0.0 or y > 0.0 else self.limits.force
        torque = min(self.limits.torque, turn) if turn > 0.0 else self.limits.torque
        needed = tool_side_tank.kept(self.rules, 0, force) + tool_side_tank.kept(self.rules, 1, torque) + UNSHIPPED
        change = max(min(self.budget, needed) - self.granted, -max(0.0, self.tank))
        self.granted += change
        self.memory[tool_side_tank.TANK] += change

    def step(self, world: World, target: np.ndarray, n: int) -> StepResult:
        """All at once where the tank covers the worst of it and no limit is near; else sub-step by sub-step."""
        if n < 2 or not tool_side_tank.covers(self.rules, self.memory, target, world.position, n):
            return self._one_by_one(world, target, n)
        made = world.step(target, n)
        tool_side_tank.went(self.rules, self.memory, target, world.position)
        self.memory[tool_side_tank.TANK] -= made.supplied
        return made

    def _one_by_one(self, world: World, target: np.ndarray, n: int) -> StepResult:
        """Sub-step by sub-step: each time `_drive` says where the handle is; what the coupling supplied is taken.

        The handle is held for a sub-step where it is in the mean of the steps that this is taken in.
        """
        made, early = None, 0.5 - 0.5 / world.inner
        start, end = target.tolist()
        for k in range(1, n + 1):
            self._held[:] = self._drive(*_between(start, end, (k - early) / n), world.position)
            one = world.step(self._held, 1)
            self.memory[tool_side_tank.TANK] -= one.supplied
            made = made.then(one) if made else one
        return made or StepResult()

    def _drive(self, position: Planar, velocity: Planar, tool: Planar) -> np.ndarray:
        """Position and velocity of the handle, as near to the tool as limits and tank ask for."""
        tool_side_tank.drive(self.rules, self.memory, position, velocity, tool)
        return self.memory[tool_side_tank.AIM : tool_side_tank.AIM + 6]

    def send(self, supplied: float) -> float:
        """All that was sent back so far: what the tank holds above its reserve."""
        over = max(0.0, self.tank - self.granted)
        self.memory[tool_side_tank.TANK] -= over
        self.returned += over
        return self.returned

    def kept_back(self, handle: HandleSample) -> np.ndarray | None:
        """What limit or tank made less of the handle's way to the tool at the last step's end; None for nothing."""
        if self.memory[tool_side_tank.SHORT] == 0.0:
            return None
        held = self.memory[tool_side_tank.AIM : tool_side_tank.AIM + 6]
        return np.array((*handle.position, *handle.velocity)) - held


Port = DirectPort | PspmPort
"""One exchange method at the tool."""


def port_of(method: str, budget: float = BUDGET, limits: Limits = LIMITS) -> Port:
    """The port of an exchange method; ValueError if there is none of this name."""
    if method not in EXCHANGE_METHODS:
        raise ValueError(f"exchange.method is {method}; there are {', '.join(EXCHANGE_METHODS)}")
    return DirectPort() if method == "direct" else PspmPort(budget, limits)


def _worst(stiffness: float, damping: float, sub_step: float, inner: int) -> float:
    """W of a sub-step of so many steps."""
    eased = 1.0 / inner - (0.25 if inner > 4 else 0.0)
    if eased * sub_step * stiffness + damping <= 0.0:
        eased = 1.0 / inner
    return tool_side_tank.worst(eased * stiffness, damping, sub_step)


def _between(start: list[float], end: list[float], share: float) -> tuple[Planar, Planar]:
    """Position and velocity at `share` of the way; exactly `end` at 1."""
    rest = 1.0 - share
    x, y, angle, vx, vy, turn = (rest * a + share * b for a, b in zip(start, end, strict=True))
    return (x, y, angle), (vx, vy, turn)
