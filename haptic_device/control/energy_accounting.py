# SPDX-License-Identifier: Apache-2.0
"""The books of the energy tank over the hold that ends: what the hand has dissipated, and what it has been given.

(1) of control/set_position; for holds that were not as their gains were chosen for, the worst that they may have given.
"""

import math

from haptic_device.control import actuation_delay, faults, passivity, set_position, velocity_estimator
from haptic_device.control.energy_tank import hidden_energy, late_energy, stored
from haptic_device.control.passivity_observer import LONG
from haptic_device.control.records import AXES, HELD
from haptic_device.control.virtual_coupling import spring_force, spring_store
from haptic_device.jit import kernel, njit

ROUNDING = 1e-9  # [s] of a write's delay that is no delay


@kernel
def hold_ended(settings, tank, spring, hold, motion, enable, sensors):
    """Books the hold that ends here (set_position, 1)."""
    if not tank.filled:
        tank.filled, tank.level, tank.sample_before = 1.0, settings.exchange.budget, sensors.latched
        _open_window(settings, tank, motion, sensors.latched)
    _set_aside(settings, tank, hold)
    # the hold lasts from sample to sample, not from deadline to deadline; where their times are not sure, `longest`
    time = (sensors.latched - tank.sample_before) * 1e-9
    held, longest = time if motion.unsure == 0.0 else motion.held, time + motion.unsure
    cut = int(sensors.device_status) & faults.CUT
    _count_given(settings, tank, hold, motion, sensors.latched, time, cut)
    # a write later than what is counted with is no hold to earn anything by
    late = sensors.write_delay - (settings.passivity.lateness - settings.hardware.delay - settings.hardware.stamp_error)
    regained = settings.version != tank.version  # damper and surplus of the hold that ends are not these
    if cut and spring.factor_held > 0.0:
        _forget_spring(settings, tank, spring)
        _open_window(settings, tank, motion, sensors.latched)
    elif regained or late > ROUNDING or max(held, tank.hold_before) > LONG * settings.period:
        _charge_late_write(settings, tank, spring, max(0.0, late))
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, longest)
        _charge_long_hold(settings, tank, spring, hold, motion, sensors.latched, time)
        owes = max(0.0, -tank.level)
        tank.owed = owes if held > LONG * settings.period else min(tank.owed, owes)
        _open_window(settings, tank, motion, sensors.latched)
    else:
        _count_drawn(settings, tank, spring, hold, motion, enable)
        _charge_changes(settings, tank, hold, motion, enable, longest)
        if hold.regained > 0.0:  # between one surplus and another nothing is earned
            _open_window(settings, tank, motion, sensors.latched)
        _count_dissipated(settings, tank, spring, hold, motion, sensors.latched)
        tank.owed = min(tank.owed, max(0.0, -tank.level))
    tank.sample_before, tank.hold_before, tank.version = sensors.latched, held, settings.version
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
        # what a standing coupling needs was its own when these gains were taken
        own = passivity.least_damping(
            stiffness, square * settings.coupling.damping[i], settings.period, settings.hardware.delay
        )
        tank.own[i] = min(left + own, _not_cancelled(settings, i))


@njit
def _not_cancelled(settings, i):
    """Physical damping of axis i [N s/m] that cancellation leaves wherever it acts, with an estimator of any window."""
    damping = settings.hardware.damping[i]
    windows = settings.velocity.estimator == velocity_estimator.ADAPTIVE_WINDOW
    cancelled = settings.cancellation.ratio * damping * (velocity_estimator.SWITCHED if windows else 1.0)
    return max(0.0, damping - passivity.least_damping(0.0, cancelled, settings.period, settings.passivity.lateness))


@njit
def _count_given(settings, tank, hold, motion, now, time, cut):
    """What the coupling alone has given [J], at most: by its forces that acted, less what its share of damping took.

    That share is taken off where the way of the midpoints shows it (_count_dissipated). What the tank paid for others
    (change_ledger.pay) and for what nobody sees counts as given where it is paid.
    cut: the device cut the motor, some time in this hold.
    """
    if time <= 0.0:
        return
    for i in range(int(settings.axes)):
        way = _sure_way(settings, tank, motion, i)
        mean, square = actuation_delay.acted(hold, hold.coupling_written, i, now, time)
        longest = time + motion.unsure
        if motion.unsure > 0.0:
            off, more = actuation_delay.unsure(hold, hold.coupling_written, i, motion, now, time, mean)
            square, tank.given = square + more, tank.given + off * abs(way)
        if cut:  # Σ (f − f̄)² τ is most where half of the time had no force
            square += 0.25 * mean * mean * longest
        tank.given += max(0.0, mean * way) if cut else mean * way
        tank.given += passivity.energy_spread(square, tank.own[i], settings.hardware.velocity_limit[i], longest)


@njit
def _sure_way(settings, tank, motion, i):
    """Way of axis i in this hold [m | rad], with half an encoder step of play: a count that flickers goes nowhere.

    The force that changes with the flicker does no work on a handle that rests.
    """
    half, place = 0.5 * abs(settings.hardware.position_per_count[i]), motion.device_position[i]
    start = place - motion.moved[i]
    before = min(start + half, max(start - half, tank.followed[i]))
    tank.followed[i] = min(place + half, max(place - half, before))
    return tank.followed[i] - before


