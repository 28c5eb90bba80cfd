# SPDX-License-Identifier: Apache-2.0
"""What impulses along rows do: W Gᵀ of each, A = G W Gᵀ, their sum on all bodies, and their report."""

from haptic_device.kernel import kernel
from haptic_sim.method.lcp import NORMAL
from haptic_sim.method.linkage import respond
from haptic_sim.method.memory import MOST_ROWS


@kernel
def respond_rows(model, layout, work, n):
    """W Gᵀ of all rows, and A."""
    f, P = work.force, work.response
    for r in range(n):
        a, b = work.row_a[r], work.row_b[r]
        la, lb = layout.linkage[a], layout.linkage[b]
        zero(P[r], model.bodies)
        zero_body(f, a)
        zero_body(f, b)
        for i in (la, lb):
            if i >= 0:
                clear_linkage(layout, f, i)
        for k in range(3):
            f[a, k] += work.G[r, k]
            f[b, k] += work.G[r, 3 + k]
        if la >= 0 and work.active[la] > 0:
            respond(layout, work, la, f, P[r])
        if lb >= 0 and lb != la and work.active[lb] > 0:
            respond(layout, work, lb, f, P[r])
        for s in range(r + 1):
            work.A[r, s] = work.A[s, r] = rate_of_response(work, s, r)


@kernel
def copy(vectors, to, n):
    """n bodies' vectors."""
    for b in range(n):
        for k in range(3):
            to[b, k] = vectors[b, k]


@kernel
def zero(vectors, n):
    """Zero for n bodies."""
    for b in range(n):
        zero_body(vectors, b)


@kernel
def zero_body(vectors, b):
    """Zero for one body."""
    vectors[b, 0] = vectors[b, 1] = vectors[b, 2] = 0.0


@kernel
def clear_linkage(layout, f, i):
    """Zero for all bodies of linkage i."""
    for m in range(layout.body_start[i], layout.body_start[i + 1]):
        zero_body(f, layout.order[m])


@kernel
def rate_of_response(work, s, r):
    """G_s W G_rᵀ."""
    a, b, G, P = work.row_a[s], work.row_b[s], work.G, work.response[r]
    return (G[s, 0] * P[a, 0] + G[s, 1] * P[a, 1] + G[s, 2] * P[a, 2]
            + G[s, 3] * P[b, 0] + G[s, 4] * P[b, 1] + G[s, 5] * P[b, 2])


@kernel
def apply_rows(model, work, n, scale, out):
    """out += scale · W Gᵀ λ."""
    for r in range(n):
        x = scale * work.lam[r]
        if x != 0.0:
            for b in range(model.bodies - 1):
                for k in range(3):
                    out[b, k] += x * work.response[r, b, k]


@kernel
def note_impulses(work, n, scale):
    """Books contact impulses λ · scale [N s] for the report of the step: record by row key, place, normal, overlap."""
    for r in range(n):
        if work.source[r] != 0 or work.kind[r] != NORMAL or work.lam[r] <= 0.0:
            continue
        at = 0
        while at < work.counts[3] and work.note_key[at] != work.key[r]:
            at += 1
        if at == MOST_ROWS:
            continue
        if at == work.counts[3]:
            work.counts[3] += 1
            for k in range(7):
                work.note[at, k] = 0.0
        work.note_key[at], work.note_pair[at] = work.key[r], work.index[r]
        nx, ny = work.G[r, 3], work.G[r, 4]
        along = work.lam[r + 1] if r + 1 < n and work.partner[r + 1] == r else 0.0
        note = work.note[at]
        note[0], note[1], note[2], note[3] = work.place[r, 0], work.place[r, 1], nx, ny
        note[4] += scale * (work.lam[r] * nx - along * ny)
        note[5] += scale * (work.lam[r] * ny + along * nx)
        note[6] = max(note[6], -work.gap[r])
