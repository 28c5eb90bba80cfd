# SPDX-License-Identifier: Apache-2.0
"""The energy tank of the device's side, whatever set position an exchange method wants (control/set_position).

It is filled by what the hand dissipates beyond what the gains need, and by what the spring lets go; it pays for what
the spring gains when the set position, or a factor on the spring, moves. One tank for all axes.
"""

import math

from haptic_device.control import (
    exchange_samples,
    faults,
    passivity,
    set_position,
    velocity_estimator,
    virtual_coupling,
)
from haptic_device.jit import kernel, njit

DAMPER_SLEW = 0.25  # share of the slew that the set position's velocity may make on top of it
LONG = 1.5  # periods: a hold beyond is one of a missed tick, which the device's damping was not chosen for


@kernel
def fill(settings, memory, row):
    """Books the hold that ends here (control/set_position, 1)."""
    if not memory.filled:
        memory.filled, memory.tank, memory.latched_before = 1.0, settings.exchange_budget, row.latched
        _open_window(settings, memory, row)
    hold = (row.latched - memory.latched_before) * 1e-9
    regained = settings.version != memory.version  # damper and surplus of the hold that ends are not these
    if int(row.device_status) & faults.WATCHDOG and memory.factor_held > 0.0:
        _forget_spring(settings, memory)
        _open_window(settings, memory, row)
    elif regained or max(hold, memory.hold_before) > LONG * settings.period:
        _count_drawn(settings, memory)
        _charge_changes(settings, memory, hold)
        _charge_long_hold(settings, memory, hold)
        memory.owed = max(0.0, -memory.tank) if hold > LONG * settings.period else memory.owed
        _open_window(settings, memory, row)
    else:
        _count_drawn(settings, memory)
        _charge_changes(settings, memory, hold)
        _count_dissipated(settings, memory, row)
        memory.owed = min(memory.owed, max(0.0, -memory.tank))
    memory.latched_before, memory.hold_before, memory.version = row.latched, hold, settings.version


@njit
def _count_drawn(settings, memory):
    """What the set position's velocity gave the handle through the damper."""
    for i in range(int(settings.axes)):
        drawn = memory.push[i] * settings.scale[i] * memory.moved[i]
        less = memory.limited[i] or memory.engage == 0.0  # at its limit, or let go on old counts, it took less
        memory.tank -= max(0.0, drawn) if less else drawn


@njit
def _charge_changes(settings, memory, hold):
    """What new gains on old counts may have given beyond the force that the books of this hold are about.

    Whoever let go in such a tick owes nothing more: tank and spring are empty (`_let_go_unseen`).
    """
    for i in range(int(settings.axes)):
        change, square = memory.held_change[i], memory.held_square[i]
        given = passivity.energy_changed(change, square, memory.moved[i], settings.physical_damping[i], hold)
        memory.tank -= max(0.0, given) if memory.engage > 0.0 else 0.0


@njit
def _forget_spring(settings, memory):
    """The device has cut the motor, some time in this hold: the spring let go unseen, and its energy is not paid back.

    What the handle did until then nobody knows, so the tank is empty; what it did after that gave it nothing.
    """
    memory.tank = min(0.0, memory.tank)
    for i in range(int(settings.axes)):
        memory.spring[i] = memory.clamp[i] = 0.0


@njit
def _open_window(settings, memory, row):
    """With the midpoint of the hold that ends now, a window begins."""
    memory.window_start, memory.window_holds = row.latched, 0.0
    for i in range(int(settings.axes)):
        memory.window_from[i] = memory.midpoint[i] = memory.device_position[i] - 0.5 * memory.moved[i]
        memory.counted[i] = 0.0


@njit
def _charge_long_hold(settings, memory, hold):
    """What the handle may have gained over the hold of a missed tick, beyond what the damper took for certain.

    Over one between old and new gains too: it needs κT/2 of the old and half of either damper, and no old gains need
    more than b. Where there are walls, the device's damper is theirs.
    """
    if hold <= 0.0:
        return
    spare = 0.0 if settings.walls > 0.0 else 1.0
    for i in range(int(settings.axes)):
        squared = settings.scale[i] ** 2
        stiffness = max(memory.spring[i], memory.factor_held * settings.stiffness[i])  # one let go unseen held too
        cancelled = settings.cancellation_ratio * settings.physical_damping[i] / settings.period
        lost = spare * settings.physical_damping[i] / hold
        gained = (0.5 * squared * stiffness + cancelled - lost) * memory.moved[i] ** 2
        memory.tank -= max(0.0, gained + _damper_gained(settings, memory, i, hold))


@njit
def _damper_gained(settings, memory, i, hold):
    """What the coupling's damper gave over a long hold [J], with what (1) leaves open on both sides of it.

    Its force F = B v is known, so it gave −F Δx, and the next tick's damper begins a new sum with (BT/2)(Δx/hold)².
    Where F or the next velocity is not known it is at most (B/T) Δx².
    """
    moved = settings.scale[i] * memory.moved[i]
    known = settings.version == memory.version and settings.velocity_estimator == velocity_estimator.BACKWARD_DIFFERENCE
    if not known or memory.limited[i] or not abs(memory.damped[i]) < math.inf:
        return memory.factor_held * settings.damping[i] / settings.period * moved * moved
    factor = max(memory.factor, memory.factor_held)
    begun = 0.5 * factor * settings.damping[i] * settings.period * (moved / hold) ** 2
    return begun - memory.damped[i] * moved + hidden_energy(settings, i, 2.0 * memory.damped[i])