@kernel
def forget_debt(settings, tank, spring, hold, motion, observer, now):
    """A spring that is empty, and of which nothing acts any more, ends what the books charged beyond what was given.

    They charge in advance the worst that may come of a change. What the display may still give is then the tank's level
    and what was shipped and is not used; with the energy given so far that is at most the budget, so the level rises to

        min(budget, budget − G − shipped + returned − what dampers owe),

    G as of `_count_given`; what is above 0 is owed no more. Never above the budget, and G stays: who lets go and
    engages again gets no second one.
    """
    budget = settings.exchange.budget
    if tank.level >= budget or not _is_empty(spring, hold, now):
        return
    # a slack spring stretches by the way of the hold that ends
    level = budget - tank.given - tank.shipped + tank.returned - stored(settings, spring, motion)
    for i in range(int(settings.axes)):
        level -= observer.store[i] + _remembered(settings, spring, i)
        # half of the way that ends here counts in the window that begins
        level -= 0.5 * max(0.0, tank.surplus[i]) * motion.moved[i] ** 2 / max(tank.hold_before, settings.period)
    if level > tank.level:
        tank.level = min(budget, level)
        tank.owed = min(tank.owed, max(0.0, -tank.level))
        spring.prepaid[:] = 0.0
        _open_window(settings, tank, motion, now)  # what was dissipated until now is in G: it fills the tank no more


@njit
def _is_empty(spring, hold, now):
    """Whether the coupling was let go, or slack and without a push, in all commands that act at `now` [ns] or will."""
    if spring.slack < 1.0:
        return False
    return spring.slack >= HELD or hold.acts[(int(hold.newest) + 1 - int(spring.slack)) % HELD] <= now


@njit
def _remembered(settings, spring, i):
    """What a damper may owe [J] whose velocity is of more than one hold, beside the observer's store; ∞: not known."""
    if settings.velocity.estimator == velocity_estimator.BACKWARD_DIFFERENCE or spring.damped[i] == 0.0:
        return 0.0
    damping = spring.factor_held * settings.coupling.damping[i]
    if settings.velocity.estimator == velocity_estimator.ADAPTIVE_WINDOW or damping == 0.0:
        return math.inf
    return 0.5 * settings.velocity.lag * spring.damped[i] ** 2 / damping


