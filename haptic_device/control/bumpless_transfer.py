# SPDX-License-Identifier: Apache-2.0
"""The settings that a tick goes by, on their way to those that are wished for.

While no force is on, and under the policy `off`, new settings are in force at once. Else gains, limits, walls and
cancellation follow them: together they move the force by no more than `exchange.slew`, and what a spring, or a limit,
gains by it is paid first, or it waits. The energy tank pays; with `direct`, which has none, what the observer leaves of
both budgets. For the coupling's spring energy_tank.pay sees to it.

A wall changes for nothing while the handle is off it: one that is new, or comes nearer, stands at the handle at first
and follows it outwards. One that turns or vanishes lets the handle in, by the slew, until it is free of it.
"""

from haptic_device.config.parameters import POLICIES
from haptic_device.control import (
    bumpless_walls,
    change_ledger,
    energy_tank,
    exchange_samples,
    virtual_coupling,
    virtual_wall,
)
from haptic_device.jit import kernel, njit

OFF = POLICIES.index("off")
OTHERS = 3.0  # groups beside walls that may be on their way: limits, coupling, cancellation


@kernel
def begin(wished, state):
    """What counts at once: everything while no force is on, else all but gains, limits, walls and cancellation.

    A velocity estimator that changes does so at once: the dampers take the next estimate.
    """
    now, taken = state.in_force, wished.passivity.policy == OFF
    if state.enable.ramp == 0.0 or now.period == 0.0 or (taken and now.version != wished.version):
        state.in_force = wished
        state.change.going = 0.0
        return
    if now.version != wished.version:
        _take_rest(wished, now)
        state.change.going = OTHERS + max(now.wall.count, wished.wall.count)
    _count_with(wished, now, state.change.going)


@kernel
def follow(wished, state):
    """Brings gains, limits, walls and cancellation in force nearer to those that are wished for.

    All that are on their way share the slew. What falls goes first: so no gains are in force together that need more
    damping than the last ones that were all in force, or those that will be. While the tank is in debt the dampers of
    coupling and walls are none: they could give more.
    """
    # where the handle is nobody knows on old counts
    if state.motion.stale_ticks > 0.0:
        return
    now = state.in_force
    indebted = state.tank.level < 0.0 and now.exchange.method != exchange_samples.DIRECT
    if state.change.going > 0.0:
        _follow(wished, now, state, indebted)
    if indebted:
        _hold_dampers(now, state)


@njit
def _hold_dampers(now, state):
    """No dampers from now on; they come back as any gains do, when they are paid."""
    held = 0.0
    for i in range(int(now.axes)):
        held += abs(now.coupling.damping[i])
        now.coupling.damping[i] = 0.0
    for j in range(int(now.wall.count)):
        held += now.wall.damping[j]
        now.wall.damping[j] = 0.0
    if held > 0.0:
        state.change.going, state.hold.regained = OTHERS + now.wall.count, 1.0


@njit
def _follow(wished, now, state, indebted):
    share, falling = 1.0 / state.change.going, indebted or not _fallen(wished, now)
    going = _follow_limits(wished, now, state, share)
    going += _follow_coupling(wished, now, state, share, falling)
    going += _follow_cancellation(wished, now, state, falling)
    going += bumpless_walls.follow(wished, now, state, share, falling)
    virtual_wall.measure_depths(now.wall, state.walls, state.motion.handle)
    state.change.going = going


@kernel
def pay_for_rise(now, state, output):
    """The force ramp rises as far as what the walls' springs gain by it is paid; with `direct` the coupling's too."""
    enable, stored = state.enable, 0.0
    rise = enable.ramp - enable.ramp_before
    if rise <= 0.0:
        return
    for j in range(int(now.wall.count)):
        stored += virtual_wall.stored(now, j, state.walls.depth[j])
    coupled = int(now.axes) if now.exchange.method == exchange_samples.DIRECT else 0
    for i in range(coupled):
        stored += _held(now, output, i)
    if stored == 0.0:
        return
    rise *= change_ledger.share(change_ledger.available(now, state), rise * stored)
    for j in range(int(now.wall.count)):
        gained = rise * virtual_wall.stored(now, j, state.walls.depth[j])
        change_ledger.pay_along(now, state, gained, now.wall.x[j], now.wall.y[j])
    for i in range(coupled):
        change_ledger.pay(now, state, rise * _held(now, output, i), i)
    enable.ramp = output.engage = enable.ramp_before + rise


@njit
def _held(now, output, i):
    """Energy [J] in the coupling's spring where forces are whole."""
    stiffness, stretch = output.exchange_fade * now.coupling.stiffness[i], output.coupling_position[i]
    limit = output.exchange_fade * now.coupling.limit[i]
    return virtual_coupling.spring_store(stiffness, limit, stretch - output.position[i])


