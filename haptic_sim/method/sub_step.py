# SPDX-License-Identifier: Apache-2.0
"""One sub-step: which linkages are within the coupling's reach, which go by events, and what the port supplied."""

import math

from haptic_device.jit import kernel, njit
from haptic_sim.method.constrained_dynamics import coupling_force, work_at_port
from haptic_sim.method.event_integration import integrate_through_events
from haptic_sim.method.implicit_step import implicit_step
from haptic_sim.method.joints import spring_row, spring_row_count
from haptic_sim.method.narrow_phase import disc_distance, place_shapes, signed_gap
from haptic_sim.reduction.model import PIN

STIFF = 6.0
"""Rate of a linkage's own spring-dampers times the sub-step beyond which a backward difference takes it.

Up to it the motion is followed in up to four pieces, each of which costs as much as the backward difference (5 µs of
one body), which has the same end but no transient: of v = e^(-rate h) it makes 1/(1 + rate h).
"""
ALLOWED_ACCELERATION = 100.0
"""Acceleration [m/s²] beyond the present speeds that is allowed for when looking who can come near the tool."""


@kernel
def sub_steps(models, works, h, count, path):
    """`count` sub-steps from each row of the handle's path (position, velocity) evenly to the next.

    The records come as arrays of one: numba tells the type of an array faster than that of a lone record, by 50 µs.
    """
    model, work = models[0], works[0]
    for k in range(count * (len(path) - 1)):
        interpolate_handle(work, path, k // count, (k % count + 1) / count)
        if work.coupling.event_driven:
            linearize_handle(work, path, k // count, count, h)
            event_step(model, work, h)
        else:
            sub_step(model, work, h)
        summarize_contacts(model, work, h)


@njit
def interpolate_handle(work, path, row, share):
    """Handle's position and velocity at this share of the way from a row of its path to the next into work.handle."""
    before, after = path[row], path[row + 1]
    for k in range(3):
        work.handle.position[k] = (1.0 - share) * before[k] + share * after[k]
        work.handle.velocity[k] = (1.0 - share) * before[3 + k] + share * after[3 + k]


@njit
def linearize_handle(work, path, row, count, h):
    """Handle when the sub-step began, and its rate; `count` sub-steps go from this row of its path to the next."""
    handle, before, after = work.handle, path[row], path[row + 1]
    for k in range(3):
        handle.position_rate[k] = (after[k] - before[k]) / (count * h)
        handle.velocity_rate[k] = (after[3 + k] - before[3 + k]) / (count * h)
        handle.start_position[k] = handle.position[k] - h * handle.position_rate[k]
        handle.start_velocity[k] = handle.velocity[k] - h * handle.velocity_rate[k]


@njit
def summarize_contacts(model, work, h):
    """Books in work.port whether a contact pushed the tool, a pair's largest force [N], the deepest overlap."""
    port, report = work.port, work.report
    for k in range(report.count):
        pair = report.pair[k]
        x = y = 0.0
        for other in range(report.count):
            if report.pair[other] == pair:
                x, y = x + report.impulse[other, 0], y + report.impulse[other, 1]
        if model.pair_bodies[pair, 0] == 0 or model.pair_bodies[pair, 1] == 0:
            port.touched = 1
        port.largest_force = max(port.largest_force, math.hypot(x, y) / h)
        port.deepest_overlap = max(port.deepest_overlap, report.overlap[k])


@njit
def sub_step(model, work, h):
    """Advances all bodies by h [s] and books the energy supplied at the tool's port."""
    x, y, angle = work.q[0, 0], work.q[0, 1], work.q[0, 2]
    work.report.count = 0
    for k in range(3):
        work.port.force[k] = 0.0
    rigid = work.contact_model.stiffness == 0.0
    held = activate_within_reach(model, work, h) if rigid else activate_all(model, work)
    if held < model.linkages:
        for i in range(model.linkages):
            work.active[i] = 1 - work.active[i]
        left = integrate_through_events(model, work, h)
        if left > 0.0:
            work.counters.refusals += 1
            implicit_step(model, work, left)
        for i in range(model.linkages):
            work.active[i] = 1 - work.active[i]
    if held > 0:
        implicit_step(model, work, h)
    work.port.supplied += work_at_port(work, x, y, angle)


@njit
def event_step(model, work, h):
    """Advances all bodies by h [s] from event to event, the coupling a force along the handle's straight way."""
    q = work.q
    work.report.count = 0
    activate_all(model, work)
    left = integrate_through_events(model, work, h)
    if left > 0.0:
        work.counters.refusals += 1
        x, y, angle = q[0, 0], q[0, 1], q[0, 2]
        implicit_step(model, work, left)
        work.port.supplied += work_at_port(work, x, y, angle)
    coupling_force(work, q, work.v, h)
    for k in range(3):
        work.port.force[k] = work.constrained_dynamics.tool_force[k]


@njit
def activate_all(model, work):
    """Marks every linkage as active; returns how many."""
    for i in range(model.linkages):
        work.active[i] = 1
    return model.linkages


@njit
def activate_within_reach(model, work, h):
    """Marks as active the linkages that a backward difference takes; returns how many.

    Those that the coupling can act on within h, by joints or contacts; those whose own spring-dampers are STIFF, and
    whom these can touch.
    """
    held, pull = 0, 0.0
    for i in range(model.linkages):
        work.active[i] = 1 if h * model.rate[i] > STIFF else 0
        if work.active[i] > 0:
            held, pull = held + 1, max(pull, way_of_springs(model, work, i))
    stiffness, damping, tool = work.coupling.stiffness, work.coupling.damping, model.linkage[0]
    if max(max(stiffness[0], damping[0]), max(stiffness[2], damping[2])) > 0.0:
        held, pull = held + 1 - work.active[tool], max(pull, way_of_coupling(model, work, h))
        work.active[tool] = 1
    if held == 0 or model.pair_count == 0:
        return held
    place_shapes(model, work, work.q)
    before, last = 0, model.pair_count - 1
    while before < held < model.linkages:  # to and fro: a stack is followed in one sweep, whichever way it is numbered
        before = held
        for k in range(2 * model.pair_count):
            held += activate_neighbour(model, work, k if k <= last else 2 * last + 1 - k, h, pull)
    return held


@njit
def way_of_coupling(model, work, h):
    """How far the coupling can draw a point of the tool within h [m]."""
    handle, q, velocity = work.handle, work.q, work.handle.velocity
    stretch = math.hypot(handle.position[0] - q[0, 0], handle.position[1] - q[0, 1])
    pull = stretch + h * math.hypot(velocity[0], velocity[1])
    if work.coupling.stiffness[2] + work.coupling.damping[2] > 0.0:
        pull += model.extent[0] * (abs(handle.position[2] - q[0, 2]) + h * abs(velocity[2]))
    return pull


@njit
def way_of_springs(model, work, i):
    """How far the springs of linkage i can draw its bodies within a step [m]: as far as they are stretched."""
    pull = 0.0
    for m in range(model.joint_start[i], model.joint_start[i + 1]):
        j = model.joint_order[m]
        if model.joint_spring[j, 0] == 0.0:
            continue
        for k in range(spring_row_count(model, j)):
            stretch = abs(spring_row(model, work.q, work.v, j, k, work.joint_row))
            if model.joint_kind[j] == PIN:
                stretch *= max(model.extent[model.joint_bodies[j, 0]], model.extent[model.joint_bodies[j, 1]])
            pull += stretch
    return pull


@njit
def activate_neighbour(model, work, p, h, pull):
    """Activates the other linkage of a pair if the two can meet within h and one is active; returns 1 if it did."""
    a, b = model.pair_bodies[p, 0], model.pair_bodies[p, 1]
    la, lb = model.linkage[a], model.linkage[b]
    if la < 0 or lb < 0 or work.active[la] == work.active[lb]:
        return 0
    v, s, u = work.v, model.pairs[p, 0], model.pairs[p, 1]
    way = h * math.hypot(v[b, 0] - v[a, 0], v[b, 1] - v[a, 1]) + ALLOWED_ACCELERATION * h * h + pull
    way += h * (abs(v[a, 2]) * model.extent[a] + abs(v[b, 2]) * model.extent[b])
    if disc_distance(model, work, s, u) > way or signed_gap(model, work, s, u) > way:
        return 0
    work.active[la] = work.active[lb] = 1
    return 1
