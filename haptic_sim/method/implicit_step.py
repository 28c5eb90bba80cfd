# SPDX-License-Identifier: Apache-2.0
"""One backward difference of what the coupling holds, with joints, contacts and friction solved in the same step.

In the generalized coordinates of each linkage (see `linkage`; W holds h B + h² K of the coupling and h c + h² k of
springs) with all forces taken over h, and contact rows at the poses of the start (Stewart & Trinkle 1996, Anitescu &
Potra 1997):

    v⁺ = W [M v + h f + h (K (x_h⁺ − x) + B v_h⁺)] + W Gᵀ λ,     q⁺ = q + h v⁺
    0 ≤ λ_n ⟂ G_n v⁺ + gap/h ≥ 0,     |λ_t| ≤ μ λ_n against G_t v⁺                                        (1)

This always has a solution, and gives at the port, with F = K (x_h⁺ − x⁺) + B (v_h⁺ − v⁺) over Δx = h v⁺,

    F · Δx = ΔE + ½ Δvᵀ M Δv + gap · λ_n/h + friction's work,

so that it absorbs: discrete-time passive, as section 4 of Colgate, Stanley & Brown (1995) asks. What (1) leaves out is
the turning of the rows within h, of second order; it is put right in the positions afterwards.

Which contact: the motion decides. The way of the step is searched for the time at which the shapes meet, in pieces of
a quarter of their widths, and the contact is read off there: no shape is passed, no wrong side is taken. Contacts
the first solution runs into are added, and it is solved again.

Contacts of a stiffness k and a damping c (`penalty_implicit`) push with λ/h = −k (gap + h w) − c w at the end of the
step: the row's diagonal gains 1/(h (c + h k)) and its b is gap k/(c + h k), which tends to (1) as k grows.

Restitution asks G_n v⁺ ≥ −e' G_n v⁻ instead, with e' ≤ e. A rebound from the speed v₀ to e' v₀ loses m v₀² (1 − e'²)/2
and goes the way h e' v₀, on which the coupling is paid |f| h e' v₀ if it pushes against it with f. So it is passive at
the port iff v₀ (1 − e'²) ≥ 2 (|f| h/m) e', and the largest such e' is

    e' = min(e, √(1 + k²) − k),    k = |f| h/(m v₀) = |G_n W h f|/v₀

It is continuous in e, f and v₀, and a body that is pressed comes to rest since e' → v₀ m/(2 |f| h) as v₀ → 0. Where the
rebounds of a step gain energy all the same (other forces, a coupling that is stiff against m/h²), all of them are
lowered alike to what gains none.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.constrained_dynamics import constraint_power, work_at_port
from haptic_sim.method.constraints import (
    CONTACT,
    add_joint_constraints,
    constraint_rate,
    evaluate_constraints,
    reference_rate,
    restore_modes,
    store_modes,
    work_of_drives,
)
from haptic_sim.method.continuous_collision import add_collisions, start_collision_search
from haptic_sim.method.delassus_operator import apply_impulses, copy_vectors, delassus_operator, report_impulses
from haptic_sim.method.impact import CLOSE, MOST_SHARES, RESTING, Bracket, narrowed, share_between
from haptic_sim.method.joints import applied_forces
from haptic_sim.method.lcp import FREE, NORMAL, principal_pivoting
from haptic_sim.method.lemke import lemke
from haptic_sim.method.linkage import apply_inverse_mass, reduce_linkage
from haptic_sim.method.narrow_phase import place_shapes
from haptic_sim.method.stabilization import energy_clamp, energy_of_active, stabilize

FASTEST = 1e6
"""Speed [m/s] that stands for one that closes an endless way, of a limit that is not there, within the step."""
MOST_SOLUTIONS = 6
"""Solutions of one step, each with the contacts that the one before has run into."""


@njit
def implicit_step(model, work, h):
    """Advances the active linkages by one backward difference of h [s]; sets the force on the tool if it is one."""
    q, v, free = work.q, work.v, work.implicit_step.velocity
    before = energy_of_active(model, work, q, v)
    x, y, angle = q[0, 0], q[0, 1], q[0, 2]
    unconstrained_velocity(model, work, h)
    n = add_joint_constraints(model, work, 0, q, v, 1e9, h)
    copy_vectors(free, work.trial.v, model.bodies)
    start_collision_search(model, work)
    for solution in range(MOST_SOLUTIONS):
        move_trial(model, work, h)
        found = add_collisions(model, work, n)
        if found == n and (n == 0 or solution > 0):
            break
        n = found
        solve_constraints(model, work, n, h, 1.0)
    move_trial(model, work, h)
    if has_rebound(model, work, n, h):
        lower_rebounds(model, work, n, h)
    accept_trial(model, work, n)
    given = work_of_drives(model, work, v, n)
    reached = energy_of_active(model, work, q, v)
    stabilize(model, work, n)
    if work.contact_model.stiffness == 0.0:
        supplied = work_at_port(work, x, y, angle)
        if work.active[model.linkage[0]] == 0:
            supplied = 0.0
        energy_clamp(model, work, before + supplied + given)
    work.accounts.correction += energy_of_active(model, work, q, v) - reached


@njit
def unconstrained_velocity(model, work, h):
    """v⁺ without contacts, of the active linkages, into work.implicit_step.velocity."""
    q, v, f, free = work.q, work.v, work.implicit_step.momentum, work.implicit_step.velocity
    handle, coupling = work.handle, work.coupling
    applied_forces(model, q, v, False, work.joint_row, f)
    for b in range(model.bodies - 1):
        mass, inertia = model.mass[b], model.inertia[b]
        f[b, 0], f[b, 1] = mass * v[b, 0] + h * f[b, 0], mass * v[b, 1] + h * f[b, 1]
        f[b, 2] = inertia * v[b, 2] + h * f[b, 2]
    for k in range(3):
        spring = coupling.stiffness[k] * (handle.position[k] - q[0, k])
        f[0, k] += h * (spring + coupling.damping[k] * handle.velocity[k])
    copy_vectors(v, free, model.bodies)
    for i in range(model.linkages):
        if work.active[i] > 0:
            reduce_linkage(model, work, i, q, v, h)
            apply_inverse_mass(model, work, i, f, free)


@njit
def move_trial(model, work, h):
    """Trial poses: the way of the step along the trial velocities; who is not held stays."""
    trial = work.trial
    copy_vectors(work.q, trial.q, model.bodies)
    for b in range(model.bodies - 1):
        if work.active[model.linkage[b]] > 0:
            for k in range(3):
                trial.q[b, k] += h * trial.v[b, k]


@njit
def solve_constraints(model, work, n, h, scale):
    """Trial velocities with n rows; restitution times `scale`."""
    rows, lcp, free = work.constraints, work.lcp, work.implicit_step.velocity
    place_shapes(model, work, work.q)
    evaluate_constraints(model, work, work.q, work.v, n)
    delassus_operator(model, work, n)
    stiffness, damping = work.contact_model.stiffness, work.contact_model.damping
    for r in range(n):
        lcp.b[r] = constraint_rate(work, free, r)
        if rows.kind[r] == NORMAL and rows.source[r] == CONTACT and stiffness > 0.0:
            lcp.b[r] += rows.gap[r] * stiffness / (damping + h * stiffness)
            lcp.A[r, r] += 1.0 / (h * (damping + h * stiffness))
        elif rows.kind[r] == NORMAL:
            lcp.b[r] += approach_allowed(model, work, r, h, scale)
        else:
            lcp.b[r] -= reference_rate(model, work, r)
        lcp.mode[r] = FREE
    restore_modes(work, n)
    if principal_pivoting(work, n, 1.0, 60) < 0:
        lemke(work, n)
    store_modes(work, n)
    copy_vectors(free, work.trial.v, model.bodies)
    apply_impulses(model, work, n, work.trial.v)


@njit
def approach_allowed(model, work, r, h, scale):
    """What a normal row adds to its rate G v⁺: the way it has left, gap/h; in a step that would use it up a rebound."""
    left = min(max(work.constraints.gap[r], 0.0) / h, FASTEST)
    if constraint_rate(work, work.implicit_step.velocity, r) + left > 0.0:
        return left
    back = scale * rebound_rate(model, work, r, h)
    return -back if back > 0.0 else left


@njit
def rebound_rate(model, work, r, h):
    """Rate −e' G v⁻ [m/s] at which row r parts after an impact; 0 where it is none."""
    rows = work.constraints
    if rows.kind[r] != NORMAL or rows.source[r] != CONTACT or model.pair_restitution[rows.index[r]] == 0.0:
        return 0.0
    approach = -constraint_rate(work, work.v, r)
    if approach <= RESTING:
        return 0.0
    k = change_by_coupling(work, r, h) / approach
    return min(model.pair_restitution[rows.index[r]], 1.0 / (math.sqrt(1.0 + k * k) + k)) * approach


