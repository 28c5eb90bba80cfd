# SPDX-License-Identifier: Apache-2.0
"""Wave variables between coupling and tool (Niemeyer & Slotine 1991; Stramigioli et al. 2002 for the sampled port).

The port: force u on the tool and its backward-difference velocity v, impedance z. With p = u + z v (towards the tool)
and q = u − z v (back), the power into the tool is u v = (p² − q²)/4z, exactly also for the sampled port: the wave that
comes back holds energy only if it was sent. What is carried is not the wave but two sums since the sender's start,

    the integral Σ p T [N s] of each axis, and the energy Σ p² T/4z [J] of all axes,

so that lost, late, repeated and reordered samples lose nothing. The receiver plays out what has come as waves of its
own: `played` empties the integral at a steady rate, `covered` keeps their energy within what has come and what the tank
adds. An integral kept whole is a position kept whole; what energy did not cover is dropped and the port led back to the
tool: no drift. A held wave would create energy, a sum played once cannot.

A message's energy is believed only up to what this side itself has sent (and a budget): then, whatever comes, the
energy out of the port stays below the energy into it, and with b > KT/2 + B the display is passive (Colgate 1995,
eq. 3), the port being the passive environment that the equation asks for.
"""

import math

from haptic_device.jit import kernel

IMPEDANCE_TIME = 0.004  # [s] z = K · this: the line is as stiff as the coupling at a delay of this length
FORGET = 0.99995  # from sample to sample, of the oldest that one of late became before the next came
LEAST = 1e-3  # [N s/m] impedance where there is no stiffness


@kernel
def impedance(stiffness):
    """Wave impedance z [N s/m | N m s/rad], from the stiffness which both sides know."""
    return max(LEAST, IMPEDANCE_TIME * stiffness)


@kernel
def played(pending, rate, period):
    """Wave [N] of this period: the rate set when the last sample came, as long as the pending integral [N s] lasts.

    A rate that followed the pending integral would ripple, and a ripple needs more energy than what was sent.
    """
    most = pending / period
    return min(max(0.0, most), max(min(0.0, most), rate))


@kernel
def power(wave, impedance):
    """Power [W] that a wave carries."""
    return wave * wave / (4.0 * impedance)


@kernel
def covered(energy, store):
    """Share 0…1 of all waves of a tick whose energy [J] is covered by the store of energy that has come."""
    if energy <= store:
        return 1.0
    return math.sqrt(store / energy) if store > 0.0 else 0.0


@kernel
def port_velocity(incoming, spring, damping, rate, stiffness, limit, impedance, period):
    """Velocity of the port behind the coupling for an incoming wave q: u − z v = q solved with the coupling's force.

    u = clamp(spring − K T v) + B (rate − v); spring: K (x − y) before this tick's motion [N], rate: the handle's.
    """
    velocity = (spring + damping * rate - incoming) / (impedance + stiffness * period + damping)
    force = spring - stiffness * period * velocity
    if abs(force) > limit:
        velocity = (math.copysign(limit, force) + damping * rate - incoming) / (impedance + damping)
    return velocity


@kernel
def returned(incoming, force, velocity, impedance):
    """Wave [N] that goes back from a port with this force and velocity: u + z v, with no more energy than came in.

    Where u − z v is the incoming wave that is u v + q²/4z exactly. A port that is held back to a part of that velocity
    (between 0 and it) has not less: u falls as v grows, so u v ≥ 0 or u v is nearer 0 than it was.
    """
    natural = force + impedance * velocity
    most = math.sqrt(max(0.0, 4.0 * impedance * force * velocity + incoming * incoming))
    return math.copysign(min(abs(natural), most), natural)
