# SPDX-License-Identifier: Apache-2.0
"""Rows of one complementarity problem: contacts, joint limits, dry friction and motors, as they stand at q, v.

Row r has six numbers G (of body a, of body b) with G v its rate, and γ with G a + γ the rate's own rate (see `touch`
and `joints`).
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.joints import coordinate_row
from haptic_sim.method.lcp import FREE, FRICTION, NORMAL
from haptic_sim.method.narrow_phase import AX, AY, BX, BY, GAP, NX, NY, OWNER, PX, PY, ROUND, evaluate
from haptic_sim.method.records import MOST_ROWS
from haptic_sim.reduction.model import SPRING

LIMIT, DRY = 1, 2
"""Sources of a row beside a contact (0): a joint's limit (which side: sign), its dry friction or motor."""


@njit
def rate_of(work, v, r):
    """G v of row r."""
    a, b, G = work.row_a[r], work.row_b[r], work.G
    return (
        G[r, 0] * v[a, 0]
        + G[r, 1] * v[a, 1]
        + G[r, 2] * v[a, 2]
        + G[r, 3] * v[b, 0]
        + G[r, 4] * v[b, 1]
        + G[r, 5] * v[b, 2]
    )


@njit
def wished(model, work, r):
    """Rate at which row r has no slip: a motor's speed; of friction on a belt −t · s, s being its surface's; else 0."""
    if work.kind[r] == NORMAL or work.source[r] == LIMIT:
        return 0.0
    if work.source[r] == 0:
        surface = model.pair_surface[work.index[r]]
        return -(work.G[r, 3] * surface[0] + work.G[r, 4] * surface[1])
    return model.joint_motor[work.index[r], 0] if model.joint_motor[work.index[r], 1] > 0.0 else 0.0


@njit
def drives_work(model, work, v, n):
    """Work of motors and belts among n rows [J] by their impulses λ.

    Of a motor λ times its rate G v, as at the port F · Δx. A belt works λ times its own speed, `wished`; the part of it
    that does not reach the body, λ (wished − G v) ≥ 0, becomes heat.
    """
    given = 0.0
    for r in range(n):
        if work.source[r] == 0:
            given += work.lam[r] * wished(model, work, r)
        elif work.source[r] == DRY and model.joint_motor[work.index[r], 1] > 0.0:
            given += work.lam[r] * rate_of(work, v, r)
    return given


@njit
def add_row(work, r, a, b, kind, partner, mu, bound, source, index, key):
    """Row r's constants; its numbers are filled in by `refresh`. Returns r + 1."""
    work.row_a[r], work.row_b[r], work.kind[r], work.partner[r] = a, b, kind, partner
    work.mu[r], work.bound[r], work.source[r], work.index[r], work.key[r] = mu, bound, source, index, key
    work.mode[r] = FREE
    return r + 1


@njit
def add_contact(model, layout, work, r, pair, feature):
    """The rows of one contact: normal and, with friction, tangent."""
    if r + 2 > MOST_ROWS:
        work.counts[4] += 1
        return r
    a, b = layout.pair_bodies[pair, 0], layout.pair_bodies[pair, 1]
    corners = model.corners
    key = (((pair * 2 + feature[0]) * corners + feature[1]) * corners + feature[2]) * 4 + 2 * (feature[3] + 1) % 4
    for k in range(4):
        work.feature[r, k] = feature[k]
    add_row(work, r, a, b, NORMAL, -1, 0.0, 0.0, 0, pair, 2 * key)
    if model.pair_friction[pair] == 0.0:
        return r + 1
    for k in range(4):
        work.feature[r + 1, k] = feature[k]
    return add_row(work, r + 1, a, b, FRICTION, r, model.pair_friction[pair], 0.0, 0, pair, 2 * key + 1)


@njit
def add_joints(model, layout, work, first, q, v, slack, friction_scale):
    """Rows of joints from `first` on; returns how many.

    Limits nearer than `slack`, dry friction and motors with their bounds times `friction_scale`.
    """
    r = first
    for j in range(model.joints):
        a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
        if model.joint_kind[j] == SPRING or not moves(layout, work, a, b):
            continue
        if r + 3 > MOST_ROWS:
            work.counts[4] += 1
            continue
        if model.joint_limit[j, 0] > -math.inf or model.joint_limit[j, 1] < math.inf:
            at = coordinate_row(model, q, v, j, work.row)[0]
            if at - model.joint_limit[j, 0] < slack:
                work.feature[r, 3] = 1
                r = add_row(work, r, a, b, NORMAL, -1, 0.0, 0.0, LIMIT, j, -4 * j - 1)
            if model.joint_limit[j, 1] - at < slack:
                work.feature[r, 3] = -1
                r = add_row(work, r, a, b, NORMAL, -1, 0.0, 0.0, LIMIT, j, -4 * j - 2)
        most = max(model.joint_friction[j], model.joint_motor[j, 1]) * friction_scale
        if most > 0.0:
            r = add_row(work, r, a, b, FRICTION, -1, 0.0, most, DRY, j, -4 * j - 3)
    return r - first


@njit
def moves(layout, work, a, b):
    """Whether one of two bodies belongs to a linkage that is being advanced."""
    la, lb = layout.linkage[a], layout.linkage[b]
    return (la >= 0 and work.active[la] > 0) or (lb >= 0 and work.active[lb] > 0)


