# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo: a copy of it behind the coupling, against the few contacts that matter now, in the same tick.

Backward difference of the copy (mass M, pose q, velocity v) with the coupling and the contacts, all at the end of the
tick (Colgate, Stanley & Brown 1995, section 4: both sides synchronous):

    M (v⁺ − v) = T [K (x − q⁺) + B (x' − v⁺)] + T M g + Gᵀ λ,     q⁺ = q + T v⁺                            (1)
    A v⁺ = M v + T [K (x − q) + B x' + M g] + Gᵀ λ,               A = M + T B + T² K                       (2)

x handle, contacts by control/contact_model and control/contact_solver. A contact's rate is b = gap/T − u while it is
open; overlap δ is left at β δ/T and no faster than PUSH_OUT: with the compliance c a spring β/c and a damper behind
it. An impact at v₀ wants v⁺ ≥ e v₀ if v₀ ≥ 2 |push|/(1 − e²), push the velocity that a free tick would
give (passive at the port).

**Energy.** The servo's tank E (control/set_position) books exactly what the hand has paid whenever the set position y,
here q, and its velocity w, here v, move, whatever moves them. The copy's kinetic energy is a claim on it. With
fixed contacts

    Σ over the ticks of Δ(E − ½ v·M v) ≥ Σ (b − c) Δx²/T + B T (w − a/2T)² + ½ K T² w² + ½ Δv·M Δv + friction ≥ 0,

a = Δx_k + Δx_{k+1}: what is left, E − ½ v·M v, only grows. A contact that moves, appears or vanishes makes it grow or
shrink by the work that it does on the copy. So a move is made only while

    E − ½ v⁺·M v⁺ − (what half an encoder step may hide) − (what the damper's worst hold may draw) ≥ 0,            (3)

else the copy stays where it is for this tick, v⁺ = 0, which takes nothing. Energy given stays within the budget for any
sequence of messages. The same is the answer where pivoting found none.
"""

import math

from haptic_device.control import contact_model, contact_solver, energy_tank, virtual_coupling
from haptic_device.jit import kernel, njit

AXES = 3
KEPT = 64  # ticks for which the pushes against movable bodies are remembered
LEAVING = 0.2  # β: share of an overlap that is left in a tick
PUSH_OUT = 0.02  # [m/s] at most
PATIENCE = 4.0  # ages in which an overlap with a body that gives way is left, or what that pushes comes back as another
GRIP = 1e-3  # compliance of stiction, in that of the contact
FIELDS = len(contact_model.EACH)
LOCKED = 1e9  # mass of an axis that the device lacks
AWAY, ACTING = 0.0, 1.0


@kernel
def acts(settings, memory, row):
    """Whether the servo's own tool is to be used in this tick; counts when it no longer is."""
    well = memory.factor >= 1.0 and memory.near_number > 0.0 and row.tool_age >= 0.0 and _is_near(settings, memory, row)
    memory.well = memory.well + settings.period if well else 0.0
    if memory.acting == ACTING and not well:
        memory.fallbacks += 1.0 if memory.factor >= 1.0 else 0.0
        memory.acting = AWAY
    if memory.acting == AWAY and well and (memory.well > settings.local_rejoin or memory.fallbacks == 0.0):
        memory.acting = ACTING
        _open_all(memory)
    return memory.acting == ACTING


@njit
def _is_near(settings, memory, row):
    """Whether the contacts are new enough, and both the copy and the simulation's tool where they were meant for."""
    if row.contact_age > settings.local_hold:
        return False
    if memory.acting == AWAY:
        _begin(settings, memory, row)
    far_x = memory.copy[0] - memory.near_pose[0]
    far_y = memory.copy[1] - memory.near_pose[1]
    way = math.hypot(far_x, far_y) + memory.near_extent * abs(memory.copy[2] - memory.near_pose[2])
    return way < memory.near_trust and apart(settings, memory, row) <= settings.local_apart


@kernel
def apart(settings, memory, row):
    """How far the simulation's tool is from where the copy was at its time, to first order [m]."""
    age = row.tool_age
    dx = row.tool_position[0] - memory.copy[0] + memory.copy_velocity[0] * age
    dy = row.tool_position[1] - memory.copy[1] + memory.copy_velocity[1] * age if settings.axes > 1.0 else 0.0
    return math.hypot(dx, dy)


@kernel
def take(memory, new):
    """Takes a set of contacts (record of contact.SET). Modes and pushes of contacts that were there go on."""
    memory.near_number, memory.near_sent, memory.near_trust = new.number, new.sent, new.trust
    memory.near_mass, memory.near_inertia, memory.near_extent = new.mass, new.inertia, new.extent
    memory.near_gravity[0], memory.near_gravity[1] = new.gravity_x, new.gravity_y
    memory.near_pose[0], memory.near_pose[1] = new.tool_pose_x, new.tool_pose_y
    memory.near_pose[2] = new.tool_pose_theta
    memory.near_fresh = 1.0
    for i in range(contact_model.MOST):
        if new.table[i, contact_model.IDENTITY] != memory.near[i, contact_model.IDENTITY]:
            known = new.table[i, contact_model.IDENTITY] > 0.0
            memory.rows[i, contact_solver.MODE] = contact_solver.OPEN if known else contact_solver.UNUSED
            memory.pushed[i], memory.shifted[i] = 0.0, 0.0
            memory.pushes[i, :], memory.shifts[i, :] = 0.0, 0.0
        for k in range(FIELDS):
            memory.near[i, k] = new.table[i, k]


@kernel
def move(settings, memory, row):
    """One tick of the copy; fills in the coupling's position and velocity of the row."""
    energy_tank.take_returned(settings, memory, row)
    age = row.contact_age
    if memory.near_fresh > 0.0:
        _rebase(settings, memory, age)
    _effective_mass(settings, memory, row)
    _see_contacts(settings, memory, age)
    found = _solve(settings, memory, row)
    if not found or not _affordable(settings, memory, row):
        memory.stays += 1.0 if found else 0.0
        memory.unsolved += 0.0 if found else 1.0
        _stay(settings, memory, row)
    else:
        _go(settings, memory, row)
    _remember_pushes(settings, memory)
    _ship(settings, memory)
    row.exchange_energy, row.tools_apart = memory.shipped, apart(settings, memory, row)
    for i in range(int(settings.axes)):
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], memory.set_velocity[i]
        row.exchange_effort[i] = 0.0


@njit
def _begin(settings, memory, row):
    """The copy where the set position is, as fast as the simulation's tool if the tank covers that; no axis more."""
    for i in range(AXES):
        there = i < settings.axes
        memory.copy[i] = memory.set[i] if there else memory.near_pose[i]
        memory.copy_velocity[i] = row.tool_velocity[i] if there else 0.0
    if kinetic(memory, settings.axes, memory.copy_velocity) > memory.tank:
        memory.copy_velocity[:] = 0.0


@njit
def _open_all(memory):
    for one in memory.rows:
        one[contact_solver.MODE] = min(one[contact_solver.MODE], contact_solver.OPEN)
        one[contact_solver.IMPULSE] = 0.0


@njit
def _effective_mass(settings, memory, row):
    """A and r of (2) into memory.mass, memory.right."""
    period = settings.period
    for i in range(AXES):
        mass = memory.near_inertia if i == 2 else memory.near_mass
        memory.mass[i] = mass if i < settings.axes else LOCKED
        memory.right[i] = memory.mass[i] * memory.copy_velocity[i]
        if i < settings.axes:
            memory.mass[i] += period * settings.damping[i] + period * period * settings.stiffness[i]
            pull = settings.stiffness[i] * (row.position[i] - memory.copy[i])
            pull += settings.damping[i] * row.velocity[i] + mass * memory.near_gravity[i]
            memory.right[i] += period * pull


@njit
def _see_contacts(settings, memory, age):
    """The rows of all contacts at the copy's pose."""
    near, period = memory.near, settings.period
    seen = min(age, settings.exchange_horizon) - period  # the copy's pose is that of the last tick
    for i in range(contact_model.MOST):
        if near[i, contact_model.IDENTITY] > 0.0:
            contact_model.place(near[i], memory.copy, seen, memory.shifted[i], memory.places[i])
    contact_model.hide_others(near, memory.places, memory.shown)
    soft = settings.local_compliance / (period * period)
    for i in range(contact_model.MOST):
        row = memory.rows[i]
        if memory.shown[i] == 0.0:
            row[contact_solver.MODE] = contact_solver.UNUSED
            continue
        if row[contact_solver.MODE] == contact_solver.UNUSED:
            row[contact_solver.MODE] = contact_solver.OPEN
        time = period / LEAVING
        if near[i, contact_model.MOBILITY] > 0.0:
            time = max(time, PATIENCE * age)
        _fill(memory, near[i], memory.places[i], row, memory.pushed[i], period, time)
        row[contact_solver.E_N] = soft + near[i, contact_model.MOBILITY]
        row[contact_solver.E_T] = GRIP * soft + near[i, contact_model.SLIP_MOBILITY]


@njit
def _fill(memory, near, place, row, pushed, period, time):
    """Directions, rates and friction of one contact; pushed [m/s]: of the other body along −n, by the copy.

    time [s]: in which an overlap is left.
    """
    nx, ny, ax, ay = (
        place[contact_model.NX],
        place[contact_model.NY],
        place[contact_model.ARM_X],
        place[contact_model.ARM_Y],
    )
    row[contact_solver.N_X], row[contact_solver.N_Y] = nx, ny
    row[contact_solver.N_TURN] = ax * ny - ay * nx
    row[contact_solver.T_X], row[contact_solver.T_Y] = -ny, nx
    row[contact_solver.T_TURN] = ax * nx + ay * ny
    surface = nx * near[contact_model.VELOCITY_X] + ny * near[contact_model.VELOCITY_Y] - pushed
    gap = place[contact_model.GAP_NOW]
    rate = gap / period if gap >= 0.0 else max(gap / time, -PUSH_OUT)
    rate = _rebound(memory, near, row, rate, surface, gap, period)
    row[contact_solver.B_N] = rate - surface
    row[contact_solver.B_T] = ny * near[contact_model.VELOCITY_X] - nx * near[contact_model.VELOCITY_Y]
    row[contact_solver.MU] = near[contact_model.FRICTION]


@njit
def _rebound(memory, near, row, rate, surface, gap, period):
    """The rate with restitution, if this tick is that of an impact hard enough; else as it is."""
    e = near[contact_model.RESTITUTION]
    if e == 0.0 or row[contact_solver.MODE] != contact_solver.OPEN:
        return rate
    speed, push = -surface, 0.0
    for i in range(AXES):
        free = memory.right[i] / memory.mass[i] - memory.copy_velocity[i]
        speed += row[contact_solver.N_X + i] * memory.copy_velocity[i]
        push += row[contact_solver.N_X + i] * free
    impact = gap + period * (speed + push) <= 0.0 and -speed * (1.0 - e * e) >= 2.0 * abs(push)
    return e * speed if impact else rate  # speed < 0: the gap's rate becomes −e times it


@njit
def _solve(settings, memory, row):
    """The copy's next velocity into memory.trial; False if pivoting found none. A spring at its limit is a force.

    That makes two problems of one; both together may take no more solutions than one at most.
    """
    clamped, most = False, contact_solver.EXACT + contact_solver.BRAKED
    turns = contact_solver.solve(memory.rows, memory.mass, memory.right, memory.system, memory.trial, most)
    memory.pivots = turns
    if turns < 0:
        return False
    for i in range(int(settings.axes)):
        stretch = memory.copy[i] + settings.period * memory.trial[i] - row.position[i]
        pull = settings.stiffness[i] * stretch
        if abs(pull) > settings.coupling_limit[i]:
            clamped = True
            memory.mass[i] -= settings.period**2 * settings.stiffness[i]
            spring = settings.stiffness[i] * (row.position[i] - memory.copy[i])
            memory.right[i] -= settings.period * (spring + math.copysign(settings.coupling_limit[i], pull))
    if clamped:
        most -= turns
        turns = contact_solver.solve(memory.rows, memory.mass, memory.right, memory.system, memory.trial, most)
        memory.pivots += max(0, turns)
    return turns > 0


@kernel
def kinetic(memory, axes, velocity):
    """Kinetic energy of the copy [J] at a velocity (3)."""
    energy = 0.5 * memory.near_mass * velocity[0] ** 2
    if axes > 1.0:
        energy += 0.5 * memory.near_mass * velocity[1] ** 2
    return energy + (0.5 * memory.near_inertia * velocity[2] ** 2 if axes > 2.0 else 0.0)


@njit
def _affordable(settings, memory, row):
    """Whether (3) holds for memory.trial; the tank's books are then those of the move."""
    stored, hidden, worst = 0.0, 0.0, 0.0
    for i in range(int(settings.axes)):
        stretch = memory.copy[i] + settings.period * memory.trial[i] - row.position[i]
        push = memory.factor * settings.damping[i] * memory.trial[i]
        own = max(0.0, abs(stretch - memory.stretched[i]) - settings.scale[i] * abs(memory.moved[i]))
        change = settings.stiffness[i] * own + abs(push - memory.push[i])
        hidden += energy_tank.hidden_energy(settings, i, change)
        stored += virtual_coupling.spring_store(settings.stiffness[i], settings.coupling_limit[i], stretch)
        worst += _worst_draw(settings, i, settings.scale[i] * abs(push))
    left = memory.tank + energy_tank.held(settings, memory, row) - stored
    if left - kinetic(memory, settings.axes, memory.trial) < hidden + worst:
        return False
    memory.tank = left
    return True


@njit
def _worst_draw(settings, i, force):
    """What the damper's force may draw in a hold: g² T/4 (b − c), and no more than the handle may move at all."""
    most = force * settings.velocity_limit[i] * settings.period
    if settings.surplus[i] <= 0.0:
        return most
    return min(most, 0.25 * force * force * settings.period / settings.surplus[i])


@njit
def _go(settings, memory, row):
    for i in range(AXES):
        memory.copy_velocity[i] = memory.trial[i]
        memory.copy[i] += settings.period * memory.trial[i]
        if i < settings.axes:
            memory.set[i], memory.set_velocity[i] = memory.copy[i], memory.trial[i]
            memory.own_velocity[i], memory.stretch[i] = memory.trial[i], memory.copy[i] - row.position[i]
            memory.spring[i] = memory.factor * settings.stiffness[i]
            memory.clamp[i] = memory.factor * settings.coupling_limit[i]


@njit
def _stay(settings, memory, row):
    """The copy stays, or goes along with the handle as far as the tank asks for it."""
    for i in range(int(settings.axes)):
        memory.goal[i] = memory.set[i]
    energy_tank.pay(settings, memory, row)
    for i in range(AXES):
        memory.copy_velocity[i] = 0.0
        if i < settings.axes:
            memory.copy[i], memory.set_velocity[i] = memory.set[i], 0.0
    _open_all(memory)


@njit
def _ship(settings, memory):
    """What the tank has beyond its keep and the copy's own claim goes to the simulation."""
    over = memory.tank - kinetic(memory, settings.axes, memory.copy_velocity) - settings.exchange_tank
    if over > 0.0:
        memory.shipped += over
        memory.tank -= over


@njit
def _rebase(settings, memory, age):
    """With a new set, bodies are where it says: only what they were pushed since its time is still to be added.

    pushed: velocity by the copy's impulses beyond the force that the simulation knew; shifted: its integral.
    """
    memory.near_fresh = 0.0
    ticks = int(min(KEPT - 1.0, max(0.0, round(age / settings.period) - 1.0)))
    then = (int(memory.near_turn) - ticks) % KEPT
    for i in range(contact_model.MOST):
        velocity, way = memory.pushes[i, then], memory.shifts[i, then]
        now = int(memory.near_turn) % KEPT
        memory.pushed[i] = memory.pushes[i, now] - velocity
        memory.shifted[i] = memory.shifts[i, now] - way - velocity * ticks * settings.period


@njit
def _remember_pushes(settings, memory):
    before = int(memory.near_turn) % KEPT
    memory.near_turn += 1.0
    now = int(memory.near_turn) % KEPT
    for i in range(contact_model.MOST):
        change = 0.0
        near = memory.near[i]
        if near[contact_model.MOBILITY] > 0.0:
            known = near[contact_model.FORCE] * settings.period
            change = near[contact_model.MOBILITY] * (memory.rows[i, contact_solver.IMPULSE] - known)
        memory.pushed[i] += change
        memory.shifted[i] += memory.pushed[i] * settings.period
        memory.pushes[i, now] = memory.pushes[i, before] + change
        memory.shifts[i, now] = memory.shifts[i, before] + memory.pushes[i, now] * settings.period
