# SPDX-License-Identifier: Apache-2.0
"""Motion between events: accelerations under the present constraints, Runge–Kutta, return to the manifold.

While no contact is made or broken and nothing starts or stops sliding, the bodies obey a smooth equation in the
generalized coordinates: joints, touching and sticking contacts are bilateral rows, sliding ones a force. It is
integrated by an explicit formula, of order 8 in free flight, of order 4 in contact, where a stage costs a solution for
the contact forces and steps are cut short by events anyway. Then the dependent coordinates are found again from the
independent ones by Newton's method, so that constraints hold to rounding.
"""

from haptic_device.jit import njit
from haptic_sim.method.constraints import constraint_rate, evaluate_constraints, reference_rate
from haptic_sim.method.delassus_operator import apply_impulses, copy_vectors, delassus_operator, zero_vectors
from haptic_sim.method.formulas import SLOPES_4, SLOPES_8, WEIGHTS_4, WEIGHTS_8
from haptic_sim.method.joints import applied_forces
from haptic_sim.method.lcp import FREE, NORMAL, solve_in_modes
from haptic_sim.method.linkage import apply_inverse_mass, joint_jacobian, partition_coordinates, reduce_linkage
from haptic_sim.method.narrow_phase import place_shapes

CONVERGED = 1e-14
"""Residual of a constraint [m | rad] that Newton's method leaves alone."""


@njit
def unconstrained_acceleration(model, work, q, v):
    """Accelerations [m/s², rad/s²] without contacts, into work.constrained_dynamics; 0 for inactive linkages."""
    linkage, dynamics = work.linkage, work.constrained_dynamics
    applied_forces(model, q, v, True, work.joint_row, dynamics.force)
    f, a = dynamics.force, dynamics.acceleration
    if work.coupling.event_driven:
        coupling_force(work, q, v, work.clock.stage)
        for k in range(3):
            f[0, k] += dynamics.tool_force[k]
    zero_vectors(a, model.bodies)
    for i in range(model.linkages):
        if work.active[i] == 0:
            continue
        reduce_linkage(model, work, i, q, v, 0.0)
        for m in range(model.body_start[i], model.body_start[i + 1]):
            b = model.order[m]
            f[b, 0] -= model.mass[b] * linkage.bias[b, 0]
            f[b, 1] -= model.mass[b] * linkage.bias[b, 1]
            f[b, 2] -= model.inertia[b] * linkage.bias[b, 2]
        apply_inverse_mass(model, work, i, f, a)
        for m in range(model.body_start[i], model.body_start[i + 1]):
            for k in range(3):
                a[model.order[m], k] += linkage.bias[model.order[m], k]


@njit
def coupling_force(work, q, v, time):
    """Force of the coupling on the tool [N, N, N m] with the handle where it is `time` [s] into the sub-step."""
    handle, coupling, force = work.handle, work.coupling, work.constrained_dynamics.tool_force
    for k in range(3):
        position = handle.start_position[k] + time * handle.position_rate[k]
        velocity = handle.start_velocity[k] + time * handle.velocity_rate[k]
        force[k] = coupling.stiffness[k] * (position - q[0, k]) + coupling.damping[k] * (velocity - v[0, k])


@njit
def work_at_port(work, x, y, angle):
    """Work [J] of the force on the tool over its way from the pose x, y, angle to where it is."""
    force, q = work.port.force, work.q
    return force[0] * (q[0, 0] - x) + force[1] * (q[0, 1] - y) + force[2] * (q[0, 2] - angle)


@njit
def constrained_acceleration(model, work, q, v, n):
    """Accelerations with n rows in their present modes, into work.constrained_dynamics.acceleration."""
    unconstrained_acceleration(model, work, q, v)
    if n == 0:
        return
    place_shapes(model, work, q)
    evaluate_constraints(model, work, q, v, n)
    delassus_operator(model, work, n)
    for r in range(n):
        work.lcp.b[r] = constraint_rate(work, work.constrained_dynamics.acceleration, r) + work.constraints.gamma[r]
    solve_in_modes(work, n, 1.0)
    apply_impulses(model, work, n, work.constrained_dynamics.acceleration)


