# SPDX-License-Identifier: Apache-2.0
"""Coordinate partitioning: generalized coordinates chosen at run time, contacts made and broken as constraints change.

Bodies that the coupling cannot reach go from event to event with exact impacts (`event_integration`); those within its
reach, and those whose own spring-dampers are too fast for the sub-step, are advanced by one backward difference with
coupling, joints, contacts and friction solved together (`implicit_step`), which is discrete-time passive at the tool's
port. Both stand on the same generalized coordinates (`linkage`) and the same direct solver of the contact problem
(`lcp`). Planar bodies, any linkage, open or closed; nothing is written for one scene.
"""

from haptic_sim.method.planar import PlanarWorld


class Partitioned(PlanarWorld):
    """A scene stepped by `sub_step` [s] in generalized coordinates."""

    passive = True
