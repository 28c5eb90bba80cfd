# SPDX-License-Identifier: Apache-2.0
"""Motion between events: accelerations under the present constraints, Runge–Kutta, return to the manifold.

While no contact is made or broken and nothing starts or stops sliding, the bodies obey a smooth equation in the
generalized coordinates: joints, touching and sticking contacts are bilateral rows, sliding ones a force. It is
integrated by an explicit formula, of order 8 in free flight, of order 4 in contact, where a stage costs a solution for
the contact forces and steps are cut short by events anyway. Then the dependent
coordinates are then found again from the independent ones by Newton's method, so that constraints hold to rounding.
"""

from haptic_device.jit import njit
from haptic_sim.method.constraints import rate_of, refresh, wished
from haptic_sim.method.delassus_operator import apply_rows, copy, respond_rows, zero
from haptic_sim.method.formulas import SLOPES_4, SLOPES_8, WEIGHTS_4, WEIGHTS_8
from haptic_sim.method.joints import applied_forces
from haptic_sim.method.lcp import FREE, NORMAL, solve_linear
from haptic_sim.method.linkage import eliminate, fill_rows, reduce_linkage, respond
from haptic_sim.method.narrow_phase import place_shapes

MET = 1e-14
"""Residual of a constraint [m | rad] that Newton's method leaves alone."""


@njit
def free_acceleration(model, layout, work, q, v):
    """Accelerations [m/s², rad/s²] without contacts, into work.free_v; bodies of inactive linkages get none."""
    applied_forces(model, q, v, True, work.row, work.smooth)
    f, a = work.smooth, work.free_v
    if work.port[19] > 0.0:
        pull_tool(work, q, v, work.clock[1])
        for k in range(3):
            f[0, k] += work.pull[k]
    zero(a, model.bodies)
    for i in range(layout.linkages):
        if work.active[i] == 0:
            continue
        reduce_linkage(model, layout, work, i, q, v, 0.0)
        for m in range(layout.body_start[i], layout.body_start[i + 1]):
            b = layout.order[m]
            f[b, 0] -= model.mass[b] * work.bias[b, 0]
            f[b, 1] -= model.mass[b] * work.bias[b, 1]
            f[b, 2] -= model.inertia[b] * work.bias[b, 2]
        respond(layout, work, i, f, a)
        for m in range(layout.body_start[i], layout.body_start[i + 1]):
            for k in range(3):
                a[layout.order[m], k] += work.bias[layout.order[m], k]


@njit
def pull_tool(work, q, v, time):
    """Force of the coupling on the tool [N, N, N m] with the handle where it is `time` [s] into the sub-step."""
    port, hand = work.port, work.hand
    for k in range(3):
        stiffness, damping = (port[6], port[7]) if k < 2 else (port[8], port[9])
        place, rate = hand[0, k] + time * hand[1, k], hand[0, 3 + k] + time * hand[1, 3 + k]
        work.pull[k] = stiffness * (place - q[0, k]) + damping * (rate - v[0, k])


@njit
def accelerate(model, layout, work, q, v, n):
    """Accelerations with n rows in their present modes, into work.free_v."""
    free_acceleration(model, layout, work, q, v)
    if n == 0:
        return
    place_shapes(model, layout, work, q)
    refresh(model, layout, work, q, v, n)
    respond_rows(model, layout, work, n)
    for r in range(n):
        work.b[r] = rate_of(work, work.free_v, r) + work.gamma[r]
    solve_linear(work, n, 1.0)
    apply_rows(model, work, n, work.free_v)


