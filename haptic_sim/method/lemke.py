# SPDX-License-Identifier: Apache-2.0
"""Lemke's complementary pivoting for contact with friction: slower than `lcp`, but sure to end.

Friction is split, λ = β⁺ − β⁻, with the slip speed σ as its multiplier (Stewart & Trinkle 1996, eq. 13):

    0 ≤ β± ⟂ ± w + σ ≥ 0,      0 ≤ σ ⟂ c + μ λ_n − β⁺ − β⁻ ≥ 0,      0 ≤ λ_n ⟂ w_n ≥ 0

The matrix is copositive, so that for velocities (impacts, backward differences) the pivoting ends in a solution and not
on a ray (Anitescu & Potra 1997, theorem 2.7). The number of pivots is bounded here.
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.lcp import NORMAL, REGULARIZATION


@njit
def lemke(work, n):
    """λ of rows NORMAL and FRICTION (see `lcp`); True if found."""
    A, start, kind, lam = work.lcp.A, work.lemke.start, work.constraints.kind, work.lcp.lam
    size = 0
    for r in range(n):
        start[r] = size
        size += 1 if kind[r] == NORMAL else 3
    width = 2 * size + 2
    T = work.lemke.tableau
    for at in range(size * width):
        T[at] = 0.0
    for r in range(n):
        for k in range(n):
            insert_entry(work, width, r, k, A[r, k] * (1.0 + REGULARIZATION if r == k else 1.0))
        insert_row(work, width, r)
    found = complementary_pivoting(work, size)
    z = work.lemke.z
    for r in range(n):
        lam[r] = z[start[r]] if kind[r] == NORMAL else z[start[r]] - z[start[r] + 1]
    return found


@njit
def insert_entry(work, width, r, k, value):
    """−A of the tableau w − A z − z0 = b, with the copies of opposite sign that split friction needs."""
    rows = work.constraints
    T, size = work.lemke.tableau, width // 2 - 1
    at = work.lemke.start[r] * width + size + work.lemke.start[k]
    T[at] = -value
    if rows.kind[k] != NORMAL:
        T[at + 1] = value
    if rows.kind[r] != NORMAL:
        T[at + width] = value
        if rows.kind[k] != NORMAL:
            T[at + width + 1] = -value


@njit
def insert_row(work, width, r):
    """b of row r, and the rows of its slip speed if it is one of friction."""
    rows = work.constraints
    T, i, size = work.lemke.tableau, work.lemke.start[r], width // 2 - 1
    row = i * width
    T[row + width - 1] = work.lcp.b[r]
    if rows.kind[r] == NORMAL:
        return
    T[row + 2 * width - 1], T[row + 3 * width - 1] = -work.lcp.b[r], rows.bound[r]
    T[row + size + i + 2] = T[row + width + size + i + 2] = -1.0
    T[row + 2 * width + size + i] = T[row + 2 * width + size + i + 1] = 1.0
    if rows.partner[r] >= 0:
        T[row + 2 * width + size + work.lemke.start[rows.partner[r]]] = -rows.mu[r]


@njit
def complementary_pivoting(work, size):
    """Complementary pivoting into work.lemke.z; False if it ended on a ray or was stopped."""
    T, basis, z = work.lemke.tableau, work.lemke.basis, work.lemke.z
    width, artificial = 2 * size + 2, 2 * size
    row = 0
    for i in range(size):
        basis[i], z[i] = i, 0.0
        T[i * width + i], T[i * width + artificial] = 1.0, -1.0
        if T[i * width + width - 1] < T[row * width + width - 1]:
            row = i
    entering = artificial
    if T[row * width + width - 1] >= 0.0:
        return True
    for _ in range(20 * size + 50):
        gauss_jordan_step(work, size, row, entering)
        left = basis[row]
        basis[row] = entering
        if left == artificial:
            for i in range(size):
                if size <= basis[i] < artificial:
                    z[basis[i] - size] = max(T[i * width + width - 1], 0.0)
            return True
        entering = left + size if left < size else left - size
        row = ratio_test(work, size, entering)
        if row < 0:
            break
    return False


@njit
def ratio_test(work, size, entering):
    """Row that leaves; the artificial variable's if it ties. −1 on a ray."""
    T, width, row, best = work.lemke.tableau, 2 * size + 2, -1, math.inf
    for i in range(size):
        if T[i * width + entering] > 1e-12:
            ratio = T[i * width + width - 1] / T[i * width + entering]
            tie = 1e-12 * (abs(ratio) + 1e-300)
            if ratio < best - tie or (ratio <= best + tie and work.lemke.basis[i] == 2 * size):
                row, best = i, min(best, ratio)
    return row


@njit
def gauss_jordan_step(work, size, row, column):
    """Gauss–Jordan step."""
    T, width = work.lemke.tableau, 2 * size + 2
    scale = 1.0 / T[row * width + column]
    for c in range(width):
        T[row * width + c] *= scale
    for i in range(size):
        share = T[i * width + column]
        if i != row and share != 0.0:
            for c in range(width):
                T[i * width + c] -= share * T[row * width + c]
