# SPDX-License-Identifier: Apache-2.0
"""The energy tank of the device's side, for whatever set position an exchange method wants (control/set_position).

It is filled by what the hand dissipates beyond what the gains need, and by what the spring lets go; it pays for what
the spring gains when the set position, or a factor on the spring, moves, and for what that change of force may give
while the old force still acts (late_energy, hidden_energy). One tank for all axes.
"""

import math

from haptic_device.control import exchange_samples, set_position
from haptic_device.control.virtual_coupling import spring_force, spring_store
from haptic_device.jit import kernel, njit


@kernel
def pay(settings, tank, spring, motion, fade):
    """Moves the set position towards the goal; the tank takes what the spring lets go and pays what it gains.

    A tank without the reserve moves nothing of its own: then the set position stays, or goes along with the handle.
    What a long hold left owing the spring pays, at once: it lets go of as much.
    """
    held, kept, shortened = stored(settings, spring, motion), reserve(settings, tank, spring), tank.shortened
    # the spring may keep what it has, less what a long hold owes, and have what the tank can spare
    available = max(0.0, held + max(0.0, tank.level - kept) - tank.owed)
    left = tank.level + held - _reach_out(settings, tank, spring, motion, fade, 1.0, available)
    lacks = left < kept or tank.shortened > shortened
    if left < kept:
        left = tank.level + held - _reach_out(settings, tank, spring, motion, fade, 0.0, available)
    tank.level = left
    for i in range(int(settings.axes)):
        before, spring.set_position[i] = spring.set_position[i], motion.handle[i] + spring.stretch[i]
        spring.own_velocity[i] = (spring.set_position[i] - before) / settings.period
        spring.stiffness[i], spring.limit[i] = _wanted_spring(settings, spring, i)
        if lacks:
            _note_kept_short(settings, tank, spring, motion, i)


@njit
def _note_kept_short(settings, tank, spring, motion, i):
    """Notes by how much the spring of axis i gives less than it would to its goal."""
    stiffness, limit = spring.stiffness[i], spring.limit[i]
    force = spring_force(stiffness, limit, spring.goal[i] - motion.handle[i])
    note_unpaid(settings, tank, i, force - spring_force(stiffness, limit, spring.set_position[i] - motion.handle[i]))


@kernel
def note_unpaid(settings, tank, i, force):
    """Notes a force [N | N m] on axis i that the tank did not pay for; the greatest of a tick is kept."""
    tank.short = max(tank.short, abs(force) / (settings.engage.torque if i == 2 else settings.engage.force))


@kernel
def reserve(settings, tank, spring):
    """Energy [J] that a tick's fastest changes of force, and dropping the push, may cost (hidden and late)."""
    cost, risen = 0.0, abs(spring.factor - spring.factor_held)
    for i in range(int(settings.axes)):
        slew = (1.0 + set_position.DAMPER_SLEW) * settings.exchange.slew[i] * settings.period
        change = slew + abs(spring.push[i]) + risen * settings.coupling.limit[i]
        cost += hidden_energy(settings, i, change) + late_energy(settings, tank, i, change)
    return cost


@kernel
def late_energy(settings, tank, i, change):
    """Energy [J] that a change of force [N] which is not the handle's own may give while it is on its way.

    By the damping set aside for it (passivity.late_price), and no more than it gives over the longest way that the
    handle can go meanwhile.
    """
    if change == 0.0:
        return 0.0
    fastest = settings.hardware.scale[i] * settings.hardware.velocity_limit[i]
    return min(tank.price[i] * change * change, abs(change) * fastest * tank.lateness)


@kernel
def worst_draw(settings, tank, i, force):
    """Most [J] that a damper's force [N] on axis i may draw in a hold (set_position.worst_draw)."""
    device = settings.hardware
    return set_position.worst_draw(device.scale[i] * force, tank.surplus[i], device.velocity_limit[i], settings.period)


@kernel
def damped_draw(settings, tank, i, force):
    """The same where only damping bounds it (set_position.damped_draw)."""
    return set_position.damped_draw(settings.hardware.scale[i] * force, tank.surplus[i], settings.period)


@kernel
def hidden_energy(settings, i, change):
    """Energy [J] of a change of force [N] over half an encoder step, by which the handle may be elsewhere."""
    return 0.5 * settings.hardware.scale[i] * abs(settings.hardware.position_per_count[i]) * abs(change)


@njit
def _wanted_spring(settings, spring, i):
    return spring.factor * settings.coupling.stiffness[i], spring.factor * settings.coupling.limit[i]


@kernel
def stored(settings, spring, motion):
    """Energy [J] in the spring that held until now, at where the handle is now."""
    energy = 0.0
    for i in range(int(settings.axes)):
        stretch = spring.set_position[i] - motion.handle[i]
        energy += spring_store(spring.stiffness[i], spring.limit[i], stretch)
    return energy


