# SPDX-License-Identifier: Apache-2.0
"""Search for tool samples and a handle path by which an exchange method gives the operator energy.

One axis, no device mass: the handle is wherever the adversary has it, which is worse than any hand. In each tick the
real servo holds its force while the handle moves straight by Δx; given to the operator is Σ f Δx − b Δx²/T − f_c |Δx|,
and damper and friction take no less by any other way. Two kinds of adversary:

* free: every sample says what it likes: position, velocity, age, contact, energy, waves;
* late: the tool is where the handle was N ticks ago, held by a wall at 0 where a gene says so, or lost.

A path is an array (ticks, GENES) of numbers of order one. With `rough` one tick in some is missed by the servo, and in
some others it finds counts that are one period old.
"""

from typing import NamedTuple

import numpy as np

from haptic_device.control import (
    contact_model,
    contact_solver,
    enable_state,
    exchange_samples,
    faults,
    records,
    servo,
    virtual_coupling,
)
from haptic_device.jit import kernel, njit

MOVED, POSITION, VELOCITY, AGE, CONTACT, ENERGY, EFFORT, LOST, DEVICE = range(9)
GENES = 9
FREE = -1  # instead of a number of ticks
MISSED, STALE = 1.8, 1.4  # the gene DEVICE above which a rough device does so


class Found(NamedTuple):
    """Largest energy given [J] that was found, and of all paths tried: the largest force [N], the fastest change of
    force that the set position made beyond the handle's own motion [N per tick], the most that the tank's books
    credited beyond the truth [J], evaluations, and the path."""

    energy: float
    force: float
    change: float
    overcredit: float
    evaluations: int
    path: np.ndarray


class Adversary(NamedTuple):
    """late: ticks, or FREE; loss: share of samples lost; coulomb: friction f_c [N]; reach: times the usual stretches
    and steps; rough: 1 for a device that misses ticks; books: 1 to look for credit beyond the truth instead."""

    late: int = FREE
    loss: float = 0.0
    coulomb: float = 0.0
    reach: float = 1.0
    rough: int = 0
    books: int = 0


def energy_given(settings, memory, row, path, scale, adversary, watched):
    """Largest energy given [J] at any tick of a path's second half; settings, memory and row are arrays of one.

    scale: of each gene; adversary.loss: genes below it are lost here; watched: largest force and change, kept.
    """
    return _energy_given(settings, memory, row.view(records.TICK), path, scale, adversary, watched)


@kernel
def _energy_given(settings, memory, row, path, scale, adversary, watched):
    period, damping = settings[0].period, settings[0].hardware.damping[0]
    step = abs(settings[0].hardware.position_per_count[0])
    past, position, moved, given, most = np.zeros(len(path)), 0.0, 0.0, 0.0, -np.inf
    record, force = row[0], 0.0
    for k in range(len(path)):
        position += moved
        past[k] = position
        troubled = path[k, DEVICE] if adversary.rough and k > 0 else 0.0
        if troubled < MISSED:
            stale = troubled > STALE
            record.sensors.deadline, record.sensors.device_status = (
                (k + 1) * period * 1e9,
                0.0 if stale else faults.FRESH,
            )
            if not stale:
                record.sensors.latched, record.sensors.counts[0] = record.sensors.deadline, np.round(position / step)
            _sample(record, path, k, scale, past, adversary, period)
            if settings[0].exchange.method == exchange_samples.LOCAL and not path[k, LOST] < adversary.loss:
                _contacts(memory[0], record, path[k], scale, position, k)
            before, faded, handle = (
                record.output.coupling_position[0],
                record.output.exchange_fade,
                record.output.position[0],
            )
            servo.tick(settings[0], memory[0], record)
            there, gone = _spring(settings, before, record.output.position[0]), _spring(settings, before, handle)
            now = _spring(settings, record.output.coupling_position[0], record.output.position[0])
            if k > 0 and faded == record.output.exchange_fade:
                watched[1] = max(watched[1], faded * max(now - max(there, gone), min(there, gone) - now))
            force = record.output.force_on_handle[0]
            watched[0] = max(watched[0], abs(force))
            if not stale:
                watched[2] = max(watched[2], given + _booked(settings[0], memory[0], record))
        moved = path[k, MOVED] * scale[MOVED]
        given += force * moved - damping * moved * moved / period - adversary.coulomb * abs(moved)
        if 2 * k >= len(path):
            most = max(most, given)
    return watched[2] if adversary.books else most


@njit
def _booked(settings, memory, record):
    """Energy [J] that the books say may still be given, or was shipped, less the budget."""
    stretch = record.output.coupling_position[0] - record.output.position[0]
    stored = virtual_coupling.spring_store(memory.spring.stiffness[0], memory.spring.limit[0], stretch)
    away = memory.tank.shipped - memory.tank.returned + memory.waves.store
    return memory.tank.level + stored + away - settings.exchange.budget


@njit
def _spring(settings, set_position, handle):
    return virtual_coupling.spring_force(
        settings[0].coupling.stiffness[0], settings[0].coupling.limit[0], set_position - handle
    )


