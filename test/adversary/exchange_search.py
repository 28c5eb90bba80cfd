# SPDX-License-Identifier: Apache-2.0
"""Search for tool samples and a handle path by which an exchange method gives the operator energy.

One axis, no device mass: the handle is wherever the adversary has it, which is worse than any hand. In each period the
handle moves by Δx while the real servo's forces act, late as they are; given to the operator is the most that any path
of that way takes (late_forces) less f_c |Δx|. Adversaries (tool_samples):

* free: every sample says what it likes: position, velocity, age, contact, energy, effort;
* late: the tool is where the handle was N ticks ago, held by a wall at 0 where a gene says so, or lost.

A path is an array (ticks, GENES) of numbers of order one. With `rough` one tick in some is missed by the servo, and in
some others it finds counts that are one period old. With LATE_GENES it also says when each motor value is written,
opens the clutch or disables, and wishes for one of several operating points.
"""

from typing import NamedTuple

import numpy as np

from adversary.late_forces import most_given
from adversary.tool_samples import DEVICE, FREE, GENES, LOST, MOVED, contacts, sample
from haptic_device.control import enable_state, exchange_samples, faults, records, rows, servo
from haptic_device.jit import kernel, njit

SURE = 1e-7  # [J] no rounding of the books
WRITE, ORDERS, POINT = range(GENES, GENES + 3)
LATE_GENES = GENES + 3
MISSED, STALE = 1.8, 1.4  # the gene DEVICE above which a rough device does so
BEYOND, OPENED = 2.2, 1.5  # genes WRITE and ORDERS above which a value is written later than counted; below −, disabled


class Found(NamedTuple):
    """Of all paths tried: the largest energy given [J], beyond what was in the tank; the largest force [N]; the fastest
    change of force that the table made beyond the handle's own motion [N per tick]; the most that the books
    credited beyond the truth [J]; evaluations; and the path that was best by what was looked for."""

    energy: float
    force: float
    change: float
    overcredit: float
    evaluations: int
    path: np.ndarray


class Adversary(NamedTuple):
    """late: ticks, or FREE; loss: share of samples lost; coulomb: friction f_c [N]; reach: times the usual stretches
    and steps; rough: 1 for a device that misses ticks; books: 1 to look for credit beyond the truth instead; full: 1 to
    begin with a full tank; mixed: ticks by which samples of `late` overtake one another; delay: from a motor's write
    until it acts [s]; write: latest write after its deadline that is counted with [s]; beyond: 1 to write later still
    now and then; orders: 1 to open the clutch and to disable."""

    late: int = FREE
    loss: float = 0.0
    coulomb: float = 0.0
    reach: float = 1.0
    rough: int = 0
    books: int = 0
    full: int = 0
    mixed: int = 0
    delay: float = 0.0
    write: float = 0.0
    beyond: int = 0
    orders: int = 0


def energy_given(settings, memory, row, path, scale, adversary, watched):
    """Largest energy given [J] at any tick of a path's second half, less what was in the tank beyond the budget.

    settings: of each operating point; memory and row: arrays of one; scale: of each gene; adversary.loss: genes below
    it are lost here; watched: largest force, change and credit, kept, and how far up the search for credit is.
    """
    return _energy_given(settings, memory, row.view(records.TICK), path, scale, adversary, watched)


