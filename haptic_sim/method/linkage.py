# SPDX-License-Identifier: Apache-2.0
"""Coordinate partitioning: generalized coordinates of a linkage, chosen at run time.

A linkage of bodies with coordinates q (three a body) obeys J(q) v = 0. Gauss–Jordan elimination of J with full
pivoting sorts the velocities into dependent and independent ones (Wehage & Haug 1982; Haug & Yen 1992),

    J = [J_d J_i],    v_d = −J_d⁻¹ J_i u,    v = N u,    N = [−J_d⁻¹ J_i; 1],

and finds by itself which rows are redundant (pivots at rounding). Accelerations obey J a + γ = 0, a = a_p + N u̇ with
a_p = [−J_d⁻¹ γ; 0]. Inserted into M a = f + Jᵀλ and multiplied by Nᵀ, which removes λ:

    a = a_p + W (f − M a_p),        W = N (Nᵀ M N)⁻¹ Nᵀ = Yᵀ Y,    Y = L⁻¹ Nᵀ,  L Lᵀ = Nᵀ M N

W is the inverse mass that the joints leave. It serves impacts (v⁺ = v + W J_c) as well as backward differences over h:
there M gains (h c + h² k) J_sᵀ J_s for each spring-damper and h B + h² K for the coupling at the tool, which is eq. (2)
of `impulse` for a whole linkage. Limits: without joints N = 1 and W = M⁻¹; at a singular position the pivoting takes
other coordinates, and a row that vanishes there is dropped.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.joints import constraint_row, spring_row, spring_row_count
from haptic_sim.reduction.model import SPRING

REDUNDANT = 1e-10
"""Pivot, in the largest entry of J, below which a row says nothing new."""


@njit
def reduce_linkage(model, work, i, q, v, h):
    """Finds N, Y, a_p of linkage i at q, v; with h > 0 for a backward difference over h with the coupling."""
    if model.joint_start[i + 1] == model.joint_start[i]:
        first = model.body_start[i]
        reduce_free_body(model, work, i, model.order[first], 3 * first, h)
    else:
        reduce_jointed(model, work, i, q, v, h)


@njit
def reduce_jointed(model, work, i, q, v, h):
    """The same of a linkage with joints."""
    first, columns = model.body_start[i], 3 * (model.body_start[i + 1] - model.body_start[i])
    partition_coordinates(work, joint_jacobian(model, work, i, q, v), columns)
    work.linkage.freedoms[i] = null_space(model, work, first, columns)
    reduced_mass(model, work, i, q, v, h)
    factor_mass(work, 3 * first, work.linkage.freedoms[i], columns)


@njit
def reduce_free_body(model, work, i, b, row, h):
    """A body without joints: W = M⁻¹."""
    linkage = work.linkage
    stiffness, damping, added, added_turn = work.coupling.stiffness, work.coupling.damping, 0.0, 0.0
    if b == 0 and h > 0.0:
        added = damping[0] * h + stiffness[0] * h * h
        added_turn = damping[2] * h + stiffness[2] * h * h
    y = 1.0 / math.sqrt(model.mass[b] + added)
    for k in range(3):
        for m in range(3):
            linkage.Y[row + k, m] = 0.0
        linkage.bias[b, k] = 0.0
    linkage.Y[row, 0], linkage.Y[row + 1, 1] = y, y
    linkage.Y[row + 2, 2] = 1.0 / math.sqrt(model.inertia[b] + added_turn)
    linkage.freedoms[i] = 3


@njit
def joint_jacobian(model, work, i, q, v):
    """[J | γ | φ] of linkage i; returns the number of rows."""
    J, columns = work.linkage.jacobian, 3 * (model.body_start[i + 1] - model.body_start[i])
    r = 0
    for m in range(model.joint_start[i], model.joint_start[i + 1]):
        j = model.joint_order[m]
        if model.joint_kind[j] == SPRING:
            continue
        a, b = model.place_in[model.joint_bodies[j, 0]], model.place_in[model.joint_bodies[j, 1]]
        for k in range(2):
            phi, gamma = constraint_row(model, q, v, j, k, work.joint_row)
            for c in range(columns):
                J[r, c] = 0.0
            for c in range(3):
                if a >= 0:
                    J[r, 3 * a + c] = work.joint_row[c]
                if b >= 0:
                    J[r, 3 * b + c] = work.joint_row[3 + c]
            J[r, columns], J[r, columns + 1] = gamma, phi
            r += 1
    return r


@njit
def partition_coordinates(work, rows, columns):
    """Gauss–Jordan with full pivoting of [J | γ | φ]; linkage.pivot holds the dependent column of each row kept."""
    linkage = work.linkage
    J, rank, largest = linkage.jacobian, 0, 0.0
    for c in range(columns):
        linkage.dependent[c] = -1
    while rank < rows:
        best, at_row, at_column = 0.0, -1, -1
        for r in range(rank, rows):
            for c in range(columns):
                if linkage.dependent[c] < 0 and abs(J[r, c]) > best:
                    best, at_row, at_column = abs(J[r, c]), r, c
        largest = max(largest, best)
        if best <= REDUNDANT * largest or at_row < 0:
            break
        scale = 1.0 / J[at_row, at_column]
        for c in range(columns + 2):
            kept = J[at_row, c] * scale
            J[at_row, c] = J[rank, c]
            J[rank, c] = kept
        for r in range(rows):
            ratio = J[r, at_column]
            if r != rank and ratio != 0.0:
                for c in range(columns + 2):
                    J[r, c] -= ratio * J[rank, c]
        linkage.dependent[at_column] = rank
        linkage.pivot[rank] = at_column
        rank += 1
    return rank


@njit
def null_space(model, work, first, columns):
    """Rows of Nᵀ into work.linkage.N, a_p into work.linkage.bias; returns the number of independent coordinates."""
    linkage = work.linkage
    J, N, u = linkage.jacobian, linkage.N, 0
    for c in range(columns):
        if linkage.dependent[c] >= 0:
            continue
        for m in range(columns):
            N[u, m] = -J[linkage.dependent[m], c] if linkage.dependent[m] >= 0 else 0.0
        N[u, c] = 1.0
        u += 1
    for c in range(columns):
        r = linkage.dependent[c]
        linkage.bias[model.order[first + c // 3], c % 3] = -J[r, columns] if r >= 0 else 0.0
    return u


@njit
def reduced_mass(model, work, i, q, v, h):
    """Nᵀ M N of linkage i into work.linkage.reduced."""
    linkage = work.linkage
    first, d, N, R = model.body_start[i], linkage.freedoms[i], linkage.N, linkage.reduced
    coupling = work.coupling
    columns = 3 * (model.body_start[i + 1] - first)
    for c in range(columns):
        b = model.order[first + c // 3]
        mass = model.inertia[b] if c % 3 == 2 else model.mass[b]
        if b == 0 and h > 0.0:
            mass += h * coupling.damping[c % 3] + h * h * coupling.stiffness[c % 3]
        linkage.mass[c] = mass
    for u in range(d):
        for w in range(u + 1):
            total = 0.0
            for c in range(columns):
                total += N[u, c] * linkage.mass[c] * N[w, c]
            R[u, w] = total
    if h > 0.0:
        for m in range(model.joint_start[i], model.joint_start[i + 1]):
            add_spring_to_mass(model, work, model.joint_order[m], q, v, h, d)


@njit
def add_spring_to_mass(model, work, j, q, v, h, d):
    """(h c + h² k) of a spring-damper along its rows, seen from the independent coordinates."""
    linkage = work.linkage
    a, b = model.place_in[model.joint_bodies[j, 0]], model.place_in[model.joint_bodies[j, 1]]
    weight = h * model.joint_spring[j, 1] + h * h * model.joint_spring[j, 0]
    for k in range(spring_row_count(model, j)):
        spring_row(model, q, v, j, k, work.joint_row)
        for u in range(d):
            seen = 0.0
            for c in range(3):
                if a >= 0:
                    seen += work.joint_row[c] * linkage.N[u, 3 * a + c]
                if b >= 0:
                    seen += work.joint_row[3 + c] * linkage.N[u, 3 * b + c]
            linkage.seen[u] = seen
        for u in range(d):
            for w in range(u + 1):
                linkage.reduced[u, w] += weight * linkage.seen[u] * linkage.seen[w]


@njit
def factor_mass(work, row, d, columns):
    """Cholesky of work.linkage.reduced, and Y = L⁻¹ Nᵀ into work.linkage.Y from `row` on."""
    linkage = work.linkage
    R, N, Y = linkage.reduced, linkage.N, linkage.Y
    for u in range(d):
        for w in range(u + 1):
            total = R[u, w]
            for k in range(w):
                total -= R[u, k] * R[w, k]
            R[u, w] = math.sqrt(total) if u == w else total / R[w, w]
        for c in range(columns):
            total = N[u, c]
            for k in range(u):
                total -= R[u, k] * Y[row + k, c]
            Y[row + u, c] = total / R[u, u]


@njit
def apply_inverse_mass(model, work, i, f, out):
    """out = W f for the bodies of linkage i; f and out (n, 3)."""
    linkage = work.linkage
    first, columns = model.body_start[i], 3 * (model.body_start[i + 1] - model.body_start[i])
    for c in range(columns):
        out[model.order[first + c // 3], c % 3] = 0.0
    for u in range(linkage.freedoms[i]):
        total = 0.0
        for c in range(columns):
            total += linkage.Y[3 * first + u, c] * f[model.order[first + c // 3], c % 3]
        for c in range(columns):
            out[model.order[first + c // 3], c % 3] += linkage.Y[3 * first + u, c] * total
