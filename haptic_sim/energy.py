# SPDX-License-Identifier: Apache-2.0
"""Energy ledger of the simulated world [J], kept exchange by exchange.

Work supplied at the tool port is Σ force_on_tool · Δx, with the force really applied over a sub-step and the
displacement over that same sub-step; positive goes into the world. What is neither kinetic nor potential has been
dissipated: friction, impacts, the sub-step's own damping (½ m |Δv|² by backward difference), less what pushing
overlaps apart has put in. A negative `dissipated` is energy the method has created.
"""

from typing import NamedTuple


class Energy(NamedTuple):
    """Balance at the end of an exchange [J]; `supplied` and `dissipated` since the start."""

    kinetic: float
    potential: float
    supplied: float
    dissipated: float


class Ledger:
    """Books work at the tool port and closes the balance once per exchange."""

    def __init__(self, kinetic: float, potential: float):
        self._stored_at_start = kinetic + potential
        self.supplied = 0.0
        self.balance = Energy(kinetic, potential, 0.0, 0.0)

    def supply(self, force_on_tool, before, after) -> None:
        """Book `force_on_tool` [N, N, N m] over the way from `before` to `after` [m, m, rad]."""
        (fx, fy, torque), (x0, y0, theta0), (x1, y1, theta1) = force_on_tool, before, after
        self.supplied += fx * (x1 - x0) + fy * (y1 - y0) + torque * (theta1 - theta0)

    def close(self, kinetic: float, potential: float) -> Energy:
        """Balance with the energies now stored [J]."""
        dissipated = self.supplied - (kinetic + potential - self._stored_at_start)
        self.balance = Energy(kinetic, potential, self.supplied, dissipated)
        return self.balance
