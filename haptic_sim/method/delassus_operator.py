# SPDX-License-Identifier: Apache-2.0
"""What impulses along rows do: W Gᵀ of each, the Delassus operator A = G W Gᵀ, their sum on bodies, their report."""

from haptic_device.jit import njit
from haptic_sim.method.constraints import CONTACT, is_advanced
from haptic_sim.method.lcp import NORMAL
from haptic_sim.method.linkage import apply_inverse_mass
from haptic_sim.method.records import MOST_ROWS


@njit
def delassus_operator(model, work, n):
    """W Gᵀ of all rows, and A = G W Gᵀ."""
    rows, delassus = work.constraints, work.delassus_operator
    f, P = delassus.force, delassus.response
    for r in range(n):
        a, b = rows.body_a[r], rows.body_b[r]
        la, lb = model.linkage[a], model.linkage[b]
        for body in range(model.bodies):
            for k in range(3):
                P[r, body, k] = 0.0
        zero_vector(f, a)
        zero_vector(f, b)
        for i in (la, lb):
            if i >= 0:
                zero_linkage(model, f, i)
        for k in range(3):
            f[a, k] += rows.G[r, k]
            f[b, k] += rows.G[r, 3 + k]
        if la >= 0 and work.active[la] > 0:
            apply_inverse_mass(model, work, la, f, delassus.answer)
            keep_response(model, work, la, r)
        if lb >= 0 and lb != la and work.active[lb] > 0:
            apply_inverse_mass(model, work, lb, f, delassus.answer)
            keep_response(model, work, lb, r)
        delassus.linkages[r, 0], delassus.linkages[r, 1] = la, lb
        for s in range(r + 1):
            lc, ld = delassus.linkages[s, 0], delassus.linkages[s, 1]
            meet = lc >= 0 and lc in (la, lb) or ld >= 0 and ld in (la, lb)
            work.lcp.A[r, s] = work.lcp.A[s, r] = delassus_entry(work, s, r) if meet else 0.0


@njit
def keep_response(model, work, i, r):
    """W Gᵀ of row r for the bodies of linkage i."""
    for m in range(model.body_start[i], model.body_start[i + 1]):
        b = model.order[m]
        for k in range(3):
            work.delassus_operator.response[r, b, k] = work.delassus_operator.answer[b, k]


@njit
def copy_vectors(vectors, to, n):
    """n bodies' vectors."""
    for b in range(n):
        for k in range(3):
            to[b, k] = vectors[b, k]


@njit
def zero_vectors(vectors, n):
    """Zero for n bodies."""
    for b in range(n):
        zero_vector(vectors, b)


@njit
def zero_vector(vectors, b):
    """Zero for one body."""
    vectors[b, 0] = vectors[b, 1] = vectors[b, 2] = 0.0


@njit
def zero_linkage(model, f, i):
    """Zero for all bodies of linkage i."""
    for m in range(model.body_start[i], model.body_start[i + 1]):
        zero_vector(f, model.order[m])


@njit
def delassus_entry(work, s, r):
    """G_s W G_rᵀ."""
    rows = work.constraints
    a, b, G, P = rows.body_a[s], rows.body_b[s], rows.G, work.delassus_operator.response
    return (
        G[s, 0] * P[r, a, 0]
        + G[s, 1] * P[r, a, 1]
        + G[s, 2] * P[r, a, 2]
        + G[s, 3] * P[r, b, 0]
        + G[s, 4] * P[r, b, 1]
        + G[s, 5] * P[r, b, 2]
    )


@njit
def apply_impulses(model, work, n, out):
    """out += W Gᵀ λ."""
    for r in range(n):
        x = work.lcp.lam[r]
        if x != 0.0:
            for b in range(model.bodies - 1):
                for k in range(3):
                    out[b, k] += x * work.delassus_operator.response[r, b, k]


@njit
def report_impulses(work, n, scale):
    """Books contact impulses λ · scale [N s] for the report of the step: record by row key, place, normal, overlap."""
    report = work.report
    for r in range(n):
        at = report_entry(work, r)
        if at >= 0:
            x, y = impulse_on_b(work, n, r)
            report.impulse[at, 0] += scale * x
            report.impulse[at, 1] += scale * y
            report.overlap[at] = max(report.overlap[at], -work.constraints.gap[r])


@njit
def keep_resting_forces(model, work, n):
    """Keeps the forces of contacts whose bodies both sleep, for `report_resting`."""
    rows, report = work.constraints, work.report
    for k in range(report.count):
        report.resting_force[k, 0] = report.resting_force[k, 1] = 0.0
    for r in range(n):
        if not is_advanced(model, work, rows.body_a[r], rows.body_b[r]):
            at = report_entry(work, r)
            if at >= 0:
                report.resting_force[at, 0], report.resting_force[at, 1] = impulse_on_b(work, n, r)
                report.overlap[at] = max(report.overlap[at], -rows.gap[r])


@njit
def report_resting(work, time):
    """Books what the contacts of sleeping bodies pushed for `time` [s]."""
    report = work.report
    for k in range(report.count):
        for axis in range(2):
            report.impulse[k, axis] += time * report.resting_force[k, axis]
            report.resting_force[k, axis] = 0.0


@njit
def report_entry(work, r):
    """Place of row r in the report, made if it is new; −1 if it does not belong there."""
    if work.constraints.source[r] != CONTACT or work.constraints.kind[r] != NORMAL or work.lcp.lam[r] <= 0.0:
        return -1
    rows, report, at = work.constraints, work.report, 0
    while at < report.count and report.key[at] != rows.key[r]:
        at += 1
    if at == MOST_ROWS:
        return -1
    if at == report.count:
        report.count += 1
        report.overlap[at] = 0.0
        for axis in range(2):
            report.impulse[at, axis] = report.resting_force[at, axis] = 0.0
    report.key[at], report.pair[at] = rows.key[r], rows.index[r]
    for axis in range(2):
        report.place[at, axis], report.normal[at, axis] = rows.place[r, axis], rows.G[r, 3 + axis]
    return at


@njit
def impulse_on_b(work, n, r):
    """λ of a normal row, and of its friction, as a vector on body b."""
    rows, lcp = work.constraints, work.lcp
    nx, ny = rows.G[r, 3], rows.G[r, 4]
    along = lcp.lam[r + 1] if r + 1 < n and rows.partner[r + 1] == r else 0.0
    return lcp.lam[r] * nx - along * ny, lcp.lam[r] * ny + along * nx
