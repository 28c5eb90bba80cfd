# SPDX-License-Identifier: Apache-2.0
"""Rows of one complementarity problem: contacts, joint limits, dry friction and motors, as they stand at q, v.

Row r has six numbers G (of body a, of body b) with G v its rate, and γ with G a + γ the rate's own rate (see
`narrow_phase` and `joints`).
"""

import math

from haptic_device.jit import njit
from haptic_sim.method.joints import coordinate_row
from haptic_sim.method.lcp import FREE, FRICTION, NORMAL
from haptic_sim.method.narrow_phase import evaluate_contact
from haptic_sim.method.records import MOST_ROWS
from haptic_sim.reduction.model import SPRING

CONTACT, JOINT_LIMIT, JOINT_FRICTION, JOINT_MOTOR = 0, 1, 2, 3
"""Sources of a row: a contact, a joint's limit (which side: sign), its dry friction, its motor."""


@njit
def constraint_rate(work, v, r):
    """G v of row r."""
    rows = work.constraints
    a, b, G = rows.body_a[r], rows.body_b[r], rows.G
    return (
        G[r, 0] * v[a, 0]
        + G[r, 1] * v[a, 1]
        + G[r, 2] * v[a, 2]
        + G[r, 3] * v[b, 0]
        + G[r, 4] * v[b, 1]
        + G[r, 5] * v[b, 2]
    )


@njit
def reference_rate(model, work, r):
    """Rate G v at which row r does not slip: a motor's speed; on a belt −t · s, s its surface's velocity; else 0."""
    rows = work.constraints
    if rows.kind[r] == NORMAL or rows.source[r] == JOINT_LIMIT:
        return 0.0
    if rows.source[r] == CONTACT:
        surface = model.pair_surface[rows.index[r]]
        return -(rows.G[r, 3] * surface[0] + rows.G[r, 4] * surface[1])
    return model.joint_motor[rows.index[r], 0] if rows.source[r] == JOINT_MOTOR else 0.0


@njit
def work_of_drives(model, work, v, n):
    """Work of motors and belts among n rows [J] by their impulses λ.

    Of a motor λ times its rate G v, as at the port F · Δx. A belt works λ times its own speed s, its
    `reference_rate`; the part of it that does not reach the body, λ (s − G v) ≥ 0, becomes heat.
    """
    rows, given = work.constraints, 0.0
    for r in range(n):
        if rows.source[r] == CONTACT:
            given += work.lcp.lam[r] * reference_rate(model, work, r)
        elif rows.source[r] == JOINT_MOTOR:
            given += work.lcp.lam[r] * constraint_rate(work, v, r)
    return given


@njit
def add_constraint(work, r, a, b, kind, partner, mu, bound, source, index, key):
    """Row r's constants; its numbers are filled in by `evaluate_constraints`. Returns r + 1."""
    rows = work.constraints
    rows.body_a[r], rows.body_b[r], rows.kind[r], rows.partner[r] = a, b, kind, partner
    rows.mu[r], rows.bound[r], rows.source[r], rows.index[r], rows.key[r] = mu, bound, source, index, key
    rows.twin[r] = -1
    work.lcp.mode[r] = FREE
    return r + 1


@njit
def add_contact_constraints(model, work, r, pair, feature):
    """The rows of one contact: normal and, with friction, tangent."""
    if r + 2 > MOST_ROWS:
        work.counters.left_out += 1
        return r
    a, b = model.pair_bodies[pair, 0], model.pair_bodies[pair, 1]
    corners = model.corners
    key = (((pair * 2 + feature[0]) * corners + feature[1]) * corners + feature[2]) * 4 + 2 * (feature[3] + 1) % 4
    for k in range(4):
        work.constraints.feature[r, k] = feature[k]
    add_constraint(work, r, a, b, NORMAL, -1, 0.0, 0.0, CONTACT, pair, 2 * key)
    if model.pair_friction[pair] == 0.0:
        return r + 1
    for k in range(4):
        work.constraints.feature[r + 1, k] = feature[k]
    return add_constraint(work, r + 1, a, b, FRICTION, r, model.pair_friction[pair], 0.0, CONTACT, pair, 2 * key + 1)


