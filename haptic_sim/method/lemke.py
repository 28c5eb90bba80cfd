# SPDX-License-Identifier: Apache-2.0
"""Lemke's complementary pivoting for contact with friction: slower than `lcp`, but sure to end.

Friction is split, λ = β⁺ − β⁻, with the slip speed σ as its multiplier (Stewart & Trinkle 1996, eq. 13):

    0 ≤ β± ⟂ ± w + σ ≥ 0,      0 ≤ σ ⟂ c + μ λ_n − β⁺ − β⁻ ≥ 0,      0 ≤ λ_n ⟂ w_n ≥ 0

The matrix is copositive, so that for velocities (impacts, backward differences) the pivoting ends in a solution and not
on a ray (Anitescu & Potra 1997, theorem 2.7). The number of pivots is bounded here.
"""

import numpy as np

from haptic_device.kernel import kernel
from haptic_sim.method.lcp import NORMAL, SOFT


@kernel
def lemke(A, b, n, kind, partner, mu, bound, lam):
    """λ of rows NORMAL and FRICTION (see `lcp`); True if found."""
    start = np.empty(n, np.int64)
    size = 0
    for r in range(n):
        start[r] = size
        size += 1 if kind[r] == NORMAL else 3
    T = np.zeros((size, 2 * size + 2))
    for r in range(n):
        i = start[r]
        for k in range(n):
            j, value = start[k], A[r, k] * (1.0 + SOFT if r == k else 1.0)
            put(T, size, i, j, value, kind[r], kind[k])
        T[i, 2 * size + 1] = b[r]
        if kind[r] != NORMAL:
            T[i + 1, 2 * size + 1], T[i + 2, 2 * size + 1] = -b[r], bound[r]
            T[i, size + i + 2] = T[i + 1, size + i + 2] = -1.0
            T[i + 2, size + i] = T[i + 2, size + i + 1] = 1.0
            if partner[r] >= 0:
                T[i + 2, size + start[partner[r]]] = -mu[r]
    z = pivot_to_end(T, size)
    for r in range(n):
        lam[r] = z[start[r]] if kind[r] == NORMAL else z[start[r]] - z[start[r] + 1]
    return z[size] == 0.0


@kernel
def put(T, size, i, j, value, row_kind, column_kind):
    """−A of the tableau w − A z − z0 = b, with the copies of opposite sign that split friction needs."""
    T[i, size + j] = -value
    if column_kind != NORMAL:
        T[i, size + j + 1] = value
    if row_kind != NORMAL:
        T[i + 1, size + j] = value
        if column_kind != NORMAL:
            T[i + 1, size + j + 1] = -value


@kernel
def pivot_to_end(T, size):
    """Complementary pivoting; returns z and, last, what is left of the artificial variable (0 if solved)."""
    basis, z = np.arange(size), np.zeros(size + 1)
    last, artificial = 2 * size + 1, 2 * size
    row = 0
    for i in range(size):
        T[i, i], T[i, artificial] = 1.0, -1.0
        if T[i, last] < T[row, last]:
            row = i
    entering = artificial
    if T[row, last] >= 0.0:
        return z
    for _ in range(20 * size + 50):
        exchange(T, row, entering)
        left = basis[row]
        basis[row] = entering
        if left == artificial:
            for i in range(size):
                if size <= basis[i] < artificial:
                    z[basis[i] - size] = max(T[i, last], 0.0)
            return z
        entering = left + size if left < size else left - size
        row = least_ratio(T, size, basis, entering, artificial)
        if row < 0:
            break
    z[size] = 1.0
    return z


@kernel
def least_ratio(T, size, basis, entering, artificial):
    """Row that leaves; the artificial variable's if it ties. −1 on a ray."""
    last, row, best = T.shape[1] - 1, -1, np.inf
    for i in range(size):
        if T[i, entering] > 1e-12:
            ratio = T[i, last] / T[i, entering]
            tie = 1e-12 * (abs(ratio) + 1e-300)
            if ratio < best - tie or (ratio <= best + tie and basis[i] == artificial):
                row, best = i, min(best, ratio)
    return row


@kernel
def exchange(T, row, column):
    """Gauss–Jordan step."""
    scale = 1.0 / T[row, column]
    for c in range(T.shape[1]):
        T[row, c] *= scale
    for i in range(T.shape[0]):
        part = T[i, column]
        if i != row and part != 0.0:
            for c in range(T.shape[1]):
                T[i, c] -= part * T[row, c]
