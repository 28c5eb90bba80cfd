# SPDX-License-Identifier: Apache-2.0
"""The local contacts of the virtual tool (control/virtual_tool): the set that counts, as constraints at its pose.

A contact's rate is b = gap/T − u while it is open; an overlap δ is left at β δ/T and no faster than PUSH_OUT: with the
compliance c a spring β/c and a damper behind it. An impact at v₀ wants v⁺ ≥ e v₀ if v₀ ≥ 2 |push|/(1 − e²), push the
velocity that a free tick would give (passive at the port).
"""

from haptic_device.control import contact_model, contact_solver
from haptic_device.control.records import AXES, PUSHES
from haptic_device.jit import kernel, njit

LEAVING = 0.2  # β: share of an overlap that is left in a tick
PUSH_OUT = 0.02  # [m/s] at most
PATIENCE = 4.0  # ages in which an overlap with a body that gives way is left, or what that pushes comes back as another
GRIP = 1e-3  # compliance of stiction, in that of the contact
FIELDS = len(contact_model.EACH)


@kernel
def take(contacts, new):
    """Takes a set of contacts (record of contact.SET). Modes and pushes of contacts that were there go on."""
    contacts.number, contacts.sent, contacts.trust = new.number, new.sent, new.trust
    contacts.mass, contacts.inertia, contacts.extent = new.mass, new.inertia, new.extent
    contacts.gravity[0], contacts.gravity[1] = new.gravity_x, new.gravity_y
    contacts.pose[0], contacts.pose[1] = new.tool_pose_x, new.tool_pose_y
    contacts.pose[2] = new.tool_pose_theta
    contacts.fresh = 1.0
    for i in range(contact_model.MOST):
        if new.table[i, contact_model.IDENTITY] != contacts.table[i, contact_model.IDENTITY]:
            known = new.table[i, contact_model.IDENTITY] > 0.0
            contacts.constraints[i, contact_solver.MODE] = contact_solver.OPEN if known else contact_solver.UNUSED
            contacts.pushed[i], contacts.shifted[i] = 0.0, 0.0
            contacts.pushes[i, :], contacts.shifts[i, :] = 0.0, 0.0
        for k in range(FIELDS):
            contacts.table[i, k] = new.table[i, k]


@njit
def open_all(contacts):
    """No contact holds: the tool begins anew."""
    for one in contacts.constraints:
        one[contact_solver.MODE] = min(one[contact_solver.MODE], contact_solver.OPEN)
        one[contact_solver.IMPULSE] = 0.0


@njit
def see(settings, own, age):
    """The rows of all contacts at the copy's pose."""
    contacts, period = own.contacts, settings.period
    near = contacts.table
    seen = min(age, settings.exchange.horizon) - period  # the copy's pose is that of the last tick
    for i in range(contact_model.MOST):
        if near[i, contact_model.IDENTITY] > 0.0:
            contact_model.place(near[i], own.pose, seen, contacts.shifted[i], contacts.places[i])
    contact_model.hide_others(near, contacts.places, contacts.shown)
    soft = settings.local.compliance / (period * period)
    for i in range(contact_model.MOST):
        row = contacts.constraints[i]
        if contacts.shown[i] == 0.0:
            row[contact_solver.MODE] = contact_solver.UNUSED
            continue
        if row[contact_solver.MODE] == contact_solver.UNUSED:
            row[contact_solver.MODE] = contact_solver.OPEN
        time = period / LEAVING
        if near[i, contact_model.MOBILITY] > 0.0:
            time = max(time, PATIENCE * age)
        _fill(own, i, row, period, time)
        row[contact_solver.E_N] = soft + near[i, contact_model.MOBILITY]
        row[contact_solver.E_T] = GRIP * soft + near[i, contact_model.SLIP_MOBILITY]


@njit
def _fill(own, i, row, period, time):
    """Directions, rates and friction of contact i into its row; time [s]: in which an overlap is left."""
    near, place, pushed = own.contacts.table[i], own.contacts.places[i], own.contacts.pushed[i]
    nx, ny = place[contact_model.NX], place[contact_model.NY]
    ax, ay = place[contact_model.ARM_X], place[contact_model.ARM_Y]
    row[contact_solver.N_X], row[contact_solver.N_Y] = nx, ny
    row[contact_solver.N_TURN] = ax * ny - ay * nx
    row[contact_solver.T_X], row[contact_solver.T_Y] = -ny, nx
    row[contact_solver.T_TURN] = ax * nx + ay * ny
    surface = nx * near[contact_model.VELOCITY_X] + ny * near[contact_model.VELOCITY_Y] - pushed
    gap = place[contact_model.GAP_NOW]
    rate = gap / period if gap >= 0.0 else max(gap / time, -PUSH_OUT)
    rate = _rebound(own, near, row, rate, surface, gap, period)
    row[contact_solver.B_N] = rate - surface
    row[contact_solver.B_T] = ny * near[contact_model.VELOCITY_X] - nx * near[contact_model.VELOCITY_Y]
    row[contact_solver.MU] = near[contact_model.FRICTION]


@njit
def _rebound(own, near, row, rate, surface, gap, period):
    """The rate with restitution, if this tick is that of an impact hard enough; else as it is."""
    e = near[contact_model.RESTITUTION]
    if e == 0.0 or row[contact_solver.MODE] != contact_solver.OPEN:
        return rate
    speed, push = -surface, 0.0
    for i in range(AXES):
        free = own.right[i] / own.mass[i] - own.velocity[i]
        speed += row[contact_solver.N_X + i] * own.velocity[i]
        push += row[contact_solver.N_X + i] * free
    impact = gap + period * (speed + push) <= 0.0 and -speed * (1.0 - e * e) >= 2.0 * abs(push)
    return e * speed if impact else rate  # speed < 0: the gap's rate becomes −e times it


@njit
def rebase(period, contacts, age):
    """With a new set, bodies are where it says: only what they were pushed since its time is still to be added.

    pushed: velocity by the copy's impulses beyond the force that the simulation knew; shifted: its integral.
    """
    contacts.fresh = 0.0
    ticks = int(min(PUSHES - 1.0, max(0.0, round(age / period) - 1.0)))
    then = (int(contacts.turn) - ticks) % PUSHES
    for i in range(contact_model.MOST):
        velocity, way = contacts.pushes[i, then], contacts.shifts[i, then]
        now = int(contacts.turn) % PUSHES
        contacts.pushed[i] = contacts.pushes[i, now] - velocity
        contacts.shifted[i] = contacts.shifts[i, now] - way - velocity * ticks * period


@njit
def remember_pushes(period, contacts):
    """What this tick's impulses pushed the bodies by, beyond the force that the simulation knew."""
    before = int(contacts.turn) % PUSHES
    contacts.turn += 1.0
    now = int(contacts.turn) % PUSHES
    for i in range(contact_model.MOST):
        change = 0.0
        near = contacts.table[i]
        if near[contact_model.MOBILITY] > 0.0:
            known = near[contact_model.FORCE] * period
            change = near[contact_model.MOBILITY] * (contacts.constraints[i, contact_solver.IMPULSE] - known)
        contacts.pushed[i] += change
        contacts.shifted[i] += contacts.pushed[i] * period
        contacts.pushes[i, now] = contacts.pushes[i, before] + change
        contacts.shifts[i, now] = contacts.shifts[i, before] + contacts.pushes[i, now] * period
