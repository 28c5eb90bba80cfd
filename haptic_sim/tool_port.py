# SPDX-License-Identifier: Apache-2.0
"""The tool's end of the exchange methods: which handle the coupling pulls to, and what the port's energy may be.

Each sub-step `drive` gives the handle that the method couples the tool with, and `book` takes what came of it.
"""

import math
from typing import Protocol

from haptic_device.law import exchange, wave
from haptic_sim.method import Coupling, Planar

BUDGET = 0.05
"""Energy [J] the tool port may supply before any has been shipped, and keep; what is over goes back to the device."""


class Port(Protocol):
    """One exchange method at the tool."""

    def rejoin(self) -> None:
        """A new session of the device, or a world put back to its start: the next sample's sums are the new zero."""

    def receive(self, handle, sub_step: float) -> Coupling:
        """Take what a handle sample ships; the gains to couple with over the next sub-steps [s]."""

    def drive(self, position: Planar, velocity: Planar, tool: Planar) -> tuple[Planar, Planar]:
        """Handle position and velocity for the sub-step that starts with the tool there."""

    def book(self, force_on_tool: Planar, before: Planar, after: Planar) -> None:
        """Take the sub-step's force on the tool [N, N, N m] and the tool's way."""

    def send(self, force_on_tool: Planar, supplied: float) -> tuple[Planar, float]:
        """The effort and energy of the tool sample."""


class Direct:
    """The handle as it is said to be, whatever that does to the energy."""

    def rejoin(self) -> None:
        """Nothing is kept."""

    def receive(self, handle, sub_step: float) -> Coupling:
        """The device's gains."""
        return handle.gains

    def drive(self, position: Planar, velocity: Planar, tool: Planar) -> tuple[Planar, Planar]:
        """The handle as it is."""
        return position, velocity

    def book(self, force_on_tool: Planar, before: Planar, after: Planar) -> None:
        """Nothing is booked."""

    def send(self, force_on_tool: Planar, supplied: float) -> tuple[Planar, float]:
        """The force on the tool, and the energy supplied."""
        return force_on_tool, supplied


class Modulated:
    """The handle drawn nearer where its pull could supply more energy than the device has shipped.

    Over a sub-step h the coupling's force on one axis is a − (h K + B) v⁺ with a = K (x_h − x) + B v_h, and the energy
    it supplies, h (a − (h K + B) v⁺) v⁺, is at most h a²/4(h K + B), whatever contacts make of v⁺. As long as the tank
    holds that much, nothing need be done; else a is made smaller by the root of what is missing. What is then really
    supplied is taken from the tank, and what the tool gives back comes into it.
    """

    def __init__(self, budget: float = BUDGET):
        self.budget = self.tank = budget
        self.returned = 0.0
        self._known, self._gains, self._worst = None, None, (0.0, 0.0)

    def rejoin(self) -> None:
        """The next sample's sum of energy is the new zero; the tank keeps what it has."""
        self._known = None

    def receive(self, handle, sub_step: float) -> Coupling:
        """Energy shipped since the last sample goes into the tank."""
        known = handle.energy if self._known is None else self._known
        self.tank += max(0.0, handle.energy - known)
        self._known = max(known, handle.energy)
        if handle.gains != self._gains:
            self._gains = handle.gains
            stiff, damping, turning, turning_damping = self._gains
            self._worst = _worst(stiff, damping, sub_step), _worst(turning, turning_damping, sub_step)
        return handle.gains

    def drive(self, position: Planar, velocity: Planar, tool: Planar) -> tuple[Planar, Planar]:
        """The handle, as near to the tool as the tank asks for."""
        stiff, damping, turning, turning_damping = self._gains
        straight, around = self._worst
        (x, y, angle), (vx, vy, turn), (tx, ty, tilt) = position, velocity, tool
        ax, ay = stiff * (x - tx) + damping * vx, stiff * (y - ty) + damping * vy
        twist = turning * (angle - tilt) + turning_damping * turn
        most = straight * (ax * ax + ay * ay) + around * twist * twist
        if most <= self.tank:
            return position, velocity
        share = math.sqrt(max(0.0, self.tank) / most)
        nearer = tx + share * (x - tx), ty + share * (y - ty), tilt + share * (angle - tilt)
        return nearer, (share * vx, share * vy, share * turn)

    def book(self, force_on_tool: Planar, before: Planar, after: Planar) -> None:
        """What the coupling supplied leaves the tank."""
        (fx, fy, torque), (x0, y0, angle0), (x1, y1, angle1) = force_on_tool, before, after
        self.tank -= fx * (x1 - x0) + fy * (y1 - y0) + torque * (angle1 - angle0)

    def send(self, force_on_tool: Planar, supplied: float) -> tuple[Planar, float]:
        """The force on the tool, and all that was sent back so far: what the tank holds above the budget."""
        over = max(0.0, self.tank - self.budget)
        self.tank -= over
        self.returned += over
        return force_on_tool, self.returned


