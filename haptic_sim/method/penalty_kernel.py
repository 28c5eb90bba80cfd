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
from haptic_sim.method.constrained_dynamics import constraint_power, work_at_port
from haptic_sim.method.constraints import (
    add_contact_constraints,
    add_joint_constraints,
    constraint_rate,
    evaluate_constraints,
    reference_rate,
)
from haptic_sim.method.delassus_operator import report_impulses
from haptic_sim.method.joints import applied_forces
from haptic_sim.method.lcp import NORMAL
from haptic_sim.method.linkage import apply_inverse_mass, reduce_linkage
from haptic_sim.method.narrow_phase import contact_features, disc_distance, evaluate_contact, place_shapes, signed_gap
from haptic_sim.method.stabilization import stabilize_linkage
from haptic_sim.method.sub_step import interpolate_handle, summarize_contacts


@kernel
def penalty_steps(models, works, h, count, path):
    """`count` sub-steps from each row of the handle's path (position, velocity) evenly to the next."""
    model, work = models[0], works[0]
    for i in range(model.linkages):
        work.active[i] = 1
    for k in range(count * (len(path) - 1)):
        interpolate_handle(work, path, k // count, (k % count + 1) / count)
        penalty_step(model, work, h)
        summarize_contacts(model, work, h)


@njit
def penalty_step(model, work, h):
    """Advances all bodies by h [s] and books the energy supplied at the tool's port."""
    q, v, f = work.q, work.v, work.penalty_kernel.force
    x, y, angle = q[0, 0], q[0, 1], q[0, 2]
    work.report.count = 0
    applied_forces(model, q, v, True, work.joint_row, f)
    explicit_coupling_force(work, f)
    n = explicit_contact_forces(model, work, f, h)
    work.accounts.contacts -= 0.5 * h * constraint_power(work, v, n)
    for b in range(model.bodies - 1):
        mass = model.mass[b]
        f[b, 0], f[b, 1] = mass * v[b, 0] + h * f[b, 0], mass * v[b, 1] + h * f[b, 1]
        f[b, 2] = model.inertia[b] * v[b, 2] + h * f[b, 2]
    for i in range(model.linkages):
        reduce_linkage(model, work, i, q, v, 0.0)
        apply_inverse_mass(model, work, i, f, v)
    work.accounts.contacts -= 0.5 * h * constraint_power(work, v, n)
    for b in range(model.bodies - 1):
        for k in range(3):
            q[b, k] += h * v[b, k]
    for i in range(model.linkages):
        if model.joint_start[i + 1] > model.joint_start[i]:
            stabilize_linkage(model, work, i)
    work.port.supplied += work_at_port(work, x, y, angle)


@njit
def explicit_coupling_force(work, f):
    """The coupling at the start of the sub-step."""
    handle, coupling, force = work.handle, work.coupling, work.port.force
    for k in range(3):
        spring = coupling.stiffness[k] * (handle.position[k] - work.q[0, k])
        force[k] = spring + coupling.damping[k] * (handle.velocity[k] - work.v[0, k])
        f[0, k] += force[k]


@njit
def explicit_contact_forces(model, work, f, h):
    """Adds what overlapping shapes, limits and dry friction in joints push to the forces f; returns how many rows."""
    rows, lcp = work.constraints, work.lcp
    place_shapes(model, work, work.q)
    n = 0
    for p in range(model.pair_count):
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        if disc_distance(model, work, s, u) < 0.0 and signed_gap(model, work, s, u) < 0.0:
            for k in range(contact_features(model, work, s, u)):
                n = add_contact_constraints(model, work, n, p, work.narrow_phase.features[k])
    n += add_joint_constraints(model, work, n, work.q, work.v, 0.0, 1.0)
    evaluate_constraints(model, work, work.q, work.v, n)
    stiffness, damping = work.contact_model.stiffness, work.contact_model.damping
    for r in range(n):
        rate = constraint_rate(work, work.v, r)
        if rows.kind[r] == NORMAL:
            lcp.lam[r] = max(0.0, -stiffness * rows.gap[r] - damping * rate) if rows.gap[r] < 0.0 else 0.0
        else:
            most = rows.bound[r] + (rows.mu[r] * lcp.lam[rows.partner[r]] if rows.partner[r] >= 0 else 0.0)
            slip = rate - reference_rate(model, work, r)
            lcp.lam[r] = -math.copysign(min(most, damping * abs(slip)), slip)
        a, b = rows.body_a[r], rows.body_b[r]
        for k in range(3):
            f[a, k] += rows.G[r, k] * lcp.lam[r]
            f[b, k] += rows.G[r, 3 + k] * lcp.lam[r]
    report_impulses(work, n, h)
    return n


@kernel
def contact_energy(models, works):
    """Energy stored in the springs of all contacts [J]."""
    model, work = models[0], works[0]
    place_shapes(model, work, work.q)
    energy = 0.0
    for p in range(model.pair_count):
        s, u = model.pairs[p, 0], model.pairs[p, 1]
        if disc_distance(model, work, s, u) >= 0.0:
            continue
        for k in range(contact_features(model, work, s, u)):
            evaluate_contact(model, work, work.narrow_phase.features[k])
            energy += 0.5 * work.contact_model.stiffness * min(work.narrow_phase.contact.gap, 0.0) ** 2
    return energy
