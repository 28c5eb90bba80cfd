# SPDX-License-Identifier: Apache-2.0
"""What impulses along rows do: W Gᵀ of each, A = G W Gᵀ, their sum on all bodies, and their report."""

from haptic_device.jit import njit
from haptic_sim.method.constraints import moves
from haptic_sim.method.lcp import NORMAL
from haptic_sim.method.linkage import respond
from haptic_sim.method.records import MOST_ROWS


@njit
def respond_rows(model, layout, work, n):
    """W Gᵀ of all rows, and A."""
    f, P = work.force, work.response
    for r in range(n):
        a, b = work.row_a[r], work.row_b[r]
        la, lb = layout.linkage[a], layout.linkage[b]
        for body in range(model.bodies):
            for k in range(3):
                P[r, body, k] = 0.0
        zero_body(f, a)
        zero_body(f, b)
        for i in (la, lb):
            if i >= 0:
                clear_linkage(layout, f, i)
        for k in range(3):
            f[a, k] += work.G[r, k]
            f[b, k] += work.G[r, 3 + k]
        if la >= 0 and work.active[la] > 0:
            respond(layout, work, la, f, work.answer)
            keep_answer(layout, work, la, r)
        if lb >= 0 and lb != la and work.active[lb] > 0:
            respond(layout, work, lb, f, work.answer)
            keep_answer(layout, work, lb, r)
        work.row_linkages[r, 0], work.row_linkages[r, 1] = la, lb
        for s in range(r + 1):
            lc, ld = work.row_linkages[s, 0], work.row_linkages[s, 1]
            meet = lc >= 0 and lc in (la, lb) or ld >= 0 and ld in (la, lb)
            work.A[r, s] = work.A[s, r] = rate_of_response(work, s, r) if meet else 0.0


@njit
def keep_answer(layout, work, i, r):
    """W Gᵀ of row r for the bodies of linkage i."""
    for m in range(layout.body_start[i], layout.body_start[i + 1]):
        b = layout.order[m]
        for k in range(3):
            work.response[r, b, k] = work.answer[b, k]


@njit
def copy(vectors, to, n):
    """n bodies' vectors."""
    for b in range(n):
        for k in range(3):
            to[b, k] = vectors[b, k]


@njit
def zero(vectors, n):
    """Zero for n bodies."""
    for b in range(n):
        zero_body(vectors, b)


@njit
def zero_body(vectors, b):
    """Zero for one body."""
    vectors[b, 0] = vectors[b, 1] = vectors[b, 2] = 0.0


@njit
def clear_linkage(layout, f, i):
    """Zero for all bodies of linkage i."""
    for m in range(layout.body_start[i], layout.body_start[i + 1]):
        zero_body(f, layout.order[m])


@njit
def rate_of_response(work, s, r):
    """G_s W G_rᵀ."""
    a, b, G, P = work.row_a[s], work.row_b[s], work.G, work.response
    return (
        G[s, 0] * P[r, a, 0]
        + G[s, 1] * P[r, a, 1]
        + G[s, 2] * P[r, a, 2]
        + G[s, 3] * P[r, b, 0]
        + G[s, 4] * P[r, b, 1]
        + G[s, 5] * P[r, b, 2]
    )


@njit
def apply_rows(model, work, n, out):
    """out += W Gᵀ λ."""
    for r in range(n):
        x = work.lam[r]
        if x != 0.0:
            for b in range(model.bodies - 1):
                for k in range(3):
                    out[b, k] += x * work.response[r, b, k]


@njit
def note_impulses(work, n, scale):
    """Books contact impulses λ · scale [N s] for the report of the step: record by row key, place, normal, overlap."""
    for r in range(n):
        at = note_of(work, r)
        if at >= 0:
            note = work.note[at]
            x, y = push_on_b(work, n, r)
            note[4] += scale * x
            note[5] += scale * y
            note[6] = max(note[6], -work.gap[r])


@njit
def hold_resting(layout, work, n):
    """Keeps the forces of contacts whose bodies both sleep, for `note_resting`."""
    for k in range(work.counts[3]):
        work.note[k, 7] = work.note[k, 8] = 0.0
    for r in range(n):
        if not moves(layout, work, work.row_a[r], work.row_b[r]):
            at = note_of(work, r)
            if at >= 0:
                work.note[at, 7], work.note[at, 8] = push_on_b(work, n, r)
                work.note[at, 6] = max(work.note[at, 6], -work.gap[r])


@njit
def note_resting(work, time):
    """Books what the contacts of sleeping bodies pushed for `time` [s]."""
    for k in range(work.counts[3]):
        work.note[k, 4] += time * work.note[k, 7]
        work.note[k, 5] += time * work.note[k, 8]
        work.note[k, 7] = work.note[k, 8] = 0.0


@njit
def note_of(work, r):
    """Place of row r in the report, made if it is new; −1 if it does not belong there."""
    if work.source[r] != 0 or work.kind[r] != NORMAL or work.lam[r] <= 0.0:
        return -1
    at = 0
    while at < work.counts[3] and work.note_key[at] != work.key[r]:
        at += 1
    if at == MOST_ROWS:
        return -1
    if at == work.counts[3]:
        work.counts[3] += 1
        for k in range(9):
            work.note[at, k] = 0.0
    work.note_key[at], work.note_pair[at] = work.key[r], work.index[r]
    work.note[at, 0], work.note[at, 1] = work.place[r, 0], work.place[r, 1]
    work.note[at, 2], work.note[at, 3] = work.G[r, 3], work.G[r, 4]
    return at


@njit
def push_on_b(work, n, r):
    """λ of a normal row, and of its friction, as a vector on body b."""
    nx, ny = work.G[r, 3], work.G[r, 4]
    along = work.lam[r + 1] if r + 1 < n and work.partner[r + 1] == r else 0.0
    return work.lam[r] * nx - along * ny, work.lam[r] * ny + along * nx