@njit
def add_joint_constraints(model, work, first, q, v, slack, friction_scale):
    """Rows of joints from `first` on; returns how many.

    Limits nearer than `slack`, dry friction and motors with their bounds times `friction_scale`.
    """
    r = first
    for j in range(model.joints):
        a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
        if model.joint_kind[j] == SPRING or not is_advanced(model, work, a, b):
            continue
        if r + 4 > MOST_ROWS:
            work.counters.left_out += 1
            continue
        if model.joint_limit[j, 0] > -math.inf or model.joint_limit[j, 1] < math.inf:
            at = coordinate_row(model, q, v, j, work.joint_row)[0]
            if at - model.joint_limit[j, 0] < slack:
                work.constraints.feature[r, 3] = 1
                r = add_constraint(work, r, a, b, NORMAL, -1, 0.0, 0.0, JOINT_LIMIT, j, -4 * j - 1)
            if model.joint_limit[j, 1] - at < slack:
                work.constraints.feature[r, 3] = -1
                r = add_constraint(work, r, a, b, NORMAL, -1, 0.0, 0.0, JOINT_LIMIT, j, -4 * j - 2)
        r = add_drive_constraints(model, work, r, j, friction_scale)
    return r - first


@njit
def add_drive_constraints(model, work, r, j, scale):
    """The rows of joint j's motor and of its dry friction, with their bounds times `scale`; returns the next row."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    motor, friction = model.joint_motor[j, 1] * scale, model.joint_friction[j] * scale
    if motor > 0.0:
        r = add_constraint(work, r, a, b, FRICTION, -1, 0.0, motor, JOINT_MOTOR, j, -4 * j - 3)
    if friction > 0.0:
        r = add_constraint(work, r, a, b, FRICTION, -1, 0.0, friction, JOINT_FRICTION, j, -4 * j - 4)
        work.constraints.twin[r - 1] = r - 2 if motor > 0.0 else -1
    return r


@njit
def is_advanced(model, work, a, b):
    """Whether one of two bodies belongs to a linkage that is being advanced."""
    la, lb = model.linkage[a], model.linkage[b]
    return (la >= 0 and work.active[la] > 0) or (lb >= 0 and work.active[lb] > 0)


@njit
def has_constraint(work, n, p, feature):
    """Whether the contact of pair p at this feature is one of the rows."""
    rows = work.constraints
    for r in range(n):
        if rows.source[r] == CONTACT and rows.index[r] == p and rows.kind[r] == NORMAL:
            same = True
            for k in range(4):
                same &= rows.feature[r, k] == feature[k]
            if same:
                return True
    return False


@njit
def restore_modes(work, n):
    """First guess of the modes: those of the same rows in the solution before."""
    warm_start = work.warm_start
    for r in range(n):
        for k in range(warm_start.count):
            at = (r + k) % warm_start.count
            if warm_start.key[at] == work.constraints.key[r]:
                work.lcp.mode[r] = warm_start.mode[at]
                break


@njit
def store_modes(work, n):
    """Keeps the modes for the next first guess."""
    warm_start = work.warm_start
    warm_start.count = n
    for r in range(n):
        warm_start.key[r], warm_start.mode[r] = work.constraints.key[r], work.lcp.mode[r]


@njit
def evaluate_constraints(model, work, q, v, n):
    """G, γ and gap of all rows at q, v; the shapes have been placed at q."""
    rows, r = work.constraints, 0
    while r < n:
        if rows.source[r] == CONTACT:
            evaluate_contact(model, work, rows.feature[r])
            tangent = r + 1 < n and rows.partner[r + 1] == r
            evaluate_contact_rows(model.pair_surface[rows.index[r]], work, q, v, r, tangent)
            r += 2 if tangent else 1
        else:
            evaluate_joint_row(model, work, q, v, r)
            r += 1


@njit
def evaluate_contact_rows(surface, work, q, v, r, tangent):
    """Normal row r, and row r + 1 along t = z × n, there with the γ of the slip, G v + t · surface."""
    rows = work.constraints
    c, a, b, G = work.narrow_phase.contact, rows.body_a[r], rows.body_b[r], rows.G
    nx, ny = c.nx, c.ny
    ax, ay, bx, by = c.ax - q[a, 0], c.ay - q[a, 1], c.bx - q[b, 0], c.by - q[b, 1]
    wa, wb = v[a, 2], v[b, 2]
    G[r, 0], G[r, 1], G[r, 2] = -nx, -ny, -(ax * ny - ay * nx)
    G[r, 3], G[r, 4], G[r, 5] = nx, ny, bx * ny - by * nx
    slip_x, slip_y = v[b, 0] - wb * by - v[a, 0] + wa * ay, v[b, 1] + wb * bx - v[a, 1] - wa * ax
    along = -ny * slip_x + nx * slip_y
    bend_x, bend_y = wa * wa * ax - wb * wb * bx, wa * wa * ay - wb * wb * by
    owner = wa if c.owner > 0.0 else wb if c.owner < 0.0 else 0.0
    rows.gap[r] = c.gap
    rows.gamma[r] = nx * bend_x + ny * bend_y + 2.0 * owner * along + c.curvature * along * along
    if tangent:
        px, py, ux, uy = c.px - q[a, 0], c.py - q[a, 1], c.px - q[b, 0], c.py - q[b, 1]
        G[r + 1, 0], G[r + 1, 1], G[r + 1, 2] = ny, -nx, -(px * nx + py * ny)
        G[r + 1, 3], G[r + 1, 4], G[r + 1, 5] = -ny, nx, ux * nx + uy * ny
        turn = owner + c.curvature * along  # of n, with which the part of the surface's velocity along t changes
        rows.gap[r + 1] = 0.0
        rows.gamma[r + 1] = -ny * bend_x + nx * bend_y - turn * (nx * surface[0] + ny * surface[1])
    rows.place[r, 0], rows.place[r, 1] = c.px, c.py


@njit
def evaluate_joint_row(model, work, q, v, r):
    """A row along a joint's coordinate: towards the inside of a limit, or the coordinate itself."""
    rows = work.constraints
    j = rows.index[r]
    at, gamma = coordinate_row(model, q, v, j, work.joint_row)
    sign = float(rows.feature[r, 3]) if rows.source[r] == JOINT_LIMIT else 1.0
    for k in range(6):
        rows.G[r, k] = sign * work.joint_row[k]
    rows.gamma[r] = sign * gamma
    rows.gap[r] = 0.0
    if rows.source[r] == JOINT_LIMIT:
        rows.gap[r] = at - model.joint_limit[j, 0] if sign > 0.0 else model.joint_limit[j, 1] - at


