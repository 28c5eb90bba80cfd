# SPDX-License-Identifier: Apache-2.0
"""Passive set-position modulation (Lee & Huang, IEEE Transactions on Robotics 2010), for one axis or summed over all.

The servo's coupling is a spring κ and a damper B between the handle x and a set position y, which follows the tool's
samples. κ carries every factor on the force (engaging, fading); U(s) is the energy of the spring at stretch s = y − x.
In tick k the force −U'(x_k − y_k) − B v_k + B w_k is held while the handle moves by Δx; w is the set position's own
velocity. Over that hold the work on the handle is at most

    U_k − U(x_{k+1} − y_k) + ½ κ Δx² + (B/T) Δx² − (B/2T)(Δx_{k−1} + Δx)² + B w_k Δx  + (a difference that telescopes)

and the device's damper takes at least b Δx²/T. With c = κT/2 + B (Colgate 1995, eq. 3) and a tank E that follows

    E ← E + (b − c) Δx²/T + (B/2T)(Δx_{k−1} + Δx)² − B w_k Δx           over the hold                            (1)
    E ← E + U(x − y_k; κ_k) − U(x − y_{k+1}; κ_{k+1})                   when y or κ changes                       (2)

the energy given up to any tick is at most E_0 − E − U. So E ≥ 0 is the whole condition, for any samples: (2) is kept by
`scale_to_available_energy`, which shortens a stretch that the tank cannot pay; (1) by `damper_share`, for the handle's
worst motion. With midpoints m_k = (x_k + x_{k+1})/2 both squares of (1) are at least (b − c + 2B) Δm²/T, and over a
window of n holds at least (b − c + 2B)(Σ Δm)²/nT (Cauchy–Schwarz): that is credited, by `dissipated`, where no encoder
step raises it.

Energy leaves the tank for the other side and comes back at most up to what has left (exchange.believed).
Limits: b = c leaves B alone to fill the tank; κ = 0 lets y go anywhere.
"""

import math

from haptic_device.jit import kernel

DAMPER_SLEW = 0.25  # share of the slew that the set position's velocity may make on top of it
WINDOW = 16  # holds over which the dissipated energy is counted from one start


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


@kernel
def scale_to_available_energy(available, wanted, square):
    """Share 0…1 of the wanted stretches whose energy is covered by the energy available [J].

    wanted: Σ U(s) of the wanted stretches; square: Σ ½ κ s² of the same, both convex and 0 at s = 0, so that
    U(σ s) ≤ σ U(s) and U(σ s) ≤ σ² ½ κ s²; the larger σ of the two holds.
    """
    if wanted <= available:
        return 1.0
    if available <= 0.0:
        return 0.0
    # U(σ s) ≤ σ U(s), and ≤ σ² ½ κ s²
    return max(available / wanted, math.sqrt(available / square))


@kernel
def damped_draw(force, surplus, period):
    """g² T/4 (b − c) [J], the maximum over Δx of g Δx − (b − c) Δx²/T; g: a damper's force B w [N], b − c: surplus."""
    if force == 0.0:
        return 0.0
    return 0.25 * force * force * period / surplus if surplus > 0.0 else math.inf


@kernel
def worst_draw(force, surplus, fastest, period):
    """Most [J] that a force [N] may draw from the tank in a hold, by the handle's worst motion.

    damped_draw, and no more than the force times the way that a handle of speed `fastest` [m/s] can go.
    """
    return min(abs(force) * fastest * period, damped_draw(force, surplus, period))


@kernel
def damper_share(tank, worst, damped):
    """Share 0…1 of the dampers' forces that the tank covers.

    worst, damped: what all together may draw [J] (worst_draw, damped_draw); a share σ draws at most σ and σ² of them.
    """
    if worst <= tank:
        return 1.0
    return max(tank / worst, math.sqrt(tank / damped)) if tank > 0.0 else 0.0


@kernel
def dissipated(counted, way, step, elapsed):
    """∫ v² dt [m²/s] since the start of a window, at least: (|way| − step)²/elapsed, never less than `counted` before.

    way: of the midpoints; step: of the encoder, by which both ends of the way together may be wrong.
    """
    # an encoder step of way is nobody's dissipation for certain
    sure = abs(way) - step
    return max(counted, sure * sure / elapsed) if sure > 0.0 and elapsed > 0.0 else counted