@njit
def change_by_coupling(work, r, h):
    """|G W h f| [m/s] by which the coupling alone changes the rate of row r within the step, if the tool goes on."""
    handle, coupling, change = work.handle, work.coupling, 0.0
    for k in range(3):
        spring = coupling.stiffness[k] * (handle.position[k] - work.q[0, k] - h * work.v[0, k])
        force = spring + coupling.damping[k] * (handle.velocity[k] - work.v[0, k])
        change += h * force * work.delassus_operator.response[r, 0, k]
    return abs(change)


@njit
def has_rebound(model, work, n, h):
    """Whether any of n rows asks for a rebound."""
    most = 0.0
    for r in range(n):
        most = max(most, rebound_rate(model, work, r, h))
    return most > 0.0


@njit
def lower_rebounds(model, work, n, h):
    """Lowers all rebounds of the trial state alike, to the largest share by which the step gains no energy."""
    gained = energy_gained(model, work, n)
    if gained <= 0.0:
        return
    bracket = Bracket(0.0, energy_gained_at(model, work, n, h, 0.0), 1.0, gained, 0)
    close = CLOSE * (bracket.lost - gained)
    for _ in range(MOST_SHARES):
        if bracket.lost >= close:
            break
        share = share_between(bracket)
        bracket = narrowed(bracket, share, energy_gained_at(model, work, n, h, share))
    energy_gained_at(model, work, n, h, bracket.low)