@njit
def _sample(record, path, k, scale, past, adversary, period):
    """The tool sample that the servo finds at tick k."""
    genes, late = path[k], adversary.late
    record.sensors.command, record.tool.session = enable_state.ENABLE, 1.0
    record.tool.age += period
    if k > 0 and genes[LOST] < adversary.loss:
        return
    record.tool.answered = record.tool.sequence = k + 1.0
    record.tool.contact = 1.0 if genes[CONTACT] > 0.0 else 0.0
    record.tool.energy += abs(genes[ENERGY]) * scale[ENERGY]
    record.tool.effort[0] += genes[EFFORT] * scale[EFFORT]
    if late < 0:
        record.tool.position[0] = genes[POSITION] * scale[POSITION]
        record.tool.velocity[0] = genes[VELOCITY] * scale[VELOCITY]
        record.tool.age = abs(genes[AGE]) * scale[AGE]
        return
    then = max(0, k - late)
    held = genes[CONTACT] > 0.0 and past[then] < 0.0
    record.tool.position[0] = 0.0 if held else past[then]
    record.tool.velocity[0] = 0.0 if held else (past[then] - past[max(0, then - 1)]) / period
    record.tool.age = late * period


@njit
def _contacts(memory, record, genes, scale, position, k):
    """Local contacts that say what they like: two planes anywhere, moving, giving way, rebounding, in turn renamed."""
    memory.virtual_tool.contacts.number, memory.virtual_tool.contacts.trust = k + 1.0, 1.0 if genes[AGE] < 2.5 else 0.0
    record.tool.contact_age = 0.01 * abs(genes[AGE])
    memory.virtual_tool.contacts.mass, memory.virtual_tool.contacts.inertia, memory.virtual_tool.contacts.fresh = (
        0.1,
        1e-4,
        1.0,
    )
    for i in range(2):
        one, side = memory.virtual_tool.contacts.table[i], 1.0 if (genes[CONTACT] > 0.0) == (i == 0) else -1.0
        identity = 1.0 + i + (2.0 if genes[ENERGY] > 1.0 else 0.0)
        if one[contact_model.IDENTITY] != identity:
            memory.virtual_tool.contacts.constraints[i, contact_solver.MODE] = contact_solver.OPEN
        one[contact_model.IDENTITY], one[contact_model.KIND], one[contact_model.NORMAL_X] = (
            identity,
            contact_model.FLAT_THERE,
            side,
        )
        at = genes[POSITION] if i == 0 else genes[EFFORT]
        one[contact_model.POINT_X] = position + at * scale[POSITION]
        one[contact_model.VELOCITY_X] = genes[VELOCITY] * scale[VELOCITY]
        one[contact_model.RESTITUTION] = min(1.0, abs(genes[AGE]))
        one[contact_model.MOBILITY], one[contact_model.FORCE] = max(0.0, genes[ENERGY]) * 10.0, 3.0 * genes[EFFORT]


def engaged():
    """Memory and row of a servo that is engaged and at rest at the origin."""
    memory, row = np.zeros(1, records.STATE), np.zeros(1, records.TRACE_ROW)
    memory["enable"]["ramp"] = memory["fade"]["factor"] = memory["observer"]["coupled"] = 1.0
    memory["enable"]["state"] = enable_state.ENGAGED
    return memory, row


def search(settings, adversary=Adversary(), ticks=150, evaluations=2000, seed=0):  # noqa: B008
    """Evolution strategy with one parent, one child and a step that adapts to success. Returns Found.

    settings: SETTINGS of one axis.
    """
    random = np.random.default_rng(seed)
    scale = scale_of(settings, adversary.reach)
    lost = -np.inf if adversary.loss <= 0.0 else float(np.quantile(random.normal(size=4000), adversary.loss))
    against = adversary._replace(loss=lost, coulomb=float(adversary.coulomb), reach=float(adversary.reach))
    best, score, size, most = np.zeros((ticks, GENES)), -np.inf, 0.5, np.full(3, -np.inf)
    for _ in range(evaluations):
        child, watched = np.clip(best + size * _change(random, ticks), -3.0, 3.0), np.full(3, -np.inf)
        value = energy_given(settings, *engaged(), child, scale, against, watched)
        most = np.maximum(most, watched)
        better = value > score
        size = min(2.0, max(0.02, size * (1.5 if better else 0.97)))
        best, score = (child, value) if better else (best, score)
    return Found(score, *(float(one) for one in most), evaluations, best)


def _change(random, ticks):
    """A change of some genes over a stretch of ticks, smooth or tick by tick."""
    change, wide = random.normal(size=(ticks, GENES)), int(2.0 ** random.uniform(0.0, 5.0))
    start, length = random.integers(0, ticks), int(2.0 ** random.uniform(0.0, np.log2(ticks)))
    held = np.repeat(change, wide, axis=0)[:ticks]
    held *= random.random(GENES) < 0.5
    held[:start], held[start + length :] = 0.0, 0.0
    return held


def scale_of(settings, reach=1.0):
    """What one of each gene is: steps and stretches of some newtons, any age, sums of energy and waves that matter."""
    stretch = reach * 5.0 / max(1.0, float(settings["coupling"]["stiffness"][0, 0]))
    way = reach * 2.5 * float(settings["period"][0]) / float(settings["hardware"]["damping"][0, 0])
    return np.array([way, stretch, reach, 0.03, 1.0, 1e-3, 1e-2, 1.0, 1.0])
