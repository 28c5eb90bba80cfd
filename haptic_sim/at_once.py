# SPDX-License-Identifier: Apache-2.0
"""The ordinary exchange in one compiled call: the bytes of a `handle` message in, the bytes of its answer out.

Most samples are ordinary (method/ordinary.py), and a turn of Python takes some 50 us, nearly all of it the interpreter
that wakes up to it. Python answers whatever else comes, refusals too, and lends its state for the next one.
"""

import numpy as np

from haptic_sim.method import ordinary
from haptic_sim.method.closed_form import ClosedForm
from haptic_sim.method.ordinary import HEAD, STATE
from haptic_sim.simulation import Simulation
from haptic_sim.tool_port import Modulated


class AtOnce:
    """Answers ordinary samples of a simulation. layout: of messages with as many axes as the device has."""

    def __init__(self, simulation: Simulation, layout, axes: int):
        self._simulation, self._drawn = simulation, (simulation.port.rules, simulation.port.memory)
        self._in, self._out, mask = (_aligned(layout.size) for _ in range(3))
        self._out[:], mask[:] = np.frombuffer(layout.template, np.uint8), 0xFF * layout.fixed
        self._fixed = np.stack([one[HEAD:].view(np.uint64) for one in (self._out, mask)])
        self._fixed[0] &= self._fixed[1]
        self.state, self._heard_ns = np.zeros(1, STATE), 0
        self.state["axes"], self.state["first"] = axes, [(offset - HEAD) // 8 for offset in layout.offsets]

    def borrow(self, messages, tail) -> None:
        """Go on from where simulation and port of messages are, which have just answered a sample with this tail."""
        record = self.state[0]
        for owner in (self._simulation, self._simulation.port, self._simulation.method, messages):
            owner.lend(record)
        record["tail"], record["lent"] = tail, 1

    def answer(self, data: bytes, now_ns: int) -> bytes | None:
        """The answer to an ordinary sample that arrived at `now_ns`; None for any other, and nothing has happened."""
        given = np.frombuffer(data, np.uint8)
        if not ordinary.answer(given, self._in, self._fixed, self._out, self.state, *self._drawn):
            return None
        self._heard_ns = now_ns
        return self._out.tobytes()

    def give_back(self, messages) -> None:
        """Tell the objects how things stand; it can go on from there."""
        record = self.state[0]
        for owner in (self._simulation.port, self._simulation.method, self._simulation):
            owner.take_back(record)
        messages.take_back(record, self._heard_ns)


def is_for(simulation: Simulation) -> bool:
    """Whether this is a tool in closed form behind a port of energy."""
    return isinstance(simulation.method, ClosedForm) and isinstance(simulation.port, Modulated)


def compile_for(simulation: Simulation, layout) -> None:
    """Compile what answers at once, if this simulation can use it; with the first sample it would be too late."""
    if is_for(simulation):
        AtOnce(simulation, layout, 1).answer(bytes(layout.size), 0)


def _aligned(size):
    """uint8 array whose byte behind the head lies on an 8-byte boundary."""
    room = np.zeros(size + 16, np.uint8)
    start = -(room.ctypes.data + HEAD) % 8
    return room[start : start + size]
