# SPDX-License-Identifier: Apache-2.0
"""Contacts as springs and dampers, stepped explicitly: the paper's first class of simulations (section 5).

Here to be compared with: "using penalty methods and explicit integration, it is essentially impossible to guarantee
stability". It creates energy, lets thin walls through and picks its constraint from the deepest overlap;
`penalty_kernel` says where it is stable. Not discrete-time passive.
"""

from haptic_sim.method.penalty_kernel import penalty_steps
from haptic_sim.method.planar import PlanarWorld


class PenaltyExplicit(PlanarWorld):
    """A scene stepped by `sub_step` [s]; `stiffness` [N/m] and `damping` [N s/m] of a contact; without restitution."""

    passive = False
    contact = 1e4, 5.0
    advance = staticmethod(penalty_steps)
