# SPDX-License-Identifier: Apache-2.0
"""From event to event: impacts and sticking are found in time, not cured after the fact.

A step is cut where a gap closes or a slip speed passes zero. The instant is found by bracketing (Illinois) on the
motion itself, which is integrated anew to each guess; then the impact is solved for all contacts touching at that time:

    v⁺ = v⁻ + W Gᵀ λ,   0 ≤ λ_n ⟂ G_n v⁺ + e G_n v⁻ ≥ 0 (Newton),   |λ_t| ≤ μ λ_n against G_t v⁺

Between events the contacts that touch, and do not part, are constraints; which of them push, stick or slide is one
complementarity problem of the accelerations. If it has no solution (Painlevé), or events crowd, the flight gives up and
the rest of the step is a backward difference (see `press`), which always has one.
"""

import math

from haptic_device.kernel import kernel
from haptic_sim.method.effect import apply_rows, copy, note_impulses, respond_rows, zero_body
from haptic_sim.method.event import first_event, locate
from haptic_sim.method.impact import RESTING, TOUCHING, impact
from haptic_sim.method.lcp import FRICTION, HIGH, LOW, NORMAL, SLIDING, solve_modes
from haptic_sim.method.rows import add_contact, add_joints, keep_rows, moves, rate_of, recall, refresh, remember, wished
from haptic_sim.method.smooth import advance, free_acceleration
from haptic_sim.method.touch import far_apart, gap_of, place_shapes, touch

MOST_EVENTS = 400
UNSOLVED, STRUCK = -1, -2


@kernel
def fly(model, layout, work, h):
    """Advances the active linkages by h [s]; returns the time left over when it had to give up, else 0."""
    left = h
    for _ in range(MOST_EVENTS):
        n = present_rows(model, layout, work)
        if n == STRUCK:
            impact(model, layout, work)
            n = present_rows(model, layout, work)
        if n < 0:
            return left
        if n > 0 and at_rest(model, layout, work, n, left):
            return 0.0
        tau = min(left, longest_flight(model, layout, work))
        advance(model, layout, work, tau, n)
        event, value = first_event(model, layout, work, n)
        if event >= 0:
            tau = locate(model, layout, work, n, tau, event, value)
            if tau < 0.0:
                return left
        copy(work.trial_q, work.q, model.bodies)
        copy(work.trial_v, work.v, model.bodies)
        for r in range(n):
            work.lam[r] = work.forces[r]
        note_impulses(work, n, tau)
        if event >= 0:
            work.counts[2] += 1
            impact(model, layout, work)
        left -= tau
        if left <= 1e-15 * h:
            return 0.0
    return left


@kernel
def present_rows(model, layout, work):
    """Rows of contacts that touch and do not part, with modes; returns how many, or UNSOLVED, or STRUCK."""
    q, v = work.q, work.v
    n = 0
    if model.pair_count > 0:
        place_shapes(model, layout, q, work.points, work.normals, work.middles)
        for p in range(model.pair_count):
            if not moves(layout, work, layout.pair_bodies[p, 0], layout.pair_bodies[p, 1]):
                continue
            s, u = model.pairs[p, 0], model.pairs[p, 1]
            if far_apart(layout, work.middles, s, u) > TOUCHING or gap_of(
                    model, work.points, work.normals, s, u) > TOUCHING:
                continue
            for k in range(touch(model, work.points, work.normals, s, u, work.features)):
                n = add_contact(model, layout, work, n, p, work.features[k])
    n = add_joints(model, layout, work, n, q, v, TOUCHING, 1.0)
    if n == 0:
        return 0
    refresh(model, layout, work, q, v, n)
    n = keep_rows(work, v, n, TOUCHING, RESTING)
    for r in range(n):
        if work.kind[r] == NORMAL and rate_of(work, v, r) < -RESTING:
            return STRUCK
    recall(work, n)
    for r in range(n):
        set_sense(model, work, v, r)
    free_acceleration(model, layout, work, q, v, work.slopes_v[0])
    respond_rows(model, layout, work, n)
    for r in range(n):
        work.b[r] = rate_of(work, work.slopes_v[0], r) + work.gamma[r]
    if solve_modes(work.A, work.b, n, work.kind, work.partner, work.mu, work.bound, work.mode, work.lam, work, 60) < 0:
        work.counts[1] = 0
        return UNSOLVED
    remember(work, n)
    for r in range(n):
        work.forces[r] = work.lam[r]
    return n


@kernel
def at_rest(model, layout, work, n, left):
    """Whether nothing moves, nor would within the time left, by more than RESTING; then velocities become zero.

    The contact forces have been solved for and hold everything: another integration would only move rounding about.
    """
    v, a = work.v, work.slopes_v[0]
    for r in range(n):
        work.lam[r] = work.forces[r]
    apply_rows(model, work, n, 1.0, a)
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] > 0:
            for k in range(3):
                if abs(v[b, k]) > RESTING or abs(a[b, k]) * left > RESTING:
                    return False
    note_impulses(work, n, left)
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] > 0:
            zero_body(v, b)
    return True


@kernel
def set_sense(model, work, v, r):
    """A row that slips has its friction against the slip; a resting one may stick. A motor's slip is from its speed."""
    if work.kind[r] != FRICTION:
        return
    slip = rate_of(work, v, r) - wished(model, work, r)
    if abs(slip) > RESTING:
        work.kind[r] = SLIDING
        work.mode[r] = LOW if slip > 0.0 else HIGH


@kernel
def longest_flight(model, layout, work):
    """Time [s] within which no two shapes can meet and be through each other again: a quarter of their widths."""
    longest = math.inf
    for p in range(model.pair_count):
        a, b = layout.pair_bodies[p, 0], layout.pair_bodies[p, 1]
        if not moves(layout, work, a, b):
            continue
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        v = work.v
        closing = math.hypot(v[b, 0] - v[a, 0], v[b, 1] - v[a, 1])
        closing += abs(v[a, 2]) * layout.extent[a] + abs(v[b, 2]) * layout.extent[b]
        if closing <= 0.0:
            continue
        apart = far_apart(layout, work.middles, s, u)
        if apart <= 0.0:
            apart = gap_of(model, work.points, work.normals, s, u)
        longest = min(longest, max(0.25 * (layout.thickness[s] + layout.thickness[u]), apart) / closing)
    return longest
