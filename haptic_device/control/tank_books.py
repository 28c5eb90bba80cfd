# SPDX-License-Identifier: Apache-2.0
"""The books of the energy tank over the hold that ends: what the hand has dissipated, and what it has been given.

(1) of control/set_position; for holds that were not as their gains were chosen for, the worst that they may have given.
"""

import math

from haptic_device.control import faults, held_force, passivity, set_position, velocity_estimator
from haptic_device.control.energy_tank import hidden_energy
from haptic_device.control.passivity_observer import LONG
from haptic_device.control.records import AXES
from haptic_device.jit import kernel, njit

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
    regained = settings.version != tank.version  # damper and surplus of the hold that ends are not these
    if int(sensors.device_status) & faults.WATCHDOG and spring.factor_held > 0.0:
        _forget_spring(settings, tank, spring)
        _open_window(settings, tank, motion, sensors.latched)
    elif regained or late > ROUNDING or max(time, tank.hold_before) > LONG * settings.period:
        _charge_late_write(settings, tank, spring, max(0.0, late))
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, time)
        _charge_long_hold(settings, tank, spring, hold, motion, sensors.latched, time)
        owes = max(0.0, -tank.level)
        tank.owed = owes if time > LONG * settings.period else min(tank.owed, owes)
        _open_window(settings, tank, motion, sensors.latched)
    else:
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, time)
        if hold.regained > 0.0:  # between one surplus and another nothing is earned
            _open_window(settings, tank, motion, sensors.latched)
        _count_dissipated(settings, tank, spring, hold, motion, sensors.latched, damper_fills)
        tank.owed = min(tank.owed, max(0.0, -tank.level))
    tank.sample_before, tank.hold_before, tank.version = sensors.latched, time, settings.version
    hold.regained = 0.0


@njit
def _set_aside(settings, tank, hold):
    """Of the damping that no standing gain needs, what pays for late changes of force, their price, and the rest."""
    same = hold.regained == 0.0 and tank.version == settings.version and tank.lateness == settings.passivity.lateness
    for i in range(AXES):
        same &= tank.left[i] == settings.passivity.surplus[i]
    if same:
        return
    tank.lateness = settings.passivity.lateness
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
def _charge_long_hold(settings, tank, spring, hold, motion, now, time):
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
        # the force of before, which acted first
        _, spread = held_force.acted(hold, i, now, time)
        tank.level -= 0.25 * spread / damping


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
