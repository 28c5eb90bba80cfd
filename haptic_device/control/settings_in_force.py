# SPDX-License-Identifier: Apache-2.0
"""The settings that a tick goes by, on their way to those that are wished for.

While no force is on, and under the policy `off`, new settings are in force at once. Else gains, limits, walls and
cancellation follow them: together they move the force by no more than `exchange.slew`, and what a spring, or a limit,
gains by it is paid first, or it waits. The energy tank pays; with `direct`, which has none, what is left of the
observer's budget. For the coupling's spring energy_tank.pay sees to it.

A wall changes for nothing while the handle is off it: one that is new, or comes nearer, stands at the handle at first
and follows it outwards. One that turns or vanishes lets the handle in, by the slew, until it is free of it.
"""

from typing import NamedTuple

from haptic_device.control import energy_tank, exchange_samples, virtual_wall
from haptic_device.jit import kernel, njit
from haptic_device.parameters import POLICIES

OFF = POLICIES.index("off")
OTHERS = 3.0  # groups beside walls that may be on their way: limits, coupling, cancellation


class Step(NamedTuple):
    """The next stiffness [N/m], offset [m] and damping [N s/m] of a wall, and what its spring gains by it [J]."""

    stiffness: float
    offset: float
    damping: float
    gained: float


@kernel
def begin(wished, state):
    """What counts at once: everything while no force is on, else all that moves none by itself."""
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

    All that are on their way share the slew.
    """
    now, motion = state.in_force, state.motion
    # where the handle is nobody knows on old counts
    if state.change.going == 0.0 or motion.stale_ticks > 0.0:
        return
    share = 1.0 / state.change.going
    going = _follow_limits(wished, now, state, share)
    going += _follow_coupling(wished, now, state, share)
    going += _follow_cancellation(wished, now, state)
    going += _follow_walls(wished, now, state, share)
    virtual_wall.measure_depths(now.wall, state.walls, motion.handle)
    state.change.going = going


@kernel
def pay_for_rise(now, state, output):
    """The force ramp rises only as far as what the walls' springs gain by it is paid."""
    enable, stored = state.enable, 0.0
    rise = enable.ramp - enable.ramp_before
    if rise <= 0.0:
        return
    for j in range(int(now.wall.count)):
        stored += virtual_wall.wall_store(now.wall.stiffness[j], state.walls.depth[j])
    if stored > 0.0:
        share = _share(_available(now, state), rise * stored)
        _pay(now, state, share * rise * stored, 0.5, 0.5)
        enable.ramp = output.engage = enable.ramp_before + share * rise


@njit
def _take_rest(wished, now):
    now.version, now.axes, now.period = wished.version, wished.axes, wished.period
    now.hardware, now.velocity, now.exchange, now.local = (
        wished.hardware,
        wished.velocity,
        wished.exchange,
        wished.local,
    )
    now.engage, now.fault = wished.engage, wished.fault


@njit
def _count_with(wished, now, going):
    """Damping left over and lateness; between old gains and new ones the lesser of what either leaves."""
    known, told = now.passivity, wished.passivity
    known.policy, known.control, known.budget = told.policy, told.control, told.budget
    known.lateness, known.cross = told.lateness, told.cross
    for i in range(known.surplus.size):
        known.margin[i] = told.margin[i]
        known.surplus[i] = min(known.surplus[i], told.surplus[i]) if going > 0.0 else told.surplus[i]


@njit
def _toward(value, wished, reach):
    return min(value + reach, max(value - reach, wished))


@njit
def _available(now, state):
    """Energy [J] that may be spent on what changes the force."""
    if now.exchange.method == exchange_samples.DIRECT:
        spent = 0.0
        for i in range(state.observer.observed_energy.size):
            spent = max(spent, state.observer.observed_energy[i] + state.observer.by_settings[i])
        return max(0.0, now.passivity.budget - spent)
    return max(0.0, state.tank.level - energy_tank.reserve(now, state.tank, state.spring))


@njit
def _share(available, cost):
    """Share 0…1 of a cost [J] that is there."""
    return 1.0 if cost <= available else available / cost


@njit
def _pay(now, state, energy, along_x, along_y):
    """Takes this energy [J] from the ledger; the observer counts it as generated, by axis."""
    state.observer.by_settings[0] += along_x * energy
    state.observer.by_settings[1] += along_y * energy
    if now.exchange.method != exchange_samples.DIRECT:
        state.tank.level -= energy