@njit
def recall(work, n):
    """First guess of the modes: what the same rows were in before."""
    for r in range(n):
        for k in range(work.counts[1]):
            at = (r + k) % work.counts[1]
            if work.old_key[at] == work.key[r]:
                work.mode[r] = work.old_mode[at]
                break


@njit
def remember(work, n):
    """Keeps the modes for the next guess."""
    work.counts[1] = n
    for r in range(n):
        work.old_key[r], work.old_mode[r] = work.key[r], work.mode[r]


@njit
def refresh(model, layout, work, q, v, n):
    """G, γ and gap of all rows at q, v; the shapes have been placed at q."""
    r = 0
    while r < n:
        if work.source[r] == 0:
            evaluate(layout, work, work.feature[r])
            tangent = r + 1 < n and work.partner[r + 1] == r
            contact_rows(model.pair_surface[work.index[r]], work, q, v, r, tangent)
            r += 2 if tangent else 1
        else:
            joint_coordinate(model, work, q, v, r)
            r += 1


@njit
def contact_rows(surface, work, q, v, r, tangent):
    """Normal row r, and row r + 1 along t = z × n, there with the γ of the slip, G v + t · surface."""
    c, a, b, G = work.contact, work.row_a[r], work.row_b[r], work.G
    nx, ny = c[NX], c[NY]
    ax, ay, bx, by = c[AX] - q[a, 0], c[AY] - q[a, 1], c[BX] - q[b, 0], c[BY] - q[b, 1]
    wa, wb = v[a, 2], v[b, 2]
    G[r, 0], G[r, 1], G[r, 2] = -nx, -ny, -(ax * ny - ay * nx)
    G[r, 3], G[r, 4], G[r, 5] = nx, ny, bx * ny - by * nx
    slip_x, slip_y = v[b, 0] - wb * by - v[a, 0] + wa * ay, v[b, 1] + wb * bx - v[a, 1] - wa * ax
    along = -ny * slip_x + nx * slip_y
    bend_x, bend_y = wa * wa * ax - wb * wb * bx, wa * wa * ay - wb * wb * by
    owner = wa if c[OWNER] > 0.0 else wb if c[OWNER] < 0.0 else 0.0
    work.gap[r] = c[GAP]
    work.gamma[r] = nx * bend_x + ny * bend_y + 2.0 * owner * along + c[ROUND] * along * along
    if tangent:
        px, py, ux, uy = c[PX] - q[a, 0], c[PY] - q[a, 1], c[PX] - q[b, 0], c[PY] - q[b, 1]
        G[r + 1, 0], G[r + 1, 1], G[r + 1, 2] = ny, -nx, -(px * nx + py * ny)
        G[r + 1, 3], G[r + 1, 4], G[r + 1, 5] = -ny, nx, ux * nx + uy * ny
        turn = owner + c[ROUND] * along  # of n, with which the part of the surface's velocity along t changes
        work.gap[r + 1] = 0.0
        work.gamma[r + 1] = -ny * bend_x + nx * bend_y - turn * (nx * surface[0] + ny * surface[1])
    work.place[r, 0], work.place[r, 1] = c[PX], c[PY]


@njit
def joint_coordinate(model, work, q, v, r):
    """A row along a joint's coordinate: towards the inside of a limit, or the coordinate itself."""
    j = work.index[r]
    at, gamma = coordinate_row(model, q, v, j, work.row)
    sign = float(work.feature[r, 3]) if work.source[r] == LIMIT else 1.0
    for k in range(6):
        work.G[r, k] = sign * work.row[k]
    work.gamma[r] = sign * gamma
    work.gap[r] = 0.0
    if work.source[r] == LIMIT:
        work.gap[r] = at - model.joint_limit[j, 0] if sign > 0.0 else model.joint_limit[j, 1] - at


@njit
def keep_rows(work, v, n, farthest, fastest):
    """Drops contacts and limits farther or parting faster (with their friction); returns how many are left."""
    kept, dropped = 0, False
    for r in range(n):
        if work.kind[r] == NORMAL:
            dropped = work.gap[r] > farthest or rate_of(work, v, r) > fastest
        if dropped and (work.kind[r] == NORMAL or work.partner[r] >= 0):
            continue
        if kept != r:
            move_row(work, r, kept)
        kept += 1
    return kept


@njit
def move_row(work, r, to):
    """Row r becomes row `to`; a friction row stays next to its normal."""
    work.row_a[to], work.row_b[to], work.kind[to], work.mu[to] = work.row_a[r], work.row_b[r], work.kind[r], work.mu[r]
    work.partner[to] = to - 1 if work.partner[r] >= 0 else -1
    work.bound[to], work.source[to], work.index[to], work.key[to] = (
        work.bound[r],
        work.source[r],
        work.index[r],
        work.key[r],
    )
    for k in range(4):
        work.feature[to, k] = work.feature[r, k]
    for k in range(6):
        work.G[to, k] = work.G[r, k]
    work.gamma[to], work.gap[to] = work.gamma[r], work.gap[r]
    work.place[to, 0], work.place[to, 1] = work.place[r, 0], work.place[r, 1]