@njit
def _reach_out(settings, tank, spring, motion, fade, own, available):
    """Fills in the stretches, whose energy is at most what is available; returns that energy. own: 0 for no slew."""
    wanted, square = 0.0, 0.0
    for i in range(int(settings.axes)):
        stiffness, limit = _wanted_spring(settings, spring, i)
        reach = own * settings.exchange.slew[i] * settings.period / stiffness if stiffness > 0.0 else math.inf
        goal = spring.goal[i] if fade > 0.0 else motion.handle[i]
        moved = settings.hardware.scale[i] * motion.moved[i]
        stretch = set_position.slewed(spring.set_position[i], goal, moved, reach) - motion.handle[i]
        spring.stretch[i] = stretch
        wanted += spring_store(stiffness, limit, stretch)
        square += 0.5 * stiffness * stretch * stretch
    share = set_position.scale_to_available_energy(available, wanted, square)
    if share == 1.0:
        return wanted
    tank.shortened += own
    wanted = 0.0
    for i in range(int(settings.axes)):
        spring.stretch[i] *= share
        stiffness, limit = _wanted_spring(settings, spring, i)
        wanted += spring_store(stiffness, limit, spring.stretch[i])
    return wanted


@kernel
def take_returned(settings, tank, tool):
    """Energy that the simulation's side sends back, never more than was shipped there."""
    if tool.session != tank.tool_session:
        tank.tool_session, tank.tool_energy = tool.session, tool.energy
    back = exchange_samples.believed(tool.energy, tank.tool_energy, tank.shipped, tank.returned)
    tank.level = max(tank.level, min(settings.exchange.tank, tank.level + back))  # what is over is not sent again
    tank.returned += back
    tank.tool_energy = max(tank.tool_energy, tool.energy)


@kernel
def tick_ended(settings, tank, spring, motion, output):
    """At the end of the tick: what the coupling's spring really holds, and what the encoder's step may hide.

    A factor that was paid for and did not rise is paid back. The handle may be half an encoder step from where it is
    booked: a change of force that is not the handle's own costs that much way (the rest is the friction's, as with any
    sampled spring: Abbott & Okamura 2005).
    """
    factor, gains, held = output.engage * output.exchange_fade, settings.coupling, 0.0
    for i in range(int(settings.axes)):
        stretch = output.coupling_position[i] - output.position[i]
        stiffness, limit = factor * gains.stiffness[i], factor * gains.limit[i]
        push = factor * gains.damping[i] * output.coupling_velocity[i]
        if abs(stretch) < math.inf and abs(push) < math.inf:
            tank.level += spring_store(spring.stiffness[i], spring.limit[i], stretch)
            kept = spring_store(stiffness, limit, stretch)
            tank.level -= kept
            held += kept
            force = spring_force(stiffness, limit, stretch)
            change = not_own(settings, spring, motion, i, force, max(factor, spring.factor_held))
            change += abs(push - spring.push[i])
            hidden = hidden_energy(settings, i, change)
            tank.level -= hidden
            tank.given += hidden
            late = late_energy(settings, tank, i, change)
            spring.prepaid[i] += late
            tank.level -= late
            damped = factor * gains.damping[i] * output.velocity[i]
            spring.changed[i] = abs(force - spring.force[i]) + abs(push - spring.push[i])
            turned = abs(damped - spring.damped[i])
            spring.changed[i] += max(turned, abs(damped)) if spring.parted else turned
            spring.push[i], spring.force[i], spring.damped[i] = push, force, damped
        spring.stiffness[i], spring.limit[i] = stiffness, limit
    spring.factor = spring.factor_held = factor
    spring.parted = 0.0
    # of what the hand lost in the past no more counts than the books hold, and one budget
    tank.given = max(tank.given, tank.returned - tank.shipped - max(0.0, tank.level) - held)
    _count_slack(settings, spring)


@njit
def _count_slack(settings, spring):
    """For how many ticks now neither the spring nor the set position's velocity has pulled, on no axis."""
    acts = False
    for i in range(int(settings.axes)):
        acts |= spring.force[i] != 0.0 or spring.push[i] != 0.0
    spring.slack = 0.0 if acts and spring.factor > 0.0 else spring.slack + 1.0


@kernel
def not_own(settings, spring, motion, i, force, factor):
    """Change of the spring's force on axis i [N] that is not of the handle's own way.

    What that way makes of it the damping of the standing spring covers, late or not.
    """
    own = factor * settings.coupling.stiffness[i] * settings.hardware.scale[i] * abs(motion.moved[i])
    return max(0.0, abs(force - spring.force[i]) - own)


@kernel
def tick_ended_unseen(settings, tank, spring, output):
    """A tick whose counts are old: nothing rises in it, and what falls is not paid back.

    The tank is empty then: what the handle did until the spring was let go, nobody knows.
    """
    factor = output.engage * output.exchange_fade
    if factor < spring.factor:
        left = factor / spring.factor
        tank.level, spring.factor, spring.parted = min(0.0, tank.level), factor, 1.0
        for i in range(int(settings.axes)):
            spring.stiffness[i] = factor * settings.coupling.stiffness[i]
            spring.limit[i] = factor * settings.coupling.limit[i]
            spring.force[i] *= left
    _count_slack(settings, spring)
