# SPDX-License-Identifier: Apache-2.0
"""Joints as rows: what a pin or a slider forbids, what its coordinate is, and what springs, gravity and dampers push.

A row J (six numbers: of body a, of body b) gives the rate J v of a scalar φ; its acceleration is J a + γ. With r the
arms from the mass centres to the anchors, × the planar cross product and n fixed in body a (Haug & Yen 1992):

    pin       φ = p_b − p_a              γ = −ω_b² r_b + ω_a² r_a
    slider    φ = n · (p_b − p_a)        γ = n · (−ω_b² r_b + ω_a² r) + 2 ω_a w_t,   r = p_b − x_a,  w_t along z × n
    angle     φ = θ_b − θ_a              γ = 0
"""

import math

from haptic_device.jit import kernel, njit
from haptic_sim.reduction.model import PIN, SLIDER, SPRING

ALONG, ACROSS = 0, 1


@njit
def lever_arms(model, q, j):
    """(arm of a, arm of b, distance p_b − p_a) in the plane [m]."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    ca, sa, cb, sb = math.cos(q[a, 2]), math.sin(q[a, 2]), math.cos(q[b, 2]), math.sin(q[b, 2])
    ax, ay = model.joint_anchor[j, 0, 0], model.joint_anchor[j, 0, 1]
    bx, by = model.joint_anchor[j, 1, 0], model.joint_anchor[j, 1, 1]
    rax, ray, rbx, rby = ca * ax - sa * ay, sa * ax + ca * ay, cb * bx - sb * by, sb * bx + cb * by
    return rax, ray, rbx, rby, q[b, 0] + rbx - q[a, 0] - rax, q[b, 1] + rby - q[a, 1] - ray


@njit
def slider_direction(model, q, j, across):
    """Unit vector of a slider's axis, or square to it, in the plane."""
    a = model.joint_bodies[j, 0]
    c, s, x, y = math.cos(q[a, 2]), math.sin(q[a, 2]), model.joint_axis[j, 0], model.joint_axis[j, 1]
    ux, uy = c * x - s * y, s * x + c * y
    if across == ACROSS:
        return -uy, ux
    return ux, uy


@njit
def slider_row(model, q, v, j, across, row):
    """(φ, γ) of a slider along or across its axis, and its row."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    rax, ray, rbx, rby, dx, dy = lever_arms(model, q, j)
    nx, ny = slider_direction(model, q, j, across)
    rx, ry = rax + dx, ray + dy
    row[0], row[1], row[2] = -nx, -ny, -(rx * ny - ry * nx)
    row[3], row[4], row[5] = nx, ny, rbx * ny - rby * nx
    wa, wb = v[a, 2], v[b, 2]
    slip_x, slip_y = v[b, 0] - wb * rby - v[a, 0] + wa * ry, v[b, 1] + wb * rbx - v[a, 1] - wa * rx
    bend = nx * (wa * wa * rx - wb * wb * rbx) + ny * (wa * wa * ry - wb * wb * rby)
    return nx * dx + ny * dy, bend + 2.0 * wa * (-ny * slip_x + nx * slip_y)


@njit
def angle_row(model, q, j, row):
    """(φ, γ) of the angle between the bodies, and its row."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    row[:] = 0.0
    row[2], row[5] = -1.0, 1.0
    return q[b, 2] - q[a, 2] - model.joint_angle[j], 0.0