@njit
def _count_dissipated(settings, memory, row):
    """What the way of the midpoints shows to have been dissipated in this window, less what has been counted."""
    if memory.window_holds >= set_position.WINDOW:
        memory.window_start, memory.window_holds = memory.latched_before, 0.0
        for i in range(int(settings.axes)):
            memory.window_from[i], memory.counted[i] = memory.midpoint[i], 0.0
    memory.window_holds += 1.0
    elapsed = (row.latched - memory.window_start) * 1e-9
    for i in range(int(settings.axes)):
        memory.midpoint[i] = memory.device_position[i] - 0.5 * memory.moved[i]
        way, step = memory.midpoint[i] - memory.window_from[i], abs(settings.position_per_count[i])
        counted = set_position.dissipated(memory.counted[i], way, step, elapsed)
        memory.tank += _worth(settings, memory, i) * (counted - memory.counted[i])
        memory.counted[i] = counted


@njit
def _worth(settings, memory, i):
    """What ∫ v² dt fills in [N s/m]: b − c, and for pspm what the coupling's damper takes beside its bound."""
    modulated = exchange_samples.is_modulated(settings.exchange_method)
    if not modulated or memory.limited[i] or settings.velocity_estimator != velocity_estimator.BACKWARD_DIFFERENCE:
        return max(0.0, settings.surplus[i])
    damper = 2.0 * memory.factor_held * settings.damping[i] * settings.scale[i] ** 2
    cancelled = settings.cancellation_ratio * settings.physical_damping[i]
    return max(0.0, settings.surplus[i]) + max(0.0, damper - cancelled)


@kernel
def pay(settings, memory, row):
    """Moves the set position towards the goal; the tank takes what the spring lets go and pays what it gains.

    A tank without the reserve moves nothing of its own: then the set position stays, or goes along with the handle.
    What a long hold left owing the spring pays, at once: it lets go of as much.
    """
    stored, kept = held(settings, memory, row), reserve(settings, memory)
    available = max(0.0, stored + max(0.0, memory.tank - kept) - memory.owed)
    left = memory.tank + stored - _reach_out(settings, memory, row, 1.0, available)
    if left < kept:
        left = memory.tank + stored - _reach_out(settings, memory, row, 0.0, available)
    memory.tank = left
    for i in range(int(settings.axes)):
        before, memory.set[i] = memory.set[i], row.position[i] + memory.stretch[i]
        memory.own_velocity[i] = (memory.set[i] - before) / settings.period
        memory.spring[i], memory.clamp[i] = _spring(settings, memory, i)


@kernel
def reserve(settings, memory):
    """Energy [J] that half an encoder step may hide of a tick's fastest changes of force, and of dropping the push."""
    hidden, risen = 0.0, abs(memory.factor - memory.factor_held)
    for i in range(int(settings.axes)):
        change = (1.0 + DAMPER_SLEW) * settings.exchange_slew[i] * settings.period + abs(memory.push[i])
        change += risen * settings.coupling_limit[i]
        hidden += hidden_energy(settings, i, change)
    return hidden


@kernel
def hidden_energy(settings, i, change):
    """Energy [J] of a change of force [N] over half an encoder step, by which the handle may be elsewhere."""
    return 0.5 * settings.scale[i] * abs(settings.position_per_count[i]) * abs(change)


@njit
def _spring(settings, memory, i):
    return memory.factor * settings.stiffness[i], memory.factor * settings.coupling_limit[i]


@kernel
def held(settings, memory, row):
    """Energy in the spring that held until now, at where the handle is now."""
    energy = 0.0
    for i in range(int(settings.axes)):
        stretch = memory.set[i] - row.position[i]
        kept = virtual_coupling.spring_store(memory.spring[i], memory.clamp[i], stretch)
        if memory.mixed[i]:  # less was held than the spring says: what the hand may not have paid is not there
            before = stretch + settings.scale[i] * memory.moved[i]
            kept = min(kept, virtual_coupling.spring_store(memory.spring[i], memory.clamp[i], before))
        energy += kept
    return energy


@njit
def _reach_out(settings, memory, row, own, available):
    """Fills in the stretches, whose energy is at most what is available; returns that energy. own: 0 for no slew."""
    wanted, square = 0.0, 0.0
    for i in range(int(settings.axes)):
        stiffness, limit = _spring(settings, memory, i)
        reach = own * settings.exchange_slew[i] * settings.period / stiffness if stiffness > 0.0 else math.inf
        goal = memory.goal[i] if row.exchange_fade > 0.0 else row.position[i]
        moved = settings.scale[i] * memory.moved[i]
        stretch = set_position.slewed(memory.set[i], goal, moved, reach) - row.position[i]
        memory.stretch[i] = stretch
        wanted += virtual_coupling.spring_store(stiffness, limit, stretch)
        square += 0.5 * stiffness * stretch * stretch
    share = set_position.share_paid(available, wanted, square)
    if share == 1.0:
        return wanted
    memory.shortened += own
    wanted = 0.0
    for i in range(int(settings.axes)):
        memory.stretch[i] *= share
        stiffness, limit = _spring(settings, memory, i)
        wanted += virtual_coupling.spring_store(stiffness, limit, memory.stretch[i])
    return wanted


@kernel
def take_returned(settings, memory, row):
    """Energy that the simulation's side sends back, never more than was shipped there."""
    if row.tool_session != memory.tool_session:
        memory.tool_session, memory.tool_energy = row.tool_session, row.tool_energy
    back = exchange_samples.believed(row.tool_energy, memory.tool_energy, memory.shipped, memory.returned)
    memory.tank = max(memory.tank, min(settings.exchange_tank, memory.tank + back))  # what is over is not sent again
    memory.returned += back
    memory.tool_energy = max(memory.tool_energy, row.tool_energy)