@njit
def _take_rest(wished, now):
    x, y, theta = now.exchange.slew[0], now.exchange.slew[1], now.exchange.slew[2]
    now.version, now.axes, now.period = wished.version, wished.axes, wished.period
    now.hardware, now.velocity, now.local = wished.hardware, wished.velocity, wished.local
    now.exchange, now.engage, now.fault = wished.exchange, wished.engage, wished.fault
    # what is on its way goes by the faster slew: that of a limit of 0 is 0
    now.exchange.slew[0], now.exchange.slew[1] = max(x, now.exchange.slew[0]), max(y, now.exchange.slew[1])
    now.exchange.slew[2] = max(theta, now.exchange.slew[2])


@njit
def _count_with(wished, now, going):
    """Damping left over and lateness; between old gains and new ones the lesser of what either leaves."""
    known, told = now.passivity, wished.passivity
    known.policy, known.control, known.budget = told.policy, told.control, told.budget
    known.lateness, known.cross = told.lateness, told.cross
    for i in range(known.surplus.size):
        known.margin[i] = told.margin[i]
        now.exchange.slew[i] = now.exchange.slew[i] if going > 0.0 else wished.exchange.slew[i]
        known.surplus[i] = min(known.surplus[i], told.surplus[i]) if going > 0.0 else told.surplus[i]


@njit
def _fallen(wished, now):
    """Whether no gain in force is above the one wished for; a wall that turns or vanishes falls to nothing first."""
    fallen = now.cancellation.ratio <= _goal(wished, now)
    for i in range(int(now.axes)):
        fallen &= now.coupling.stiffness[i] <= wished.coupling.stiffness[i]
        fallen &= now.coupling.damping[i] <= wished.coupling.damping[i]
    for j in range(int(now.wall.count)):
        stays = bumpless_walls.stays(wished.wall, now.wall, j)
        fallen &= now.wall.stiffness[j] <= (wished.wall.stiffness[j] if stays else 0.0)
        fallen &= now.wall.damping[j] <= (wished.wall.damping[j] if stays else 0.0)
    return fallen


@njit
def _follow_limits(wished, now, state, share):
    """Limits of force, by the slew; that of the springs rises as far as they are paid. 1 while on their way."""
    going = 0.0
    for i in range(int(now.axes)):
        reach = share * now.exchange.slew[i] * now.period
        # what acts is within that of the springs
        now.force.limit[i] = change_ledger.toward(now.force.limit[i], wished.force.limit[i], reach)
        _follow_spring_limit(min(wished.coupling.limit[i], now.force.limit[i]), now, state, i, reach)
        there = now.force.limit[i] == wished.force.limit[i] and now.coupling.limit[i] == wished.coupling.limit[i]
        going = going if there else 1.0
    return going


@njit
def _follow_spring_limit(aim, now, state, i, reach):
    """Limit of all springs on axis i; what they gain is paid, of the coupling's by the tank (energy_tank.pay)."""
    before = now.coupling.limit[i]
    limit = change_ledger.toward(before, aim, reach)
    now.coupling.limit[i] = limit
    if limit <= before:
        return
    held, dearest = _held_at_limits(now, state, i), (limit - before) * _beyond_limit(now, state, i, before)
    now.coupling.limit[i] = before
    kept = _held_at_limits(now, state, i)
    paid = change_ledger.share(change_ledger.available(now, state), dearest)
    now.coupling.limit[i] = limit if paid == 1.0 else before + paid * (limit - before)
    held = held if paid == 1.0 else _held_at_limits(now, state, i)
    change_ledger.pay(now, state, max(0.0, held - kept), i)


@njit
def _held_at_limits(now, state, i):
    """Energy [J] in the springs that a limit of axis i holds back, and that the tank does not pay for."""
    energy, left = 0.0, state.enable.ramp * virtual_wall.share_left(state.walls)
    for j in range(int(now.wall.count) if i < 2 else 0):
        energy += left * virtual_wall.stored(now, j, state.walls.depth[j])
    if now.exchange.method == exchange_samples.DIRECT:
        stretch = state.observer.pulled_to[i] - state.motion.handle[i]
        stored = virtual_coupling.spring_store(now.coupling.stiffness[i], now.coupling.limit[i], stretch)
        energy += state.observer.coupled * stored
    return energy


@njit
def _beyond_limit(now, state, i, limit):
    """Way [m | rad] along axis i by which those springs are beyond a limit: no rise of it costs more than rise · way.

    A wall's clamped store grows by (depth − L/K) dL, and L by 1/|n_i| of the limit's rise.
    """
    way, left = 0.0, state.enable.ramp * virtual_wall.share_left(state.walls)
    for j in range(int(now.wall.count) if i < 2 else 0):
        lean = abs(now.wall.x[j]) if i == 0 else abs(now.wall.y[j])
        force = lean * now.wall.stiffness[j] * state.walls.depth[j]
        if force > limit:
            way += left * (force - limit) / (lean * lean * now.wall.stiffness[j])
    if now.exchange.method == exchange_samples.DIRECT and now.coupling.stiffness[i] > 0.0:
        stretch = abs(state.observer.pulled_to[i] - state.motion.handle[i])
        way += state.observer.coupled * max(0.0, stretch - limit / now.coupling.stiffness[i])
    return way


