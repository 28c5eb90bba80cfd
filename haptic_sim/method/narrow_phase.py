# SPDX-License-Identifier: Apache-2.0
"""Where two convex shapes touch: signed gap, normal and points, for polygons and discs, as compiled kernels.

Two polygons are apart exactly if some edge of either has the whole other polygon on its outer side (separating axes);
the largest such separation is their signed gap here. It is continuous in the poses, is zero exactly when they touch,
and below zero is the least way out. The edge that reached zero last is the one that was passed when they met: methods
that stop at the time of touching read the right constraint off it, however many vertices overlap a moment later.

A body of several shapes has seams: edges that begin inside or on a neighbour, and that nothing can strike. What slides
over a seam reaches the next shape's flush surface and its hidden side at the same time, gap zero of both; so a hidden
edge, or one that faces it, is a contact only for what overlaps the surface by more than the depth it is hidden to.

A contact is a vertex (or a disc) on an edge: then the gap's own acceleration is known in closed form, with w the
velocity of the point relative to the edge's body, w_t its part along t = z × n, ω the edge's angular velocity:

    gap'' = n · (a_b − a_a)(at the point) + 2 ω w_t    (the same for an edge of a and of b, w = v_b − v_a, t = z × n)
    gap'' = n · (a_b − a_a) + w_t²/ρ                   two points (disc centres or a vertex) at a distance ρ
"""

import math

from haptic_device.jit import njit

ON_EDGE, TWO_POINTS = 0, 1
"""Kinds of feature (kind, first, second, sign): vertex `first` on edge `second`, which is a's if the sign is 1, b's if
it is -1; or vertex `first` of a near vertex `second` of b. A disc is a vertex with a radius."""
ROUNDING = 1e-9
"""Of an edge's length: two equal edges face each other whole."""
HIDDEN = 1e6
"""m; what a hidden edge counts less than one that is not."""
FLUSH = 0.9
"""Cosine between two facing edges above which both ends are contacts."""


@njit
def place_shapes(model, work, q):
    """Vertices, edge normals and disc centres of all shapes in the plane, bodies at poses `q`."""
    body, c, sn = -1, 1.0, 0.0
    for s in range(model.shapes):
        b = model.shape_body[s]
        if b != body:
            body, c, sn = b, math.cos(q[b, 2]), math.sin(q[b, 2])
        place_shape(model, work, s, q[b, 0], q[b, 1], c, sn)


@njit
def place_shape(model, work, s, x, y, c, sn):
    """The same of one shape, with its body's mass centre and the cosine and sine of its angle given."""
    narrow_phase = work.narrow_phase
    points, normals, middles = narrow_phase.points, narrow_phase.normals, narrow_phase.middles
    mx, my = model.middle[s, 0], model.middle[s, 1]
    middles[s, 0], middles[s, 1] = x + c * mx - sn * my, y + sn * mx + c * my
    for v in range(model.shape_start[s], model.shape_start[s + 1]):
        vx, vy = model.vertices[v, 0], model.vertices[v, 1]
        points[v, 0], points[v, 1] = x + c * vx - sn * vy, y + sn * vx + c * vy
        nx, ny = model.normals[v, 0], model.normals[v, 1]
        normals[v, 0], normals[v, 1] = c * nx - sn * ny, sn * nx + c * ny


@njit
def disc_distance(model, work, s, u):
    """Distance of the discs around two shapes [m]: a lower bound of their gap."""
    middles = work.narrow_phase.middles
    return math.hypot(middles[u, 0] - middles[s, 0], middles[u, 1] - middles[s, 1]) - model.reach[s] - model.reach[u]


@njit
def separating_edge(work, a0, a1, b0, b1):
    """(separation, edge, deepest vertex): the edge of a with the largest least distance of b's vertices from it."""
    best, edge, deep = -math.inf, a0, b0
    for e in range(a0, a1):
        least, at = separation(work, e, b0, b1)
        if least > best:
            best, edge, deep = least, e, at
    return best, edge, deep


@njit
def disc_to_polygon(work, c, radius, a0, a1):
    """(gap, vertex or -1, edge): of a disc about vertex `c` from a polygon, and the corner it is nearest to, if any."""
    points, normals = work.narrow_phase.points, work.narrow_phase.normals
    best, edge, _ = separating_edge(work, a0, a1, c, c + 1)
    nx, ny = normals[edge, 0], normals[edge, 1]
    after = edge + 1 if edge + 1 < a1 else a0
    if best > 0.0:
        from_start = (points[c, 1] - points[edge, 1]) * nx - (points[c, 0] - points[edge, 0]) * ny
        from_end = (points[c, 1] - points[after, 1]) * nx - (points[c, 0] - points[after, 0]) * ny
        corner = edge if from_start < 0.0 else after if from_end > 0.0 else -1
        if corner >= 0:
            away = math.hypot(points[c, 0] - points[corner, 0], points[c, 1] - points[corner, 1])
            return away - radius, corner, edge
    return best - radius, -1, edge