@njit
def runge_kutta_step(model, work, tau, n):
    """Trial state after `tau` [s] from work.q, work.v, brought back to the constraints.

    The work of the coupling, and that of the rows, are integrated as well.
    """
    dynamics, trial = work.constrained_dynamics, work.trial
    slopes, weights = (SLOPES_8, WEIGHTS_8) if n == 0 else (SLOPES_4, WEIGHTS_4)
    q, v, at_q, at_v, pull = work.q, work.v, dynamics.stage_q, dynamics.stage_v, dynamics.tool_force
    stages = len(weights)
    for s in range(stages):
        copy_vectors(q, at_q, model.bodies)
        copy_vectors(v, at_v, model.bodies)
        work.clock.stage = work.clock.state
        for k in range(s):
            if slopes[s, k] != 0.0:
                add_slope(model, work, at_q, at_v, tau * slopes[s, k], k)
                work.clock.stage += tau * slopes[s, k]
        constrained_acceleration(model, work, at_q, at_v, n)
        dynamics.slopes_taken[s] = -constraint_power(work, at_v, n)
        dynamics.slopes_supplied[s] = pull[0] * at_v[0, 0] + pull[1] * at_v[0, 1] + pull[2] * at_v[0, 2]
        for b in range(model.bodies):
            for k in range(3):
                dynamics.slopes_q[s, b, k], dynamics.slopes_v[s, b, k] = at_v[b, k], dynamics.acceleration[b, k]
    copy_vectors(q, trial.q, model.bodies)
    copy_vectors(v, trial.v, model.bodies)
    trial.supplied, trial.taken, work.clock.stage = 0.0, 0.0, work.clock.state + tau
    for s in range(stages):
        add_slope(model, work, trial.q, trial.v, tau * weights[s], s)
        trial.supplied += tau * weights[s] * dynamics.slopes_supplied[s]
        trial.taken += tau * weights[s] * dynamics.slopes_taken[s]
    project_onto_constraints(model, work, trial.q, trial.v, n)


@njit
def constraint_power(work, v, n):
    """What n rows give to bodies at velocities v [W]."""
    given = 0.0
    for r in range(n):
        given += work.lcp.lam[r] * constraint_rate(work, v, r)
    return given


@njit
def add_slope(model, work, q, v, part, s):
    """Adds a part of the slopes of stage s for bodies that are being advanced."""
    for b in range(model.bodies - 1):
        if work.active[model.linkage[b]] == 0:
            continue
        for k in range(3):
            q[b, k] += part * work.constrained_dynamics.slopes_q[s, b, k]
            v[b, k] += part * work.constrained_dynamics.slopes_v[s, b, k]


@njit
def project_onto_constraints(model, work, q, v, n):
    """Newton steps of the dependent coordinates, then their velocities, then contacts that are held."""
    for i in range(model.linkages):
        if work.active[i] > 0 and model.joint_start[i + 1] > model.joint_start[i]:
            project_linkage(model, work, i, q, v)
    if n > 0:
        project_contacts(model, work, q, v, n)


@njit
def project_linkage(model, work, i, q, v):
    """Dependent coordinates and velocities of a linkage from the independent ones."""
    linkage = work.linkage
    first, J = model.body_start[i], linkage.jacobian
    columns = 3 * (model.body_start[i + 1] - first)
    rank = close_joints(model, work, i, q, v)
    for r in range(rank):
        total = 0.0
        for c in range(columns):
            if linkage.dependent[c] < 0:
                total += J[r, c] * v[model.order[first + c // 3], c % 3]
        c = linkage.pivot[r]
        v[model.order[first + c // 3], c % 3] = -total


@njit
def close_joints(model, work, i, q, v):
    """Dependent coordinates of a linkage by Newton's method; returns the rank, J is left eliminated there."""
    first, J, rank = model.body_start[i], work.linkage.jacobian, 0
    columns = 3 * (model.body_start[i + 1] - first)
    for _ in range(8):
        rank = partition_coordinates(work, joint_jacobian(model, work, i, q, v), columns)
        largest = 0.0
        for r in range(rank):
            largest = max(largest, abs(J[r, columns + 1]))
        if largest < CONVERGED:
            break
        for r in range(rank):
            c = work.linkage.pivot[r]
            q[model.order[first + c // 3], c % 3] -= J[r, columns + 1]
    return rank


@njit
def project_contacts(model, work, q, v, n):
    """Gaps of held contacts to zero, by the least motion in the sense of the masses; then held rates to zero.

    Sliding rows are left without force.
    """
    for i in range(model.linkages):
        if work.active[i] > 0:
            reduce_linkage(model, work, i, q, v, 0.0)
    place_shapes(model, work, q)
    evaluate_constraints(model, work, q, v, n)
    delassus_operator(model, work, n)
    if largest_held_gap(work, n) > CONVERGED:
        for r in range(n):
            work.lcp.b[r] = work.constraints.gap[r] if work.constraints.kind[r] == NORMAL else 0.0
        solve_in_modes(work, n, 0.0)
        apply_impulses(model, work, n, q)
    for r in range(n):
        work.lcp.b[r] = constraint_rate(work, v, r) - reference_rate(model, work, r)
    solve_in_modes(work, n, 0.0)
    apply_impulses(model, work, n, v)


@njit
def largest_held_gap(work, n):
    """Largest gap, or overlap, of a contact that is held [m]."""
    largest = 0.0
    for r in range(n):
        if work.constraints.kind[r] == NORMAL and work.lcp.mode[r] == FREE:
            largest = max(largest, abs(work.constraints.gap[r]))
    return largest