@njit
def energy_gained_at(model, work, n, h, share):
    """The same with this share of the rebounds, which becomes the trial state."""
    solve_constraints(model, work, n, h, share)
    move_trial(model, work, h)
    return energy_gained(model, work, n)


@njit
def energy_gained(model, work, n):
    """Energy [J] that the trial state has more than the present one and what port, motors and belts supply."""
    trial = work.trial
    supplied = work_of_drives(model, work, trial.v, n)
    if work.active[model.linkage[0]] > 0:
        for k in range(3):
            supplied += coupling_force_at_end(work, k) * (trial.q[0, k] - work.q[0, k])
    held = energy_of_active(model, work, trial.q, trial.v)
    return held - energy_of_active(model, work, work.q, work.v) - supplied


@njit
def coupling_force_at_end(work, k):
    """Coupling's force on axis k of the tool in the trial state [N | N m]."""
    spring = work.coupling.stiffness[k] * (work.handle.position[k] - work.trial.q[0, k])
    return spring + work.coupling.damping[k] * (work.handle.velocity[k] - work.trial.v[0, k])


@njit
def accept_trial(model, work, n):
    """Takes the trial state; books the contacts, what the rows take, and the force at the port.

    An impulse λ on a velocity that goes from v to v⁺ does the work λ · G (v + v⁺)/2.
    """
    q, v, trial = work.q, work.v, work.trial
    report_impulses(work, n, 1.0)
    work.accounts.contacts -= 0.5 * (constraint_power(work, v, n) + constraint_power(work, trial.v, n))
    if work.active[model.linkage[0]] > 0:
        for k in range(3):
            work.port.force[k] = coupling_force_at_end(work, k)
    copy_vectors(trial.v, v, model.bodies)
    copy_vectors(trial.q, q, model.bodies)