@njit
def _charge_late_write(settings, tank, spring, late):
    """What the last tick's change of force may give over the time [s] by which it was written later than counted."""
    for i in range(int(settings.axes)):
        force, fastest = settings.hardware.scale[i] * spring.changed[i], settings.hardware.velocity_limit[i]
        tank.level -= set_position.worst_draw(force, tank.surplus[i], fastest, late)


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

    Whoever let go in such a tick owes nothing more: tank and spring are empty (energy_tank.tick_ended_unseen).
    """
    for i in range(int(settings.axes)):
        damping = settings.hardware.damping[i]
        fastest = settings.hardware.velocity_limit[i]
        given = passivity.energy_changed(hold.change[i], hold.square[i], motion.moved[i], damping, fastest, time)
        charged = max(0.0, given) if enable.ramp > 0.0 else 0.0
        tank.level -= charged
        tank.given += charged


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
    tank.window_start, tank.window_error, tank.window_holds = latched, motion.sample_error, 0.0
    for i in range(int(settings.axes)):
        tank.window_from[i] = tank.midpoint[i] = motion.device_position[i] - 0.5 * motion.moved[i]
        tank.counted[i] = 0.0


@njit
def _charge_long_hold(settings, tank, spring, hold, motion, now, time):
    """What the handle may have gained over the hold of a missed tick, beyond what the damper took for certain.

    All forces that acted are known, and where the hold begins and ends: so what spring, damper and cancellation gave is
    counted with them, and only the path between is the worst. Of the device's damping the share that is cancelled pays
    for that; the rest is the coupling's where there are no walls.
    """
    if time <= 0.0:
        return
    longest = time + motion.unsure
    for i in range(int(settings.axes)):
        damping, fastest = settings.hardware.damping[i], settings.hardware.velocity_limit[i]
        left = (1.0 - hold.cancelling) * damping if settings.wall.count == 0.0 else 0.0
        mean, spread = actuation_delay.acted(hold, hold.written, i, now, time)
        # what acted late is not what the ticks of this hold commanded
        gained = max(0.0, (mean - hold.force[i]) * motion.moved[i] - hold.change[i] * motion.moved[i] / time)
        if motion.unsure > 0.0:
            off, more = actuation_delay.unsure(hold, hold.written, i, motion, now, time, mean)
            gained, spread = gained + off * abs(motion.moved[i]), spread + more
        gained += _spring_gained(settings, tank, spring, motion, i)
        gained += _damper_gained(settings, spring, hold, i, settings.hardware.scale[i] * motion.moved[i], longest)
        tank.level -= max(0.0, gained - left * motion.moved[i] ** 2 / longest)
        cancelled = max(0.0, _cancellation_gained(settings, hold, i, motion.moved[i], longest))
        tank.level -= cancelled
        tank.given += cancelled
        # the force of before, which acted first
        tank.level -= passivity.energy_spread(spread, damping, fastest, longest)


@njit
def _spring_gained(settings, tank, spring, motion, i):
    """What the coupling's spring gave over a long hold [J]: growth of its store, and the work of the force held.

    That is ½ K Δx² while the spring is at no limit, and at most twice its limit times the way. The change of force that
    this way made acts late in the holds that follow; their own ways pay for half of that.
    """
    # one let go unseen held too
    stiffness = max(spring.stiffness[i], spring.factor_held * settings.coupling.stiffness[i])
    limit = max(spring.limit[i], spring.factor_held * settings.coupling.limit[i])
    way = settings.hardware.scale[i] * motion.moved[i]
    end = spring.set_position[i] - motion.handle[i]
    begin = end + way
    begun = spring_force(stiffness, limit, begin)
    grown = spring_store(stiffness, limit, end) - spring_store(stiffness, limit, begin)
    change = abs(spring_force(stiffness, limit, end) - begun)
    owed = 0.5 * tank.lateness / settings.period * stiffness * way * way
    return max(0.0, grown + begun * way) + min(owed, late_energy(settings, tank, i, change))


@njit
def _begun(settings, damping, moved, time):
    """What a sampled damper may owe [J] after a long hold: half of D v̂², for as long as it takes that hold's velocity.

    One tick by backward difference. A low-pass has no more energy than its input; the means of windows have at most
    four times that (Hardy and Littlewood 1930), shared by halves.
    """
    acts = settings.period
    if settings.velocity.estimator != velocity_estimator.BACKWARD_DIFFERENCE:
        acts = 2.0 * time if settings.velocity.estimator == velocity_estimator.ADAPTIVE_WINDOW else time
    return 0.5 * damping * acts * (moved / time) ** 2


@njit
def _damper_gained(settings, spring, hold, i, moved, time):
    """What the coupling's damper gave over a long hold [J], with what (1) leaves open on both sides of it.

    Its force F = −B v is known, so it gave F Δx, and the next tick's damper begins a new sum. At the motor's limit, and
    where it was let go within the hold, it took less.
    """
    factor, damped = max(spring.factor, spring.factor_held), spring.damped[i]
    given = -damped * moved
    given = max(0.0, given) if hold.limited[i] or spring.parted else given
    return (
        _begun(settings, factor * settings.coupling.damping[i], moved, time)
        + given
        + hidden_energy(settings, i, 2.0 * damped)
    )


@njit
def _cancellation_gained(settings, hold, i, moved, time):
    """What damping cancellation gave over a long hold [J], less what the damping that it cancels took."""
    cancelled = hold.cancelling * settings.hardware.damping[i]
    given = max(0.0, hold.cancellation_force[i] * moved) - cancelled * moved * moved / time
    return given + _begun(settings, cancelled, moved, time)


@njit
def _count_dissipated(settings, tank, spring, hold, motion, latched):
    """What the way of the midpoints shows to have been dissipated in this window, less what has been counted."""
    if tank.window_holds >= set_position.WINDOW:
        tank.window_start, tank.window_error = tank.sample_before, motion.unsure * 1e9 - motion.sample_error
        tank.window_holds = 0.0
        for i in range(int(settings.axes)):
            tank.window_from[i], tank.counted[i] = tank.midpoint[i], 0.0
    tank.window_holds += 1.0
    elapsed = (latched - tank.window_start + tank.window_error + motion.sample_error) * 1e-9
    for i in range(int(settings.axes)):
        tank.midpoint[i] = motion.device_position[i] - 0.5 * motion.moved[i]
        way, step = tank.midpoint[i] - tank.window_from[i], abs(settings.hardware.position_per_count[i])
        counted = set_position.dissipated(tank.counted[i], way, step, elapsed)
        # (1): (b − c) ∫ v² dt, of which only the growth since the last tick
        worth = _worth(settings, tank, spring, hold, motion, i)
        tank.level += worth * (counted - tank.counted[i])
        tank.given -= tank.own[i] * (counted - tank.counted[i])
        tank.counted[i] = counted


@njit
def _worth(settings, tank, spring, hold, motion, i):
    """What ∫ v² dt fills in [N s/m]: b − c, and what the coupling's damper takes beside its bound."""
    surplus = max(0.0, tank.surplus[i])
    if hold.limited[i] or settings.velocity.estimator != velocity_estimator.BACKWARD_DIFFERENCE:
        return surplus
    # only what it takes on time is a square of midpoints, of a velocity over the hold and twice its error at most
    on_time = max(0.0, 1.0 - settings.passivity.lateness / settings.period)
    on_time *= settings.period / (settings.period + 2.0 * motion.unsure)
    damper = 2.0 * on_time * spring.factor_held * settings.coupling.damping[i] * settings.hardware.scale[i] ** 2
    cancelled = settings.cancellation.ratio * settings.hardware.damping[i]
    return surplus + max(0.0, damper - cancelled)