@kernel
def _energy_given(settings, memory, row, path, scale, adversary, watched):
    record, one, device, period = row[0], memory[0], settings[0].hardware, settings[0].period
    there = max(0.0, one.account.free - settings[0].exchange.budget)
    past, acts, forces, sent, write = np.zeros(len(path)), np.zeros(len(path)), np.zeros(len(path)), 0, 0.0
    position, given, paid, most, owed = 0.0, -there, 0.0, -np.inf, -np.inf
    for k in range(len(path)):
        past[k] = position
        troubled = path[k, DEVICE] if adversary.rough and k > 0 else 0.0
        if troubled < MISSED:
            stale, now = troubled > STALE, settings[_point(path[k], len(settings)) if k > 0 else 0]
            record.sensors.write_delay = write
            _sense(record, k + 1, position / abs(device.position_per_count[0]), period, stale)
            sample(record, path, k, scale, past, adversary, period)
            record.sensors.command = _orders(path[k], adversary)
            if now.exchange.method == exchange_samples.LOCAL and not path[k, LOST] < adversary.loss:
                contacts(one, record, path[k], scale, position, k)
            _tick(now, one, record, watched, k > 0)
            write = _write_delay(path[k], adversary, period)
            acts[sent], forces[sent] = k + (write + adversary.delay) / period, record.output.force_on_handle[0]
            sent += 1
            if not stale:
                credit = given + booked(now, one, record)
                watched[2] = max(watched[2], credit)
                owed = max(owed, _slope(credit, paid)) if 2 * k >= len(path) else owed
        moved = path[k, MOVED] * scale[MOVED]
        paid += device.damping[0] * moved * moved / period
        given += most_given(acts, forces, sent, k, period, moved, device.damping[0]) - adversary.coulomb * abs(moved)
        position += moved
        if 2 * k >= len(path):
            most = max(most, given)
    watched[3] = owed
    return most


@njit
def _slope(credit, paid):
    """What the search for credit climbs: the credit [J], and where there is none its share of what damping took [J].

    The laws are nearly homogeneous, so that a share of almost nothing leads there. A handle at rest has no credit
    either, and would be the best of all that have none: hence the little that is never there (SURE).
    """
    return credit if credit > SURE else (credit - SURE) / (paid + 1e-12)


@njit
def _point(genes, points):
    """Number of the operating point that is wished for."""
    return min(points - 1, int(abs(genes[POINT]) * points / 2.0)) if genes.size > GENES else 0


@njit
def _sense(record, number, counts, period, stale):
    """What the servo's tick of this number finds; counts that are old are those of the tick before."""
    record.sensors.deadline, record.sensors.device_status = number * period * 1e9, 0.0 if stale else faults.FRESH
    if not stale:
        record.sensors.latched, record.sensors.counts[0] = record.sensors.deadline, np.round(counts)


@njit
def _orders(genes, adversary):
    """The command word: enabled, with the clutch open, or disabled."""
    if adversary.orders == 0 or abs(genes[ORDERS]) < OPENED:
        return enable_state.ENABLE
    return enable_state.ENABLE | enable_state.CLUTCH if genes[ORDERS] > 0.0 else 0


@njit
def _write_delay(genes, adversary, period):
    """How long after its deadline this tick's motor value is written [s]."""
    if genes.size == GENES:
        return 0.0
    gene = abs(genes[WRITE])
    if adversary.beyond == 0 or gene < BEYOND:
        return adversary.write * min(1.0, gene)
    return adversary.write + (gene - BEYOND) * (0.9 * period - adversary.write)


@njit
def _tick(settings, memory, record, watched, watching):
    """The servo's tick; watches its force, and the change of force that is not the handle's own.

    Nor that of a damper which lets go at once, because nothing is left to pay for it.
    """
    before, handle, speed = memory.rows.copy(), record.output.position.copy(), memory.account.velocity.copy()
    servo.tick(settings, memory, record)
    here, now = record.output.position, memory.account.velocity
    there, gone, made = _force(before, here, now), _force(before, handle, speed), _force(memory.rows, here, now)
    for r in range(before.size):
        before[r].rate = 0.0
    slack = _force(before, here, now)
    if watching and record.output.engage > 0.0:
        watched[1] = max(watched[1], made - max(there, gone, slack), min(there, gone, slack) - made)
    watched[0] = max(watched[0], abs(record.output.force_on_handle[0]))