@njit
def _follow_limits(wished, now, state, share):
    """Limits of force, by the slew; one that holds a wall back rises as far as that is paid. 1 while on their way."""
    going = 0.0
    for i in range(int(now.axes)):
        reach = share * now.exchange.slew[i] * now.period
        limit = _toward(now.force.limit[i], wished.force.limit[i], reach)
        rise = limit - now.force.limit[i]
        if rise > 0.0 and state.hold.limited[i] > 0.0 and state.walls.touched > 0.0:
            cost = rise * _way_out(now, state, i)
            paid = _share(_available(now, state), cost)
            _pay(now, state, paid * cost, 1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0)
            limit = now.force.limit[i] + paid * rise
        now.force.limit[i] = limit
        now.coupling.limit[i] = _toward(now.coupling.limit[i], wished.coupling.limit[i], reach)
        there = limit == wished.force.limit[i] and now.coupling.limit[i] == wished.coupling.limit[i]
        going = going if there else 1.0
    return going


@njit
def _way_out(now, state, i):
    """Way [m | rad] along axis i after which no spring pushes along it any more."""
    way = abs(state.observer.pulled_to[i] - state.motion.handle[i])
    for j in range(int(now.wall.count)):
        lean = abs(now.wall.x[j]) if i == 0 else abs(now.wall.y[j])
        if state.walls.depth[j] > 0.0 and i < 2 and lean > 1e-3:
            way = max(way, state.walls.depth[j] / lean)
    return way


@njit
def _follow_coupling(wished, now, state, share):
    """Spring, then damper, of the coupling, by the slew; 1 while it is on its way."""
    gains, aim, going = now.coupling, wished.coupling, 0.0
    if state.fade.factor == 0.0:  # nothing is pulled, so nothing moves
        gains.stiffness[:] = aim.stiffness
        gains.damping[:] = aim.damping
    for i in range(int(now.axes)):
        if gains.stiffness[i] == aim.stiffness[i] and gains.damping[i] == aim.damping[i]:
            continue
        going, reach = 1.0, share * now.exchange.slew[i] * now.period
        late = energy_tank.late_energy(state.tank, i, reach)
        if late > 0.0 and late > _available(now, state):
            continue
        _pay(now, state, late, 0.0, 0.0)
        state.hold.regained = 1.0
        if gains.stiffness[i] != aim.stiffness[i]:
            _follow_spring(aim, now, state, i, reach)
        else:
            speed = max(abs(state.motion.device_velocity[i]) * now.hardware.scale[i], abs(state.spring.set_velocity[i]))
            gains.damping[i] = _toward(gains.damping[i], aim.damping[i], reach / max(speed, 1e-9))
    return going


@njit
def _follow_spring(aim, now, state, i, reach):
    """Stiffness of the coupling; what its spring gains the tank pays (energy_tank.pay), the budget with `direct`."""
    before, stretch = now.coupling.stiffness[i], abs(state.observer.pulled_to[i] - state.motion.handle[i])
    stiffness = _toward(before, aim.stiffness[i], reach / max(stretch, 1e-9))
    gained = max(0.0, 0.5 * state.observer.coupled * (stiffness - before) * stretch * stretch)
    if now.exchange.method == exchange_samples.DIRECT:
        paid = _share(_available(now, state), gained)
        stiffness, gained = before + paid * (stiffness - before), paid * gained
    state.observer.by_settings[i] += gained
    now.coupling.stiffness[i] = stiffness


@njit
def _follow_cancellation(wished, now, state):
    """The share cancelled, over engage.time; 1 while it is on its way.

    It ends before anything else about it, or a wall before which it fades, changes, and begins anew.
    """
    chosen, aim = now.cancellation, wished.cancellation
    same = chosen.band == aim.band and chosen.stretch == aim.stretch and chosen.twist == aim.twist
    same = same and chosen.source == aim.source and chosen.filter == aim.filter
    goal = aim.ratio if same and _all_same(wished.wall, now.wall) else 0.0
    if same and chosen.ratio == aim.ratio == goal:
        return 0.0
    before = chosen.ratio
    ratio = _toward(before, goal, now.period / now.engage.time)
    if ratio > before:
        cost = 0.0
        for i in range(int(now.axes)):
            speed = state.motion.device_velocity[i]
            cost += 0.5 * (ratio - before) * now.hardware.damping[i] * speed * speed * now.period
        paid = _share(_available(now, state), cost)
        _pay(now, state, paid * cost, 0.5, 0.5)
        ratio = before + paid * (ratio - before)
    state.hold.regained = 1.0 if ratio != before else state.hold.regained
    if not same and ratio == 0.0:
        now.cancellation = wished.cancellation
    now.cancellation.ratio = ratio
    return 1.0


