# SPDX-License-Identifier: Apache-2.0
"""Contacts as springs and dampers by backward difference, solved together with coupling, joints and friction.

What section 5 of Colgate, Stanley & Brown (1995) was "currently investigating". A contact of stiffness k and damping c
is a row of the same complementarity problem as in `implicit_step`, with a diagonal that is its compliance over the
sub-step; stable for every k, m, h. A spring by backward difference only loses energy (½ k Δgap²), so it is passive
while contacts keep their features; an overlap so deep that another edge is nearer changes its spring, and may gain. So
it claims none.
"""

from haptic_sim.method.planar import PlanarWorld


class PenaltyImplicit(PlanarWorld):
    """A scene stepped by `sub_step` [s]; `stiffness` [N/m] and `damping` [N s/m] of a contact; without restitution."""

    passive = False
    contact = 1e5, 10.0
