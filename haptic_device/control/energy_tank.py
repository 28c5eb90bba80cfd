# SPDX-License-Identifier: Apache-2.0
"""The energy tank of the device's side, for whatever set position an exchange method wants (control/set_position).

It is filled by what the hand dissipates beyond what the gains need, and by what the spring lets go; it pays for what
the spring gains when the set position, or a factor on the spring, moves, and for what that change of force may give
while the old force still acts (change_cost). One tank for all axes.
"""

import math

import numpy as np

from haptic_device.control import exchange_samples, faults, passivity, set_position, velocity_estimator
from haptic_device.control.passivity_observer import LONG
from haptic_device.control.records import AXES
from haptic_device.control.virtual_coupling import spring_force, spring_store
from haptic_device.jit import kernel, njit

NOTHING_PAID = np.zeros(3)
ROUNDING = 1e-9  # [s] of a write's delay that is no delay


@kernel
def hold_ended(settings, tank, spring, hold, motion, enable, sensors, damper_fills):
    """Books the hold that ends here (set_position, 1).

    damper_fills: the coupling's own damper fills the tank beside its bound.
    """
    if not tank.filled:
        tank.filled, tank.level, tank.sample_before = 1.0, settings.exchange.budget, sensors.latched
        _open_window(settings, tank, motion, sensors.latched)
    _set_aside(settings, tank, hold)
    # the hold lasts from sample to sample, not from deadline to deadline
    time = (sensors.latched - tank.sample_before) * 1e-9
    # a write later than what is counted with is no hold to earn anything by
    late = sensors.write_delay - (settings.passivity.lateness - settings.hardware.delay)
    # damper and surplus of the hold that ends are not these
    regained = settings.version != tank.version or hold.regained > 0.0
    if int(sensors.device_status) & faults.WATCHDOG and spring.factor_held > 0.0:
        _forget_spring(settings, tank, spring)
        _open_window(settings, tank, motion, sensors.latched)
    elif regained or late > ROUNDING or max(time, tank.hold_before) > LONG * settings.period:
        _charge_late_write(settings, tank, spring, max(0.0, late))
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, time)
        _charge_long_hold(settings, tank, spring, hold, motion, time)
        tank.owed = max(0.0, -tank.level) if time > LONG * settings.period else tank.owed
        _open_window(settings, tank, motion, sensors.latched)
    else:
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, time)
        _count_dissipated(settings, tank, spring, hold, motion, sensors.latched, damper_fills)
        tank.owed = min(tank.owed, max(0.0, -tank.level))
    tank.sample_before, tank.hold_before, tank.version = sensors.latched, time, settings.version
    hold.regained = 0.0


@njit
def _set_aside(settings, tank, hold):
    """Of the damping that no standing gain needs, what pays for late changes of force, their price, and the rest."""
    same = hold.regained == 0.0 and tank.version == settings.version and tank.late == settings.passivity.lateness
    for i in range(AXES):
        same &= tank.left[i] == settings.passivity.surplus[i]
    if same:
        return
    tank.late = settings.passivity.lateness
    for i in range(AXES):
        tank.left[i] = settings.passivity.surplus[i]
        square, left = settings.hardware.scale[i] ** 2, settings.passivity.surplus[i]
        stiffness, lateness = square * settings.coupling.stiffness[i], settings.passivity.lateness
        reserve = passivity.late_reserve(stiffness, settings.period, lateness, left)
        tank.price[i] = square * passivity.late_price(reserve, settings.period, lateness)
        tank.surplus[i] = left - reserve


@njit
def _charge_late_write(settings, tank, spring, late):
    """What the last tick's change of force may give over the time [s] by which it was written later than counted."""
    for i in range(int(settings.axes)):
        # max over the way of q Δx − b Δx²/t, and no more than the handle may move at all
        force = settings.hardware.scale[i] * spring.changed[i]
        most = force * settings.hardware.velocity_limit[i] * late
        damping = max(1e-12, tank.surplus[i])
        tank.level -= min(most, 0.25 * force * force * late / damping)


