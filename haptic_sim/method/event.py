# SPDX-License-Identifier: Apache-2.0
"""Events: a gap closes, a joint reaches its limit, a slip comes to rest.

Each event is a function of time that falls below zero, read off the trial state of the motion itself. Its zero is found
by the Illinois rule (regula falsi that halves the weight of a bound kept twice), order 1.44, never outside the bracket.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.constrained_dynamics import constrained_acceleration, runge_kutta_step
from haptic_sim.method.constraints import (
    CONTACT,
    JOINT_LIMIT,
    constraint_rate,
    has_constraint,
    is_advanced,
    reference_rate,
)
from haptic_sim.method.delassus_operator import copy_vectors
from haptic_sim.method.impact import TOUCHING
from haptic_sim.method.joints import coordinate_row
from haptic_sim.method.lcp import FREE, LOW, NORMAL, SLIDING, friction_bound
from haptic_sim.method.narrow_phase import contact_features, disc_distance, evaluate_contact, place_shapes, signed_gap
from haptic_sim.reduction.model import SPRING

MOST_ITERATIONS = 60
FORCE_TOLERANCE, RELATIVE_TOLERANCE = 1e-9, 1e-7
"""Force [N], and share of its bound, by which a contact pulls or a friction exceeds it when its mode ends."""
HALVINGS = 40
ZERO = 1e-15
"""Value [m | m/s] that is zero."""


@njit
def first_event(model, work, n):
    """(event, value) of the lowest below zero in the trial state, event −1 if none is.

    Events 0…p−1 are gaps of pairs, then follow the slips of the n rows, then the limits of joints.
    """
    trial = work.trial
    place_shapes(model, work, trial.q)
    contact_forces_at(model, work, trial.q, trial.v, n)
    worst, event = -TOUCHING, -1
    for e in range(model.pair_count + n + model.joints):
        value = event_value(model, work, n, e)
        if value < worst:
            worst, event = value, e
    return event, worst


@njit
def event_value(model, work, n, e):
    """What must not fall below zero, in the trial state whose shapes have been placed."""
    pairs = model.pair_count
    if e < pairs:
        return pair_gap(model, work, n, e)
    if e >= pairs + n:
        return limit_gap(model, work, n, e - pairs - n)
    r = e - pairs
    if work.constraints.kind[r] != SLIDING:
        return force_margin(work, r)
    slip = constraint_rate(work, work.trial.v, r) - reference_rate(model, work, r)
    return slip if work.lcp.mode[r] == LOW else -slip


@njit
def contact_forces_at(model, work, q, v, n):
    """Contact forces at q, v at the time of work.clock.stage into work.lcp.lam."""
    if n > 0:
        constrained_acceleration(model, work, q, v, n)


@njit
def force_margin(work, r):
    """How much more a held row may be pulled [N], before it parts or slips."""
    lcp = work.lcp
    if lcp.mode[r] != FREE:
        return 0.0
    if work.constraints.kind[r] == NORMAL:
        return lcp.lam[r] + FORCE_TOLERANCE
    return friction_bound(work, r, 1.0) * (1.0 + RELATIVE_TOLERANCE) + FORCE_TOLERANCE - abs(lcp.lam[r])


@njit
def pair_gap(model, work, n, p):
    """Gap of a pair [m]; if it is in contact, of what else of it could touch."""
    narrow_phase = work.narrow_phase
    if not is_advanced(model, work, model.pair_bodies[p, 0], model.pair_bodies[p, 1]):
        return math.inf
    s, u = model.pairs[p, 0], model.pairs[p, 1]
    distance = disc_distance(model, work, s, u)
    if distance > 0.0:
        return distance
    held = False
    for r in range(n):
        held |= work.constraints.source[r] == CONTACT and work.constraints.index[r] == p
    if not held:
        return signed_gap(model, work, s, u)
    least = math.inf
    for k in range(contact_features(model, work, s, u)):
        if not has_constraint(work, n, p, narrow_phase.features[k]):
            evaluate_contact(model, work, narrow_phase.features[k])
            least = min(least, narrow_phase.contact.gap)
    return least


@njit
def limit_gap(model, work, n, j):
    """Way left to the nearer limit of joint j that is not held."""
    rows = work.constraints
    low, high = model.joint_limit[j, 0], model.joint_limit[j, 1]
    unlimited = low == -math.inf and high == math.inf
    if (
        unlimited
        or model.joint_kind[j] == SPRING
        or not is_advanced(model, work, model.joint_bodies[j, 0], model.joint_bodies[j, 1])
    ):
        return math.inf
    for r in range(n):
        if rows.source[r] == JOINT_LIMIT and rows.index[r] == j:
            if rows.feature[r, 3] > 0:
                low = -math.inf
            else:
                high = math.inf
    at = coordinate_row(model, work.trial.q, work.trial.v, j, work.joint_row)[0]
    return min(at - low, high - at)


@njit
def locate_event(model, work, n, tau, event, value):
    """Moves the trial state to the first event within tau and returns its time [s]; −1 if it cannot be told."""
    for _ in range(6):
        tau = find_zero(model, work, n, tau, event, value)
        if tau < 0.0:
            return tau
        other, value = first_event(model, work, n)
        if other < 0 or other == event:
            return tau
        event = other
    return -1.0


@njit
def value_after(model, work, n, time, event):
    """An event's value after `time` [s], which becomes the trial state."""
    trial = work.trial
    if time > 0.0:
        runge_kutta_step(model, work, time, n)
    else:
        copy_vectors(work.q, trial.q, model.bodies)
        copy_vectors(work.v, trial.v, model.bodies)
        work.clock.stage = work.clock.state
    place_shapes(model, work, trial.q)
    contact_forces_at(model, work, trial.q, trial.v, n)
    return event_value(model, work, n, event)


@njit
def find_zero(model, work, n, high, event, value_high):
    """Time at which the event's value passes zero downwards, before `high` where it is below."""
    low, value_low = 0.0, value_after(model, work, n, 0.0, event)
    if value_low <= TOUCHING:
        # Just parted, and back within the step: the bracket starts where it is clear of the other shape.
        low, value_low = high, -1.0
        for _ in range(HALVINGS):
            low *= 0.5
            value_low = value_after(model, work, n, low, event)
            if value_low > 0.0:
                break
            high, value_high = low, value_low
        if value_low <= 0.0:
            return -1.0
    side = 0
    at, value = high, value_high
    for _ in range(MOST_ITERATIONS):
        if value_low < math.inf:
            at = (low * value_high - high * value_low) / (value_high - value_low)
        else:  # all that could touch was held: a disc that rolls from a corner onto an edge
            at = 0.5 * (low + high)
        value = value_after(model, work, n, at, event)
        if abs(value) <= ZERO or high - low <= 1e-16 * high:
            break
        if value > 0.0:
            low, value_low = at, value
            value_high *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, value_high = at, value
            value_low *= 0.5 if side == -1 else 1.0
            side = -1
    return at