@njit
def signed_gap(model, work, s, u):
    """Signed gap of two shapes [m]."""
    points = work.narrow_phase.points
    a0, a1, b0, b1 = model.shape_start[s], model.shape_start[s + 1], model.shape_start[u], model.shape_start[u + 1]
    ra, rb = model.radius[s], model.radius[u]
    if ra > 0.0 and rb > 0.0:
        return math.hypot(points[b0, 0] - points[a0, 0], points[b0, 1] - points[a0, 1]) - ra - rb
    if ra > 0.0:
        return disc_to_polygon(work, a0, ra, b0, b1)[0]
    if rb > 0.0:
        return disc_to_polygon(work, b0, rb, a0, a1)[0]
    return max(separating_edge(work, a0, a1, b0, b1)[0], separating_edge(work, b0, b1, a0, a1)[0])


@njit
def contact_features(model, work, s, u):
    """Writes the features by which two shapes touch or come nearest into narrow_phase; returns how many, 1 or 2."""
    a0, a1, b0, b1 = model.shape_start[s], model.shape_start[s + 1], model.shape_start[u], model.shape_start[u + 1]
    ra, rb = model.radius[s], model.radius[u]
    if ra > 0.0 and rb > 0.0:
        return write_feature(work, 0, TWO_POINTS, a0, b0, 0)
    if rb > 0.0:
        corner, edge = nearest_of_polygon(model, work, b0, rb, a0, a1)
        return (
            write_feature(work, 0, ON_EDGE, b0, edge, 1)
            if corner < 0
            else write_feature(work, 0, TWO_POINTS, corner, b0, 0)
        )
    if ra > 0.0:
        corner, edge = nearest_of_polygon(model, work, a0, ra, b0, b1)
        return (
            write_feature(work, 0, ON_EDGE, a0, edge, -1)
            if corner < 0
            else write_feature(work, 0, TWO_POINTS, a0, corner, 0)
        )
    sep_a, edge_a, deep_b = touching_edge(model, work, a0, a1, b0, b1)
    sep_b, edge_b, deep_a = touching_edge(model, work, b0, b1, a0, a1)
    if sep_a >= sep_b - 1e-9 * abs(sep_b):
        return edge_features(work, edge_a, a0, a1, deep_b, b0, b1, 1)
    return edge_features(work, edge_b, b0, b1, deep_a, a0, a1, -1)


@njit
def touching_edge(model, work, a0, a1, b0, b1):
    """As `separating_edge`, but an edge that is hidden at a seam, or faces one that is, only if all are."""
    normals = work.narrow_phase.normals
    best, edge, deep = -math.inf, a0, b0
    for e in range(a0, a1):
        least, at = separation(work, e, b0, b1)
        before = at - 1 if at > b0 else b1 - 1
        turn_x, turn_y = normals[at, 0] - normals[before, 0], normals[at, 1] - normals[before, 1]
        facing = at if normals[e, 0] * turn_x + normals[e, 1] * turn_y < 0.0 else before
        if is_hidden(model, work, e, a0, a1, b0, b1) or is_hidden(model, work, facing, b0, b1, a0, a1):
            least -= HIDDEN
        if least > best:
            best, edge, deep = least, e, at
    return best, edge, deep


@njit
def separation(work, e, b0, b1):
    """(least distance, vertex): of the other shape's vertices from edge e [m]."""
    points, normals = work.narrow_phase.points, work.narrow_phase.normals
    nx, ny, ox, oy = normals[e, 0], normals[e, 1], points[e, 0], points[e, 1]
    least, at = math.inf, b0
    for v in range(b0, b1):
        d = (points[v, 0] - ox) * nx + (points[v, 1] - oy) * ny
        if d < least:
            least, at = d, v
    return least, at


@njit
def is_hidden(model, work, e, a0, a1, b0, b1):
    """Whether the other shape overlaps the surface beside edge e by less than the depth to which that covers e."""
    after, before = e + 1 if e + 1 < a1 else a0, e - 1 if e > a0 else a1 - 1
    at_start, at_end = model.covered[e, 0], model.covered[after, 1]
    if at_start > 0.0 and separation(work, before, b0, b1)[0] > -at_start:
        return True
    return at_end > 0.0 and separation(work, after, b0, b1)[0] > -at_end