@njit
def _force(table, place, velocity):
    """Of all rows on the first axis [N]."""
    spring, damper = np.zeros(rows.AXES), np.zeros(rows.AXES)
    rows.force(table, table.size, place, velocity, spring, damper)
    return spring[0] + damper[0]


@kernel
def booked(settings, memory, record):
    """Energy [J] that account and springs may still give, or that was shipped, less the budget."""
    none, account, exchange = np.zeros(rows.AXES), memory.account, memory.exchange
    stored = rows.force(memory.rows, memory.rows.size, record.output.position, none, none.copy(), none.copy())
    return account.free + stored + exchange.shipped - exchange.returned - settings.exchange.budget


def engaged(tank=0.0):
    """Memory and row of a servo that is engaged and at rest at the origin; with this in its tank [J], if any."""
    memory, row = np.zeros(1, records.STATE), np.zeros(1, records.TRACE_ROW)
    memory["enable"]["ramp"] = memory["fade"]["factor"] = 1.0
    memory["enable"]["state"] = enable_state.ENGAGED
    memory["account"]["filled"], memory["account"]["free"] = float(tank > 0.0), tank
    return memory, row


def search(settings, adversary=Adversary(), ticks=150, evaluations=2000, seed=0, start=None):  # noqa: B008
    """Evolution strategy with one parent, one child and a step that adapts to success. Returns Found.

    settings: SETTINGS of one axis, of each operating point; start: a path to begin with, which is tried first.
    """
    random = np.random.default_rng(seed)
    late = len(settings) > 1 or adversary.write > 0.0 or adversary.beyond or adversary.orders
    scale, against = scale_of(settings, adversary.reach), _with_loss(adversary, random)
    best, score, size = np.zeros((ticks, LATE_GENES if late else GENES)) if start is None else start, -np.inf, 0.5
    most, energy = np.full(3, -np.inf), -np.inf
    for number in range(evaluations):
        child, watched = np.clip(best + size * _change(random, best.shape), -3.0, 3.0), np.full(4, -np.inf)
        child = best if start is not None and number == 0 else child
        tank = float(settings["exchange"]["tank"][0]) if adversary.full else 0.0
        given = energy_given(settings, *engaged(tank), child, scale, against, watched)
        most, energy = np.maximum(most, watched[:3]), max(energy, given)
        value = watched[3] if adversary.books else given
        better = value > score
        size = min(2.0, max(0.02, size * (1.5 if better else 0.97)))
        best, score = (child, value) if better else (best, score)
    return Found(energy, *(float(one) for one in most), evaluations, best)


def _with_loss(adversary, random):
    """The adversary in the types that the kernel takes, with the gene below which a sample is lost."""
    lost = -np.inf if adversary.loss <= 0.0 else float(np.quantile(random.normal(size=4000), adversary.loss))
    plain = (type(default)(one) for one, default in zip(adversary, Adversary(), strict=True))
    return Adversary(*plain)._replace(loss=lost)


def _change(random, shape):
    """A change of some genes over a stretch of ticks, smooth or tick by tick."""
    (ticks, genes), change, wide = shape, random.normal(size=shape), int(2.0 ** random.uniform(0.0, 5.0))
    start, length = random.integers(0, ticks), int(2.0 ** random.uniform(0.0, np.log2(ticks)))
    held = np.repeat(change, wide, axis=0)[:ticks]
    held *= random.random(genes) < 0.5
    held[:start], held[start + length :] = 0.0, 0.0
    return held


def scale_of(settings, reach=1.0):
    """What one of each gene is: steps and stretches of some newtons, any age, sums of energy and effort that matter."""
    stretch = reach * 5.0 / max(1.0, float(settings["coupling"]["stiffness"][0, 0]))
    way = reach * 2.5 * float(settings["period"][0]) / float(settings["hardware"]["damping"][0, 0])
    return np.array([way, stretch, reach, 0.03, 1.0, 1e-3, 1e-2, 1.0, 1.0])
