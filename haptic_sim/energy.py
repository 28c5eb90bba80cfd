# SPDX-License-Identifier: Apache-2.0
"""Energy ledger of the simulated world [J], booked sub-step by sub-step, closed exchange by exchange.

Work supplied at the tool port is Σ force_on_tool · Δx, with the force really applied over a sub-step and the
displacement over that same sub-step; positive goes into the world. What is neither kinetic nor potential has been
dissipated: by contacts and stops, friction of joints with them, less what motors and belts give; by the sub-step's own
damping (½ Δvᵀ M Δv by backward difference) and dampers of springs; less what putting constraints right has put in. A
negative `dissipated` is energy the method has created, or a motor or a belt has given.

    supplied = Δkinetic + Δpotential + dissipated,      dissipated = contacts + numerical − correction
"""

from typing import NamedTuple


class Energy(NamedTuple):
    """Balance at the end of an exchange [J]; all but `kinetic` and `potential` since the start."""

    kinetic: float
    potential: float
    supplied: float
    """By the coupling, at the tool's port."""
    contacts: float
    """Taken by impacts, friction, stops and dry friction of joints; motors and belts give. Of `impulse`: all that is
    lost, but for numerical."""
    correction: float
    """Put in by putting joints and overlaps right, by `impulse` at the tool; negative where the motion was slowed down
    to make up for it."""
    dissipated: float
    """All that is neither supplied and still there nor was there at the start."""

    @property
    def numerical(self) -> float:
        """Lost to the sub-step's own damping and to dampers of springs; of `impulse`, by a tool that nothing pushes."""
        return self.dissipated - self.contacts + self.correction


class Ledger:
    """Adds up what the sub-steps booked, and closes the balance once per exchange."""

    def __init__(self, kinetic: float, potential: float):
        self._stored_at_start = kinetic + potential
        self.supplied = self.contacts = self.correction = 0.0
        self._lost = None
        self.balance = Energy(kinetic, potential, 0.0, 0.0, 0.0, 0.0)

    def book(self, supplied: float, contacts: float, correction: float, numerical: float | None = None) -> None:
        """What some sub-steps say of themselves [J]; with `numerical` said, contacts have taken what else is gone."""
        self.supplied += supplied
        self.contacts += contacts
        self.correction += correction
        if numerical is not None:
            self._lost = (self._lost or 0.0) + numerical

    def close(self, kinetic: float, potential: float) -> Energy:
        """Balance with the energies now stored [J]."""
        dissipated = self.supplied - (kinetic + potential - self._stored_at_start)
        if self._lost is not None:
            self.contacts = dissipated + self.correction - self._lost
        self.balance = Energy(kinetic, potential, self.supplied, self.contacts, self.correction, dissipated)
        return self.balance
