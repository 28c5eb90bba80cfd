# SPDX-License-Identifier: Apache-2.0
"""What the tool can touch within its next moves: pairs of features, the most urgent of them in stable places.

Between two convex polygons contact begins at a corner of one and an edge of the other. So each corner is taken against
each edge of the other shape: the edge with the largest distance of the corner (separating axis) is where it is; others
of that shape are offered too, since it may go round a corner. Discs are corners with a radius; there every edge counts
by itself, as a segment.

Which are sent is decided by how far the tool may move before they matter, from where it will be when they are used: to
first order, gaps g + lead · rate. The edge with the largest gap matters when that is gone; another, at g₂, once the
corner is nearer to it: (n₂ − n₁) · u ≥ g₁ − g₂, so not before |u| = (g₁ − g₂)/|n₂ − n₁|.
"""

import math

import numpy as np

from haptic_device.control import contact_model
from haptic_device.jit import kernel, njit

MOST = 512  # pairs of features looked at
FAR = 1e3  # [m] trust where none was left out
FIELDS = len(contact_model.EACH)
URGENCY, BODY, WORLD_NX, WORLD_NY, LEADER = range(FIELDS, FIELDS + 5)
COLUMNS = FIELDS + 5  # URGENCY: way [m] until it matters; LEADER: candidate of its group with the largest gap, or −1
READ = "shape_body", "shape_start", "vertices", "radius", "pairs", "pair_friction", "pair_restitution"
CORNERS = 64  # of a shape, at most; numbers of an identity


@kernel
def find(model, pose, velocity, lead, out):
    """Fills in candidates (MOST, COLUMNS) for the tool at pose[0]; returns how many there are.

    lead [s]: after which they are used; pose, velocity: of all bodies.
    model: its arrays READ.
    """
    body, start, corners, radius, pairs, friction, restitution = model
    count = 0
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        if body[a] != 0:
            continue
        first = count
        if radius[a] > 0.0 and radius[b] > 0.0:
            count = _discs(model, pose, p, out, count)
        else:
            if radius[b] == 0.0:
                count = _corners(model, pose, p, a, b, True, out, count)
            if radius[a] == 0.0:
                count = _corners(model, pose, p, b, a, False, out, count)
        for k in range(first, count):
            out[k, contact_model.FRICTION], out[k, contact_model.RESTITUTION] = friction[p], restitution[p]
            _move(out[k], pose, velocity, body[b], lead)
        _rank(out, first, count)
    return count


@njit
def _discs(model, pose, p, out, count):
    body, start, corners, radius, pairs, friction, restitution = model
    a, b = pairs[p, 0], pairs[p, 1]
    if count >= MOST:
        return count
    ax, ay = _world(corners[start[a]], pose[0])
    bx, by = _world(corners[start[b]], pose[body[b]])
    far = math.hypot(ax - bx, ay - by)
    one = out[count]
    one[:] = 0.0
    one[contact_model.IDENTITY], one[contact_model.KIND] = 1.0 + float(p) * 2.0 * CORNERS * CORNERS, contact_model.ROUND
    one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y] = (
        ((ax - bx) / far, (ay - by) / far) if far > 0.0 else (1.0, 0.0)
    )
    one[contact_model.POINT_X], one[contact_model.POINT_Y] = bx, by
    one[contact_model.TOOL_X], one[contact_model.TOOL_Y] = corners[start[a], 0], corners[start[a], 1]
    one[contact_model.RADIUS], one[contact_model.TOOL_RADIUS] = radius[a] + radius[b], radius[a]
    one[contact_model.GAP] = far - one[contact_model.RADIUS]
    one[URGENCY] = one[contact_model.GAP]
    return count + 1


@njit
def _corners(model, pose, p, point_shape, edge_shape, there, out, count):
    """Every corner of one shape against every edge of the other; there: the edges are the other body's."""
    body, start, corners, radius, pairs, friction, restitution = model
    edge_pose, point_pose = pose[body[edge_shape]], pose[body[point_shape]]
    kind = contact_model.FLAT_THERE if there else contact_model.FLAT_HERE
    edges = start[edge_shape + 1] - start[edge_shape]
    rounded = radius[point_shape]
    for c in range(start[point_shape], start[point_shape + 1]):
        x, y = _world(corners[c], point_pose)
        group = 1.0 + ((float(p) * 2.0 + (1.0 if there else 0.0)) * CORNERS + (c - start[point_shape])) * CORNERS
        for e in range(edges):
            if count >= MOST:
                return count
            q, r = start[edge_shape] + e, start[edge_shape] + (e + 1) % edges
            one = out[count]
            one[:] = 0.0
            gap = _at_edge(one, corners[q], corners[r], edge_pose, x, y, there)
            one[contact_model.GAP], one[contact_model.RADIUS] = gap - rounded, rounded
            one[contact_model.IDENTITY], one[contact_model.KIND] = group + e, kind
            one[contact_model.TOOL_RADIUS] = rounded if there else 0.0
            if there:
                one[contact_model.TOOL_X], one[contact_model.TOOL_Y] = corners[c, 0], corners[c, 1]
            else:
                one[contact_model.POINT_X], one[contact_model.POINT_Y] = x, y
            if rounded == 0.0:
                one[contact_model.GROUP], one[URGENCY] = group, gap
            elif gap < -0.5 * rounded:  # an edge on the far side
                continue
            else:
                one[URGENCY] -= rounded
            count += 1
    return count


