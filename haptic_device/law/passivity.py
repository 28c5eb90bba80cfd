# SPDX-License-Identifier: Apache-2.0
"""Energy booked in the servo, and the least damping that a sampled wall needs."""

from haptic_device.kernel import kernel


@kernel
def least_damping(stiffness, damping, period):
    """Physical damping b [N s/m] above which wall or coupling is passive: KT/2 + |B| (Colgate 1995, eq. 3)."""
    return stiffness * period / 2.0 + abs(damping)


@kernel
def energy_booked(held_force, displacement, physical_damping, elapsed):
    """Energy given to the operator [J] over one hold: motor work less what the physical damper surely took.

    The force is the one really held, the displacement the one it was held over. Over that time the damper takes at
    least b dx²/dt, by Cauchy–Schwarz; without that credit every stiff spring looks active. Changes of the device's
    kinetic energy are not seen here.
    """
    if elapsed <= 0.0:
        return 0.0
    return held_force * displacement - physical_damping * displacement * displacement / elapsed