@njit
def _follow_coupling(wished, now, state, share, falling):
    """Spring, then damper, of the coupling, by the slew; 1 while it is on its way."""
    gains, aim, going = now.coupling, wished.coupling, 0.0
    for i in range(int(now.axes)):
        stiffness = change_ledger.aim(gains.stiffness[i], aim.stiffness[i], falling)
        damping = change_ledger.aim(gains.damping[i], aim.damping[i], falling)
        known = gains.stiffness[i] + gains.damping[i]
        if state.fade.factor == 0.0 or now.force.limit[i] == 0.0:  # nothing is pulled, so nothing moves
            gains.stiffness[i], gains.damping[i] = stiffness, damping
        elif gains.stiffness[i] != stiffness:
            _follow_spring(stiffness, now, state, i, share * now.exchange.slew[i] * now.period)
        elif gains.damping[i] != damping:
            speed = max(abs(state.motion.device_velocity[i]) * now.hardware.scale[i], abs(state.spring.set_velocity[i]))
            reach = share * now.exchange.slew[i] * now.period
            _follow_damper(damping, now, state, i, reach / max(speed, 1e-9))
        if gains.stiffness[i] + gains.damping[i] != known:
            state.hold.regained = 1.0
        if gains.stiffness[i] != aim.stiffness[i] or gains.damping[i] != aim.damping[i]:
            going = 1.0
    return going


@njit
def _follow_spring(aim, now, state, i, reach):
    """Stiffness of the coupling; what its spring gains the tank pays (energy_tank.pay), the budget with `direct`."""
    before, stretch = now.coupling.stiffness[i], abs(state.observer.pulled_to[i] - state.motion.handle[i])
    stiffness = change_ledger.toward(before, aim, reach / max(stretch, 1e-9))
    gained = max(0.0, 0.5 * state.observer.coupled * (stiffness - before) * stretch * stretch)
    if now.exchange.method == exchange_samples.DIRECT:
        paid = change_ledger.share(change_ledger.available(now, state), gained)
        stiffness, gained = before + paid * (stiffness - before), paid * gained
    elif stiffness > before and energy_tank.late_energy(now, state.tank, i, reach) > change_ledger.available(
        now, state
    ):
        stiffness, gained = before, 0.0
    state.observer.by_settings[i] += gained
    now.coupling.stiffness[i] = stiffness


@njit
def _follow_damper(aim, now, state, i, reach):
    """Damping of the coupling; what it may owe for the handle's last way (passivity.damping_store) is paid."""
    before, way = now.coupling.damping[i], now.hardware.scale[i] * state.motion.moved[i]
    damping = change_ledger.toward(before, aim, reach)
    cost = max(0.0, 0.5 * (damping - before) * way * way / now.period)
    paid = change_ledger.share(change_ledger.available(now, state), cost)
    change_ledger.pay(now, state, paid * cost, i)
    now.coupling.damping[i] = before + paid * (damping - before) if paid < 1.0 else damping


@njit
def _about(wished, now):
    """Whether all about cancellation but its share is as it is wished for."""
    chosen, aim = now.cancellation, wished.cancellation
    same = chosen.band == aim.band and chosen.stretch == aim.stretch and chosen.twist == aim.twist
    return same and chosen.source == aim.source and chosen.filter == aim.filter


@njit
def _goal(wished, now):
    """Share cancelled that is aimed at: none until all else about it, and the walls where it fades, are there."""
    return wished.cancellation.ratio if _about(wished, now) and bumpless_walls.all_same(wished.wall, now.wall) else 0.0


@njit
def _owed_for(now, state, ratio, i):
    """What a sampled damper of this share of b may owe for the last way [J] (passivity.damping_store)."""
    speed = state.motion.device_velocity[i]
    return 0.5 * ratio * now.hardware.damping[i] * speed * speed * now.period


@njit
def _follow_cancellation(wished, now, state, falling):
    """The share cancelled, over engage.time; 1 while it is on its way."""
    before = now.cancellation.ratio
    ratio = change_ledger.toward(
        before, change_ledger.aim(before, _goal(wished, now), falling), now.period / now.engage.time
    )
    if ratio > before:
        cost = 0.0
        for i in range(int(now.axes)):
            cost += _owed_for(now, state, ratio - before, i)
        paid = change_ledger.share(change_ledger.available(now, state), cost)
        ratio = before + paid * (ratio - before) if paid < 1.0 else ratio
        for i in range(int(now.axes)):
            change_ledger.pay(now, state, _owed_for(now, state, ratio - before, i), i)
    state.hold.regained = 1.0 if ratio != before else state.hold.regained
    if ratio == 0.0 and not _about(wished, now):
        now.cancellation = wished.cancellation
    now.cancellation.ratio = ratio
    return 0.0 if ratio == wished.cancellation.ratio and _about(wished, now) else 1.0