@njit
def pin_row(model, q, v, j, axis, row):
    """(φ, γ) of a pin along x (axis 0) or y (axis 1), and its row."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    rax, ray, rbx, rby, dx, dy = lever_arms(model, q, j)
    wa2, wb2 = v[a, 2] * v[a, 2], v[b, 2] * v[b, 2]
    row[:] = 0.0
    row[axis], row[3 + axis] = -1.0, 1.0
    if axis == 0:
        row[2], row[5] = ray, -rby
        return dx, wa2 * rax - wb2 * rbx
    row[2], row[5] = -rax, rbx
    return dy, wa2 * ray - wb2 * rby


@njit
def constraint_row(model, q, v, j, k, row):
    """(φ, γ) of what joint j forbids, k = 0 or 1, and its row; pins and sliders only."""
    if model.joint_kind[j] == PIN:
        return pin_row(model, q, v, j, k, row)
    if k == 0:
        return angle_row(model, q, j, row)
    return slider_row(model, q, v, j, ACROSS, row)


@njit
def coordinate_row(model, q, v, j, row):
    """(q, γ) of the joint's coordinate, and its row; a SPRING's is the distance of its anchors."""
    if model.joint_kind[j] == PIN:
        return angle_row(model, q, j, row)
    if model.joint_kind[j] == SLIDER:
        return slider_row(model, q, v, j, ALONG, row)
    rax, ray, rbx, rby, dx, dy = lever_arms(model, q, j)
    length = math.hypot(dx, dy)
    ux, uy = dx / length, dy / length
    row[0], row[1], row[2] = -ux, -uy, -(rax * uy - ray * ux)
    row[3], row[4], row[5] = ux, uy, rbx * uy - rby * ux
    return length, 0.0


@njit
def spring_row_count(model, j):
    """How many rows joint j's spring-damper acts along: none, one, or two for a spring without length."""
    if model.joint_spring[j, 0] == 0.0 and model.joint_spring[j, 1] == 0.0:
        return 0
    if model.joint_kind[j] == SPRING and model.joint_spring[j, 2] == 0.0:
        return 2
    return 1


@njit
def spring_row(model, q, v, j, k, row):
    """(stretch, row) of a spring-damper along its k-th row."""
    if model.joint_kind[j] == SPRING and model.joint_spring[j, 2] == 0.0:
        return pin_row(model, q, v, j, k, row)[0]
    return coordinate_row(model, q, v, j, row)[0] - model.joint_spring[j, 2]


@njit
def row_rate(model, v, j, row):
    """J v of a joint's row."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    return (
        row[0] * v[a, 0] + row[1] * v[a, 1] + row[2] * v[a, 2] + row[3] * v[b, 0] + row[4] * v[b, 1] + row[5] * v[b, 2]
    )


@njit
def add_row_force(model, f, j, row, force):
    """Adds `force` along a joint's row to the generalized forces f (n, 3)."""
    a, b = model.joint_bodies[j, 0], model.joint_bodies[j, 1]
    for k in range(3):
        f[a, k] += row[k] * force
        f[b, k] += row[3 + k] * force


@njit
def applied_forces(model, q, v, damped, row, f):
    """Gravity and springs [N, N, N m]; with `damped` their dampers too (else these are left to an implicit solve)."""
    for b in range(model.bodies - 1):
        f[b, 0], f[b, 1], f[b, 2] = model.mass[b] * model.gravity[0], model.mass[b] * model.gravity[1], 0.0
    add_spring_forces(model, q, v, damped, row, f)


@njit
def add_spring_forces(model, q, v, damped, row, f):
    """Adds the forces of the joints' springs, with `damped` their dampers too."""
    for j in range(model.joints):
        for k in range(spring_row_count(model, j)):
            force = -model.joint_spring[j, 0] * spring_row(model, q, v, j, k, row)
            if damped:
                force -= model.joint_spring[j, 1] * row_rate(model, v, j, row)
            add_row_force(model, f, j, row, force)


@njit
def spring_energy(model, q, v, row):
    """Energy stored in the joints' springs [J]."""
    energy = 0.0
    for j in range(model.joints):
        for k in range(spring_row_count(model, j)):
            stretch = spring_row(model, q, v, j, k, row)
            energy += 0.5 * model.joint_spring[j, 0] * stretch * stretch
    return energy


@kernel
def stored_in_springs(models, works):
    """The same from arrays of one record each."""
    return spring_energy(models[0], works[0].q, works[0].v, works[0].joint_row)