@njit
def _count_drawn(settings, tank, spring, hold, motion, enable):
    """What the set position's velocity gave the handle through the damper."""
    for i in range(int(settings.axes)):
        # the term −B w Δx of (1)
        drawn = spring.push[i] * settings.hardware.scale[i] * motion.moved[i]
        less = hold.limited[i] or enable.ramp == 0.0  # at its limit, or let go on old counts, it took less
        tank.level -= max(0.0, drawn) if less else drawn


@njit
def _charge_changes(settings, tank, hold, motion, enable, time):
    """What new gains on old counts may have given beyond the force that the books of this hold are about.

    Whoever let go in such a tick owes nothing more: tank and spring are empty (`_let_go_unseen`).
    """
    for i in range(int(settings.axes)):
        damping = settings.hardware.damping[i]
        given = passivity.energy_changed(hold.change[i], hold.square[i], motion.moved[i], damping, time)
        tank.level -= max(0.0, given) if enable.ramp > 0.0 else 0.0


@njit
def _forget_spring(settings, tank, spring):
    """The device has cut the motor, some time in this hold: the spring let go unseen, and its energy is not paid back.

    What the handle did until then nobody knows, so the tank is empty; what it did after that gave it nothing.
    """
    tank.level = min(0.0, tank.level)
    for i in range(int(settings.axes)):
        spring.stiffness[i] = spring.limit[i] = 0.0


@njit
def _open_window(settings, tank, motion, latched):
    """With the midpoint of the hold that ends now, a window begins."""
    tank.window_start, tank.window_holds = latched, 0.0
    for i in range(int(settings.axes)):
        tank.window_from[i] = tank.midpoint[i] = motion.device_position[i] - 0.5 * motion.moved[i]
        tank.counted[i] = 0.0


@njit
def _charge_long_hold(settings, tank, spring, hold, motion, time):
    """What the handle may have gained over the hold of a missed tick, beyond what the damper took for certain.

    Over one between old and new gains too: it needs κT/2 of the old and half of either damper, and no old gains need
    more than b. Where there are walls, the device's damper is theirs.
    """
    if time <= 0.0:
        return
    spare = 0.0 if settings.wall.count > 0.0 else 1.0
    late = settings.passivity.lateness / settings.period
    for i in range(int(settings.axes)):
        scale, damping = settings.hardware.scale[i], settings.hardware.damping[i]
        # one let go unseen held too
        stiffness = max(spring.stiffness[i], spring.factor_held * settings.coupling.stiffness[i])
        cancelled = settings.cancellation.ratio * damping / settings.period
        lost = spare * damping / time
        # (κT/2 of the spring, κT a period of delay + what is cancelled − what the damper took) Δx²/T
        gained = ((0.5 + late) * scale**2 * stiffness + cancelled - lost) * motion.moved[i] ** 2
        known = not hold.limited[i] and _is_known(settings, tank, spring, i)
        tank.level -= max(0.0, gained + _damper_gained(settings, spring, i, scale * motion.moved[i], time, known))


@njit
def _is_known(settings, tank, spring, i):
    """Whether the damper's force over the hold, and the next one's velocity, are known."""
    estimator = settings.velocity.estimator
    known = settings.version == tank.version and estimator == velocity_estimator.BACKWARD_DIFFERENCE
    return known and abs(spring.damped[i]) < math.inf


@njit
def _damper_gained(settings, spring, i, moved, time, known):
    """What the coupling's damper gave over a long hold [J], with what (1) leaves open on both sides of it.

    Its force F = B v is known, so it gave −F Δx, and the next tick's damper begins a new sum with (BT/2)(Δx/hold)².
    Where F or the next velocity is not known it is at most (B/T) Δx².
    """
    damping = settings.coupling.damping[i]
    if not known:
        return spring.factor_held * damping / settings.period * moved * moved
    factor = max(spring.factor, spring.factor_held)
    begun = 0.5 * factor * damping * settings.period * (moved / time) ** 2
    return begun - spring.damped[i] * moved + hidden_energy(settings, i, 2.0 * spring.damped[i])


