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

Restitution asks G_n v⁺ ≥ −e G_n v⁻ instead. An impact at speed v₀ under a push f stays passive at the port iff
v₀ ≥ 2 |f| h e/(m (1 − e²)); the push shows as |f| h/m = |G_n (v_free − v)|. A slower one gets e = 0.
So does a step that gains energy by it all the same, as with a coupling that is stiff against m/h².
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.constrained_dynamics import close_joints, power, work_at_port
from haptic_sim.method.constraints import add_joints, drives_work, rate_of, recall, refresh, remember, wished
from haptic_sim.method.continuous_collision import add_met, look_around
from haptic_sim.method.delassus_operator import apply_rows, copy, note_impulses, respond_rows
from haptic_sim.method.impact import RESTING, TOUCHING, kinetic
from haptic_sim.method.joints import applied_forces, spring_energy
from haptic_sim.method.lcp import FREE, FRICTION, NORMAL, solve_modes
from haptic_sim.method.lemke import lemke
from haptic_sim.method.linkage import reduce_linkage, respond
from haptic_sim.method.narrow_phase import place_shapes

FAR = 1e6
"""Speed [m/s] that stands for one that closes an endless way, of a limit that is not there, within the step."""
PASSES = 6
"""Solutions of one step, each with the contacts that the one before has run into."""


@njit
def press(model, layout, work, h):
    """Advances the active linkages by one backward difference of h [s]; sets the force on the tool if it is one."""
    q, v, free = work.q, work.v, work.implicit_step.velocity
    before = energy_held(model, layout, work, work.q, work.v)
    x, y, angle = work.q[0, 0], work.q[0, 1], work.q[0, 2]
    free_velocity(model, layout, work, h)
    n = add_joints(model, layout, work, 0, q, v, 1e9, h)
    copy(free, work.trial.v, model.bodies)
    look_around(model, layout, work)
    for _ in range(PASSES):
        move(model, layout, work, h)
        found = add_met(model, layout, work, n)
        if found == n and (n == 0 or _ > 0):
            break
        n = found
        solve(model, layout, work, n, h, 1.0)
    move(model, layout, work, h)
    if rebounds(model, work, n) and gained(model, layout, work, n) > 0.0:
        solve(model, layout, work, n, h, 0.0)
        move(model, layout, work, h)
    take(model, layout, work, n)
    given = drives_work(model, work, work.v, n)
    reached = energy_held(model, layout, work, work.q, work.v)
    put_right(model, layout, work, n)
    if work.contact_model.stiffness == 0.0:
        supplied = work_at_port(work, x, y, angle)
        if work.active[layout.linkage[0]] == 0:
            supplied = 0.0
        brake(model, layout, work, before + supplied + given)
    work.accounts.correction += energy_held(model, layout, work, work.q, work.v) - reached


@njit
def free_velocity(model, layout, work, h):
    """v⁺ without contacts, of the active linkages, into work.implicit_step.velocity."""
    q, v, f, free = work.q, work.v, work.implicit_step.momentum, work.implicit_step.velocity
    handle, coupling = work.handle, work.coupling
    applied_forces(model, q, v, False, work.joint_row, f)
    for b in range(model.bodies - 1):
        mass, inertia = model.mass[b], model.inertia[b]
        f[b, 0], f[b, 1], f[b, 2] = (
            mass * v[b, 0] + h * f[b, 0],
            mass * v[b, 1] + h * f[b, 1],
            (inertia * v[b, 2] + h * f[b, 2]),
        )
    for k in range(3):
        spring = coupling.stiffness[k] * (handle.position[k] - q[0, k])
        f[0, k] += h * (spring + coupling.damping[k] * handle.velocity[k])
    copy(v, free, model.bodies)
    for i in range(layout.linkages):
        if work.active[i] > 0:
            reduce_linkage(model, layout, work, i, q, v, h)
            respond(layout, work, i, f, free)


@njit
def move(model, layout, work, h):
    """Trial poses: the way of the step along the trial velocities; who is not held stays."""
    trial = work.trial
    copy(work.q, trial.q, model.bodies)
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] > 0:
            for k in range(3):
                trial.q[b, k] += h * trial.v[b, k]


@njit
def solve(model, layout, work, n, h, scale):
    """Trial velocities with n rows; restitution times `scale`."""
    rows, lcp = work.constraints, work.lcp
    free = work.implicit_step.velocity
    place_shapes(model, layout, work, work.q)
    refresh(model, layout, work, work.q, work.v, n)
    respond_rows(model, layout, work, n)
    stiffness, damping = work.contact_model.stiffness, work.contact_model.damping
    for r in range(n):
        lcp.b[r] = rate_of(work, free, r)
        if rows.kind[r] == NORMAL and rows.source[r] == 0 and stiffness > 0.0:
            lcp.b[r] += rows.gap[r] * stiffness / (damping + h * stiffness)
            lcp.A[r, r] += 1.0 / (h * (damping + h * stiffness))
        elif rows.kind[r] == NORMAL:
            lcp.b[r] += room(model, work, r, h, scale)
        else:
            lcp.b[r] -= wished(model, work, r)
        lcp.mode[r] = FREE
    recall(work, n)
    if solve_modes(work, n, 1.0, 60) < 0:
        lemke(work, n)
    remember(work, n)
    copy(free, work.trial.v, model.bodies)
    apply_rows(model, work, n, work.trial.v)


