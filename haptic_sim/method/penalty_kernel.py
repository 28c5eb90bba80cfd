# SPDX-License-Identifier: Apache-2.0
"""Contacts as springs and dampers, stepped explicitly: the kernels of `penalty_explicit`.

All forces are taken at the start of the sub-step, the new velocities move the bodies (Euler–Cromer):

    v⁺ = W [M v + h (f + Gᵀ λ)] with W = M⁻¹ less the joints,      x⁺ = x + h v⁺
    λ_n = max(0, −k gap − c G_n v) where shapes overlap,   λ_t = −min(μ λ_n, c |G_t v|) sign(G_t v)

Stable only while h² k/m + 2 h c/m < 4, and even then a contact that begins and ends between samples may give back more
than it took: at h² k/m = .5 restitution already exceeds 1.06 at some phases. The coupling is as explicit as the rest.
"""

import math

from haptic_device.jit import kernel, njit
from haptic_sim.method.constrained_dynamics import power
from haptic_sim.method.constraints import add_contact, add_joints, rate_of, refresh, wished
from haptic_sim.method.delassus_operator import note_impulses
from haptic_sim.method.implicit_step import settle
from haptic_sim.method.joints import applied_forces
from haptic_sim.method.lcp import NORMAL
from haptic_sim.method.linkage import reduce_linkage, respond
from haptic_sim.method.narrow_phase import GAP, evaluate, far_apart, gap_of, place_shapes, touch
from haptic_sim.method.sub_step import lead_handle, watch_contacts


@kernel
def penalty_steps(models, layouts, works, h, count, path):
    """`count` sub-steps from each row of the handle's path (position, velocity) evenly to the next."""
    model, layout, work = models[0], layouts[0], works[0]
    for i in range(layout.linkages):
        work.active[i] = 1
    for k in range(count * (len(path) - 1)):
        lead_handle(work, path, k // count, (k % count + 1) / count)
        penalty_step(model, layout, work, h)
        watch_contacts(layout, work, h)


@njit
def penalty_step(model, layout, work, h):
    """Advances all bodies by h [s] and books the energy supplied at the tool's port."""
    q, v, f, port = work.q, work.v, work.smooth, work.port
    x, y, angle = q[0, 0], q[0, 1], q[0, 2]
    work.counts[3] = 0
    applied_forces(model, q, v, True, work.row, f)
    couple_tool(work, f)
    n = push_contacts(model, layout, work, f, h)
    port[20] -= 0.5 * h * power(work, v, n)
    for b in range(model.bodies - 1):
        mass = model.mass[b]
        f[b, 0], f[b, 1] = mass * v[b, 0] + h * f[b, 0], mass * v[b, 1] + h * f[b, 1]
        f[b, 2] = model.inertia[b] * v[b, 2] + h * f[b, 2]
    for i in range(layout.linkages):
        reduce_linkage(model, layout, work, i, q, v, 0.0)
        respond(layout, work, i, f, v)
    port[20] -= 0.5 * h * power(work, v, n)
    for b in range(model.bodies - 1):
        for k in range(3):
            q[b, k] += h * v[b, k]
    for i in range(layout.linkages):
        if layout.joint_start[i + 1] > layout.joint_start[i]:
            settle(model, layout, work, i)
    port[13] += port[10] * (q[0, 0] - x) + port[11] * (q[0, 1] - y) + port[12] * (q[0, 2] - angle)


@njit
def couple_tool(work, f):
    """The coupling at the start of the sub-step."""
    port = work.port
    for k in range(3):
        stiffness, damping = (port[6], port[7]) if k < 2 else (port[8], port[9])
        port[10 + k] = stiffness * (port[k] - work.q[0, k]) + damping * (port[3 + k] - work.v[0, k])
        f[0, k] += port[10 + k]


@njit
def push_contacts(model, layout, work, f, h):
    """Adds what overlapping shapes, limits and dry friction in joints push to the forces f; returns how many rows."""
    place_shapes(model, layout, work, work.q)
    n = 0
    for p in range(model.pair_count):
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        if far_apart(layout, work, s, u) < 0.0 and gap_of(model, work, s, u) < 0.0:
            for k in range(touch(model, work, s, u)):
                n = add_contact(model, layout, work, n, p, work.features[k])
    n += add_joints(model, layout, work, n, work.q, work.v, 0.0, 1.0)
    refresh(model, layout, work, work.q, work.v, n)
    stiffness, damping = work.port[17], work.port[18]
    for r in range(n):
        rate = rate_of(work, work.v, r)
        if work.kind[r] == NORMAL:
            work.lam[r] = max(0.0, -stiffness * work.gap[r] - damping * rate) if work.gap[r] < 0.0 else 0.0
        else:
            most = work.bound[r] + (work.mu[r] * work.lam[work.partner[r]] if work.partner[r] >= 0 else 0.0)
            slip = rate - wished(model, work, r)
            work.lam[r] = -math.copysign(min(most, damping * abs(slip)), slip)
        a, b = work.row_a[r], work.row_b[r]
        for k in range(3):
            f[a, k] += work.G[r, k] * work.lam[r]
            f[b, k] += work.G[r, 3 + k] * work.lam[r]
    note_impulses(work, n, h)
    return n


@kernel
def contact_energy(models, layouts, works):
    """Energy stored in the springs of all contacts [J]."""
    model, layout, work = models[0], layouts[0], works[0]
    place_shapes(model, layout, work, work.q)
    energy = 0.0
    for p in range(model.pair_count):
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        if far_apart(layout, work, s, u) >= 0.0:
            continue
        for k in range(touch(model, work, s, u)):
            evaluate(layout, work, work.features[k])
            energy += 0.5 * work.port[17] * min(work.contact[GAP], 0.0) ** 2
    return energy
