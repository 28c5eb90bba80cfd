# SPDX-License-Identifier: Apache-2.0
"""One sub-step of the partitioned method: who is held by the coupling, who flies, and what the port supplied."""

import math

from haptic_device.jit import kernel, njit
from haptic_sim.method.constrained_dynamics import pull_tool
from haptic_sim.method.event_integration import fly
from haptic_sim.method.implicit_step import press
from haptic_sim.method.narrow_phase import far_apart, gap_of, place_shapes

FALL = 100.0
"""Acceleration [m/s²] beyond the present speeds that is allowed for when looking who can come near the tool."""


@kernel
def sub_steps(models, layouts, works, h, count, path):
    """`count` sub-steps from each row of the handle's path (position, velocity) evenly to the next.

    The records come as arrays of one: numba tells the type of an array faster than that of a lone record, by 50 µs.
    """
    model, layout, work = models[0], layouts[0], works[0]
    for k in range(count * (len(path) - 1)):
        lead_handle(work, path, k // count, (k % count + 1) / count)
        if work.port[19] > 0.0:
            follow_hand(work, path, k // count, count, h)
            event_step(model, layout, work, h)
        else:
            sub_step(model, layout, work, h)
        watch_contacts(layout, work, h)


@njit
def lead_handle(work, path, row, share):
    """Handle's position and velocity at this share of the way from a row of its path to the next into work.port."""
    for m in range(6):
        work.port[m] = (1.0 - share) * path[row, m] + share * path[row + 1, m]


@njit
def follow_hand(work, path, row, count, h):
    """Handle a sub-step ago, `count` of which go from this row of its path to the next, and how fast it changes."""
    for m in range(6):
        rate = (path[row + 1, m] - path[row, m]) / (count * h)
        work.hand[0, m], work.hand[1, m] = work.port[m] - h * rate, rate


@njit
def watch_contacts(layout, work, h):
    """Books in work.port[14:] whether a contact pushed the tool, a pair's largest force [N], the deepest overlap."""
    port = work.port
    for k in range(work.counts[3]):
        note, pair = work.note[k], work.note_pair[k]
        x = y = 0.0
        for other in range(work.counts[3]):
            if work.note_pair[other] == pair:
                x, y = x + work.note[other, 4], y + work.note[other, 5]
        if layout.pair_bodies[pair, 0] == 0 or layout.pair_bodies[pair, 1] == 0:
            port[14] = 1.0
        port[15] = max(port[15], math.hypot(x, y) / h)
        port[16] = max(port[16], note[6])


@njit
def sub_step(model, layout, work, h):
    """Advances all bodies by h [s] and books the energy supplied at the tool's port."""
    x, y, angle = work.q[0, 0], work.q[0, 1], work.q[0, 2]
    work.counts[3] = 0
    for k in range(10, 13):
        work.port[k] = 0.0
    held = hold_to_tool(model, layout, work, h) if work.port[17] == 0.0 else hold_all(layout, work)
    if held < layout.linkages:
        for i in range(layout.linkages):
            work.active[i] = 1 - work.active[i]
        left = fly(model, layout, work, h)
        if left > 0.0:
            work.counts[0] += 1
            press(model, layout, work, left)
        for i in range(layout.linkages):
            work.active[i] = 1 - work.active[i]
    if held > 0:
        press(model, layout, work, h)
    q, port = work.q, work.port
    port[13] += port[10] * (q[0, 0] - x) + port[11] * (q[0, 1] - y) + port[12] * (q[0, 2] - angle)


@njit
def event_step(model, layout, work, h):
    """Advances all bodies by h [s] from event to event, the coupling a force along the handle's straight way."""
    q, port = work.q, work.port
    work.counts[3] = 0
    hold_all(layout, work)
    left = fly(model, layout, work, h)
    if left > 0.0:
        work.counts[0] += 1
        x, y, angle = q[0, 0], q[0, 1], q[0, 2]
        press(model, layout, work, left)
        port[13] += port[10] * (q[0, 0] - x) + port[11] * (q[0, 1] - y) + port[12] * (q[0, 2] - angle)
    pull_tool(work, q, work.v, h)
    for k in range(3):
        port[10 + k] = work.pull[k]


@njit
def hold_all(layout, work):
    """Marks every linkage as active; returns how many."""
    for i in range(layout.linkages):
        work.active[i] = 1
    return layout.linkages


@njit
def hold_to_tool(model, layout, work, h):
    """Marks as active the linkages that the coupling can act on within h, by joints or contacts; returns how many."""
    for i in range(layout.linkages):
        work.active[i] = 0
    port, q = work.port, work.q
    if max(max(port[6], port[7]), max(port[8], port[9])) <= 0.0:
        return 0
    work.active[layout.linkage[0]] = 1
    if model.pair_count == 0:
        return 1
    place_shapes(model, layout, work, q)
    pull = math.hypot(port[0] - q[0, 0], port[1] - q[0, 1]) + h * math.hypot(port[3], port[4])
    pull += layout.extent[0] * (abs(port[2] - q[0, 2]) + h * abs(port[5])) if port[8] + port[9] > 0.0 else 0.0
    held, before, last = 1, 0, model.pair_count - 1
    while before < held < layout.linkages:  # to and fro: a stack is followed in one sweep, whichever way it is numbered
        before = held
        for k in range(2 * model.pair_count):
            held += spread(model, layout, work, k if k <= last else 2 * last + 1 - k, h, pull)
    return held


@njit
def spread(model, layout, work, p, h, pull):
    """Activates the other linkage of a pair if the two can meet within h and one is active; returns 1 if it did."""
    a, b = layout.pair_bodies[p, 0], layout.pair_bodies[p, 1]
    la, lb = layout.linkage[a], layout.linkage[b]
    if la < 0 or lb < 0 or work.active[la] == work.active[lb]:
        return 0
    v, s, u = work.v, model.pairs[p, 0], model.pairs[p, 1]
    way = h * math.hypot(v[b, 0] - v[a, 0], v[b, 1] - v[a, 1]) + FALL * h * h + pull
    way += h * (abs(v[a, 2]) * layout.extent[a] + abs(v[b, 2]) * layout.extent[b])
    if far_apart(layout, work, s, u) > way or gap_of(model, work, s, u) > way:
        return 0
    work.active[la] = work.active[lb] = 1
    return 1