@njit
def room(model, work, r, h, scale):
    """What a normal row adds to its rate G v⁺: the way it has left, gap/h; in a step that would use it up a rebound."""
    left = min(max(work.constraints.gap[r], 0.0) / h, FAR)
    if rate_of(work, work.implicit_step.velocity, r) + left > 0.0:
        return left
    back = scale * rebound(model, work, r)
    return -back if back > 0.0 else left


@njit
def rebound(model, work, r):
    """Rate −e G v⁻ [m/s] at which row r parts after an impact; 0 where it is none, or one too slow."""
    rows = work.constraints
    if rows.kind[r] != NORMAL or rows.source[r] != 0:
        return 0.0
    e, approach = model.pair_restitution[rows.index[r]], -rate_of(work, work.v, r)
    change = abs(rate_of(work, work.implicit_step.velocity, r) + approach)
    return e * approach if approach > RESTING and approach * (1.0 - e * e) >= 2.0 * change * e else 0.0


@njit
def rebounds(model, work, n):
    """Whether any of n rows asks for a rebound."""
    most = 0.0
    for r in range(n):
        most = max(most, rebound(model, work, r))
    return most > 0.0


@njit
def gained(model, layout, work, n):
    """Energy [J] that the trial state has more than the present one and what port, motors and belts supply."""
    trial = work.trial
    supplied = drives_work(model, work, trial.v, n)
    if work.active[layout.linkage[0]] > 0:
        for k in range(3):
            supplied += pull(work, k) * (trial.q[0, k] - work.q[0, k])
    held = energy_held(model, layout, work, trial.q, trial.v)
    return held - energy_held(model, layout, work, work.q, work.v) - supplied


@njit
def pull(work, k):
    """Coupling's force on axis k of the tool in the trial state [N | N m]."""
    spring = work.coupling.stiffness[k] * (work.handle.position[k] - work.trial.q[0, k])
    return spring + work.coupling.damping[k] * (work.handle.velocity[k] - work.trial.v[0, k])


@njit
def take(model, layout, work, n):
    """Takes the trial state; books the contacts, what the rows take, and the force at the port.

    An impulse λ on a velocity that goes from v to v⁺ does the work λ · G (v + v⁺)/2.
    """
    trial = work.trial
    q, v = work.q, work.v
    note_impulses(work, n, 1.0)
    work.accounts.contacts -= 0.5 * (power(work, v, n) + power(work, trial.v, n))
    if work.active[layout.linkage[0]] > 0:
        for k in range(3):
            work.port.force[k] = pull(work, k)
    copy(trial.v, v, model.bodies)
    copy(trial.q, q, model.bodies)


@njit
def put_right(model, layout, work, n):
    """Joints and overlaps that the turning of the rows has left, out of the positions; joints out of the velocities."""
    for i in range(layout.linkages):
        if work.active[i] > 0 and layout.joint_start[i + 1] > layout.joint_start[i]:
            settle(model, layout, work, i)
    if n > 0 and work.contact_model.stiffness == 0.0:
        push_out(model, layout, work, n)


@njit
def energy_held(model, layout, work, q, v):
    """Kinetic energy of the active linkages, their potential energy and that of all springs [J], at q, v."""
    energy = kinetic(model, layout, work, v) + spring_energy(model, q, v, work.joint_row)
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] > 0:
            energy -= model.mass[b] * (model.gravity[0] * q[b, 0] + model.gravity[1] * q[b, 1])
    return energy


@njit
def brake(model, layout, work, most):
    """Slows the active linkages down, all alike, if they have gained more energy than `most` [J].

    What puts joints and contacts right after the step moves them against their forces, by an amount of second order;
    most steps dissipate more than that, and where one does not this takes the difference from the motion. Velocities
    in one proportion still obey joints and contacts.
    """
    excess, moving = energy_held(model, layout, work, work.q, work.v) - most, kinetic(model, layout, work, work.v)
    if excess <= 0.0 or moving <= 0.0:
        return
    share = math.sqrt(max(moving - excess, 0.0) / moving)
    for b in range(model.bodies - 1):
        if work.active[layout.linkage[b]] > 0:
            for k in range(3):
                work.v[b, k] *= share


@njit
def settle(model, layout, work, i):
    """Closes a linkage's joints; then its velocities onto what they allow, orthogonally in the sense of the masses.

    Of all ways to do it this one never adds energy.
    """
    q, v, f = work.q, work.v, work.stabilization.momentum
    close_joints(model, layout, work, i, q, v)
    reduce_linkage(model, layout, work, i, q, v, 0.0)
    for m in range(layout.body_start[i], layout.body_start[i + 1]):
        b = layout.order[m]
        f[b, 0], f[b, 1], f[b, 2] = model.mass[b] * v[b, 0], model.mass[b] * v[b, 1], model.inertia[b] * v[b, 2]
    respond(layout, work, i, f, v)


@njit
def push_out(model, layout, work, n):
    """Takes overlaps that the turning of the rows has left out of the positions; velocities stay."""
    rows = work.constraints
    place_shapes(model, layout, work, work.q)
    refresh(model, layout, work, work.q, work.v, n)
    deepest = 0.0
    for r in range(n):
        if rows.kind[r] == NORMAL:
            deepest = min(deepest, rows.gap[r])
    if deepest > -TOUCHING:
        return
    respond_rows(model, layout, work, n)
    for r in range(n):
        work.lcp.b[r] = rows.gap[r]
        work.lcp.mode[r] = FREE if rows.kind[r] == FRICTION or rows.gap[r] < 0.0 else 0
    solve_modes(work, n, 0.0, 60)
    apply_rows(model, work, n, work.q)