@njit
def _count_dissipated(settings, tank, spring, hold, motion, latched, damper_fills):
    """What the way of the midpoints shows to have been dissipated in this window, less what has been counted."""
    if tank.window_holds >= set_position.WINDOW:
        tank.window_start, tank.window_holds = tank.sample_before, 0.0
        for i in range(int(settings.axes)):
            tank.window_from[i], tank.counted[i] = tank.midpoint[i], 0.0
    tank.window_holds += 1.0
    elapsed = (latched - tank.window_start) * 1e-9
    for i in range(int(settings.axes)):
        tank.midpoint[i] = motion.device_position[i] - 0.5 * motion.moved[i]
        way, step = tank.midpoint[i] - tank.window_from[i], abs(settings.hardware.position_per_count[i])
        counted = set_position.dissipated(tank.counted[i], way, step, elapsed)
        # (1): (b − c) ∫ v² dt, of which only the growth since the last tick
        worth = _worth(settings, tank, spring, i, damper_fills and not hold.limited[i])
        tank.level += worth * (counted - tank.counted[i])
        tank.counted[i] = counted


@njit
def _worth(settings, tank, spring, i, damper_fills):
    """What ∫ v² dt fills in [N s/m]: b − c, and what the coupling's damper takes beside its bound."""
    surplus = max(0.0, tank.surplus[i])
    if not damper_fills or settings.velocity.estimator != velocity_estimator.BACKWARD_DIFFERENCE:
        return surplus
    # only what it takes on time is a square of midpoints
    on_time = max(0.0, 1.0 - settings.passivity.lateness / settings.period)
    damper = 2.0 * on_time * spring.factor_held * settings.coupling.damping[i] * settings.hardware.scale[i] ** 2
    cancelled = settings.cancellation.ratio * settings.hardware.damping[i]
    return surplus + max(0.0, damper - cancelled)


@kernel
def pay(settings, tank, spring, hold, motion, fade):
    """Moves the set position towards the goal; the tank takes what the spring lets go and pays what it gains.

    A tank without the reserve moves nothing of its own: then the set position stays, or goes along with the handle.
    What a long hold left owing the spring pays, at once: it lets go of as much.
    """
    held, kept = stored(settings, spring, hold, motion), reserve(settings, tank, spring)
    # the spring may keep what it has, less what a long hold owes, and have what the tank can spare
    available = max(0.0, held + max(0.0, tank.level - kept) - tank.owed)
    left = tank.level + held - _reach_out(settings, tank, spring, motion, fade, 1.0, available)
    if left < kept:
        left = tank.level + held - _reach_out(settings, tank, spring, motion, fade, 0.0, available)
    tank.level = left
    for i in range(int(settings.axes)):
        before, spring.set_position[i] = spring.set_position[i], motion.handle[i] + spring.stretch[i]
        spring.own_velocity[i] = (spring.set_position[i] - before) / settings.period
        spring.stiffness[i], spring.limit[i] = _wanted_spring(settings, spring, i)


@kernel
def reserve(settings, tank, spring):
    """Energy [J] that a tick's fastest changes of force, and dropping the push, may cost (change_cost)."""
    cost, risen = 0.0, abs(spring.factor - spring.factor_held)
    for i in range(int(settings.axes)):
        slew = (1.0 + set_position.DAMPER_SLEW) * settings.exchange.slew[i] * settings.period
        change = slew + abs(spring.push[i]) + risen * settings.coupling.limit[i]
        cost += hidden_energy(settings, i, change) + late_energy(tank, i, change)
    return cost


@kernel
def late_energy(tank, i, change):
    """Energy [J] that a change of force [N] which is not the handle's own may give while it is on its way."""
    return tank.price[i] * change * change


