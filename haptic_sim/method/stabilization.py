# SPDX-License-Identifier: Apache-2.0
"""After a step: joints and overlaps that the turning of the rows has left are put right, which adds no energy.

Positions are moved to the constraints by the least motion in the sense of the masses, velocities onto what the joints
allow. That works against the forces by an amount of second order; the energy clamp takes it from the motion.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.constrained_dynamics import close_joints
from haptic_sim.method.constraints import evaluate_constraints
from haptic_sim.method.delassus_operator import apply_impulses, delassus_operator
from haptic_sim.method.impact import TOUCHING, kinetic_energy
from haptic_sim.method.joints import spring_energy
from haptic_sim.method.lcp import FREE, FRICTION, NORMAL, OPEN, principal_pivoting
from haptic_sim.method.linkage import apply_inverse_mass, reduce_linkage
from haptic_sim.method.narrow_phase import place_shapes


@njit
def stabilize(model, work, n):
    """Joints and overlaps that the turning of the rows has left, out of the positions; joints out of the velocities."""
    for i in range(model.linkages):
        if work.active[i] > 0 and model.joint_start[i + 1] > model.joint_start[i]:
            stabilize_linkage(model, work, i)
    if n > 0 and work.contact_model.stiffness == 0.0:
        stabilize_contacts(model, work, n)


@njit
def stabilize_linkage(model, work, i):
    """Closes a linkage's joints; then its velocities onto what they allow, orthogonally in the sense of the masses.

    Of all ways to do it this one never adds energy.
    """
    q, v, f = work.q, work.v, work.stabilization.momentum
    close_joints(model, work, i, q, v)
    reduce_linkage(model, work, i, q, v, 0.0)
    for m in range(model.body_start[i], model.body_start[i + 1]):
        b = model.order[m]
        f[b, 0], f[b, 1], f[b, 2] = model.mass[b] * v[b, 0], model.mass[b] * v[b, 1], model.inertia[b] * v[b, 2]
    apply_inverse_mass(model, work, i, f, v)


@njit
def stabilize_contacts(model, work, n):
    """Takes overlaps that the turning of the rows has left out of the positions; velocities stay."""
    rows = work.constraints
    place_shapes(model, work, work.q)
    evaluate_constraints(model, work, work.q, work.v, n)
    deepest = 0.0
    for r in range(n):
        if rows.kind[r] == NORMAL:
            deepest = min(deepest, rows.gap[r])
    if deepest > -TOUCHING:
        return
    delassus_operator(model, work, n)
    for r in range(n):
        work.lcp.b[r] = rows.gap[r]
        work.lcp.mode[r] = FREE if rows.kind[r] == FRICTION or rows.gap[r] < 0.0 else OPEN
    principal_pivoting(work, n, 0.0, 60)
    apply_impulses(model, work, n, work.q)


@njit
def energy_clamp(model, work, most):
    """Slows the active linkages down, all alike, if they have gained more energy than `most` [J].

    What puts joints and contacts right after the step moves them against their forces, by an amount of second order;
    most steps dissipate more than that, and where one does not this takes the difference from the motion. Velocities
    in one proportion still obey joints and contacts.
    """
    excess = energy_of_active(model, work, work.q, work.v) - most
    moving = kinetic_energy(model, work, work.v)
    if excess <= 0.0 or moving <= 0.0:
        return
    share = math.sqrt(max(moving - excess, 0.0) / moving)
    for b in range(model.bodies - 1):
        if work.active[model.linkage[b]] > 0:
            for k in range(3):
                work.v[b, k] *= share


@njit
def energy_of_active(model, work, q, v):
    """Kinetic energy of the active linkages, their potential energy and that of all springs [J], at q, v."""
    energy = kinetic_energy(model, work, v) + spring_energy(model, q, v, work.joint_row)
    for b in range(model.bodies - 1):
        if work.active[model.linkage[b]] > 0:
            energy -= model.mass[b] * (model.gravity[0] * q[b, 0] + model.gravity[1] * q[b, 1])
    return energy
