# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo: a copy of it behind the coupling, against the few contacts that matter now, in the same tick.

Backward difference of the copy (mass M, pose q, velocity v) with the coupling and the contacts, all at the end of the
tick (Colgate, Stanley & Brown 1995, section 4: both sides synchronous):

    M (v⁺ − v) = T [K (x − q⁺) + B (x' − v⁺)] + T M g + Gᵀ λ,     q⁺ = q + T v⁺                            (1)
    A v⁺ = M v + T [K (x − q) + B x' + M g] + Gᵀ λ,               A = M + T B + T² K                       (2)

x handle; the contacts as control/tool_contacts has them, solved by control/contact_solver.

**Energy.** A move of the copy is one of the coupling's rows: of their offsets by T v⁺, of their rates to v⁺. The
account (control/account) pays V' − V, and the copy's kinetic energy is a claim on what is left. So it is made while

    free − (V' − V) − ½ v⁺·M v⁺ ≥ 0,                                                                            (3)

else as much of it as is paid: a share of the way, and of the velocity, to what contacts allow is allowed by them too.
Energy given stays within the budget for any sequence of messages. Where pivoting found none the copy stays.
"""

import math

from haptic_device.control import contact_solver, tool_contacts
from haptic_device.control.records import AXES
from haptic_device.jit import kernel, njit

LOCKED = 1e9  # mass of an axis that the device lacks
AWAY, ACTING = 0.0, 1.0
STAYED = 1.0  # as account.short has it: what a copy that stays withholds no force says


@kernel
def acts(settings, state, tool):
    """Whether the servo's own tool is to be used in this tick; counts when it no longer is."""
    own, whole = state.virtual_tool, state.enable.ramp * state.fade.factor >= 1.0
    well = whole and own.contacts.number > 0.0 and tool.age >= 0.0 and _is_near(settings, state, own, tool)
    own.well = own.well + settings.period if well else 0.0
    if own.acting == ACTING and not well:
        own.fallbacks += 1.0 if whole else 0.0
        own.acting = AWAY
    if own.acting == AWAY and well and (own.well > settings.local.rejoin or own.fallbacks == 0.0):
        own.acting = ACTING
        tool_contacts.open_all(own.contacts)
    return own.acting == ACTING


@njit
def _is_near(settings, state, own, tool):
    """Whether the contacts are new enough, and both the copy and the simulation's tool where they were meant for."""
    if tool.contact_age > settings.local.hold:
        return False
    if own.acting == AWAY:
        _begin(settings, state, own, tool)
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
def wish(settings, state, tool, output):
    """One tick of the virtual tool: where the coupling shall pull to; `spare` is then what it needs of the account."""
    own = state.virtual_tool
    contacts, age = own.contacts, tool.contact_age
    if contacts.fresh > 0.0:
        tool_contacts.rebase(settings.period, contacts, age)
    _effective_mass(settings, state, own, output)
    tool_contacts.see(settings, own, age)
    found = _solve(settings, state, own)
    own.unsolved += 0.0 if found else 1.0
    for i in range(AXES):
        if not found:
            own.trial[i] = 0.0
        if i < settings.axes:
            output.coupling_position[i] = own.pose[i] + settings.period * own.trial[i]
            output.coupling_velocity[i] = own.trial[i]
    own.spare = kinetic(own.contacts, settings.axes, own.trial)


@kernel
def moved(settings, state, share):
    """The copy goes by this share of its way; returns its kinetic energy [J]."""
    own = state.virtual_tool
    own.stays += 1.0 if share < 1.0 else 0.0
    if share < 1.0:
        state.account.short = max(state.account.short, STAYED)
    for i in range(AXES):
        own.velocity[i] = share * own.trial[i]
        own.pose[i] = state.rows[i].offset if i < settings.axes else own.pose[i] + settings.period * own.velocity[i]
    if share == 0.0:
        tool_contacts.open_all(own.contacts)
    tool_contacts.remember_pushes(settings.period, own.contacts)
    return kinetic(own.contacts, settings.axes, own.velocity)


@njit
def _begin(settings, state, own, tool):
    """The copy where the set position is, as fast as the simulation's tool if the account covers that; no axis more."""
    for i in range(AXES):
        there = i < settings.axes
        own.pose[i] = state.rows[i].offset if there else own.contacts.pose[i]
        own.velocity[i] = tool.velocity[i] if there else 0.0
    if kinetic(own.contacts, settings.axes, own.velocity) > state.account.free:
        own.velocity[:] = 0.0


@njit
def _effective_mass(settings, state, own, output):
    """A and r of (2) into own.mass, own.right."""
    period, motion, contacts = settings.period, state.motion, own.contacts
    for i in range(AXES):
        mass = contacts.inertia if i == 2 else contacts.mass
        # an axis that is not there cannot be moved
        own.mass[i] = mass if i < settings.axes else LOCKED
        own.right[i] = own.mass[i] * own.velocity[i]
        if i < settings.axes:
            row = state.rows[i]
            own.mass[i] += period * row.damping + period * period * row.stiffness
            pull = row.stiffness * (motion.handle[i] - own.pose[i])
            pull += row.damping * output.velocity[i] + mass * contacts.gravity[i]
            own.right[i] += period * pull


@njit
def _solve(settings, state, own):
    """The copy's next velocity into own.trial; False if pivoting found none. A spring at its limit is a force.

    That makes two problems of one; both together may take no more solutions than one at most.
    """
    clamped, most = False, contact_solver.EXACT + contact_solver.BRAKED
    constraints, motion = own.contacts.constraints, state.motion
    turns = contact_solver.solve(constraints, own.mass, own.right, own.system, own.trial, most)
    own.pivots = turns
    if turns < 0:
        return False
    for i in range(int(settings.axes)):
        row = state.rows[i]
        stretch = own.pose[i] + settings.period * own.trial[i] - motion.handle[i]
        pull = row.stiffness * stretch
        # a clamped spring is a constant force: without K in A, with ± limit in r
        if abs(pull) > row.high:
            clamped = True
            own.mass[i] -= settings.period**2 * row.stiffness
            spring = row.stiffness * (motion.handle[i] - own.pose[i])
            own.right[i] -= settings.period * (spring + math.copysign(row.high, pull))
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