@njit
def advance(model, layout, work, tau, n):
    """Trial state after `tau` [s] from work.q, work.v, brought back to the constraints.

    The work of the coupling, and that of the rows, are integrated as well.
    """
    slopes, weights = (SLOPES_8, WEIGHTS_8) if n == 0 else (SLOPES_4, WEIGHTS_4)
    q, v, at_q, at_v = work.q, work.v, work.stage_q, work.stage_v
    stages = len(weights)
    for s in range(stages):
        copy(q, at_q, model.bodies)
        copy(v, at_v, model.bodies)
        work.clock[1] = work.clock[0]
        for k in range(s):
            if slopes[s, k] != 0.0:
                add(model, layout, work, at_q, at_v, tau * slopes[s, k], k)
                work.clock[1] += tau * slopes[s, k]
        accelerate(model, layout, work, at_q, at_v, n)
        work.slopes_lost[s] = -power(work, at_v, n)
        work.slopes_work[s] = work.pull[0] * at_v[0, 0] + work.pull[1] * at_v[0, 1] + work.pull[2] * at_v[0, 2]
        for b in range(model.bodies):
            for k in range(3):
                work.slopes_q[s, b, k], work.slopes_v[s, b, k] = at_v[b, k], work.free_v[b, k]
    copy(q, work.trial_q, model.bodies)
    copy(v, work.trial_v, model.bodies)
    work.supply, work.lost, work.clock[1] = 0.0, 0.0, work.clock[0] + tau
    for s in range(stages):
        add(model, layout, work, work.trial_q, work.trial_v, tau * weights[s], s)
        work.supply += tau * weights[s] * work.slopes_work[s]
        work.lost += tau * weights[s] * work.slopes_lost[s]
    bring_back(model, layout, work, work.trial_q, work.trial_v, n)


@njit
def power(work, v, n):
    """What n rows give to bodies at velocities v [W]."""
    given = 0.0
    for r in range(n):
        given += work.lam[r] * rate_of(work, v, r)
    return given


@njit
def add(model, layout, work, q, v, part, s):
    """Adds a part of the slopes of stage s for bodies that are being advanced."""
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] == 0:
            continue
        for k in range(3):
            q[b, k] += part * work.slopes_q[s, b, k]
            v[b, k] += part * work.slopes_v[s, b, k]


@njit
def bring_back(model, layout, work, q, v, n):
    """Newton steps of the dependent coordinates, then their velocities, then contacts that are held."""
    for i in range(layout.linkages):
        if work.active[i] > 0 and layout.joint_start[i + 1] > layout.joint_start[i]:
            bring_back_linkage(model, layout, work, i, q, v)
    if n > 0:
        bring_back_contacts(model, layout, work, q, v, n)


@njit
def bring_back_linkage(model, layout, work, i, q, v):
    """Dependent coordinates and velocities of a linkage from the independent ones."""
    first, J = layout.body_start[i], work.jacobian
    columns = 3 * (layout.body_start[i + 1] - first)
    rank = close_joints(model, layout, work, i, q, v)
    for r in range(rank):
        total = 0.0
        for c in range(columns):
            if work.dependent[c] < 0:
                total += J[r, c] * v[layout.order[first + c // 3], c % 3]
        c = work.pivot[r]
        v[layout.order[first + c // 3], c % 3] = -total


@njit
def close_joints(model, layout, work, i, q, v):
    """Dependent coordinates of a linkage by Newton's method; returns the rank, J is left eliminated there."""
    first, J, rank = layout.body_start[i], work.jacobian, 0
    columns = 3 * (layout.body_start[i + 1] - first)
    for _ in range(8):
        rank = eliminate(work, fill_rows(model, layout, work, i, q, v), columns)
        largest = 0.0
        for r in range(rank):
            largest = max(largest, abs(J[r, columns + 1]))
        if largest < MET:
            break
        for r in range(rank):
            c = work.pivot[r]
            q[layout.order[first + c // 3], c % 3] -= J[r, columns + 1]
    return rank


@njit
def bring_back_contacts(model, layout, work, q, v, n):
    """Gaps of held contacts to zero, by the least motion in the sense of the masses; then held rates to zero."""
    for i in range(layout.linkages):
        if work.active[i] > 0:
            reduce_linkage(model, layout, work, i, q, v, 0.0)
    place_shapes(model, layout, work, q)
    refresh(model, layout, work, q, v, n)
    respond_rows(model, layout, work, n)
    if held_gap(work, n) > MET:
        for r in range(n):
            work.b[r] = work.gap[r] if work.kind[r] == NORMAL else 0.0
        hold(work, n)
        apply_rows(model, work, n, q)
    for r in range(n):
        work.b[r] = rate_of(work, v, r) - wished(model, work, r)
    hold(work, n)
    apply_rows(model, work, n, v)


@njit
def held_gap(work, n):
    """Largest gap, or overlap, of a contact that is held [m]."""
    largest = 0.0
    for r in range(n):
        if work.kind[r] == NORMAL and work.mode[r] == FREE:
            largest = max(largest, abs(work.gap[r]))
    return largest


@njit
def hold(work, n):
    """λ that takes the rates b of all held rows to zero, sliding ones without force."""
    solve_linear(work, n, 0.0)