@njit
def nearest_of_polygon(model, work, c, radius, a0, a1):
    """(corner or -1, edge) by which a polygon touches a disc about vertex `c`; at a seam its edge, not a corner."""
    points, normals = work.narrow_phase.points, work.narrow_phase.normals
    gap, corner, edge = disc_to_polygon(work, c, radius, a0, a1)
    if corner >= 0 and model.straight[corner] > 0.0:
        nx, ny = normals[edge, 0], normals[edge, 1]
        beside = (points[c, 0] - points[edge, 0]) * nx + (points[c, 1] - points[edge, 1]) * ny - radius
        if gap - beside < model.straight[corner]:
            return -1, edge
    return corner, edge


@njit
def write_feature(work, k, kind, first, second, sign):
    """Writes feature k and returns k + 1."""
    features = work.narrow_phase.features
    features[k, 0], features[k, 1], features[k, 2], features[k, 3] = kind, first, second, sign
    return k + 1


@njit
def edge_features(work, e, a0, a1, deep, b0, b1, sign):
    """Features of edge `e` of one polygon with the other, whose deepest vertex is `deep`; sign -1 if e is body b's."""
    normals = work.narrow_phase.normals
    nx, ny = normals[e, 0], normals[e, 1]
    after = e + 1 if e + 1 < a1 else a0
    before = deep - 1 if deep > b0 else b1 - 1
    facing_deep = normals[deep, 0] * nx + normals[deep, 1] * ny
    facing_before = normals[before, 0] * nx + normals[before, 1] * ny
    f = deep if facing_deep < facing_before else before
    g = f + 1 if f + 1 < b1 else b0
    if min(facing_deep, facing_before) > -FLUSH:
        return write_feature(work, 0, ON_EDGE, deep, e, sign)
    count = 0
    for v in (f, g):
        if projects_into_edge(work, v, e, after):
            count = write_feature(work, count, ON_EDGE, v, e, sign)
    for v in (e, after):
        if count < 2 and projects_into_edge(work, v, f, g) and not (count > 0 and is_abreast(work, v, f, g)):
            count = write_feature(work, count, ON_EDGE, v, f, -sign)
    return count if count > 0 else write_feature(work, 0, ON_EDGE, deep, e, sign)


@njit
def is_abreast(work, v, f, g):
    """Whether vertex v is where the first feature's vertex is, along the edge from f to g: one point needs no two."""
    points, known = work.narrow_phase.points, int(work.narrow_phase.features[0, 1])
    ex, ey = points[g, 0] - points[f, 0], points[g, 1] - points[f, 1]
    along = (points[v, 0] - points[known, 0]) * ex + (points[v, 1] - points[known, 1]) * ey
    return abs(along) <= ROUNDING * (ex * ex + ey * ey)


@njit
def projects_into_edge(work, v, e, after):
    """Whether vertex v projects into the edge from e to after."""
    points = work.narrow_phase.points
    ex, ey = points[after, 0] - points[e, 0], points[after, 1] - points[e, 1]
    along = (points[v, 0] - points[e, 0]) * ex + (points[v, 1] - points[e, 1]) * ey
    length = ex * ex + ey * ey
    return -ROUNDING * length <= along <= (1.0 + ROUNDING) * length


@njit
def evaluate_contact(model, work, feature):
    """The contact at one feature into work.narrow_phase.contact, for the poses that the shapes were placed at."""
    narrow_phase = work.narrow_phase
    points, normals, out = narrow_phase.points, narrow_phase.normals, narrow_phase.contact
    first, second = feature[1], feature[2]
    if feature[0] == TWO_POINTS:
        dx, dy = points[second, 0] - points[first, 0], points[second, 1] - points[first, 1]
        d = math.hypot(dx, dy)
        nx, ny, ra = dx / d, dy / d, model.disc[first]
        out.gap, out.nx, out.ny, out.curvature, out.owner = d - ra - model.disc[second], nx, ny, 1.0 / d, 0.0
        out.ax, out.ay, out.bx, out.by = points[first, 0], points[first, 1], points[second, 0], points[second, 1]
        out.px, out.py = points[first, 0] + ra * nx, points[first, 1] + ra * ny
        return
    nx, ny, r, x, y = normals[second, 0], normals[second, 1], model.disc[first], points[first, 0], points[first, 1]
    sign = float(feature[3])
    out.gap = (x - points[second, 0]) * nx + (y - points[second, 1]) * ny - r
    out.nx, out.ny, out.curvature, out.owner = sign * nx, sign * ny, 0.0, sign
    out.ax, out.ay, out.bx, out.by = x, y, x, y
    out.px, out.py = x - r * nx, y - r * ny
