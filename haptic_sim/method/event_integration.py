# SPDX-License-Identifier: Apache-2.0
"""Integration from event to event: impacts and sticking are found in time, not cured after the fact.

A step is cut where a gap closes or a slip speed passes zero. The instant is found by bracketing (Illinois) on the
motion itself, which is integrated anew to each guess; then the impact is solved for all contacts touching at that time:

    v⁺ = v⁻ + W Gᵀ λ,   0 ≤ λ_n ⟂ G_n v⁺ + e G_n v⁻ ≥ 0 (Newton),   |λ_t| ≤ μ λ_n against G_t v⁺

Between events the contacts that touch, and do not part, are constraints; which of them push, stick or slide is one
complementarity problem of the accelerations. If it has no solution (Painlevé), or events crowd, the integration gives
up and the rest of the step is a backward difference (see `implicit_step`), which always has one. So it does where
spring-dampers are so fast that the pieces in which the explicit formulas follow them would be as many.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.constrained_dynamics import runge_kutta_step, unconstrained_acceleration
from haptic_sim.method.constraints import (
    add_joint_constraints,
    constraint_rate,
    evaluate_constraints,
    is_advanced,
    keep_constraints,
    reference_rate,
    restore_modes,
    store_modes,
)
from haptic_sim.method.delassus_operator import (
    apply_impulses,
    copy_vectors,
    delassus_operator,
    keep_resting_forces,
    report_impulses,
    report_resting,
    zero_vector,
)
from haptic_sim.method.event import first_event, locate_event
from haptic_sim.method.impact import RESTING, TOUCHING, add_touching_contacts, resolve_impact
from haptic_sim.method.lcp import FRICTION, HIGH, LOW, NORMAL, SLIDING, principal_pivoting
from haptic_sim.method.narrow_phase import disc_distance, signed_gap

MOST_EVENTS = 400
FOLLOWED = 1.5
"""Rate times step up to which the explicit formulas take a spring-damper: stable to 2.8 (order 4) and 6 (order 8).