@kernel
def hidden_energy(settings, i, change):
    """Energy [J] of a change of force [N] over half an encoder step, by which the handle may be elsewhere."""
    return 0.5 * settings.hardware.scale[i] * abs(settings.hardware.position_per_count[i]) * abs(change)


@njit
def _wanted_spring(settings, spring, i):
    return spring.factor * settings.coupling.stiffness[i], spring.factor * settings.coupling.limit[i]


@kernel
def stored(settings, spring, hold, motion):
    """Energy [J] in the spring that held until now, at where the handle is now."""
    energy = 0.0
    for i in range(int(settings.axes)):
        stretch = spring.set_position[i] - motion.handle[i]
        kept = spring_store(spring.stiffness[i], spring.limit[i], stretch)
        if hold.mixed[i]:  # less was held than the spring says: what the hand may not have paid is not there
            before = stretch + settings.hardware.scale[i] * motion.moved[i]
            kept = min(kept, spring_store(spring.stiffness[i], spring.limit[i], before))
        energy += kept
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
def tick_ended(settings, tank, spring, motion, output, paid):
    """At the end of the tick: what the coupling's spring really holds, and what the encoder's step may hide.

    paid (3): velocity of the set position that somebody else pays for [m/s | rad/s].

    A factor that was paid for and did not rise is paid back. The handle may be half an encoder step from where it is
    booked: a change of force that is not the handle's own costs that much way (the rest is the friction's, as with any
    sampled spring: Abbott & Okamura 2005).
    """
    factor, gains = output.engage * output.exchange_fade, settings.coupling
    for i in range(int(settings.axes)):
        stretch = output.coupling_position[i] - output.position[i]
        stiffness, limit = factor * gains.stiffness[i], factor * gains.limit[i]
        push = factor * gains.damping[i] * (output.coupling_velocity[i] - paid[i])
        if abs(stretch) < math.inf and abs(push) < math.inf:
            tank.level += spring_store(spring.stiffness[i], spring.limit[i], stretch)
            tank.level -= spring_store(stiffness, limit, stretch)
            own = abs(stretch - spring.stretch_before[i]) - settings.hardware.scale[i] * abs(motion.moved[i])
            # f₁ s₁ − f₀ s₀ = f₁ (s₁ − s₀) + (f₁ − f₀) s₀
            full = spring_force(gains.stiffness[i], gains.limit[i], spring.stretch_before[i])
            # only what is not the handle's own way, and every change of damper and factor
            change = abs(push - spring.push[i]) + abs((factor - spring.factor_held) * full)
            tank.level -= hidden_energy(settings, i, stiffness * max(0.0, own) + change)
            # what somebody else pays for, he pays for as a port does: half of its own square too
            port = stiffness * settings.period * abs(paid[i])
            both = port + change if port > 0.0 else stiffness * max(0.0, own) + change
            tank.level -= late_energy(tank, i, both) - late_energy(tank, i, port)
            damped = factor * gains.damping[i] * output.velocity[i]
            spring.changed[i] = abs(stretch - spring.stretch_before[i]) * stiffness + change
            spring.changed[i] += abs(damped - spring.damped[i]) if abs(spring.damped[i]) < math.inf else abs(damped)
            spring.push[i], spring.stretch_before[i], spring.damped[i] = push, stretch, damped
        spring.stiffness[i], spring.limit[i] = stiffness, limit
    spring.factor = spring.factor_held = factor


@kernel
def tick_ended_unseen(settings, tank, spring, output):
    """A tick whose counts are old: nothing rises in it, and what falls is not paid back.

    The tank is empty then: what the handle did until the spring was let go, nobody knows.
    """
    factor = output.engage * output.exchange_fade
    if factor < spring.factor:
        tank.level, spring.factor = min(0.0, tank.level), factor
        for i in range(int(settings.axes)):
            spring.stiffness[i] = factor * settings.coupling.stiffness[i]
            spring.limit[i] = factor * settings.coupling.limit[i]
            spring.damped[i] = math.nan  # more than one force in one hold