@njit
def _rank(out, first, count):
    """From gaps when they are used to ways until they matter, for the candidates of one pair of shapes."""
    start = first
    for k in range(first, count):
        out[k, LEADER] = -1.0
        if out[k, contact_model.GROUP] == 0.0 or out[k, contact_model.GROUP] != out[start, contact_model.GROUP]:
            start = k
        if out[k, contact_model.GROUP] == 0.0 or (
            k + 1 < count and out[k + 1, contact_model.GROUP] == out[k, contact_model.GROUP]
        ):
            continue
        leader = start
        for i in range(start, k + 1):
            leader = i if out[i, URGENCY] > out[leader, URGENCY] else leader
        best = out[leader, URGENCY]
        for i in range(start, k + 1):
            out[i, LEADER] = leader
            between = math.hypot(out[i, WORLD_NX] - out[leader, WORLD_NX], out[i, WORLD_NY] - out[leader, WORLD_NY])
            out[i, URGENCY] = max(best, (best - out[i, URGENCY]) / between) if i != leader else best


@njit
def _at_edge(one, corner, next_corner, edge_pose, x, y, there):
    """Distance of the point (x, y) from an edge's line; fills in normal, reference point and extent of the edge."""
    px, py = _world(corner, edge_pose)
    qx, qy = _world(next_corner, edge_pose)
    length = math.hypot(qx - px, qy - py)
    nx, ny = (qy - py) / length, (px - qx) / length
    distance = nx * (x - px) + ny * (y - py)
    along = -ny * (x - px) + nx * (y - py)
    over = along - min(length, max(0.0, along))
    one[URGENCY] = math.hypot(distance, over) if over != 0.0 else distance
    if there:  # the edge's normal points to the tool, its tangent (−n_y, n_x) runs from corner to next corner
        one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y] = nx, ny
        one[contact_model.POINT_X], one[contact_model.POINT_Y] = px, py
        one[contact_model.LOW], one[contact_model.HIGH] = 0.0, length
    else:  # out of the other body is into the tool: against the edge's normal, and so is the tangent
        c, s = math.cos(edge_pose[2]), math.sin(edge_pose[2])
        one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y] = -(c * nx + s * ny), -(c * ny - s * nx)
        one[contact_model.TOOL_X], one[contact_model.TOOL_Y] = corner[0], corner[1]
        one[contact_model.LOW], one[contact_model.HIGH] = -length, 0.0
    return distance


@njit
def _move(one, pose, velocity, other, lead):
    """Velocity of the other body at its point, and the gap when the contact is used."""
    px, py = one[contact_model.POINT_X], one[contact_model.POINT_Y]
    bx, by = px - pose[other, 0], py - pose[other, 1]
    turn = velocity[other, 2]
    one[contact_model.VELOCITY_X] = velocity[other, 0] - turn * by
    one[contact_model.VELOCITY_Y] = velocity[other, 1] + turn * bx
    one[contact_model.TURN_RATE], one[BODY] = turn, other
    c, s = math.cos(pose[0, 2]), math.sin(pose[0, 2])
    ax = c * one[contact_model.TOOL_X] - s * one[contact_model.TOOL_Y]
    ay = s * one[contact_model.TOOL_X] + c * one[contact_model.TOOL_Y]
    nx, ny = one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y]
    if one[contact_model.KIND] == contact_model.FLAT_HERE:
        nx, ny = c * nx - s * ny, s * nx + c * ny
        ax, ay = px - pose[0, 0], py - pose[0, 1]
    rate = nx * (velocity[0, 0] - velocity[0, 2] * ay - one[contact_model.VELOCITY_X])
    rate += ny * (velocity[0, 1] + velocity[0, 2] * ax - one[contact_model.VELOCITY_Y])
    one[URGENCY] += lead * rate
    one[WORLD_NX], one[WORLD_NY] = nx, ny


@njit
def _world(point, pose):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]


@kernel
def choose(candidates, count, places, table):
    """The most urgent candidates into table (contact.MOST, EACH), each where it was before; returns their trust [m].

    places: identities of the table before. Trust: how far the tool may be from where it is expected to be.
    """
    chosen, slot = np.full(contact_model.MOST, -1), np.full(contact_model.MOST, -1)
    left = np.ones(count)
    for k in range(min(count, contact_model.MOST)):
        for i in range(count):
            if left[i] > 0.0 and (chosen[k] < 0 or candidates[i, URGENCY] < candidates[chosen[k], URGENCY]):
                chosen[k] = i
        leader = int(candidates[chosen[k], LEADER])
        if leader >= 0 and left[leader] > 0.0:  # without it the others are a contact where there is none
            chosen[k] = leader
        left[chosen[k]] = 0.0
    _keep_places(candidates, chosen, places, slot)
    table[:] = 0.0
    for k in range(min(count, contact_model.MOST)):
        for c in range(FIELDS):
            table[slot[k], c] = candidates[chosen[k], c]
    trust = FAR
    for i in range(count):
        if left[i] > 0.0:
            trust = min(trust, max(0.0, candidates[i, URGENCY]))
    return trust


@njit
def _keep_places(candidates, chosen, places, slot):
    """Fills in slot: those that were there keep their place, the others take what is free."""
    taken = np.zeros(contact_model.MOST)
    for k in range(contact_model.MOST):
        for i in range(contact_model.MOST):
            if chosen[k] >= 0 and places[i] == candidates[chosen[k], contact_model.IDENTITY]:
                slot[k], taken[i] = i, 1.0
    for k in range(contact_model.MOST):
        for i in range(contact_model.MOST):
            if chosen[k] >= 0 and slot[k] < 0 and taken[i] == 0.0:
                slot[k], taken[i] = i, 1.0
