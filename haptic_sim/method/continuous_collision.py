# SPDX-License-Identifier: Apache-2.0
"""Continuous collision detection: a step's contacts are those at the time of touching, not the overlaps after it."""

import math

from haptic_device.jit import njit
from haptic_sim.method.constraints import add_contact_constraints, has_constraint, is_advanced
from haptic_sim.method.impact import TOUCHING
from haptic_sim.method.narrow_phase import contact_features, place_shape, place_shapes, signed_gap

BISECTIONS = 40
MOST_PIECES = 4000
APART, MET, TOUCHES = 0, 1, 2
"""A pair in this step: no contact yet; one on the way; in contact from the start, of which nothing new can be said."""


@njit
def start_collision_search(model, work):
    """Discs around all shapes at work.q, and no pair has met yet: what `add_collisions` starts from."""
    place_shapes(model, work, work.q)
    collision, middles = work.continuous_collision, work.narrow_phase.middles
    for s in range(model.shapes):
        collision.around[s, 0], collision.around[s, 1] = middles[s, 0], middles[s, 1]
    for p in range(model.pair_count):
        collision.met[p] = APART


@njit
def add_collisions(model, work, n):
    """Adds rows for pairs that touch now, or meet on the straight way from work.q to work.trial.q; returns how many."""
    met, features = work.continuous_collision.met, work.narrow_phase.features
    for p in range(model.pair_count):
        a, b = model.pair_bodies[p, 0], model.pair_bodies[p, 1]
        if met[p] == TOUCHES or not is_advanced(model, work, a, b):
            continue
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        way = relative_travel(model, work, a, b)
        if disc_distance_at_start(model, work, s, u) > way + TOUCHING:
            continue
        share = share_of_impact(model, work, s, u, way)
        if share < 0.0:
            continue
        if share > 0.0:
            place_pair(model, work, s, u, share)
        for k in range(contact_features(model, work, s, u)):
            if met[p] == APART or not has_constraint(work, n, p, features[k]):
                n = add_contact_constraints(model, work, n, p, features[k])
        met[p] = MET if share > 0.0 else TOUCHES
    return n


@njit
def relative_travel(model, work, a, b):
    """How far points of two bodies move against each other at most [m]."""
    q, to = work.q, work.trial.q
    way = math.hypot(to[b, 0] - q[b, 0] - to[a, 0] + q[a, 0], to[b, 1] - q[b, 1] - to[a, 1] + q[a, 1])
    return way + abs(to[a, 2] - q[a, 2]) * model.extent[a] + abs(to[b, 2] - q[b, 2]) * model.extent[b]


@njit
def disc_distance_at_start(model, work, s, u):
    """Distance of the discs around two shapes at the start [m]."""
    m = work.continuous_collision.around
    return math.hypot(m[u, 0] - m[s, 0], m[u, 1] - m[s, 1]) - model.reach[s] - model.reach[u]


@njit
def place_pair(model, work, s, u, share):
    """Two shapes at a share of the way."""
    trial = work.trial
    for shape in (s, u):
        b = model.shape_body[shape]
        x = work.q[b, 0] + share * (trial.q[b, 0] - work.q[b, 0])
        y = work.q[b, 1] + share * (trial.q[b, 1] - work.q[b, 1])
        angle = work.q[b, 2] + share * (trial.q[b, 2] - work.q[b, 2])
        place_shape(model, work, shape, x, y, math.cos(angle), math.sin(angle))


@njit
def gap_on_the_way(model, work, s, u, share):
    """Gap of two shapes at a share of the way [m]."""
    place_pair(model, work, s, u, share)
    return signed_gap(model, work, s, u)


@njit
def share_of_impact(model, work, s, u, way):
    """Share of the way at which two shapes meet; 0 if they touch already, −1 if they do not meet."""
    if gap_on_the_way(model, work, s, u, 0.0) <= TOUCHING:
        return 0.0
    pieces = min(int(4.0 * way / (model.thickness[s] + model.thickness[u])) + 1, MOST_PIECES)
    low = 0.0
    for k in range(1, pieces + 1):
        high = k / pieces
        if gap_on_the_way(model, work, s, u, high) < 0.0:
            return bisect_gap(model, work, s, u, low, high)
        low = high
    return -1.0


@njit
def bisect_gap(model, work, s, u, low, high):
    """Share of the way, between `low` (apart) and `high` (overlapping), at which the gap is zero."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if gap_on_the_way(model, work, s, u, middle) > 0.0:
            low = middle
        else:
            high = middle
    return low