def _worst(stiffness, damping, sub_step):
    """h/4(h K + B) [J/N² | J/(N m)²]: energy of the worst tool motion in a sub-step for each pull at rest squared."""
    hold = sub_step * stiffness + damping
    return 0.25 * sub_step / hold if hold > 0.0 else 0.0


class Waves:
    """The tool pulled by the waves that have come: a force p − z v, which is a damper z to a handle at velocity p/z."""

    def __init__(self):
        self._last_ns = 0
        self._store, self._sent_energy = 0.0, 0.0
        self._sent, self._pending, self._come = [0.0] * 3, [0.0] * 3, None
        self._energy_come, self._rate = 0.0, [0.0] * 3
        self._impedance, self._sub_step = (1.0,) * 3, 1.0

    def rejoin(self) -> None:
        """The next sample's sums are the new zero, and nothing of the old ones is still to come."""
        self._come, self._pending, self._store = None, [0.0] * 3, 0.0

    def receive(self, handle, sub_step: float) -> Coupling:
        """What has come since the last sample is played over the time that the world now makes up."""
        if self._come is None:
            self._come, self._energy_come = handle.effort, handle.energy
        passed, self._last_ns = (handle.time_ns - self._last_ns) * 1e-9, handle.time_ns
        for i in range(3):
            self._pending[i] += handle.effort[i] - self._come[i]
            self._rate[i] = self._pending[i] / max(passed, sub_step)
        self._store += max(0.0, handle.energy - self._energy_come)
        self._come, self._energy_come = handle.effort, max(handle.energy, self._energy_come)
        line, turning = wave.impedance(handle.stiffness), wave.impedance(handle.rotational_stiffness)
        self._impedance, self._sub_step = (line, line, turning), sub_step
        return Coupling(0.0, line, 0.0, turning)

    def drive(self, position: Planar, velocity: Planar, tool: Planar) -> tuple[Planar, Planar]:
        """The waves of this sub-step as velocities."""
        waves = [wave.played(*both, self._sub_step) for both in zip(self._pending, self._rate, strict=True)]
        pairs = zip(waves, self._impedance, strict=True)
        energy = sum(wave.power(value, z) for value, z in pairs) * self._sub_step
        share = wave.covered(energy, self._store)
        self._store = max(0.0, self._store - share * share * energy)
        for i in range(3):
            self._pending[i] -= waves[i] * self._sub_step  # what energy does not cover is dropped, or it grows
            waves[i] *= share
        return tool, tuple(value / z for value, z in zip(waves, self._impedance, strict=True))

    def book(self, force_on_tool: Planar, before: Planar, after: Planar) -> None:
        """The waves that go back: q = u − z v."""
        for i in range(3):
            z = self._impedance[i]
            back = force_on_tool[i] - z * (after[i] - before[i]) / self._sub_step
            self._sent[i] += back * self._sub_step
            self._sent_energy += wave.power(back, z) * self._sub_step

    def send(self, force_on_tool: Planar, supplied: float) -> tuple[Planar, float]:
        """The sums of the waves sent and of their energy."""
        return tuple(self._sent), self._sent_energy


def port_of(method: str, budget: float = BUDGET) -> Port:
    """The port of an exchange method; ValueError if there is none of this name."""
    if method not in exchange.METHODS:
        raise ValueError(f"exchange.method is {method}; there are {', '.join(exchange.METHODS)}")
    return {"direct": Direct, "wave": Waves}[method]() if method in ("direct", "wave") else Modulated(budget)