Measured error of order 8, of the amplitude: 2e-7 at 1, 6e-6 at 1.5, 5e-5 at 2.
"""
UNSOLVED, IMPACT_DUE = -1, -2


@njit
def integrate_through_events(model, work, h):
    """Advances the active linkages by h [s]; returns the time left over when it had to give up, else 0."""
    for i in range(model.linkages):
        work.event_integration.advanced[i] = work.active[i]
    work.clock.state = work.clock.stage = 0.0
    left = h
    if fastest_rate(model, work) * h > FOLLOWED * MOST_EVENTS:
        return left
    for _ in range(MOST_EVENTS):
        n = active_constraints(model, work, True)
        if n == IMPACT_DUE:
            resolve_impact(model, work)
            n = active_constraints(model, work, True)
        if n < 0:
            return left
        resting = n > 0 and put_to_sleep(model, work, n, left) > 0
        if resting and count_awake(model, work) == 0:
            report_resting(work, left)
            wake_up(model, work)
            return 0.0
        if resting:
            n = active_constraints(model, work, False)
        tau, event = integrate_to_event(model, work, n, left) if n >= 0 else (-1.0, -1)
        wake_up(model, work)
        if tau < 0.0:
            return left
        report_impulses(work, n, tau)
        if resting:
            report_resting(work, tau)
        work.clock.state += tau
        work.clock.stage = work.clock.state
        work.port.supplied += work.trial.supplied
        work.accounts.contacts += work.trial.taken
        if event >= 0:
            resolve_impact(model, work)
        left -= tau
        if left <= 1e-15 * h:
            return 0.0
    return left


@njit
def integrate_to_event(model, work, n, left):
    """Moves on until something happens, or the time is up; (time taken, event), time −1 if it cannot be told."""
    tau = min(left, longest_safe_step(model, work))
    runge_kutta_step(model, work, tau, n)
    event, value = first_event(model, work, n)
    if event >= 0:
        tau = locate_event(model, work, n, tau, event, value)
        if tau < 0.0:
            return tau, event
    copy_vectors(work.trial.q, work.q, model.bodies)
    copy_vectors(work.trial.v, work.v, model.bodies)
    for r in range(n):
        work.lcp.lam[r] = work.event_integration.force[r]
    return tau, event


@njit
def active_constraints(model, work, all_awake):
    """Rows of contacts that touch and do not part, with modes; returns how many, or UNSOLVED, or IMPACT_DUE."""
    q, v = work.q, work.v
    n = add_touching_contacts(model, work)
    n += add_joint_constraints(model, work, n, q, v, TOUCHING, 1.0)
    if n == 0:
        return 0
    evaluate_constraints(model, work, q, v, n)
    n = keep_constraints(work, v, n, TOUCHING, RESTING)
    for r in range(n):
        if work.constraints.kind[r] == NORMAL and constraint_rate(work, v, r) < -RESTING:
            return IMPACT_DUE
    restore_modes(work, n)
    for r in range(n):
        set_sliding_direction(model, work, v, r)
    unconstrained_acceleration(model, work, q, v)
    delassus_operator(model, work, n)
    for r in range(n):
        work.lcp.b[r] = constraint_rate(work, work.constrained_dynamics.acceleration, r) + work.constraints.gamma[r]
    if principal_pivoting(work, n, 1.0, 60) < 0:
        work.warm_start.count = 0
        return UNSOLVED
    if all_awake:
        store_modes(work, n)
    for r in range(n):
        work.event_integration.force[r] = work.lcp.lam[r]
    return n


@njit
def put_to_sleep(model, work, n, left):
    """Linkages that do not move, nor would within the time left, by more than RESTING get velocity zero and sleep.

    The contact forces have been solved for and hold them: to integrate them would only move rounding about. Who
    touches one that moves, or that the hand pulls, stays awake. Returns how many sleep.
    """
    a, moving = work.constrained_dynamics.acceleration, work.event_integration.moving
    apply_impulses(model, work, n, a)
    for i in range(model.linkages):
        moving[i] = 0
        for m in range(model.body_start[i], model.body_start[i + 1]):
            b = model.order[m]
            for k in range(3):
                if abs(work.v[b, k]) > RESTING or abs(a[b, k]) * left > RESTING:
                    moving[i] = 1
    if work.coupling.event_driven:
        moving[model.linkage[0]] = 1
    propagate_motion(model, work, n)
    asleep = 0
    for i in range(model.linkages):
        if work.active[i] > 0 and moving[i] == 0:
            work.active[i] = 0
            asleep += 1
            for m in range(model.body_start[i], model.body_start[i + 1]):
                zero_vector(work.v, model.order[m])
    if asleep > 0:
        keep_resting_forces(model, work, n)
    return asleep


@njit
def propagate_motion(model, work, n):
    """Who shares a row with one that moves moves too."""
    rows, moving, changed = work.constraints, work.event_integration.moving, True
    while changed:
        changed = False
        for r in range(n):
            a, b = model.linkage[rows.body_a[r]], model.linkage[rows.body_b[r]]
            if a >= 0 and b >= 0 and moving[a] != moving[b]:
                moving[a] = moving[b] = 1
                changed = True


@njit
def count_awake(model, work):
    """How many linkages move."""
    count = 0
    for i in range(model.linkages):
        count += work.active[i]
    return count


@njit
def wake_up(model, work):
    """All linkages that are being advanced are active again."""
    for i in range(model.linkages):
        work.active[i] = work.event_integration.advanced[i]


@njit
def set_sliding_direction(model, work, v, r):
    """A row that slips has its friction against the slip; a resting one may stick. A motor's slip is from its speed."""
    if work.constraints.kind[r] != FRICTION:
        return
    slip = constraint_rate(work, v, r) - reference_rate(model, work, r)
    if abs(slip) > RESTING:
        work.constraints.kind[r] = SLIDING
        work.lcp.mode[r] = LOW if slip > 0.0 else HIGH


@njit
def fastest_rate(model, work):
    """Rate [1/s] at which spring-dampers of the linkages being advanced, or the coupling as a force, act at most."""
    fastest = 0.0
    for i in range(model.linkages):
        if work.active[i] > 0:
            fastest = max(fastest, model.rate[i])
    if work.coupling.event_driven:
        stiffness, damping, mass, inertia = (
            work.coupling.stiffness,
            work.coupling.damping,
            model.mass[0],
            model.inertia[0],
        )
        fastest = max(fastest, max(damping[0] / mass, math.sqrt(stiffness[0] / mass)))
        fastest = max(fastest, max(damping[2] / inertia, math.sqrt(stiffness[2] / inertia)))
    return fastest


@njit
def longest_safe_step(model, work):
    """Time [s] within which no two shapes can meet and be through each other again: a quarter of their widths.

    Nor do spring-dampers, and the coupling where it is a force, act faster than the explicit formulas follow.
    """
    longest = FOLLOWED / max(fastest_rate(model, work), 1e-300)
    for p in range(model.pair_count):
        a, b = model.pair_bodies[p, 0], model.pair_bodies[p, 1]
        if not is_advanced(model, work, a, b):
            continue
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        v = work.v
        closing = math.hypot(v[b, 0] - v[a, 0], v[b, 1] - v[a, 1])
        closing += abs(v[a, 2]) * model.extent[a] + abs(v[b, 2]) * model.extent[b]
        if closing <= 0.0:
            continue
        apart = disc_distance(model, work, s, u)
        if apart <= 0.0:
            apart = signed_gap(model, work, s, u)
        longest = min(longest, max(0.25 * (model.thickness[s] + model.thickness[u]), apart) / closing)
    return longest
