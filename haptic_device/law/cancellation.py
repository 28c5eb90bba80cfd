# SPDX-License-Identifier: Apache-2.0
"""Damping cancellation: negative virtual damping in free space against the device's own (Colgate 1995, section 3)."""

from haptic_device.kernel import kernel
from haptic_device.parameter import Parameter

PARAMETERS = (
    Parameter("cancellation.ratio", 0.0, "", "part of the physical damping cancelled in free space", 0.0, 0.98, True),
    Parameter("cancellation.band", 0.005, "m", "distance before a wall over which it fades out", 1e-5, 1.0, True),
    Parameter("cancellation.stretch", 0.001, "m", "coupling stretch at which it is faded out", 1e-6, 1.0, True),
)


@kernel
def cancellation_fade(clearance, band, stretch, stretch_limit):
    """Factor 0…1: full in free space, none at a wall or with the coupling stretched.

    clearance: distance to the nearest wall [m] (inf without walls); stretch: of the coupling [m]. Cancelling inside a
    wall as well would need b(1 − ratio) > KT/2 there.
    """
    before_wall = min(1.0, max(0.0, clearance / band))
    unstretched = min(1.0, max(0.0, 1.0 - stretch / stretch_limit))
    return before_wall * unstretched


@kernel
def cancellation_force(ratio, damping, velocity):
    """Force on the handle along its motion [N | N m] that cancels this part of the physical damping b."""
    return ratio * damping * velocity
