# SPDX-License-Identifier: Apache-2.0
"""Passivity in the servo: the least damping that gains need, what is left of it, and the observer and controller."""

import math

from haptic_device.jit import kernel


@kernel
def least_damping(stiffness, damping, period, delay):
    """Physical damping b [N s/m] above which a wall or a coupling is passive: KT/2 + |B| (Colgate 1995, eq. 3).

    A force that acts late needs more damping. With delay = (N + s) T, 0 ≤ s < 1, and A = KT (½ + N + s) it is

        ½ [A + √(A² + s(1−s)(KT)²)] + |B| √(1 + min(delay/T, 1)).

    The spring's part is exact for a constant delay, and for writes that are late by anything up to a delay below T/2.
    The damper's part is a bound, since it acts over holds of up to T + delay. Proof: docs/theory/passivity.md.
    Compiled; the arguments are not checked.

    Args:
        stiffness: K ≥ 0 [N/m].
        damping: B of either sign [N s/m].
        period: T [s].
        delay: how late the force acts [s].

    Examples:
        >>> from haptic_device.control.passivity import least_damping
        >>> round(least_damping(1000.0, 0.1, 0.001, 0.0), 12)  # KT/2 + |B|
        0.6
        >>> round(least_damping(1000.0, 0.0, 0.001, 0.001), 12)  # one period late: KT (1/2 + 1)
        1.5
    """
    late = delay / period
    # late = N + s periods
    fraction = late - math.floor(late)
    straight = 0.5 + late
    spring = stiffness * period * 0.5 * (straight + math.sqrt(straight * straight + fraction * (1.0 - fraction)))
    return spring + abs(damping) * math.sqrt(1.0 + min(late, 1.0))


@kernel
def coupling_damping(stiffness, damping, period, delay):
    """Physical damping b [N s/m] above which a coupling to any passive simulation in step is passive.

    The delay is in the display's own loop. With delay = (N + s) T, 0 ≤ s < 1, and L = (1−s)(N+1)² + s(N+2)² it is

        L KT/2 + B √(1 + min(delay/T, 1))    for B ≥ 0, where the spring's part is exact,
        L (KT/2)²/(KT/2 + B)                 for −KT/2 < B < 0, and infinite for B ≤ −KT/2.

    Proof: docs/theory/passivity.md. Set-position modulation needs the same, where each change of force that is not the
    handle's own is paid by what it can give while it is late (late_price). Compiled; the arguments are not checked.

    Args:
        stiffness: K ≥ 0 [N/m].
        damping: B of either sign [N s/m].
        period: T [s].
        delay: how late the force acts [s].

    Examples:
        >>> from haptic_device.control.passivity import coupling_damping
        >>> round(coupling_damping(1000.0, 0.1, 0.001, 0.0), 12)  # without delay as a wall
        0.6
        >>> round(coupling_damping(1000.0, 0.0, 0.001, 0.001), 12)  # one period late: 2² KT/2
        2.0
    """
    late = delay / period
    whole = math.floor(late)
    leak = (whole + 1.0) ** 2 + (late - whole) * (2.0 * whole + 3.0)
    spring = 0.5 * stiffness * period
    if damping < 0.0:
        return leak * spring * spring / (spring + damping) if spring + damping > 0.0 else math.inf
    return leak * spring + damping * math.sqrt(1.0 + min(late, 1.0))


@kernel
def late_price(reserve, period, delay):
    """Energy per square of a change of force [J/N²] that it can give while it acts `delay` [s] late.

    A change q is on its way for W = delay/T periods, at most ⌈W⌉ changes at a time. With `reserve` [N s/m] of damping
    set aside, the part of it that falls to one change is reserve/⌈W⌉, and over W T

        q ẋ ≤ ⌈W⌉ q²/(4 reserve) + (reserve/⌈W⌉) ẋ²,     hence     W ⌈W⌉ T q²/(4 reserve).
    """
    late = delay / period
    if late <= 0.0:
        return 0.0
    # with no damping to spare the way that the handle may go meanwhile is the limit (energy_tank.late_energy)
    return 0.25 * late * math.ceil(late) * period / reserve if reserve > 0.0 else math.inf


