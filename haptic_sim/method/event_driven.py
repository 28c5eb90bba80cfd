# SPDX-License-Identifier: Apache-2.0
"""From event to event, the tool too: the coupling is a force along the hand's straight way between two samples.

The same generalized coordinates, contact problem and impacts as `partitioned`, but nothing is held by a backward
difference: order 8 while nothing touches, 4 in contact, instants of contact, parting, sticking and slipping found
(`event_integration`, `event`). What the coupling supplies is integrated with the motion, so the ledger is as exact. It
is the method for references, for replay and for whatever has no hand on it: section 4 of Colgate, Stanley & Brown
(1995) asks for coupling and environment by backward difference, and an environment that is nearer to the continuous one
is, seen from the sampled port, not discrete-time passive.
"""

from haptic_sim.method.planar import PlanarWorld


class EventDriven(PlanarWorld):
    """A scene stepped by at most `sub_step` [s], cut short by events."""

    passive = False
    by_events = True