@njit
def keep_constraints(work, v, n, farthest, fastest):
    """Drops contacts and limits farther or parting faster (with their friction); returns how many are left."""
    rows = work.constraints
    kept, dropped = 0, False
    for r in range(n):
        if rows.kind[r] == NORMAL:
            dropped = rows.gap[r] > farthest or constraint_rate(work, v, r) > fastest
        if dropped and (rows.kind[r] == NORMAL or rows.partner[r] >= 0):
            continue
        if kept != r:
            move_constraint(work, r, kept)
        kept += 1
    return kept


@njit
def move_constraint(work, r, to):
    """Row r becomes row `to`; a friction row stays next to its normal, or to its motor."""
    rows = work.constraints
    rows.body_a[to], rows.body_b[to], rows.kind[to] = rows.body_a[r], rows.body_b[r], rows.kind[r]
    rows.source[to], rows.index[to], rows.key[to] = rows.source[r], rows.index[r], rows.key[r]
    rows.partner[to] = to - 1 if rows.partner[r] >= 0 else -1
    rows.twin[to] = to - 1 if rows.twin[r] >= 0 else -1
    rows.mu[to], rows.bound[to], rows.gamma[to], rows.gap[to] = rows.mu[r], rows.bound[r], rows.gamma[r], rows.gap[r]
    for k in range(4):
        rows.feature[to, k] = rows.feature[r, k]
    for k in range(6):
        rows.G[to, k] = rows.G[r, k]
    rows.place[to, 0], rows.place[to, 1] = rows.place[r, 0], rows.place[r, 1]