@kernel
def late_reserve(stiffness, period, delay, left):
    """Damping [N s/m] of what is left that is set aside for late changes of force of a spring of this stiffness.

    KT/2 · w or its root, w = W ⌈W⌉, and an eighth of what is left at least, all of it at most. With KT/2 · w a change q
    costs q²/2K, what a spring of that force holds; for W < 1 the root makes reserve and price of a steady speed least.
    """
    late = delay / period
    weight = late * math.ceil(late)
    wanted = 0.5 * stiffness * period * max(weight, math.sqrt(weight))
    return min(left, max(wanted, 0.125 * left)) if late > 0.0 else 0.0


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


@kernel
def energy_spread(square, physical_damping, fastest, elapsed):
    """Most [J] that the changes of a force within a hold may give: square/4b (energy_changed), and no more than way.

    square: Σ (f_j − F̄)² τ_j [N² s]; fastest: speed limit of the handle [m/s]. By |Δx_j| ≤ v τ_j and Cauchy–Schwarz
    Σ (f_j − F̄) Δx_j ≤ v √(T Σ (f_j − F̄)² τ_j), whatever the damping.
    """
    if square <= 0.0:
        return 0.0
    most = fastest * math.sqrt(square * elapsed)
    return min(most, square / (4.0 * physical_damping)) if physical_damping > 0.0 else most


@kernel
def energy_changed(change, square, displacement, physical_damping, fastest, elapsed):
    """What a force that changes within a hold may have given [J] beyond its first force f₀ times the displacement.

    change: Σ (f_j − f₀) τ_j [N s]; square: Σ (f_j − f₀)² τ_j [N² s], over the times τ_j for which each force f_j acted;
    they add up to elapsed = T. Only the whole way Δx is known, not the ways Δx_j of the times. With the mean F̄ = f₀ +
    change/T, and with the damper's least b Δx_j²/τ_j, the most that any path to the same Δx gives is

        max Σ (f_j Δx_j − b Δx_j²/τ_j) = F̄ Δx − b Δx²/T + Σ (f_j − F̄)² τ_j / 4b,

    by Δx_j = τ_j (Δx/T + (f_j − F̄)/2b). The last term is at most (largest − smallest f)² T/16b, and what a handle of
    speed `fastest` can take (energy_spread). It is assumed that samples are latched at ticks and that a force acts from
    its tick to the next: one that acts late is not seen here.
    """
    if square == 0.0:
        return 0.0
    # Σ (f_j − F̄)² τ_j; rounding may leave it below 0
    spread = max(0.0, square - change * change / elapsed)
    return change * displacement / elapsed + energy_spread(spread, physical_damping, fastest, elapsed)


@kernel
def energy_generated(held_force, displacement, stored, physical_damping, elapsed):
    """Energy [J] that one hold generated: work on the handle and growth of the springs' store, less the damper's share.

    A held spring force gives −K x dx while its store takes K x dx + K dx²/2: what is left over is K dx²/2, the leak of
    the zero-order hold, and under eq. 3 the sum over all ticks, with damping_store, never rises.
    """
    if elapsed <= 0.0:
        return 0.0
    return held_force * displacement + stored - physical_damping * displacement * displacement / elapsed


@kernel
def damping_store(damping, displacement, elapsed):
    """What a sampled damper may still owe: |B| dx²/(2T) [J], the store that makes its bound hold tick by tick."""
    return abs(damping) * displacement * displacement / (2.0 * elapsed) if elapsed > 0.0 else 0.0


@kernel
def injected_damping(generated, budget, velocity, elapsed, most):
    """Damping [N s/m] that takes the excess over the budget out of the next tick at this velocity, at most `most`.

    A time-domain passivity controller (Hannaford & Ryu 2002); `most` is what the sampled loop can take.
    """
    # ΔE = b_c v² T is what damping takes in a tick
    excess = generated - budget
    power = velocity * velocity * elapsed
    if excess <= 0.0 or power <= 0.0:
        return 0.0
    return min(most, excess / power)
