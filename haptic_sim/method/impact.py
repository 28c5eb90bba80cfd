# SPDX-License-Identifier: Apache-2.0
"""One impact: all contacts that touch at an instant, solved together.

The law (Moreau 1988; Glocker & Pfeiffer 1995): every contact that touches, be it struck or only at rest, obeys

    0 ≤ λ_n ⟂ G_n v⁺ + e min(G_n v⁻, 0) ≥ 0,     |λ_t| ≤ μ λ_n against the slip after,     v⁺ = v⁻ + W Gᵀ λ

Three equal discs in a row with e = 1, two of them touching, struck by the third at speed 1, leave with −1/3, 2/3, 2/3.
It keeps momentum, since λ is mutual. It never creates energy: without friction T⁺ − T⁻ = Σ ½ (1 − e) λ_n G_n v⁻ ≤ 0
unless some contact parts already; in that case, and with friction, `resolve_impact` lowers all restitutions alike where
they would gain, to the largest share that gains nothing. And it invents no order of impacts, of which rigid bodies
know nothing.

Its limit: it is not continuous. The same discs with any gap strike one after the other and leave with 0, 0, 1. No law
could be: as gaps vanish the outcome tends to different limits for different orders of impact (Ivanov 1995), and only
the bodies' elasticity, which is not modelled, could tell which one is right. A Newton's cradle is a scene with gaps of
1 nm or more (TOUCHING is 1 pm) among bodies that the coupling does not hold: for a backward difference
(`implicit_step`) all that is struck within one step is struck at once.
"""

import math
from typing import NamedTuple

from haptic_device.jit import njit
from haptic_sim.method.constraints import (
    CONTACT,
    add_contact_constraints,
    add_joint_constraints,
    constraint_rate,
    evaluate_constraints,
    is_advanced,
    keep_constraints,
    reference_rate,
    work_of_drives,
)
from haptic_sim.method.delassus_operator import apply_impulses, copy_vectors, delassus_operator, report_impulses
from haptic_sim.method.lcp import NORMAL, principal_pivoting
from haptic_sim.method.lemke import lemke
from haptic_sim.method.linkage import reduce_linkage
from haptic_sim.method.narrow_phase import contact_features, disc_distance, place_shapes, signed_gap

TOUCHING = 1e-12
"""Gap [m] below which two shapes touch."""
RESTING = 1e-9
"""Speed [m/s | rad/s] below which a contact neither parts nor slips nor rebounds."""
MOST_SHARES, CLOSE = 16, 1e-9
"""Solutions in search of the share of restitution that gains no energy; what it may lose, of what is at stake."""


@njit
def resolve_impact(model, work):
    """Velocities after the impact at work.q; restitution is lowered where, with friction, it would add energy."""
    before = kinetic_energy(model, work, work.v)
    n = impact_constraints(model, work)
    if n == 0:
        return
    copy_vectors(work.v, work.trial.v, model.bodies)
    gained = energy_of_impact(model, work, n, before, 1.0)
    if gained > 0.0:
        lower_restitution(model, work, n, before, gained)
    report_impulses(work, n, 1.0)
    work.accounts.contacts += before - kinetic_energy(model, work, work.v)


class Bracket(NamedTuple):
    """Two shares of the restitution, and what energy is gained with them [J]: none with the low one."""

    low: float
    lost: float
    high: float
    gained: float
    side: int
    """1 if the high share has changed last, −1 the low one."""


@njit
def share_between(bracket):
    """Where a straight line through both passes zero."""
    return (bracket.low * bracket.gained - bracket.high * bracket.lost) / (bracket.gained - bracket.lost)


@njit
def narrowed(bracket, share, gained):
    """The bracket with this share for one of its ends; an end kept twice counts half (Illinois)."""
    if gained > 0.0:
        lost = 0.5 * bracket.lost if bracket.side == 1 else bracket.lost
        return Bracket(bracket.low, lost, share, gained, 1)
    kept = 0.5 * bracket.gained if bracket.side == -1 else bracket.gained
    return Bracket(share, gained, bracket.high, kept, -1)


@njit
def lower_restitution(model, work, n, before, gained):
    """Velocities with the largest share of the restitution that gains no energy; the whole gains `gained` [J]."""
    bracket = Bracket(0.0, energy_of_impact(model, work, n, before, 0.0), 1.0, gained, 0)
    close = CLOSE * (bracket.lost - gained)
    for _ in range(MOST_SHARES):
        if bracket.lost >= close:
            break
        share = share_between(bracket)
        bracket = narrowed(bracket, share, energy_of_impact(model, work, n, before, share))
    energy_of_impact(model, work, n, before, bracket.low)


@njit
def energy_of_impact(model, work, n, before, share):
    """Energy [J] beyond rounding that an impact adds to `before` with this share of the restitution."""
    copy_vectors(work.trial.v, work.v, model.bodies)
    solve_impact(model, work, n, share)
    given = work_of_drives(model, work, work.v, n)
    return kinetic_energy(model, work, work.v) - given - before - 1e-12 * (before + abs(given))


@njit
def impact_constraints(model, work):
    """Rows of all contacts that touch, and of joints at a limit; returns how many."""
    n = add_touching_contacts(model, work)
    n += add_joint_constraints(model, work, n, work.q, work.v, TOUCHING, 0.0)
    evaluate_constraints(model, work, work.q, work.v, n)
    n = keep_constraints(work, work.v, n, TOUCHING, math.inf)
    for i in range(model.linkages):
        if work.active[i] > 0:
            reduce_linkage(model, work, i, work.q, work.v, 0.0)
    delassus_operator(model, work, n)
    return n


@njit
def add_touching_contacts(model, work):
    """Rows of all contacts that touch; returns how many."""
    n = 0
    place_shapes(model, work, work.q)
    for p in range(model.pair_count):
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        if not is_advanced(model, work, model.pair_bodies[p, 0], model.pair_bodies[p, 1]):
            continue
        if disc_distance(model, work, s, u) <= TOUCHING and signed_gap(model, work, s, u) <= TOUCHING:
            for k in range(contact_features(model, work, s, u)):
                n = add_contact_constraints(model, work, n, p, work.narrow_phase.features[k])
    return n


@njit
def solve_impact(model, work, n, scale):
    """v⁺ with the pairs' restitution times `scale`."""
    rows, lcp = work.constraints, work.lcp
    for r in range(n):
        lcp.b[r] = constraint_rate(work, work.v, r) - reference_rate(model, work, r)
        if rows.kind[r] == NORMAL and rows.source[r] == CONTACT and lcp.b[r] < -RESTING:
            lcp.b[r] *= 1.0 + scale * model.pair_restitution[rows.index[r]]
    if principal_pivoting(work, n, 1.0, 60) < 0:
        lemke(work, n)
    apply_impulses(model, work, n, work.v)


@njit
def kinetic_energy(model, work, v):
    """Kinetic energy of the bodies that are being advanced [J]."""
    energy = 0.0
    for b in range(model.bodies - 1):
        if work.active[model.linkage[b]] > 0:
            energy += 0.5 * (model.mass[b] * (v[b, 0] ** 2 + v[b, 1] ** 2) + model.inertia[b] * v[b, 2] ** 2)
    return energy