@njit
def _follow_walls(wished, now, state, share):
    """Every wall by its own rule; how many are on their way. One that is wished for no more goes when it is free."""
    going, most, reach = 0.0, int(max(wished.wall.count, now.wall.count)), share * now.exchange.slew[0] * now.period
    if now.cancellation.ratio > 0.0 and not _all_same(wished.wall, now.wall):
        return float(most)
    for j in range(most):
        if j >= now.wall.count:
            now.wall.count = j + 1.0
            _take_wall(wished.wall, now.wall, state, j)
        elif j < wished.wall.count and _same(wished.wall, now.wall, j):
            continue
        elif _depth(now.wall, state, j) <= 0.0:
            _take_wall(wished.wall, now.wall, state, j)
        elif j < wished.wall.count and _same_way(wished.wall, now.wall, j):
            _step_inside(wished.wall, now, state, j, reach)
        else:
            _let_in(now, state, j, reach)
        going += 0.0 if j < wished.wall.count and _same(wished.wall, now.wall, j) else 1.0
    # those at the end that are wished for no more, and gone
    while now.wall.count > wished.wall.count and now.wall.stiffness[int(now.wall.count) - 1] == 0.0:
        now.wall.count -= 1.0
    return going if now.wall.count != wished.wall.count or not _all_same(wished.wall, now.wall) else 0.0


@njit
def _all_same(wished, walls):
    same = walls.count == wished.count
    for j in range(int(min(walls.count, wished.count))):
        same = same and _same(wished, walls, j)
    return same


@njit
def _same_way(wished, walls, j):
    return walls.x[j] == wished.x[j] and walls.y[j] == wished.y[j]


@njit
def _same(wished, walls, j):
    gains = walls.stiffness[j] == wished.stiffness[j] and walls.damping[j] == wished.damping[j]
    return gains and walls.offset[j] == wished.offset[j] and _same_way(wished, walls, j)


@njit
def _depth(walls, state, j):
    handle = state.motion.handle
    return virtual_wall.wall_depth(walls.x[j], walls.y[j], walls.offset[j], handle[0], handle[1])


@njit
def _take_wall(wished, walls, state, j):
    """A wall that the handle is off, as it is wished for but no nearer than the handle; one no more wished for is none.

    It has no force, and its spring holds nothing.
    """
    if j >= wished.count:
        walls.stiffness[j] = walls.damping[j] = 0.0
        return
    walls.x[j], walls.y[j] = wished.x[j], wished.y[j]
    walls.stiffness[j], walls.damping[j] = wished.stiffness[j], wished.damping[j]
    handle = state.motion.handle
    walls.offset[j] = min(wished.offset[j], walls.x[j] * handle[0] + walls.y[j] * handle[1])


@njit
def _let_in(now, state, j, reach):
    """A wall goes back from the handle until that is off it; its force falls by the slew."""
    stiffness, depth = now.wall.stiffness[j], _depth(now.wall, state, j)
    now.wall.offset[j] -= min(depth, reach / stiffness) if stiffness > 0.0 else depth


@njit
def _step_inside(wished, now, state, j, reach):
    """A step of a wall that the handle is in: its stiffness first, then its place, then its damping, as it is paid."""
    walls, nx, ny = now.wall, now.wall.x[j], now.wall.y[j]
    step = _wanted(wished, now, state, j, reach)
    price = max(state.tank.price[0], state.tank.price[1]) if step.gained > 0.0 else 0.0
    cost = step.gained + price * reach * reach
    share = _share(_available(now, state), cost)
    if share == 1.0:
        walls.stiffness[j], walls.offset[j], walls.damping[j] = step.stiffness, step.offset, step.damping
    else:
        walls.stiffness[j] += share * (step.stiffness - walls.stiffness[j])
        walls.offset[j] += share * (step.offset - walls.offset[j])
        walls.damping[j] += share * (step.damping - walls.damping[j])
    _pay(now, state, share * cost, nx * nx, ny * ny)


@njit
def _wanted(wished, now, state, j, reach):
    """The Step by which the force may change in this tick; all but one of its parts stay."""
    walls, depth = now.wall, _depth(now.wall, state, j)
    stiffness, offset, damping = walls.stiffness[j], walls.offset[j], walls.damping[j]
    if stiffness != wished.stiffness[j]:
        new = _toward(stiffness, wished.stiffness[j], reach / depth)
        return Step(new, offset, damping, max(0.0, 0.5 * (new - stiffness) * depth * depth))
    if offset != wished.offset[j]:
        new = _toward(offset, wished.offset[j], reach / stiffness) if stiffness > 0.0 else wished.offset[j]
        way = new - offset
        return Step(stiffness, new, damping, max(0.0, stiffness * way * (depth + 0.5 * way)))
    motion = state.motion
    way = walls.x[j] * (motion.handle[0] - motion.handle_before[0])
    way += walls.y[j] * (motion.handle[1] - motion.handle_before[1])
    new = _toward(damping, wished.damping[j], reach * now.period / max(abs(way), 1e-9))
    # what a sampled damper may owe for the last way (passivity.damping_store)
    return Step(stiffness, offset, new, max(0.0, 0.5 * (new - damping) * way * way / now.period))
