# SPDX-License-Identifier: Apache-2.0
"""Where the set position of the coupling is wished for, after the tool's samples (Lee & Huang, IEEE Transactions on
Robotics 2010: passive set-position modulation). How far it goes the account says (control/account).
"""

import math

from haptic_device.jit import kernel

DAMPER_SLEW = 0.25  # share of the slew that the set position's velocity may make on top of it


@kernel
def predicted_position(position, velocity, age, horizon):
    """Where a tool that goes on as it did is now [m | rad]: first order, for at most the horizon [s]."""
    return position + velocity * min(horizon, max(0.0, age))


@kernel
def predicted_beside_handle(straight, handle, stretch, age, agility, trust):
    """Where a free tool is now: beside the handle, by the stretch of its last sample, which is believed less with age.

    A free tool goes where the handle goes, so that the handle's own motion foretells it without the error of
    acceleration · age²/2 that `straight`, the first-order place, is felt as a mass by. It stays within agility · age²/2
    of that place: what a tool is given credit for to have turned aside since. An old force is no damping but its
    opposite, share · K · age between handle and tool, and a resonance where the dampers there are do not take that:
    hence the share 1/(1 + (age/trust)²), with the trust [s] a damping over K.
    """
    reach = 0.5 * agility * age * age
    wanted = handle - stretch / (1.0 + (age / trust) ** 2) if trust > 0.0 else handle
    return min(straight + reach, max(straight - reach, wanted))


@kernel
def slewed(before, wanted, moved, reach):
    """Next set position: the wanted one, as far as it lies between staying, going along with the handle, and `reach`.

    before: the last one; moved: by which the handle has moved since. The force thus changes by no more than the
    handle's own motion makes of it and stiffness · reach.
    """
    low, high = before + min(0.0, moved) - reach, before + max(0.0, moved) + reach
    return min(high, max(low, wanted))


@kernel
def slewed_velocity(before, wanted, damping, slew, period):
    """Next velocity at which the damper pulls: the wanted one, as far as the damper's share of the slew lets it.

    damping [N s/m], slew [N/s].
    """
    reach = DAMPER_SLEW * slew * period / damping if damping > 0.0 else math.inf
    return min(before + reach, max(before - reach, wanted))
