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

A joint's motor and its dry friction are two rows of one rate, the second the first one's twin, with b apart by the
motor's speed.

Redundant contacts (two corners of a block) make A singular: every diagonal gains the part SOFT of itself, which picks
the solution of least sum of squares and changes w by that part only.
"""

from haptic_device.jit import njit

NORMAL, FRICTION, SLIDING = 0, 1, 2
OPEN, FREE, LOW, HIGH = 0, 1, -1, 2
"""Modes: a normal row is OPEN (λ = 0) or FREE (w = 0); a friction row FREE, or at its LOW or HIGH bound."""
REGULARIZATION = 1e-11
ROUNDING = 1e-9


@njit
def principal_pivoting(work, n, share, limit):
    """Solves the rows 0…n−1 in place (`work.lcp.mode` is the first guess and the answer). Returns pivots used, or −1.

    `share` of the friction acts: 1, or 0 where constraints are only stabilized.
    """
    fewest, patience = n + 1, 8
    for turn in range(limit):
        separate_twins(work, n)
        if not solve_in_modes(work, n, share):
            return -1
        wrong, last = count_wrong_modes(work, n, share, False)
        if wrong == 0:
            return turn + 1
        if wrong < fewest:
            fewest, patience = wrong, 8
        else:
            patience -= 1
        if patience > 0:
            count_wrong_modes(work, n, share, True)
        else:
            work.lcp.mode[last] = consistent_mode(work, n, share, last)
    return -1


@njit
def separate_twins(work, n):
    """Motor and friction of a joint, both FREE, ask one rate for two values: now it turns, slower than the motor."""
    mode, b = work.lcp.mode, work.lcp.b
    for r in range(n):
        motor = work.constraints.twin[r]
        if motor >= 0 and mode[r] == FREE and mode[motor] == FREE:
            mode[motor], mode[r] = (HIGH, LOW) if b[motor] < b[r] else (LOW, HIGH)


@njit
def friction_bound(work, r, share):
    """Bound on |λ_r|."""
    rows = work.constraints
    normal = rows.partner[r]
    return share * (rows.bound[r] + (rows.mu[r] * max(work.lcp.lam[normal], 0.0) if normal >= 0 else 0.0))


@njit
def count_wrong_modes(work, n, share, change):
    """(number, last) of rows whose mode the solution contradicts; with `change` they get the better one."""
    wrong, last = 0, -1
    for r in range(n):
        wish = consistent_mode(work, n, share, r)
        if wish != work.lcp.mode[r]:
            wrong, last = wrong + 1, r
            if change:
                work.lcp.mode[r] = wish
    return wrong, last


@njit
def consistent_mode(work, n, share, r):
    """The mode that the present solution asks for in row r."""
    lcp = work.lcp
    A, lam, kind, mode = lcp.A, lcp.lam, work.constraints.kind, lcp.mode
    if kind[r] == SLIDING:
        return mode[r]
    if mode[r] == FREE:
        if kind[r] == NORMAL:
            return OPEN if lam[r] < 0.0 else FREE
        most = friction_bound(work, r, share)
        if abs(lam[r]) <= most * (1.0 + ROUNDING):
            return FREE
        return HIGH if lam[r] > 0.0 else LOW
    w, size = lcp.b[r], abs(lcp.b[r])
    for k in range(n):
        w += A[r, k] * lam[k]
        size += abs(A[r, k] * lam[k])
    if kind[r] == NORMAL:
        return FREE if w < -ROUNDING * size else OPEN
    if friction_bound(work, r, share) <= 0.0:
        return mode[r]
    if mode[r] == LOW:
        return FREE if w < -ROUNDING * size else LOW
    return FREE if w > ROUNDING * size else HIGH


@njit
def solve_in_modes(work, n, share):
    """λ for the present modes, by elimination with row pivoting; False if the system is singular."""
    rows, lcp = work.constraints, work.lcp
    S, free, m, kind, partner = lcp.system, lcp.free, 0, rows.kind, rows.partner
    A, lam, mode = lcp.A, lcp.lam, lcp.mode
    for r in range(n):
        lam[r] = 0.0
        if mode[r] == FREE and (kind[r] == NORMAL or partner[r] < 0 or mode[partner[r]] == FREE):
            lcp.column[r] = m
            free[m] = r
            m += 1
    for i in range(m):
        lcp.bottom[i] = i
    for i in range(m):
        r = free[i]
        lcp.last[i] = i
        for k in range(m):
            S[i, k] = A[r, free[k]]
            if S[i, k] != 0.0:
                lcp.last[i], lcp.bottom[k] = max(lcp.last[i], k), max(lcp.bottom[k], i)
        S[i, i] += REGULARIZATION * A[r, r]
        S[i, m] = -lcp.b[r]
    for r in range(n):
        if kind[r] != NORMAL and mode[r] != FREE:
            insert_bounded_row(work, r, m, share, -1.0 if mode[r] == LOW else 1.0)
    if not solve_band(work, m):
        return False
    for i in range(m):
        lam[free[i]] = S[i, m]
    for r in range(n):
        if kind[r] != NORMAL and mode[r] != FREE:
            sense = -1.0 if mode[r] == LOW else 1.0
            carried = rows.mu[r] * lam[partner[r]] if partner[r] >= 0 else 0.0
            lam[r] = sense * share * (rows.bound[r] + carried)
    return True


@njit
def insert_bounded_row(work, r, m, share, sense):
    """Inserts λ_r = ± (c + μ λ_n) of a row at its bound into the equations of the free rows."""
    rows, lcp = work.constraints, work.lcp
    A, S, free, normal = lcp.A, lcp.system, lcp.free, rows.partner[r]
    seen = normal >= 0 and lcp.mode[normal] == FREE
    for i in range(m):
        S[i, m] -= A[free[i], r] * sense * share * rows.bound[r]
        if seen:
            S[i, lcp.column[normal]] += A[free[i], r] * sense * share * rows.mu[r]
            c = lcp.column[normal]
            lcp.last[i], lcp.bottom[c] = max(lcp.last[i], c), max(lcp.bottom[c], i)


@njit
def solve_band(work, m):
    """Solves S[:m, :m] x = S[:m, m] in place; x ends in the last column. False if a pivot is zero.

    Row i is zero beyond column last[i], column k below row bottom[k]: contacts that share no body do not know
    each other, so S is a band.
    """
    lcp = work.lcp
    S, last, low = lcp.system, lcp.last, 0
    for k in range(m):
        at, low = k, max(low, lcp.bottom[k])
        for i in range(k + 1, low + 1):
            if abs(S[i, k]) > abs(S[at, k]):
                at = i
        if S[at, k] == 0.0:
            return False
        if at != k:
            swap_rows(work, k, at, m)
        scale = 1.0 / S[k, k]
        for i in range(k + 1, low + 1):
            ratio = S[i, k] * scale
            if ratio != 0.0:
                for c in range(k + 1, last[k] + 1):
                    S[i, c] -= ratio * S[k, c]
                S[i, m] -= ratio * S[k, m]
                last[i] = max(last[i], last[k])
    for k in range(m - 1, -1, -1):
        total = S[k, m]
        for c in range(k + 1, last[k] + 1):
            total -= S[k, c] * S[c, m]
        S[k, m] = total / S[k, k]
    return True


@njit
def swap_rows(work, k, at, m):
    """Rows k and `at` change places."""
    S, last = work.lcp.system, work.lcp.last
    for c in range(k, m + 1):
        kept = S[k, c]
        S[k, c] = S[at, c]
        S[at, c] = kept
    kept_last = last[k]
    last[k] = last[at]
    last[at] = kept_last
