# SPDX-License-Identifier: Apache-2.0
"""Walls on their way to those that are wished for (control/bumpless_transfer)."""

from typing import NamedTuple

from haptic_device.control import change_ledger, energy_tank, virtual_wall
from haptic_device.jit import kernel, njit


class Step(NamedTuple):
    """The next stiffness [N/m], offset [m] and damping [N s/m] of a wall, and what its spring gains by it [J]."""

    stiffness: float
    offset: float
    damping: float
    gained: float


@kernel
def follow(wished, now, state, share, falling):
    """Every wall by its own rule; how many are on their way."""
    going, reach, walls = 0.0, share * now.exchange.slew[0] * now.period, now.wall
    if now.cancellation.ratio > 0.0 and not all_same(wished.wall, walls):
        return max(wished.wall.count, walls.count)
    for j in range(int(walls.count)):
        if stays(wished.wall, walls, j) and _same(wished.wall, walls, j):
            continue
        going += 1.0
        if _depth(walls, state, j) <= 0.0:
            _take_wall(wished.wall, walls, state, j, falling)
        elif stays(wished.wall, walls, j):
            _step_inside(wished.wall, now, state, j, reach, falling)
        else:
            _let_in(now, state, j, reach)
    while not falling and walls.count < wished.wall.count:
        walls.count, going = walls.count + 1.0, going + 1.0
        _take_wall(wished.wall, walls, state, int(walls.count) - 1, falling)
    # those at the end that are wished for no more, and gone
    while walls.count > wished.wall.count and walls.stiffness[int(walls.count) - 1] == 0.0:
        walls.count -= 1.0
    return 0.0 if all_same(wished.wall, walls) else max(1.0, going)


@kernel
def all_same(wished, walls):
    same = walls.count == wished.count
    for j in range(int(min(walls.count, wished.count))):
        same = same and _same(wished, walls, j)
    return same


@njit
def _same(wished, walls, j):
    gains = walls.stiffness[j] == wished.stiffness[j] and walls.damping[j] == wished.damping[j]
    return gains and walls.offset[j] == wished.offset[j] and walls.x[j] == wished.x[j] and walls.y[j] == wished.y[j]


@njit
def _depth(walls, state, j):
    handle = state.motion.handle
    return virtual_wall.wall_depth(walls.x[j], walls.y[j], walls.offset[j], handle[0], handle[1])


@njit
def _take_wall(wished, walls, state, j, falling):
    """A wall that the handle is off, as it is wished for but no nearer than the handle; while gains fall, its fall.

    It has no force, and its spring holds nothing.
    """
    if falling:
        there = stays(wished, walls, j)
        walls.stiffness[j] = min(walls.stiffness[j], wished.stiffness[j]) if there else 0.0
        walls.damping[j] = min(walls.damping[j], wished.damping[j]) if there else 0.0
    elif j < wished.count:
        walls.x[j], walls.y[j] = wished.x[j], wished.y[j]
        walls.stiffness[j], walls.damping[j] = wished.stiffness[j], wished.damping[j]
        handle = state.motion.handle
        walls.offset[j] = min(wished.offset[j], walls.x[j] * handle[0] + walls.y[j] * handle[1])


@njit
def _let_in(now, state, j, reach):
    """A wall lets the handle in: stiffness, then damping, fall by the slew; then it goes back behind the handle."""
    walls = now.wall
    depth, way = _depth(walls, state, j), _way(walls, state, j)
    if walls.stiffness[j] > 0.0:
        walls.stiffness[j] = change_ledger.toward(walls.stiffness[j], 0.0, reach / depth)
    elif walls.damping[j] > 0.0:
        walls.damping[j] = change_ledger.toward(walls.damping[j], 0.0, reach * now.period / max(abs(way), 1e-9))
    else:
        walls.offset[j] -= depth


@njit
def _way(walls, state, j):
    """Way of the handle along a wall's normal in the last hold [m]."""
    motion = state.motion
    way = walls.x[j] * (motion.handle[0] - motion.handle_before[0])
    return way + walls.y[j] * (motion.handle[1] - motion.handle_before[1])


@njit
def _step_inside(wished, now, state, j, reach, falling):
    """A step of a wall that the handle is in: its stiffness first, then its place, then its damping, as it is paid."""
    walls, nx, ny = now.wall, now.wall.x[j], now.wall.y[j]
    step = _wanted(wished, now, state, j, reach, falling)
    cost = step.gained
    for i in range(min(2, int(now.axes)) if step.gained > 0.0 else 0):
        cost += energy_tank.late_energy(now, state.tank, i, (nx if i == 0 else ny) * reach)
    share = change_ledger.share(change_ledger.available(now, state), cost)
    if share == 1.0:
        walls.stiffness[j], walls.offset[j], walls.damping[j] = step.stiffness, step.offset, step.damping
    else:
        walls.stiffness[j] += share * (step.stiffness - walls.stiffness[j])
        walls.offset[j] += share * (step.offset - walls.offset[j])
        walls.damping[j] += share * (step.damping - walls.damping[j])
    change_ledger.pay_along(now, state, share * cost, nx, ny)


@njit
def _wanted(wished, now, state, j, reach, falling):
    """The Step by which the force may change in this tick; all but one of its parts stay."""
    walls, depth = now.wall, _depth(now.wall, state, j)
    stiffness, offset, damping = walls.stiffness[j], walls.offset[j], walls.damping[j]
    aim = change_ledger.aim(stiffness, wished.stiffness[j], falling)
    if stiffness != aim:
        new = change_ledger.toward(stiffness, aim, reach / depth)
        return Step(new, offset, damping, max(0.0, 0.5 * (new - stiffness) * depth * depth))
    if offset != wished.offset[j] and not falling:
        new = change_ledger.toward(offset, wished.offset[j], reach / stiffness) if stiffness > 0.0 else wished.offset[j]
        way = new - offset
        return Step(stiffness, new, damping, max(0.0, stiffness * way * (depth + 0.5 * way)))
    way = _way(walls, state, j)
    new = change_ledger.toward(
        damping, change_ledger.aim(damping, wished.damping[j], falling), reach * now.period / max(abs(way), 1e-9)
    )
    # what a sampled damper may owe for the last way (passivity.damping_store)
    return Step(stiffness, offset, new, max(0.0, 0.5 * (new - damping) * way * way / now.period))


@kernel
def stays(wished, walls, j):
    """Whether wall j is wished for with the normal that it has."""
    return j < wished.count and walls.x[j] == wished.x[j] and walls.y[j] == wished.y[j]
