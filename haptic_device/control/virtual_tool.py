# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo: a copy of it behind the coupling, against the few contacts that matter now, in the same tick.

Backward difference of the copy (mass M, pose q, velocity v) with the coupling and the contacts, all at the end of the
tick (Colgate, Stanley & Brown 1995, section 4: both sides synchronous):

    M (v⁺ − v) = T [K (x − q⁺) + B (x' − v⁺)] + T M g + Gᵀ λ,     q⁺ = q + T v⁺                            (1)
    A v⁺ = M v + T [K (x − q) + B x' + M g] + Gᵀ λ,               A = M + T B + T² K                       (2)

x handle; the contacts as control/tool_contacts has them, solved by control/contact_solver.

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

from haptic_device.control import contact_solver, energy_tank, tool_contacts, virtual_coupling
from haptic_device.control.records import AXES
from haptic_device.jit import kernel, njit

LOCKED = 1e9  # mass of an axis that the device lacks
AWAY, ACTING = 0.0, 1.0
STAYED = 1.0  # as tank.short has it: what a copy that stays withholds no force says


@kernel
def acts(settings, own, tank, spring, tool):
    """Whether the servo's own tool is to be used in this tick; counts when it no longer is."""
    well = spring.factor >= 1.0 and own.contacts.number > 0.0 and tool.age >= 0.0
    well = well and _is_near(settings, own, tank, spring, tool)
    own.well = own.well + settings.period if well else 0.0
    if own.acting == ACTING and not well:
        own.fallbacks += 1.0 if spring.factor >= 1.0 else 0.0
        own.acting = AWAY
    if own.acting == AWAY and well and (own.well > settings.local.rejoin or own.fallbacks == 0.0):
        own.acting = ACTING
        tool_contacts.open_all(own.contacts)
    return own.acting == ACTING


@njit
def _is_near(settings, own, tank, spring, tool):
    """Whether the contacts are new enough, and both the copy and the simulation's tool where they were meant for."""
    if tool.contact_age > settings.local.hold:
        return False
    if own.acting == AWAY:
        _begin(settings, own, tank, spring, tool)
    contacts = own.contacts
    far_x = own.pose[0] - contacts.pose[0]
    far_y = own.pose[1] - contacts.pose[1]
    way = math.hypot(far_x, far_y) + contacts.extent * abs(own.pose[2] - contacts.pose[2])
    return way < contacts.trust and apart(settings, own, tool) <= settings.local.apart


@kernel
def apart(settings, own, tool):
    """How far the simulation's tool is from where the copy was at its time, to first order [m]."""
    age = tool.age
    dx = tool.position[0] - own.pose[0] + own.velocity[0] * age
    dy = tool.position[1] - own.pose[1] + own.velocity[1] * age if settings.axes > 1.0 else 0.0
    return math.hypot(dx, dy)


@kernel
def move_set_point(settings, own, tank, spring, motion, tool, output):
    """One tick of the virtual tool: the coupling pulls to it."""
    contacts, age = own.contacts, tool.contact_age
    energy_tank.take_returned(settings, tank, tool)
    if contacts.fresh > 0.0:
        tool_contacts.rebase(settings.period, contacts, age)
    _effective_mass(settings, own, motion, output)
    tool_contacts.see(settings, own, age)
    found = _solve(settings, own, motion)
    # (3), or it stays where it is, which costs nothing
    if not found or not _pay_for_move(settings, own, tank, spring, motion):
        own.stays += 1.0 if found else 0.0
        own.unsolved += 0.0 if found else 1.0
        tank.short = max(tank.short, STAYED) if found else tank.short
        _stay(settings, own, tank, spring, motion, output)
    else:
        _go(settings, own, spring, motion)
    tool_contacts.remember_pushes(settings.period, contacts)
    _ship(settings, own, tank)
    output.exchange_energy, output.tools_apart = tank.shipped, apart(settings, own, tool)
    for i in range(int(settings.axes)):
        output.coupling_position[i], output.coupling_velocity[i] = spring.set_position[i], spring.set_velocity[i]


@njit
def _begin(settings, own, tank, spring, tool):
    """The copy where the set position is, as fast as the simulation's tool if the tank covers that; no axis more."""
    for i in range(AXES):
        there = i < settings.axes
        own.pose[i] = spring.set_position[i] if there else own.contacts.pose[i]
        own.velocity[i] = tool.velocity[i] if there else 0.0
    if kinetic(own.contacts, settings.axes, own.velocity) > tank.level:
        own.velocity[:] = 0.0


@njit
def _effective_mass(settings, own, motion, output):
    """A and r of (2) into own.mass, own.right."""
    period, gains, contacts = settings.period, settings.coupling, own.contacts
    for i in range(AXES):
        mass = contacts.inertia if i == 2 else contacts.mass
        # an axis that is not there cannot be moved
        own.mass[i] = mass if i < settings.axes else LOCKED
        own.right[i] = own.mass[i] * own.velocity[i]
        if i < settings.axes:
            own.mass[i] += period * gains.damping[i] + period * period * gains.stiffness[i]
            pull = gains.stiffness[i] * (motion.handle[i] - own.pose[i])
            pull += gains.damping[i] * output.velocity[i] + mass * contacts.gravity[i]
            own.right[i] += period * pull


@njit
def _solve(settings, own, motion):
    """The copy's next velocity into own.trial; False if pivoting found none. A spring at its limit is a force.

    That makes two problems of one; both together may take no more solutions than one at most.
    """
    clamped, most = False, contact_solver.EXACT + contact_solver.BRAKED
    constraints, gains = own.contacts.constraints, settings.coupling
    turns = contact_solver.solve(constraints, own.mass, own.right, own.system, own.trial, most)
    own.pivots = turns
    if turns < 0:
        return False
    for i in range(int(settings.axes)):
        stretch = own.pose[i] + settings.period * own.trial[i] - motion.handle[i]
        pull = gains.stiffness[i] * stretch
        # a clamped spring is a constant force: without K in A, with ± limit in r
        if abs(pull) > gains.limit[i]:
            clamped = True
            own.mass[i] -= settings.period**2 * gains.stiffness[i]
            spring = gains.stiffness[i] * (motion.handle[i] - own.pose[i])
            own.right[i] -= settings.period * (spring + math.copysign(gains.limit[i], pull))
    if clamped:
        most -= turns
        turns = contact_solver.solve(constraints, own.mass, own.right, own.system, own.trial, most)
        own.pivots += max(0, turns)
    return turns > 0


@kernel
def kinetic(contacts, axes, velocity):
    """Kinetic energy of the copy [J] at a velocity (3)."""
    energy = 0.5 * contacts.mass * velocity[0] ** 2
    if axes > 1.0:
        energy += 0.5 * contacts.mass * velocity[1] ** 2
    return energy + (0.5 * contacts.inertia * velocity[2] ** 2 if axes > 2.0 else 0.0)


@njit
def _pay_for_move(settings, own, tank, spring, motion):
    """Whether (3) holds for own.trial; the tank's books are then those of the move."""
    stored, hidden, worst, gains = 0.0, 0.0, 0.0, settings.coupling
    for i in range(int(settings.axes)):
        stretch = own.pose[i] + settings.period * own.trial[i] - motion.handle[i]
        push = spring.factor * gains.damping[i] * own.trial[i]
        force = virtual_coupling.spring_force(gains.stiffness[i], gains.limit[i], stretch)
        change = energy_tank.not_own(settings, spring, motion, i, force, spring.factor) + abs(push - spring.push[i])
        hidden += energy_tank.hidden_energy(settings, i, change) + energy_tank.late_energy(settings, tank, i, change)
        stored += virtual_coupling.spring_store(gains.stiffness[i], gains.limit[i], stretch)
        # as the damper of pspm: the handle's worst motion
        worst += energy_tank.worst_draw(settings, tank, i, push)
    left = tank.level + energy_tank.stored(settings, spring, motion) - stored
    if left - kinetic(own.contacts, settings.axes, own.trial) < hidden + worst:
        return False
    tank.level = left
    return True


@njit
def _go(settings, own, spring, motion):
    """The copy moves, and the set point with it."""
    for i in range(AXES):
        own.velocity[i] = own.trial[i]
        own.pose[i] += settings.period * own.trial[i]
        if i < settings.axes:
            spring.set_position[i], spring.set_velocity[i] = own.pose[i], own.trial[i]
            spring.own_velocity[i], spring.stretch[i] = own.trial[i], own.pose[i] - motion.handle[i]
            spring.stiffness[i] = spring.factor * settings.coupling.stiffness[i]
            spring.limit[i] = spring.factor * settings.coupling.limit[i]


@njit
def _stay(settings, own, tank, spring, motion, output):
    """The copy stays, or goes along with the handle as far as the tank asks for it."""
    for i in range(int(settings.axes)):
        spring.goal[i] = spring.set_position[i]
    energy_tank.pay(settings, tank, spring, motion, output.exchange_fade)
    for i in range(AXES):
        own.velocity[i] = 0.0
        if i < settings.axes:
            own.pose[i], spring.set_velocity[i] = spring.set_position[i], 0.0
    tool_contacts.open_all(own.contacts)


@njit
def _ship(settings, own, tank):
    """What the tank has beyond its keep and the copy's own claim goes to the simulation."""
    over = tank.level - kinetic(own.contacts, settings.axes, own.velocity) - settings.exchange.tank
    if over > 0.0:
        tank.shipped += over
        tank.level -= over
