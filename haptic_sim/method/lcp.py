# SPDX-License-Identifier: Apache-2.0
"""Direct solution of planar contact with Coulomb friction, warm-started, bounded, without sweeps.

Rows r have w = A λ + b (a velocity, or an acceleration) and a bound β_r on |λ_r|:

    normal    0 ≤ λ ⟂ w ≥ 0
    friction  |λ| ≤ β = c + μ λ_n, with λ against w:  |λ| < β ⇒ w = 0;  λ = −β ⇒ w ≥ 0;  λ = β ⇒ w ≤ 0
              (a joint's dry friction or motor has μ = 0, a contact's c = 0)
    sliding   λ = −s (c + μ λ_n), its sense s known

A guess of each row's mode gives a linear system; its solution says which modes were wrong. All wrong ones change at
once while their number falls, then only the last of them (principal pivoting after Murty and Júdice & Pires). That
ends for every A in the class P; the friction of Painlevé's paradox is outside it, and then the answer is −1. Impacts
and backward differences, where sliding senses are not fixed, always have a solution (Stewart & Trinkle 1996; Anitescu
& Potra 1997): `lemke` finds it.

Redundant contacts (two corners of a block) make A singular: every diagonal gains the part SOFT of itself, which picks
the solution of least sum of squares and changes w by that part only.
"""

from haptic_device.kernel import kernel

NORMAL, FRICTION, SLIDING = 0, 1, 2
OPEN, FREE, LOW, HIGH = 0, 1, -1, 2
"""Modes: a normal row is OPEN (λ = 0) or FREE (w = 0); a friction row FREE, or at its LOW or HIGH bound."""
SOFT = 1e-11
ROUNDING = 1e-9


@kernel
def solve_modes(A, b, n, kind, partner, mu, bound, mode, lam, scratch, limit):
    """Solves the rows 0…n−1 in place (`mode` is the first guess and the answer). Returns pivots used, or −1."""
    fewest, patience = n + 1, 8
    for turn in range(limit):
        if not solve_linear(A, b, n, kind, partner, mu, bound, mode, lam, scratch):
            return -1
        wrong, last = count_wrong(A, b, n, kind, partner, mu, bound, mode, lam, False)
        if wrong == 0:
            return turn + 1
        if wrong < fewest:
            fewest, patience = wrong, 8
        else:
            patience -= 1
        if patience > 0:
            count_wrong(A, b, n, kind, partner, mu, bound, mode, lam, True)
        else:
            mode[last] = better(A, b, n, kind, partner, mu, bound, mode, lam, last)
    return -1


@kernel
def limit_of(r, partner, mu, bound, lam):
    """Bound on |λ_r|."""
    return bound[r] + (mu[r] * max(lam[partner[r]], 0.0) if partner[r] >= 0 else 0.0)


@kernel
def count_wrong(A, b, n, kind, partner, mu, bound, mode, lam, change):
    """(number, last) of rows whose mode the solution contradicts; with `change` they get the better one."""
    wrong, last = 0, -1
    for r in range(n):
        wish = better(A, b, n, kind, partner, mu, bound, mode, lam, r)
        if wish != mode[r]:
            wrong, last = wrong + 1, r
            if change:
                mode[r] = wish
    return wrong, last


@kernel
def better(A, b, n, kind, partner, mu, bound, mode, lam, r):
    """The mode that the present solution asks for in row r."""
    if kind[r] == SLIDING:
        return mode[r]
    if mode[r] == FREE:
        if kind[r] == NORMAL:
            return OPEN if lam[r] < 0.0 else FREE
        most = limit_of(r, partner, mu, bound, lam)
        if abs(lam[r]) <= most * (1.0 + ROUNDING):
            return FREE
        return HIGH if lam[r] > 0.0 else LOW
    w, size = b[r], abs(b[r])
    for k in range(n):
        w += A[r, k] * lam[k]
        size += abs(A[r, k] * lam[k])
    if kind[r] == NORMAL:
        return FREE if w < -ROUNDING * size else OPEN
    if limit_of(r, partner, mu, bound, lam) <= 0.0:
        return mode[r]
    if mode[r] == LOW:
        return FREE if w < -ROUNDING * size else LOW
    return FREE if w > ROUNDING * size else HIGH


@kernel
def solve_linear(A, b, n, kind, partner, mu, bound, mode, lam, scratch):
    """λ for the present modes, by elimination with row pivoting; False if the system is singular."""
    S, free, m = scratch.system, scratch.free, 0
    for r in range(n):
        lam[r] = 0.0
        if mode[r] == FREE and (kind[r] == NORMAL or partner[r] < 0 or mode[partner[r]] == FREE):
            scratch.column[r] = m
            free[m] = r
            m += 1
    for i in range(m):
        r = free[i]
        for k in range(m):
            S[i, k] = A[r, free[k]]
        S[i, i] += SOFT * A[r, r]
        S[i, m] = -b[r]
    for r in range(n):
        if kind[r] != NORMAL and mode[r] != FREE:
            carry(A, r, m, free, S, partner, mu, bound, mode, scratch.column, -1.0 if mode[r] == LOW else 1.0)
    if not gauss(S, m):
        return False
    for i in range(m):
        lam[free[i]] = S[i, m]
    for r in range(n):
        if kind[r] != NORMAL and mode[r] != FREE:
            sense = -1.0 if mode[r] == LOW else 1.0
            lam[r] = sense * (bound[r] + (mu[r] * lam[partner[r]] if partner[r] >= 0 else 0.0))
    return True


@kernel
def carry(A, r, m, free, S, partner, mu, bound, mode, column, sense):
    """Inserts λ_r = ± (c + μ λ_n) of a row at its bound into the equations of the free rows."""
    normal = partner[r]
    seen = normal >= 0 and mode[normal] == FREE
    for i in range(m):
        S[i, m] -= A[free[i], r] * sense * bound[r]
        if seen:
            S[i, column[normal]] += A[free[i], r] * sense * mu[r]


@kernel
def gauss(S, m):
    """Solves S[:m, :m] x = S[:m, m] in place; x ends in the last column. False if a pivot is zero."""
    for k in range(m):
        at = k
        for i in range(k + 1, m):
            if abs(S[i, k]) > abs(S[at, k]):
                at = i
        if S[at, k] == 0.0:
            return False
        if at != k:
            for c in range(k, m + 1):
                kept = S[k, c]
                S[k, c] = S[at, c]
                S[at, c] = kept
        scale = 1.0 / S[k, k]
        for i in range(k + 1, m):
            part = S[i, k] * scale
            if part != 0.0:
                for c in range(k + 1, m + 1):
                    S[i, c] -= part * S[k, c]
    for k in range(m - 1, -1, -1):
        total = S[k, m]
        for c in range(k + 1, m):
            total -= S[k, c] * S[c, m]
        S[k, m] = total / S[k, k]
    return True
